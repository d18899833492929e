#include "smartsurf/view/Window.h"

#include <epoxy/gl.h>
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string_view>

#include "smartsurf/view/GlObjects.h"
#include "smartsurf/view/Hud.h"
#include "smartsurf/view/ReadPixels.h"
#include "smartsurf/view/Renderer.h"

namespace smartsurf::view {
namespace {

using Clock = std::chrono::steady_clock;

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

bool drawn_in_software() {
  const std::string_view driver = reinterpret_cast<const char*>(glGetString(GL_RENDERER));
  return driver.find("llvmpipe") != driver.npos || driver.find("softpipe") != driver.npos ||
         driver.find("SWR") != driver.npos;
}

// By the character typed, so that the keys are where the user's keyboard has them.
std::optional<Key> key_of_character(unsigned character) {
  switch (character) {
    case ' ':
      return Key::kPause;
    case '+':
    case '=':
      return Key::kFaster;
    case '-':
    case '_':
      return Key::kSlower;
    case 'm':
    case 'M':
      return Key::kMaxPace;
    case '1':
      return Key::kTop;
    case '2':
      return Key::kIso;
    case '3':
      return Key::kSide;
    case 'w':
    case 'W':
      return Key::kWireframe;
    case 'g':
    case 'G':
      return Key::kGrid;
    case 'p':
    case 'P':
      return Key::kPicture;
    case 'q':
    case 'Q':
      return Key::kQuit;
    default:
      return std::nullopt;
  }
}

std::optional<Key> key_of_code(int code) {
  switch (code) {
    case GLFW_KEY_RIGHT:
      return Key::kStep;
    case GLFW_KEY_F1:
      return Key::kHelp;
    case GLFW_KEY_ESCAPE:
      return Key::kQuit;
    default:
      return std::nullopt;
  }
}

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

// GLFW, the window with its context, and ImGui: each undone in reverse when a later one fails.
class Desktop {
 public:
  Desktop(const std::string& title, int width, int height, Place place) {
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
    glfwSwapInterval(0);  // the simulation must never wait for the display
  }
  ~Desktop() {
    glfwDestroyWindow(window_);
    glfwTerminate();
  }
  Desktop(const Desktop&) = delete;
  Desktop& operator=(const Desktop&) = delete;
  GLFWwindow* window() const { return window_; }

 private:
  GLFWwindow* window_ = nullptr;
};

// The window's context is current only while it is needed: EGL refuses to make another one current beside it.
class Current {
 public:
  explicit Current(GLFWwindow* window) { glfwMakeContextCurrent(window); }
  ~Current() { glfwMakeContextCurrent(nullptr); }
  Current(const Current&) = delete;
  Current& operator=(const Current&) = delete;
};

class Gui {
 public:
  Gui(GLFWwindow* window, float scale) {
    ImGui::CreateContext();
    set_up_hud(scale);
    ImGui_ImplGlfw_InitForOpenGL(window, true);
    ImGui_ImplOpenGL3_Init("#version 330 core");
  }
  ~Gui() {
    ImGui_ImplOpenGL3_Shutdown();
    ImGui_ImplGlfw_Shutdown();
    ImGui::DestroyContext();
  }
  Gui(const Gui&) = delete;
  Gui& operator=(const Gui&) = delete;
};

}  // namespace

struct Window::State {
  State(const scene::SceneSpec& s, const std::string& title, int window_width, int window_height, Place place)
      : spec(s),
        desktop(title, window_width, window_height, place),
        controls(s.surface),
        scale(content_scale()),
        gui(listen(), scale),
        renderer(s, drawn_in_software() ? Quality::fast() : Quality{2, 4096, true}) {
    glfwGetFramebufferSize(desktop.window(), &width, &height);
    if (width > 0 && height > 0) controls.resize(static_cast<double>(width) / height);
    glfwMakeContextCurrent(nullptr);
  }

