#include "apron/ui/Window.h"

#include <epoxy/gl.h>
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>

#include <algorithm>

#include "apron/ui/Gui.h"
#include "apron/ui/Panels.h"
#include "apron/ui/Textures.h"

namespace apron::ui {
namespace {

constexpr int kWidth = 1280, kHeight = 800, kLeastWidth = 640, kLeastHeight = 480;
// Of the screen's width, from the left, for the simulator beside which the window stands.
constexpr float kOtherShare = 0.42F;

struct Area {
  int x = 0, y = 0, width = kWidth, height = kHeight;
  float scale_x = 1.0F, scale_y = 1.0F;  // by which a window of a chosen size grows
};

Area work_area() {
  Area area;
  if (GLFWmonitor* monitor = glfwGetPrimaryMonitor()) {
    glfwGetMonitorWorkarea(monitor, &area.x, &area.y, &area.width, &area.height);
    glfwGetMonitorContentScale(monitor, &area.scale_x, &area.scale_y);
  }
  return area;
}

int fitting(int wanted, int room, float scale) {
  return std::min(wanted, static_cast<int>(static_cast<float>(room) / scale));
}

// GLFW and the window with its context.
class Desktop {
 public:
  Desktop(const std::string& title, const Placement& wanted) {
    if (glfwInit() == GLFW_FALSE)
      throw PictureError(
          "there is no display to open a window on: set DISPLAY, or use --screenshot or --video");
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    const bool chosen = wanted.width == 0 && !wanted.beside;  // then it is larger where the display is scaled
    glfwWindowHint(GLFW_SCALE_TO_MONITOR, chosen ? GLFW_TRUE : GLFW_FALSE);
    glfwWindowHint(GLFW_VISIBLE, GLFW_FALSE);
    const Placement place = found(wanted);
    window_ = glfwCreateWindow(place.width, place.height, title.c_str(), nullptr, nullptr);
    if (window_ == nullptr) {
      glfwTerminate();
      throw PictureError("the display offers no OpenGL 3.3: install the packages libgl1-mesa-dri libegl1");
    }
    glfwSetWindowSizeLimits(window_, kLeastWidth, kLeastHeight, GLFW_DONT_CARE, GLFW_DONT_CARE);
    if (place.placed) glfwSetWindowPos(window_, place.x, place.y);
    glfwShowWindow(window_);
    glfwMakeContextCurrent(window_);
    glfwSwapInterval(0);  // frames are paced by the caller
  }
  ~Desktop() {
    glfwDestroyWindow(window_);
    glfwTerminate();
  }
  Desktop(const Desktop&) = delete;
  Desktop& operator=(const Desktop&) = delete;
  GLFWwindow* window() const { return window_; }

  float scale() const {
    float x = 1.0F, y = 1.0F;
    glfwGetWindowContentScale(window_, &x, &y);
    return std::max(x, y);
  }

 private:
  static Placement found(Placement place) {
    const Area area = work_area();
    if (place.beside) {
      const int from = static_cast<int>(static_cast<float>(area.width) * kOtherShare);
      return {area.width - from, area.height, true, area.x + from, area.y, true};
    }
    if (place.width == 0) place.width = fitting(kWidth, area.width, area.scale_x);
    if (place.height == 0) place.height = fitting(kHeight, area.height, area.scale_y);
    return place;
  }

  GLFWwindow* window_ = nullptr;
};

class GuiInput {
 public:
  explicit GuiInput(GLFWwindow* window) { ImGui_ImplGlfw_InitForOpenGL(window, true); }
  ~GuiInput() { ImGui_ImplGlfw_Shutdown(); }
  GuiInput(const GuiInput&) = delete;
  GuiInput& operator=(const GuiInput&) = delete;
};

}  // namespace

struct Window::State {
  State(const std::string& title, const Placement& place)
      : desktop(title, place), gui(desktop.scale()), input(desktop.window()) {}

  bool drawable() {
    glfwGetFramebufferSize(desktop.window(), &width, &height);
    return width > 0 && height > 0 && glfwGetWindowAttrib(desktop.window(), GLFW_ICONIFIED) == GLFW_FALSE;
  }
  void draw(Workbench& bench) {
    ImGui_ImplOpenGL3_NewFrame();
    ImGui_ImplGlfw_NewFrame();
    ImGui::NewFrame();
    if (ImGui::IsKeyPressed(GLFW_KEY_F1, false)) bench.help_shown = !bench.help_shown;
    Stage stage{bench, textures, gui};
    draw_window(stage);
    ImGui::Render();
    glViewport(0, 0, width, height);
    glClearColor(1.0F, 1.0F, 1.0F, 1.0F);
    glClear(GL_COLOR_BUFFER_BIT);
    ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
  }

  Desktop desktop;
  Gui gui;
  GuiInput input;
  Textures textures;
  int width = 0, height = 0;  // pixels
};

// Stays connected: some displays begin again when the last program leaves, and refuse the next one meanwhile.
bool Window::display_available() { return glfwInit() == GLFW_TRUE; }

Window::Window(const std::string& title, const Placement& placement)
    : state_(std::make_unique<State>(title, placement)) {}
Window::~Window() = default;

bool Window::frame(Workbench& bench) {
  glfwPollEvents();
  if (glfwWindowShouldClose(state_->desktop.window()) == GLFW_TRUE) return false;
  if (!state_->drawable()) return true;
  state_->draw(bench);
  glfwSwapBuffers(state_->desktop.window());
  return true;
}

void Window::wait(double seconds) { glfwWaitEventsTimeout(seconds); }

Image Window::picture(Workbench& bench) {
  if (!state_->drawable()) return {};
  state_->draw(bench);
  return read_pixels(state_->width, state_->height);
}

void Window::close() { glfwSetWindowShouldClose(state_->desktop.window(), GLFW_TRUE); }
unsigned Window::take_error() { return glGetError(); }

}  // namespace apron::ui
