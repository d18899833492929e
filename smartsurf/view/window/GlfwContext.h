// The window of the window system, its OpenGL context and Dear ImGui in it: opened in order, undone in
// reverse. Internal to the room; main thread only.
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
  GlfwContext(const std::string& title, int width, int height, Place place);
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
class Current {
 public:
  explicit Current(GLFWwindow* window);
  ~Current();
  Current(const Current&) = delete;
  Current& operator=(const Current&) = delete;
};

// Dear ImGui in that window. Callbacks that are to come before its own must be set before.
class Gui {
 public:
  Gui(GLFWwindow* window, float scale);
  ~Gui();
  Gui(const Gui&) = delete;
  Gui& operator=(const Gui&) = delete;
};

// Whether the context that is current draws on the processor.
bool drawn_in_software();

}  // namespace smartsurf::view