  float content_scale() const {
    float x = 1.0f, y = 1.0f;
    glfwGetWindowContentScale(desktop.window(), &x, &y);
    return std::max(x, y);
  }
  GLFWwindow* listen();  // before ImGui does, which then passes events on
  void on_pointer(double x, double y);
  Commands take();
  // False when there is nothing to draw on. copy: where to keep what is shown, or null.
  bool show(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
            const Status& new_status, const DrawOptions& overlay, Image* copy);
  DrawOptions options(const DrawOptions& overlay) const;
  void draw_panels(const scene::Snapshot& snapshot, bool axes);
  void write_picture(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                     Commands& commands);
  Image fine_picture(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                     const DrawOptions& shown, int picture_width, int picture_height);

  scene::SceneSpec spec;
  Desktop desktop;
  Controls controls;
  Status status;
  HudState hud;
  double pointer_x = 0.0, pointer_y = 0.0;
  int width = 0, height = 0;  // of the framebuffer, pixels
  float scale;
  Gui gui;
  Renderer renderer;
  std::unique_ptr<Renderer> fine_renderer;  // made when the first picture is asked for
};

GLFWwindow* Window::State::listen() {
  GLFWwindow* window = desktop.window();
  glfwSetWindowUserPointer(window, this);
  glfwSetKeyCallback(window, [](GLFWwindow* w, int code, int, int action, int) {
    State& s = *static_cast<State*>(glfwGetWindowUserPointer(w));
    const auto key = key_of_code(code);
    if (key && (action == GLFW_PRESS || (action == GLFW_REPEAT && *key == Key::kStep)))
      s.controls.press(*key, s.status);
  });
  glfwSetCharCallback(window, [](GLFWwindow* w, unsigned character) {
    State& s = *static_cast<State*>(glfwGetWindowUserPointer(w));
    if (const auto key = key_of_character(character)) s.controls.press(*key, s.status);
  });
  glfwSetCursorPosCallback(window, [](GLFWwindow* w, double x, double y) {
    static_cast<State*>(glfwGetWindowUserPointer(w))->on_pointer(x, y);
  });
  glfwSetScrollCallback(window, [](GLFWwindow* w, double, double notches) {
    if (!ImGui::GetIO().WantCaptureMouse)
      static_cast<State*>(glfwGetWindowUserPointer(w))->controls.wheel(notches);
  });
  return window;
}

void Window::State::on_pointer(double x, double y) {
  GLFWwindow* window = desktop.window();
  const double dx = x - pointer_x, dy = y - pointer_y;
  pointer_x = x;
  pointer_y = y;
  if (ImGui::GetIO().WantCaptureMouse) return;
  const auto down = [window](int button) { return glfwGetMouseButton(window, button) == GLFW_PRESS; };
  const bool shift = glfwGetKey(window, GLFW_KEY_LEFT_SHIFT) == GLFW_PRESS ||
                     glfwGetKey(window, GLFW_KEY_RIGHT_SHIFT) == GLFW_PRESS;
  int window_width = 1, window_height = 1;
  glfwGetWindowSize(window, &window_width, &window_height);
  if (down(GLFW_MOUSE_BUTTON_RIGHT) || down(GLFW_MOUSE_BUTTON_MIDDLE) ||
      (down(GLFW_MOUSE_BUTTON_LEFT) && shift))
    controls.drag(Drag::kPan, dx, dy, window_height);
  else if (down(GLFW_MOUSE_BUTTON_LEFT))
    controls.drag(Drag::kOrbit, dx, dy, window_height);
}

Commands Window::State::take() {
  if (glfwWindowShouldClose(desktop.window())) controls.press(Key::kQuit, status);
  return controls.take();
}

bool Window::State::show(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                         const Status& new_status, const DrawOptions& overlay, Image* copy) {
  status = new_status;
  glfwPollEvents();
  glfwGetFramebufferSize(desktop.window(), &width, &height);
  if (width < 1 || height < 1 || glfwGetWindowAttrib(desktop.window(), GLFW_ICONIFIED) == GLFW_TRUE)
    return false;
  const auto start = Clock::now();
  const Current current(desktop.window());
  controls.resize(static_cast<double>(width) / height);
  renderer.draw(snapshot, catalogue, controls.camera(), options(overlay), 0, width, height);
  draw_panels(snapshot, overlay.axes);
  if (copy) *copy = read_pixels(0, width, height);
  glfwSwapBuffers(desktop.window());
  hud.render_ms += 0.2 * (milliseconds_since(start) - hud.render_ms);
  return true;
}

DrawOptions Window::State::options(const DrawOptions& overlay) const {
  DrawOptions options = overlay;
  if (controls.style() == Style::kWireframe) options.style = Style::kWireframe;
  options.grid = overlay.grid && controls.grid_shown();
  return options;
}

void Window::State::draw_panels(const scene::Snapshot& snapshot, bool axes) {
  ImGui_ImplOpenGL3_NewFrame();
  ImGui_ImplGlfw_NewFrame();
  ImGui::NewFrame();
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  if (axes) draw_axis_names(spec.surface, controls.camera(), size.x, size.y);
  draw_hud(snapshot, status, hud, controls, scale);
  if (controls.help_shown()) draw_help(scale);
  ImGui::Render();
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
}

Image Window::State::fine_picture(const scene::Snapshot& snapshot,
                                  const std::vector<scene::ObjectSpec>& catalogue, const DrawOptions& shown,
                                  int picture_width, int picture_height) {
  const Current current(desktop.window());
  if (!fine_renderer) fine_renderer = std::make_unique<Renderer>(spec, Quality::fine());
  Canvas canvas;
  canvas.resize(picture_width, picture_height);
  fine_renderer->draw(snapshot, catalogue, controls.camera(), shown, canvas.framebuffer.id(), picture_width,
                      picture_height);
  Image image = read_pixels(canvas.framebuffer.id(), picture_width, picture_height);
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  return image;
}

void Window::State::write_picture(const scene::Snapshot& snapshot,
                                  const std::vector<scene::ObjectSpec>& catalogue, Commands& commands) {
  char number[16];
  std::snprintf(number, sizeof(number), "-%06llu", static_cast<unsigned long long>(snapshot.tick));
  std::string name = std::filesystem::path(spec.file).stem().string();
  if (name.empty()) name = "smartsurf";
  const std::string path = name + number + ".png";
  try {
    write_png(path, fine_picture(snapshot, catalogue, options({}), width, height));
    commands.screenshot = path;
    hud.message = "wrote " + path;
  } catch (const std::runtime_error& error) {
    hud.message = error.what();
  }
}

bool Window::display_available() {
  if (!glfwInit()) return false;
  glfwTerminate();
  return true;
}

Window::Window(const scene::SceneSpec& spec, const std::string& title, int width, int height, Place place)
    : state_(std::make_unique<State>(spec, title, width, height, place)) {}

Window::~Window() {
  if (state_) glfwMakeContextCurrent(state_->desktop.window());
}

Commands Window::poll(const Status& status) {
  state_->status = status;
  glfwPollEvents();
  return state_->take();
}

Commands Window::frame(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                       const Status& status, const DrawOptions& overlay) {
  State& s = *state_;
  const bool shown = s.show(snapshot, catalogue, status, overlay, nullptr);
  Commands commands = s.take();
  if (shown && s.controls.take_picture_request()) s.write_picture(snapshot, catalogue, commands);
  return commands;
}

Image Window::picture(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                      int width, int height) {
  return state_->fine_picture(snapshot, catalogue, {}, width, height);
}

Image Window::show(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                   const Status& status, const DrawOptions& overlay) {
  Image image;
  state_->show(snapshot, catalogue, status, overlay, &image);
  return image;
}

void Window::press(Key key) { state_->controls.press(key, state_->status); }

}  // namespace smartsurf::view
