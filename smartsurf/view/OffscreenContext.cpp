#include "smartsurf/view/OffscreenContext.h"

#include <epoxy/egl.h>

#include <array>
#include <stdexcept>
#include <vector>

namespace smartsurf::view {
namespace {

std::vector<EGLDisplay> displays() {
  std::vector<EGLDisplay> found;
  const auto add = [&found](EGLDisplay display) {
    if (display != EGL_NO_DISPLAY) found.push_back(display);
  };
  if (epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_MESA_platform_surfaceless"))
    add(eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr));
  if (epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_EXT_platform_device") &&
      epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_EXT_device_enumeration")) {
    std::array<EGLDeviceEXT, 16> devices{};
    EGLint count = 0;
    if (eglQueryDevicesEXT(static_cast<EGLint>(devices.size()), devices.data(), &count))
      for (EGLint i = 0; i < count; ++i)
        add(eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, devices[i], nullptr));
  }
  add(eglGetDisplay(EGL_DEFAULT_DISPLAY));
  return found;
}

}  // namespace

OffscreenContext::OffscreenContext() {
  if (epoxy_has_egl())
    for (EGLDisplay display : displays())
      if (open(display)) return;
  throw std::runtime_error(
      "no OpenGL 3.3 for pictures on this machine: install the packages libgl1-mesa-dri libegl1");
}

bool OffscreenContext::open(void* display) {
  if (!eglInitialize(display, nullptr, nullptr)) return false;
  static constexpr EGLint kVersion[] = {EGL_CONTEXT_MAJOR_VERSION,
                                        3,
                                        EGL_CONTEXT_MINOR_VERSION,
                                        3,
                                        EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                        EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                        EGL_NONE};
  static constexpr EGLint kAnyConfig[] = {EGL_SURFACE_TYPE, EGL_DONT_CARE, EGL_RENDERABLE_TYPE,
                                          EGL_OPENGL_BIT, EGL_NONE};
  EGLConfig config = EGL_NO_CONFIG_KHR;  // enough where the framebuffers are our own
  EGLint count = 0;
  if (!epoxy_has_egl_extension(display, "EGL_KHR_no_config_context"))
    eglChooseConfig(display, kAnyConfig, &config, 1, &count);
  if (eglBindAPI(EGL_OPENGL_API)) {
    EGLContext context = eglCreateContext(display, config, EGL_NO_CONTEXT, kVersion);
    if (context != EGL_NO_CONTEXT) {
      if (eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context)) {
        display_ = display;
        context_ = context;
        return true;
      }
      eglDestroyContext(display, context);
    }
  }
  eglTerminate(display);
  return false;
}

OffscreenContext::~OffscreenContext() {
  release();
  eglDestroyContext(display_, context_);
  // The display stays initialised: EGL counts it once for the process, and another view may be using it.
}

void OffscreenContext::make_current() {
  eglBindAPI(EGL_OPENGL_API);
  if (!eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_))
    throw std::runtime_error("OpenGL: the context for pictures is lost");
}

void OffscreenContext::release() { eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT); }

}  // namespace smartsurf::view
