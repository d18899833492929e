#include "apron/ui/window/Window.h"

#include <epoxy/gl.h>
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>

#include <algorithm>
#include <set>

#include "apron/ui/Gui.h"
#include "apron/ui/panels/Panels.h"
#include "apron/ui/panels/TextureCache.h"
#include "common/error/UserError.h"
#include "common/gl/Framebuffer.h"

namespace apron::ui {
namespace {

constexpr int kWidth = 1280, kHeight = 800, kMinWidth = 640, kMinHeight = 480;
// The left fraction of the work area that --geometry beside leaves to the simulator.
constexpr float kSimulatorShare = 0.42F;

struct WorkArea {
  int x = 0, y = 0, width = kWidth, height = kHeight;
  float scale_x = 1.0F, scale_y = 1.0F;  // content scale; a window of default size grows by it
};

WorkArea work_area() {
  WorkArea area;
  if (GLFWmonitor* monitor = glfwGetPrimaryMonitor()) {
    glfwGetMonitorWorkarea(monitor, &area.x, &area.y, &area.width, &area.height);
    glfwGetMonitorContentScale(monitor, &area.scale_x, &area.scale_y);
  }
  return area;
}

int fit_to_work_area(int requested, int available, float scale) {
  return std::min(requested, static_cast<int>(static_cast<float>(available) / scale));
}

// Owns GLFW, the window and its OpenGL context.
class GlfwContext {
 public:
  GlfwContext(const std::string& title, const WindowPlacement& requested) {
    if (glfwInit() == GLFW_FALSE)
      throw common::UserError(
          "there is no display to open a window on: set DISPLAY, or use --screenshot or --video");
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    // Only a default size grows on a scaled display.
    const bool default_size = requested.width == 0 && !requested.beside_simulator;
    glfwWindowHint(GLFW_SCALE_TO_MONITOR, default_size ? GLFW_TRUE : GLFW_FALSE);
    glfwWindowHint(GLFW_VISIBLE, GLFW_FALSE);
    const WindowPlacement placement = resolve_placement(requested);
    window_ = glfwCreateWindow(placement.width, placement.height, title.c_str(), nullptr, nullptr);
    if (window_ == nullptr) {
      glfwTerminate();
      throw common::UserError(
          "the display offers no OpenGL 3.3: install the packages libgl1 libgl1-mesa-dri libegl1");
    }
    glfwSetWindowSizeLimits(window_, kMinWidth, kMinHeight, GLFW_DONT_CARE, GLFW_DONT_CARE);
    if (placement.beside_simulator)
      place_with_frame(placement);
    else if (placement.has_position)
      glfwSetWindowPos(window_, placement.x, placement.y);
    glfwShowWindow(window_);
    glfwMakeContextCurrent(window_);
    glfwSwapInterval(0);  // frames are paced by the caller
  }
  ~GlfwContext() {
    glfwDestroyWindow(window_);
    glfwTerminate();
  }
  GlfwContext(const GlfwContext&) = delete;
  GlfwContext& operator=(const GlfwContext&) = delete;
  GLFWwindow* window() const { return window_; }

  float scale() const {
    float x = 1.0F, y = 1.0F;
    glfwGetWindowContentScale(window_, &x, &y);
    return std::max(x, y);
  }

 private:
  static WindowPlacement resolve_placement(WindowPlacement placement) {
    const WorkArea area = work_area();
    if (placement.beside_simulator) {
      const int from = static_cast<int>(static_cast<float>(area.width) * kSimulatorShare);
      return {area.width - from, area.height, true, area.x + from, area.y, true};
    }
    if (placement.width == 0) placement.width = fit_to_work_area(kWidth, area.width, area.scale_x);
    if (placement.height == 0) placement.height = fit_to_work_area(kHeight, area.height, area.scale_y);
    return placement;
  }

  // Positions are those of the contents: without room for the frame, the title bar would lie above the
  // screen.
  void place_with_frame(const WindowPlacement& placement) {
    int left = 0, top = 0, right = 0, bottom = 0;
    glfwGetWindowFrameSize(window_, &left, &top, &right, &bottom);
    glfwSetWindowSize(window_, std::max(placement.width - left - right, kMinWidth),
                      std::max(placement.height - top - bottom, kMinHeight));
    glfwSetWindowPos(window_, placement.x + left, placement.y + top);
  }

