#include "smartsurf/view/window/GlfwContext.h"

#include <epoxy/gl.h>
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <algorithm>
#include <stdexcept>
#include <string_view>

#include "smartsurf/view/panels/Hud.h"
#include "smartsurf/view/window/DisplayLoss.h"

namespace smartsurf::view {
namespace {

// In screen coordinates.
struct Area {
  int x = 0, y = 0, width = 1280, height = 720;
};

// Of the screen's width, from the left, when another program's window has the rest.
constexpr double kLeftShare = 0.42;

Area left_part() {
  Area area;
  if (GLFWmonitor* monitor = glfwGetPrimaryMonitor())
    glfwGetMonitorWorkarea(monitor, &area.x, &area.y, &area.width, &area.height);
  area.width = static_cast<int>(area.width * kLeftShare);
  return area;
}

}  // namespace

GlfwContext::GlfwContext(const std::string& title, int width, int height, Place place) {
  if (!glfwInit())
    throw std::runtime_error("no display to open a window on: set DISPLAY, or run with --headless");
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  glfwWindowHint(GLFW_SCALE_TO_MONITOR, place == Place::kAnywhere ? GLFW_TRUE : GLFW_FALSE);
  const Area left = left_part();
  if (place == Place::kLeft) {
    width = left.width;
    height = left.height;
  }
  window_ = glfwCreateWindow(width, height, title.c_str(), nullptr, nullptr);
  if (!window_) {
    glfwTerminate();
    throw std::runtime_error(
        "the display offers no OpenGL 3.3: install the packages libgl1-mesa-dri libegl1, or run with "
        "--headless");
  }
  if (place == Place::kLeft) glfwSetWindowPos(window_, left.x, left.y);
  glfwMakeContextCurrent(window_);
  detect_display_loss();
  glfwSwapInterval(0);  // the simulation must never wait for the display
}

GlfwContext::~GlfwContext() {
  glfwDestroyWindow(window_);
  glfwTerminate();
}

float GlfwContext::content_scale() const {
  float x = 1.0f, y = 1.0f;
  glfwGetWindowContentScale(window_, &x, &y);
  return std::max(x, y);
}

bool GlfwContext::minimised() const { return glfwGetWindowAttrib(window_, GLFW_ICONIFIED) == GLFW_TRUE; }

Current::Current(GLFWwindow* window) { glfwMakeContextCurrent(window); }
Current::~Current() { glfwMakeContextCurrent(nullptr); }

Gui::Gui(GLFWwindow* window, float scale) {
  ImGui::CreateContext();
  set_up_hud(scale);
  ImGui_ImplGlfw_InitForOpenGL(window, true);
  ImGui_ImplOpenGL3_Init("#version 330 core");
}

Gui::~Gui() {
  ImGui_ImplOpenGL3_Shutdown();
  ImGui_ImplGlfw_Shutdown();
  ImGui::DestroyContext();
}

bool drawn_in_software() {
  const std::string_view driver = reinterpret_cast<const char*>(glGetString(GL_RENDERER));
  return driver.find("llvmpipe") != driver.npos || driver.find("softpipe") != driver.npos ||
         driver.find("SWR") != driver.npos;
}

}  // namespace smartsurf::view
