// An OpenGL 3.3 core context without a display. Internal to the room.
#pragma once

namespace apron::ui {

class OffscreenContext {
 public:
  // Tries Mesa's surfaceless platform, the graphics devices, then the default display; leaves the context
  // current. Throws PictureError, one line that names the packages, when none gives OpenGL 3.3.
  OffscreenContext();
  ~OffscreenContext();
  OffscreenContext(const OffscreenContext&) = delete;
  OffscreenContext& operator=(const OffscreenContext&) = delete;

 private:
  bool open(void* display);

  void* display_ = nullptr;  // EGLDisplay
  void* context_ = nullptr;  // EGLContext
};

}  // namespace apron::ui
