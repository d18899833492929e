#include "apron/ui/OffscreenContext.h"

#include <epoxy/egl.h>

#include <array>
#include <vector>

#include "apron/ui/Image.h"

namespace apron::ui {
namespace {

std::vector<EGLDisplay> displays() {
  std::vector<EGLDisplay> all;
  if (epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_MESA_platform_surfaceless"))
    all.push_back(eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr));
  if (epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_EXT_platform_device") &&
      epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_EXT_device_enumeration")) {
    std::array<EGLDeviceEXT, 16> devices{};
    EGLint count = 0;
    if (eglQueryDevicesEXT(static_cast<EGLint>(devices.size()), devices.data(), &count) == EGL_FALSE)
      count = 0;
    for (EGLint i = 0; i < count; ++i)
      all.push_back(
          eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, devices[static_cast<std::size_t>(i)], nullptr));
  }
  all.push_back(eglGetDisplay(EGL_DEFAULT_DISPLAY));
  return all;
}

}  // namespace

OffscreenContext::OffscreenContext() {
  if (epoxy_has_egl())
    for (EGLDisplay display : displays())
      if (display != EGL_NO_DISPLAY && open(display)) return;
  throw PictureError(
      "no OpenGL 3.3 for pictures on this machine: install the packages libgl1-mesa-dri libegl1");
}

bool OffscreenContext::open(void* display) {
  if (eglInitialize(display, nullptr, nullptr) == EGL_FALSE) return false;
  static constexpr EGLint kVersion[] = {EGL_CONTEXT_MAJOR_VERSION,
                                        3,
                                        EGL_CONTEXT_MINOR_VERSION,
                                        3,
                                        EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                        EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                        EGL_NONE};
  static constexpr EGLint kAny[] = {EGL_SURFACE_TYPE, EGL_DONT_CARE, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT,
                                    EGL_NONE};
  EGLConfig config = EGL_NO_CONFIG_KHR;  // enough where the framebuffers are our own
  EGLint count = 0;
  if (!epoxy_has_egl_extension(display, "EGL_KHR_no_config_context"))
    eglChooseConfig(display, kAny, &config, 1, &count);
  if (eglBindAPI(EGL_OPENGL_API) == EGL_FALSE) return false;
  EGLContext context = eglCreateContext(display, config, EGL_NO_CONTEXT, kVersion);
  if (context == EGL_NO_CONTEXT) return false;
  if (eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context) == EGL_FALSE) {
    eglDestroyContext(display, context);
    return false;
  }
  display_ = display;
  context_ = context;
  return true;
}

OffscreenContext::~OffscreenContext() {
  eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  eglDestroyContext(display_, context_);
  // The display stays initialised: EGL counts it once a process, and another may be using it.
}

}  // namespace apron::ui
