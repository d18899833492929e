// An OpenGL 3.3 core context without a display. Internal to the room.
#pragma once

#include <string>

namespace smartsurf::view {

class OffscreenContext {
 public:
  // Tries in turn Mesa's surfaceless platform, the graphics devices and the default display.
  // Throws std::runtime_error, one line that names the packages, when none gives OpenGL 3.3.
  OffscreenContext();
  ~OffscreenContext();
  OffscreenContext(const OffscreenContext&) = delete;
  OffscreenContext& operator=(const OffscreenContext&) = delete;

  void make_current();
  void release();

 private:
  bool open(void* display);

  void* display_ = nullptr;  // EGLDisplay
  void* context_ = nullptr;  // EGLContext
};

}  // namespace smartsurf::view
