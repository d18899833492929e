#include "common/gl/EglContext.h"

#include <epoxy/egl.h>

#include <array>
#include <string>
#include <vector>

#include "common/error/UserError.h"

// EGL does not count eglInitialize() calls: eglTerminate() would invalidate every other context of the
// process on the same display. So no display is terminated, neither after a failed attempt nor with its last
// context.

namespace common {
namespace {

std::vector<EGLDisplay> candidate_displays() {
  std::vector<EGLDisplay> displays;
  const auto add = [&displays](EGLDisplay display) {
    if (display != EGL_NO_DISPLAY) displays.push_back(display);
  };
  if (epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_MESA_platform_surfaceless"))
    add(eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr));
  if (epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_EXT_platform_device") &&
      epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_EXT_device_enumeration")) {
    std::array<EGLDeviceEXT, 16> devices{};
    EGLint count = 0;
    if (eglQueryDevicesEXT(static_cast<EGLint>(devices.size()), devices.data(), &count) == EGL_FALSE)
      count = 0;
    for (EGLint i = 0; i < count; ++i)
      add(eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, devices[i], nullptr));
  }
  add(eglGetDisplay(EGL_DEFAULT_DISPLAY));
  return displays;
}

}  // namespace

EglContext::EglContext(int major, int minor) {
  if (epoxy_has_egl())
    for (EGLDisplay display : candidate_displays())
      if (open(display, major, minor)) return;
  throw UserError("no OpenGL " + std::to_string(major) + "." + std::to_string(minor) +
                  " for pictures on this machine: install the packages libgl1-mesa-dri libegl1");
}

bool EglContext::open(void* display, int major, int minor) {
  if (eglInitialize(display, nullptr, nullptr) == EGL_FALSE) return false;
  const std::array<EGLint, 7> version{EGL_CONTEXT_MAJOR_VERSION,
                                      major,
                                      EGL_CONTEXT_MINOR_VERSION,
                                      minor,
                                      EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                      EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                      EGL_NONE};
  static constexpr EGLint kAnyConfig[] = {EGL_SURFACE_TYPE, EGL_DONT_CARE, EGL_RENDERABLE_TYPE,
                                          EGL_OPENGL_BIT, EGL_NONE};
  EGLConfig config = EGL_NO_CONFIG_KHR;  // enough, as all framebuffers are our own
  EGLint count = 0;
  if (!epoxy_has_egl_extension(display, "EGL_KHR_no_config_context"))
    eglChooseConfig(display, kAnyConfig, &config, 1, &count);
  if (eglBindAPI(EGL_OPENGL_API) == EGL_FALSE) return false;
  EGLContext context = eglCreateContext(display, config, EGL_NO_CONTEXT, version.data());
  if (context == EGL_NO_CONTEXT) return false;
  if (eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context) == EGL_FALSE) {
    eglDestroyContext(display, context);
    return false;
  }
  display_ = display;
  context_ = context;
  return true;
}

EglContext::~EglContext() {
  release();
  eglDestroyContext(display_, context_);
}

void EglContext::make_current() {
  eglBindAPI(EGL_OPENGL_API);
  if (eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_) == EGL_FALSE)
    throw std::runtime_error("OpenGL: the context for pictures is lost");
}

void EglContext::release() { eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT); }

}  // namespace common
