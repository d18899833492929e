// An OpenGL core context without a display, for rendering into memory.
#pragma once

namespace common {

class EglContext {
 public:
  // Tries Mesa's surfaceless platform, the graphics devices, then the default display, and leaves the context
  // current. Throws UserError, one line that names the packages, when none of them gives this version of
  // OpenGL.
  explicit EglContext(int major = 3, int minor = 3);
  ~EglContext();
  EglContext(const EglContext&) = delete;
  EglContext& operator=(const EglContext&) = delete;

  void make_current();
  void release();

 private:
  bool open(void* display, int major, int minor);

  void* display_ = nullptr;  // EGLDisplay; never terminated (see EglContext.cpp)
  void* context_ = nullptr;  // EGLContext
};

}  // namespace common
