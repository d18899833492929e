#include "smartsurf/view/window/Window.h"

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
#include <utility>

#include "common/image/Png.h"
#include "smartsurf/view/gl/GlObjects.h"
#include "smartsurf/view/gl/Renderer.h"
#include "smartsurf/view/model/Overlay.h"
#include "smartsurf/view/output/VideoCapture.h"
#include "smartsurf/view/panels/Hud.h"
#include "smartsurf/view/window/AdaptiveResolution.h"
#include "smartsurf/view/window/DisplayLoss.h"
#include "smartsurf/view/window/GlfwContext.h"
#include "smartsurf/view/window/WindowKeys.h"

namespace smartsurf::view {
namespace {

using Clock = std::chrono::steady_clock;

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

}  // namespace

struct Window::State {
  State(const scene::SceneSpec& s, const std::string& title, int window_width, int window_height, Place place)
      : spec(s),
        desktop(title, window_width, window_height, place),
        controls(s.surface),
        overlay(s.surface),
        scale(desktop.content_scale()),
        gui(listen(), scale),
        in_software(drawn_in_software()),
        quality(in_software ? Quality::fast() : Quality::card()),
        renderer(std::make_unique<Renderer>(s, quality)) {
    glfwGetFramebufferSize(desktop.window(), &width, &height);
    if (width > 0 && height > 0) controls.resize(static_cast<double>(width) / height);
    hud.edits = edits_of(spec.options);
    glfwMakeContextCurrent(nullptr);
  }

  GLFWwindow* listen();  // before ImGui does, which then passes events on
  void note_pointer(PointerEvent event, int mods);
  void set_scene(const scene::SceneSpec& s);
  Commands take_screenshot();
  // False when there is nothing to draw on. copy: where to keep what is shown, or null.
  bool show(const FrameInput& moment, const Status& new_status, common::Image* copy);
  bool stands_still() const;
  void draw_scene(const FrameInput& moment);
  void handle_pointer(const FrameInput& moment);
  DrawOptions options(const FrameInput& moment, bool marks);
  void draw_panels(const FrameInput& moment);
  std::string file_name(const FrameInput& moment, const char* ending) const;
  void write_picture(const FrameInput& moment, Commands& commands);
  void video(const FrameInput& moment);
  void toggle_video(const FrameInput& moment);
  common::Image fine_picture(const FrameInput& moment, const DrawOptions& shown, int picture_width,
                             int picture_height);