  GLFWwindow* window_ = nullptr;
};

// ImGui reads once a frame which keys are down. A key that goes down and up between two frames stays down for
// the next one.
class GuiInput {
 public:
  explicit GuiInput(GLFWwindow* window) {
    glfwSetWindowUserPointer(window, this);
    glfwSetKeyCallback(window, [](GLFWwindow* of, int key, int, int action, int) {
      static_cast<GuiInput*>(glfwGetWindowUserPointer(of))->record(key, action);
    });
    ImGui_ImplGlfw_InitForOpenGL(window, true);  // chains the callback
  }
  ~GuiInput() { ImGui_ImplGlfw_Shutdown(); }
  GuiInput(const GuiInput&) = delete;
  GuiInput& operator=(const GuiInput&) = delete;

  // Around a frame, after the events before it.
  void begin_frame() { set_tapped(true); }
  void end_frame() {
    set_tapped(false);
    pressed_.clear();
    tapped_.clear();
  }

 private:
  void record(int key, int action) {
    if (action == GLFW_PRESS) pressed_.insert(key);
    if (action == GLFW_RELEASE && pressed_.contains(key)) tapped_.insert(key);
  }
  void set_tapped(bool down) {
    ImGuiIO& io = ImGui::GetIO();
    for (const int key : tapped_)
      if (key >= 0 && key < IM_ARRAYSIZE(io.KeysDown)) io.KeysDown[key] = down;
    io.KeyCtrl = io.KeysDown[GLFW_KEY_LEFT_CONTROL] || io.KeysDown[GLFW_KEY_RIGHT_CONTROL];
    io.KeyShift = io.KeysDown[GLFW_KEY_LEFT_SHIFT] || io.KeysDown[GLFW_KEY_RIGHT_SHIFT];
    io.KeyAlt = io.KeysDown[GLFW_KEY_LEFT_ALT] || io.KeysDown[GLFW_KEY_RIGHT_ALT];
  }

  std::set<int> pressed_, tapped_;  // GLFW's codes, since the last frame; pressed and released
};

}  // namespace

struct Window::State {
  State(const std::string& title, const WindowPlacement& placement)
      : glfw(title, placement), gui(glfw.scale()), input(glfw.window()) {}

  bool drawable() {
    glfwGetFramebufferSize(glfw.window(), &width, &height);
    return width > 0 && height > 0 && glfwGetWindowAttrib(glfw.window(), GLFW_ICONIFIED) == GLFW_FALSE;
  }
  void draw(ViewModel& model) {
    ImGui_ImplOpenGL3_NewFrame();
    ImGui_ImplGlfw_NewFrame();
    input.begin_frame();
    ImGui::NewFrame();
    if (ImGui::IsKeyPressed(GLFW_KEY_F1, false)) model.help_shown = !model.help_shown;
    DrawContext context{model, textures, gui};
    draw_window(context);
    ImGui::Render();
    input.end_frame();
    glViewport(0, 0, width, height);
    glClearColor(1.0F, 1.0F, 1.0F, 1.0F);
    glClear(GL_COLOR_BUFFER_BIT);
    ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
  }

  GlfwContext glfw;
  Gui gui;
  GuiInput input;
  TextureCache textures;
  int width = 0, height = 0;  // pixels
};

// Leaves GLFW initialised: some X servers reset when the last client disconnects and refuse connections
// meanwhile.
bool Window::display_available() { return glfwInit() == GLFW_TRUE; }

Window::Window(const std::string& title, const WindowPlacement& placement)
    : state_(std::make_unique<State>(title, placement)) {}
Window::~Window() = default;

bool Window::render_frame(ViewModel& model) {
  glfwPollEvents();
  if (glfwWindowShouldClose(state_->glfw.window()) == GLFW_TRUE) return false;
  if (!state_->drawable()) return true;
  state_->draw(model);
  glfwSwapBuffers(state_->glfw.window());
  return true;
}

void Window::wait_events(double seconds) { glfwWaitEventsTimeout(seconds); }

common::Image Window::capture(ViewModel& model) {
  if (!state_->drawable()) return {};
  state_->draw(model);
  return common::read_framebuffer(state_->width, state_->height);
}

void Window::close() { glfwSetWindowShouldClose(state_->glfw.window(), GLFW_TRUE); }
unsigned Window::take_gl_error() { return glGetError(); }

}  // namespace apron::ui
