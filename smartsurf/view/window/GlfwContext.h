// RAII owners of the GLFW window with its OpenGL context, and of Dear ImGui. Internal to smartsurf/view; main
// thread only.
#pragma once

#include <string>

#include "smartsurf/view/window/WindowPlacement.h"

struct GLFWwindow;

namespace smartsurf::view {

// GLFW and one window with its OpenGL context.
class GlfwContext {
 public:
  // Leaves the context current. Throws std::runtime_error with a one-line message if there is no display or
  // no OpenGL 3.3.
  GlfwContext(const std::string& title, int width, int height, WindowPlacement placement);
  ~GlfwContext();
  GlfwContext(const GlfwContext&) = delete;
  GlfwContext& operator=(const GlfwContext&) = delete;

  GLFWwindow* window() const { return window_; }
  float content_scale() const;  // the display's scale factor, the larger of x and y
  bool minimised() const;
  void move_to_left();  // to WindowPlacement::kLeft

 private:
  GLFWwindow* window_ = nullptr;
};

// Makes the window's context current for a scope. It is not current otherwise, because EGL refuses to make an
// off-screen context current beside it.
class ScopedGlContext {
 public:
  explicit ScopedGlContext(GLFWwindow* window);
  ~ScopedGlContext();
  ScopedGlContext(const ScopedGlContext&) = delete;
  ScopedGlContext& operator=(const ScopedGlContext&) = delete;
};

// Dear ImGui in the window. ImGui chains the GLFW callbacks that are installed before it is constructed.
class ImGuiBackend {
 public:
  ImGuiBackend(GLFWwindow* window, float scale);
  ~ImGuiBackend();
  ImGuiBackend(const ImGuiBackend&) = delete;
  ImGuiBackend& operator=(const ImGuiBackend&) = delete;
};

// True if the current context renders on the CPU.
bool is_software_renderer();

}  // namespace smartsurf::view