  scene::SceneSpec spec;
  GlfwContext desktop;
  Controls controls;
  Overlay overlay;
  Status status;
  HudState hud;
  std::vector<PointerEvent> pointer;  // not yet taken in
  double pointer_x = 0.0, pointer_y = 0.0;
  bool stirred = true;  // by the user or the window system, since the last frame
  Clock::time_point shown_at = Clock::now();
  int width = 0, height = 0;  // of the framebuffer, pixels
  float scale;
  Gui gui;
  bool in_software;
  Quality quality;
  AdaptiveResolution sharpness;
  Canvas coarse;  // where the scene is drawn with fewer pixels than are shown
  std::unique_ptr<Renderer> renderer;
  std::unique_ptr<Renderer> fine_renderer;  // made when the first picture is asked for
  std::unique_ptr<VideoCapture> film_of_window;
};

GLFWwindow* Window::State::listen() {
  GLFWwindow* window = desktop.window();
  glfwSetWindowUserPointer(window, this);
  static constexpr auto state_of = [](GLFWwindow* w) -> State& {
    return *static_cast<State*>(glfwGetWindowUserPointer(w));
  };
  glfwSetWindowRefreshCallback(window, [](GLFWwindow* w) { state_of(w).stirred = true; });
  glfwSetKeyCallback(window, [](GLFWwindow* w, int code, int, int action, int) {
    state_of(w).stirred = true;
    if (ImGui::GetIO().WantTextInput) return;
    if (const auto key = key_of_code(code, action == GLFW_REPEAT); key && action != GLFW_RELEASE)
      state_of(w).controls.press(*key, state_of(w).status);
  });
  glfwSetCharCallback(window, [](GLFWwindow* w, unsigned character) {
    state_of(w).stirred = true;
    if (ImGui::GetIO().WantTextInput) return;
    if (const auto key = key_of_character(character)) state_of(w).controls.press(*key, state_of(w).status);
  });
  glfwSetCursorPosCallback(window, [](GLFWwindow* w, double x, double y) {
    state_of(w).pointer_x = x;
    state_of(w).pointer_y = y;
    state_of(w).note_pointer({PointerEvent::Kind::kMove}, 0);
  });
  glfwSetMouseButtonCallback(window, [](GLFWwindow* w, int button, int action, int mods) {
    const bool down = action == GLFW_PRESS;
    if (down && over_panel(state_of(w).pointer_x, state_of(w).pointer_y)) return;
    state_of(w).note_pointer(
        {down ? PointerEvent::Kind::kPress : PointerEvent::Kind::kRelease,
         button == GLFW_MOUSE_BUTTON_LEFT ? PointerEvent::Button::kLeft : PointerEvent::Button::kOther},
        mods);
  });
  glfwSetScrollCallback(window, [](GLFWwindow* w, double, double notches) {
    state_of(w).stirred = true;
    if (!over_panel(state_of(w).pointer_x, state_of(w).pointer_y)) state_of(w).controls.wheel(notches);
  });
  return window;
}

void Window::State::note_pointer(PointerEvent event, int mods) {
  stirred = true;
  event.x = pointer_x;
  event.y = pointer_y;
  event.control = (mods & GLFW_MOD_CONTROL) != 0;
  event.shift = (mods & GLFW_MOD_SHIFT) != 0;
  pointer.push_back(event);
}

void Window::State::set_scene(const scene::SceneSpec& s) {
  const Current current(desktop.window());
  spec = s;
  controls.set_surface(s.surface);
  overlay = Overlay(s.surface);
  hud.edits = edits_of(s.options);
  hud.watch = {};
  fine_renderer.reset();
  renderer = std::make_unique<Renderer>(s, quality);
}

Commands Window::State::take_screenshot() {
  if (glfwWindowShouldClose(desktop.window())) controls.press(Key::kQuit, status);
  Commands commands = controls.take();
  if (commands.reset && commands.options.empty()) commands.options = changes(hud.edits);
  commands.display_lost = display_lost();
  return commands;
}

bool Window::State::show(const FrameInput& moment, const Status& new_status, common::Image* copy) {
  status = new_status;
  glfwPollEvents();
  stirred = false;
  if (display_lost()) return false;
  glfwGetFramebufferSize(desktop.window(), &width, &height);
  const bool minimised = desktop.minimised();
  if (display_lost() || width < 1 || height < 1 || minimised) return false;  // what a lost one says is chance
  const auto start = Clock::now();
  const Current current(desktop.window());
  controls.resize(static_cast<double>(width) / height, hud.covered);
  handle_pointer(moment);
  controls.track(moment.snapshot);
  controls.set_channels(moment.channels);
  if (controls.tools().selected()) hud.watch.add(*controls.tools().selected(), spec.surface, moment);
  draw_scene(moment);
  video(moment);
  draw_panels(moment);
  if (copy) *copy = read_pixels(0, width, height);
  glfwSwapBuffers(desktop.window());
  const double took_ms = milliseconds_since(start);
  if (in_software && !stands_still()) sharpness.took(took_ms);
  hud.render_ms += 0.2 * (took_ms - hud.render_ms);
  hud.interval_ms += 0.2 * (std::min(milliseconds_since(shown_at), 1000.0) - hud.interval_ms);
  shown_at = Clock::now();
  return true;
}

// A held run is drawn in full, and so is what is filmed.
bool Window::State::stands_still() const { return status.paused || film_of_window; }

void Window::State::draw_scene(const FrameInput& moment) {
  const double share = in_software && !stands_still() ? sharpness.value() : 1.0;
  DrawOptions shown = options(moment, true);
  if (share >= 1.0) {
    renderer->draw(moment.snapshot, moment.catalogue, controls.camera(), shown, 0, width, height);
    return;
  }
  const int w = std::max(1, static_cast<int>(share * width)),
            h = std::max(1, static_cast<int>(share * height));
  coarse.resize(w, h);
  shown.line_width *= static_cast<float>(share);
  renderer->draw(moment.snapshot, moment.catalogue, controls.camera(), shown, coarse.framebuffer.id(), w, h);
  glBindFramebuffer(GL_READ_FRAMEBUFFER, coarse.framebuffer.id());
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, 0);
  glBlitFramebuffer(0, 0, w, h, 0, 0, width, height, GL_COLOR_BUFFER_BIT, GL_LINEAR);
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  glViewport(0, 0, width, height);
}

void Window::State::handle_pointer(const FrameInput& moment) {
  int window_width = 1, window_height = 1;
  glfwGetWindowSize(desktop.window(), &window_width, &window_height);
  for (const PointerEvent& event : std::exchange(pointer, {}))
    controls.point(event, moment, status, window_width, window_height);
}

// marks: also the selection and the spring, which belong into no picture.
DrawOptions Window::State::options(const FrameInput& moment, bool marks) {
  DrawOptions options;
  options.style = controls.style();
  options.grid = controls.grid_shown();
  options.line_width = 2.0f * scale;
  overlay.settings = controls.overlay();
  overlay.apply(moment, marks ? &controls.tools() : nullptr, options);
  return options;
}

