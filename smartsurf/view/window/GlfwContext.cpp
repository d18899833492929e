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
struct WindowRect {
  int x = 0, y = 0, width = 1280, height = 720;
};

// Share of the screen's width with WindowPlacement::kLeft.
constexpr double kLeftWidthFraction = 0.42;

WindowRect left_screen_area() {
  WindowRect area;
  if (GLFWmonitor* monitor = glfwGetPrimaryMonitor())
    glfwGetMonitorWorkarea(monitor, &area.x, &area.y, &area.width, &area.height);
  area.width = static_cast<int>(area.width * kLeftWidthFraction);
  return area;
}

// Sizes and positions are those of the contents: without room for the frame, the title bar would lie above
// the screen.
void place_left(GLFWwindow* window) {
  int left = 0, top = 0, right = 0, bottom = 0;
  glfwGetWindowFrameSize(window, &left, &top, &right, &bottom);
  const WindowRect area = left_screen_area();
  glfwSetWindowSize(window, std::max(area.width - left - right, 1), std::max(area.height - top - bottom, 1));
  glfwSetWindowPos(window, area.x + left, area.y + top);
}

// In the middle of the screen, and no larger.
void place_in_middle(GLFWwindow* window) {
  GLFWmonitor* const monitor = glfwGetPrimaryMonitor();
  if (!monitor) return;
  WindowRect area, size;
  glfwGetMonitorWorkarea(monitor, &area.x, &area.y, &area.width, &area.height);
  glfwGetWindowSize(window, &size.width, &size.height);
  int left = 0, top = 0, right = 0, bottom = 0;
  glfwGetWindowFrameSize(window, &left, &top, &right, &bottom);
  area.width -= left + right;
  area.height -= top + bottom;
  size.width = std::max(std::min(size.width, area.width), 1);
  size.height = std::max(std::min(size.height, area.height), 1);
  glfwSetWindowSize(window, size.width, size.height);
  glfwSetWindowPos(window, area.x + left + (area.width - size.width) / 2,
                   area.y + top + (area.height - size.height) / 2);
}

}  // namespace

GlfwContext::GlfwContext(const std::string& title, int width, int height, WindowPlacement placement) {
  if (!glfwInit())
    throw std::runtime_error("no display to open a window on: set DISPLAY, or run with --headless");
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  glfwWindowHint(GLFW_SCALE_TO_MONITOR, placement == WindowPlacement::kDefault ? GLFW_TRUE : GLFW_FALSE);
  glfwWindowHint(GLFW_VISIBLE, GLFW_FALSE);
  window_ = glfwCreateWindow(width, height, title.c_str(), nullptr, nullptr);
  if (!window_) {
    glfwTerminate();
    throw std::runtime_error(
        "the display offers no OpenGL 3.3: install the packages libgl1 libgl1-mesa-dri libegl1, or run with "
        "--headless");
  }
  if (placement == WindowPlacement::kLeft)
    place_left(window_);
  else
    place_in_middle(window_);
  glfwShowWindow(window_);
  glfwMakeContextCurrent(window_);
  detect_display_loss();
  glfwSwapInterval(0);  // the simulation must not block on vertical sync
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

void GlfwContext::move_to_left() { place_left(window_); }

bool GlfwContext::minimised() const { return glfwGetWindowAttrib(window_, GLFW_ICONIFIED) == GLFW_TRUE; }

ScopedGlContext::ScopedGlContext(GLFWwindow* window) { glfwMakeContextCurrent(window); }
ScopedGlContext::~ScopedGlContext() { glfwMakeContextCurrent(nullptr); }

ImGuiBackend::ImGuiBackend(GLFWwindow* window, float scale) {
  ImGui::CreateContext();
  setup_imgui_style(scale);
  ImGui_ImplGlfw_InitForOpenGL(window, true);
  ImGui_ImplOpenGL3_Init("#version 330 core");
}

ImGuiBackend::~ImGuiBackend() {
  ImGui_ImplOpenGL3_Shutdown();
  ImGui_ImplGlfw_Shutdown();
  ImGui::DestroyContext();
}

bool is_software_renderer() {
  const auto* const name = reinterpret_cast<const char*>(glGetString(GL_RENDERER));  // null after an error
  const std::string_view driver = name == nullptr ? "" : name;
  return driver.find("llvmpipe") != driver.npos || driver.find("softpipe") != driver.npos ||
         driver.find("SWR") != driver.npos;
}

}  // namespace smartsurf::view
