// The GLFW window, its OpenGL context and Dear ImGui, created in order and destroyed in reverse. Internal to
// this module; main thread only.
#pragma once

#include <string>

#include "smartsurf/view/window/Window.h"

struct GLFWwindow;

namespace smartsurf::view {

// GLFW, and one window with its context.
class GlfwContext {
 public:
  // Throws std::runtime_error, one line, when there is no display or no OpenGL 3.3. The context is left
  // current.
  GlfwContext(const std::string& title, int width, int height, WindowPlacement placement);
  ~GlfwContext();
  GlfwContext(const GlfwContext&) = delete;
  GlfwContext& operator=(const GlfwContext&) = delete;

  GLFWwindow* window() const { return window_; }
  float content_scale() const;  // pixels a unit of the screen's coordinates, the larger of both ways
  bool minimised() const;

 private:
  GLFWwindow* window_ = nullptr;
};

// The window's context is current only while it is needed: EGL refuses to make another one current beside it.
class ScopedGlContext {
 public:
  explicit ScopedGlContext(GLFWwindow* window);
  ~ScopedGlContext();
  ScopedGlContext(const ScopedGlContext&) = delete;
  ScopedGlContext& operator=(const ScopedGlContext&) = delete;
};

// Dear ImGui in that window. Callbacks that are to come before its own must be set before.
class ImGuiBackend {
 public:
  ImGuiBackend(GLFWwindow* window, float scale);
  ~ImGuiBackend();
  ImGuiBackend(const ImGuiBackend&) = delete;
  ImGuiBackend& operator=(const ImGuiBackend&) = delete;
};

// Whether the context that is current draws on the processor.
bool is_software_renderer();

}  // namespace smartsurf::view