void Window::State::draw_panels(const FrameInput& moment) {
  ImGui_ImplOpenGL3_NewFrame();
  ImGui_ImplGlfw_NewFrame();
  if (display_lost()) return;  // then the size that it read is none
  ImGui::NewFrame();
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  draw_axis_names(spec.surface, controls.camera(), size.x, size.y);
  if (controls.labels_shown()) draw_labels(moment, controls.camera(), size.x, size.y);
  draw_hud(moment, status, overlay.heat(), hud, controls, scale);
  if (controls.help_shown()) draw_help(scale);
  ImGui::Render();
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
}

void Window::State::video(const FrameInput& moment) {
  if (!film_of_window || !film_of_window->due(moment.snapshot.time_s)) return;
  try {
    film_of_window->add(read_pixels(0, width, height), moment.snapshot.time_s);
  } catch (const std::runtime_error& error) {
    film_of_window.reset();
    hud.filming = false;
    hud.message = error.what();
  }
}

void Window::State::toggle_video(const FrameInput& moment) {
  try {
    if (const auto film = std::exchange(film_of_window, nullptr)) {
      film->finish();
      hud.message = "wrote " + film->file();
    } else {
      film_of_window =
          std::make_unique<VideoCapture>(file_name(moment, ".mp4"), width, height, moment.snapshot.time_s);
      hud.message.clear();
    }
  } catch (const std::runtime_error& error) {
    hud.message = error.what();
  }
  hud.filming = film_of_window != nullptr;
}

std::string Window::State::file_name(const FrameInput& moment, const char* ending) const {
  char number[16];
  std::snprintf(number, sizeof(number), "-%06llu", static_cast<unsigned long long>(moment.snapshot.tick));
  std::string name = std::filesystem::path(spec.file).stem().string();
  if (name.empty()) name = "smartsurf";
  return name + number + ending;
}

common::Image Window::State::fine_picture(const FrameInput& moment, const DrawOptions& shown,
                                          int picture_width, int picture_height) {
  const Current current(desktop.window());
  if (!fine_renderer) fine_renderer = std::make_unique<Renderer>(spec, Quality::fine());
  Canvas canvas;
  canvas.resize(picture_width, picture_height);
  fine_renderer->draw(moment.snapshot, moment.catalogue, controls.camera(), shown, canvas.framebuffer.id(),
                      picture_width, picture_height);
  common::Image image = read_pixels(canvas.framebuffer.id(), picture_width, picture_height);
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  return image;
}

void Window::State::write_picture(const FrameInput& moment, Commands& commands) {
  const std::string path = file_name(moment, ".png");
  try {
    common::write_png(path, fine_picture(moment, options(moment, false), width, height));
    commands.screenshot = path;
    hud.message = "wrote " + path;
  } catch (const std::runtime_error& error) {
    hud.message = error.what();
  }
}

// What was opened stays open: a display server may begin anew when its last client leaves, and refuse the
// next.
bool Window::display_available() { return glfwInit() == GLFW_TRUE; }

Window::Window(const scene::SceneSpec& spec, const std::string& title, int width, int height, Place place)
    : state_(std::make_unique<State>(spec, title, width, height, place)) {}

Window::~Window() {
  // Nothing of a lost display can be given back: its driver would wait for answers that do not come.
  if (display_lost())
    static_cast<void>(state_.release());
  else
    glfwMakeContextCurrent(state_->desktop.window());
}

Commands Window::poll(const Status& status) {
  state_->status = status;
  glfwPollEvents();
  return state_->take_screenshot();
}

Commands Window::frame(const FrameInput& moment, const Status& status) {
  State& s = *state_;
  const bool shown = s.show(moment, status, nullptr);
  Commands commands = s.take_screenshot();
  if (shown && s.controls.take_screenshot_request()) s.write_picture(moment, commands);
  if (shown && s.controls.take_video_request()) s.toggle_video(moment);
  return commands;
}

common::Image Window::picture(const FrameInput& moment, int width, int height) {
  return state_->fine_picture(moment, {}, width, height);
}

common::Image Window::show(const FrameInput& moment, const Status& status) {
  common::Image image;
  state_->show(moment, status, &image);
  return image;
}

bool Window::stirred() const { return state_->stirred; }
bool Window::wants_contacts() const { return state_->controls.overlay().contacts; }
void Window::press(Key key) {
  state_->stirred = true;
  state_->controls.press(key, state_->status);
}
void Window::point(const PointerEvent& event) {
  state_->stirred = true;
  state_->pointer.push_back(event);
}
void Window::set_scene(const scene::SceneSpec& spec) { state_->set_scene(spec); }

}  // namespace smartsurf::view
