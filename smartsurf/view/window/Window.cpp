#include "smartsurf/view/window/Window.h"

#include <epoxy/gl.h>
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <utility>

#include "common/files/UserFile.h"
#include "common/image/Png.h"
#include "smartsurf/view/gl/GlObjects.h"
#include "smartsurf/view/gl/Renderer.h"
#include "smartsurf/view/interaction/Overlay.h"
#include "smartsurf/view/output/VideoCapture.h"
#include "smartsurf/view/panels/Hud.h"
#include "smartsurf/view/window/AdaptiveResolution.h"
#include "smartsurf/view/window/DisplayLoss.h"
#include "smartsurf/view/window/GlfwContext.h"
#include "smartsurf/view/window/KeyBindings.h"

namespace smartsurf::view {
namespace {

using Clock = std::chrono::steady_clock;

constexpr const char* kLayoutFile = "window.layout";

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

}  // namespace

struct Window::State {
  State(const scene::SceneSpec& s, const std::string& title, int window_width, int window_height,
        WindowPlacement placement)
      : spec(s),
        glfw(title, window_width, window_height, placement),
        controls(s.surface),
        overlay(s.surface),
        ui_scale(glfw.content_scale()),
        imgui(install_callbacks(), ui_scale),
        software_rendering(is_software_renderer()),
        quality(software_rendering ? RenderQuality::fast() : RenderQuality::gpu()),
        renderer(std::make_unique<Renderer>(s, quality)) {
    saved_sizes = hud.sizes = parse_sizes(common::read_user_file(kLayoutFile));
    read_sizes();
    hud.bar_height *= ui_scale;
    hud.message_height *= ui_scale;
    update_layout();
    hud.option_edits = make_option_edits(spec.options);
    glfwMakeContextCurrent(nullptr);
  }

  GLFWwindow* install_callbacks();  // before ImGui installs its own, which chain these
  void queue_pointer_event(PointerEvent event, int mods);
  void set_scene(const scene::SceneSpec& s);
  void set_detail(Detail detail);
  Commands take_commands();
  // False if the window has no size: if the display is lost, or no part is shown.
  bool read_sizes();
  void update_layout();
  void save_layout();
  // Returns false without drawing if the display is lost or the window is minimised. copy: receives the
  // frame; may be null.
  bool render_frame(const FrameInput& input, const Status& new_status, common::Image* copy);
  bool needs_full_resolution() const;
  void draw_scene(const FrameInput& input);
  void handle_pointer(const FrameInput& input);
  DrawOptions make_draw_options(const FrameInput& input, bool show_selection);
  void update_plots(const FrameInput& input);
  void draw_panels(const FrameInput& input);
  void copy_camera();
  void paste_camera();
  std::string output_file_name(const FrameInput& input, const char* extension) const;
  void save_screenshot(const FrameInput& input, Commands& commands);
  void record_video_frame(const FrameInput& input);
  void toggle_video(const FrameInput& input);
  common::Image render_still(const FrameInput& input, const DrawOptions& shown, int image_width,
                             int image_height);

  scene::SceneSpec spec;
  GlfwContext glfw;
  Controls controls;
  Overlay overlay;
  Status status;
  HudState hud;
  std::vector<PointerEvent> pointer_events;  // not yet handled
  double pointer_x = 0.0, pointer_y = 0.0;
  bool needs_redraw = true;  // input or a window-system event since the last frame
  Clock::time_point last_frame_at = Clock::now();
  int width = 0, height = 0;                // of the framebuffer, pixels
  int width_points = 1, height_points = 1;  // of the window
  int scene_width = 1, scene_height = 1;    // of the scene in it
  DockSizes saved_sizes;
  float ui_scale;
  ImGuiBackend imgui;
  bool software_rendering;
  RenderQuality quality;
  Stage stage = Stage::kLight;
  AdaptiveResolution resolution;
  RenderTarget scene_target;
  std::unique_ptr<Renderer> renderer;
  std::unique_ptr<Renderer> still_renderer;  // created for the first screenshot
  std::unique_ptr<VideoCapture> video_capture;
};

GLFWwindow* Window::State::install_callbacks() {
  GLFWwindow* window = glfw.window();
  glfwSetWindowUserPointer(window, this);
  static constexpr auto state_of = [](GLFWwindow* w) -> State& {
    return *static_cast<State*>(glfwGetWindowUserPointer(w));
  };
  glfwSetWindowRefreshCallback(window, [](GLFWwindow* w) { state_of(w).needs_redraw = true; });
  glfwSetDropCallback(window, [](GLFWwindow* w, int count, const char** files) {
    state_of(w).needs_redraw = true;
    if (count > 0) state_of(w).controls.open_file(files[0]);
  });
  glfwSetKeyCallback(window, [](GLFWwindow* w, int code, int, int action, int mods) {
    state_of(w).needs_redraw = true;
    const bool is_emergency = code == GLFW_KEY_F9;  // which no text field takes
    if (ImGui::GetIO().WantTextInput && !is_emergency) return;
    if (action == GLFW_PRESS && (mods & GLFW_MOD_CONTROL) != 0 && code == GLFW_KEY_C)
      state_of(w).copy_camera();
    if (action == GLFW_PRESS && (mods & GLFW_MOD_CONTROL) != 0 && code == GLFW_KEY_V)
      state_of(w).paste_camera();
    if (const auto key = action_for_key_code(code, action == GLFW_REPEAT); key && action != GLFW_RELEASE)
      state_of(w).controls.perform(*key, state_of(w).status);
  });
  glfwSetCharCallback(window, [](GLFWwindow* w, unsigned character) {
    state_of(w).needs_redraw = true;
    if (ImGui::GetIO().WantTextInput) return;
    if (const auto key = action_for_character(character))
      state_of(w).controls.perform(*key, state_of(w).status);
  });
  glfwSetCursorPosCallback(window, [](GLFWwindow* w, double x, double y) {
    state_of(w).pointer_x = x;
    state_of(w).pointer_y = y;
    state_of(w).queue_pointer_event({PointerEvent::Kind::kMove}, 0);
  });
  glfwSetMouseButtonCallback(window, [](GLFWwindow* w, int button, int action, int mods) {
    const bool down = action == GLFW_PRESS;
    if (down && is_over_panel(state_of(w).pointer_x, state_of(w).pointer_y)) return;
    state_of(w).queue_pointer_event(
        {down ? PointerEvent::Kind::kPress : PointerEvent::Kind::kRelease,
         button == GLFW_MOUSE_BUTTON_LEFT ? PointerEvent::Button::kLeft : PointerEvent::Button::kOther},
        mods);
  });
  glfwSetScrollCallback(window, [](GLFWwindow* w, double, double notches) {
    state_of(w).needs_redraw = true;
    if (!is_over_panel(state_of(w).pointer_x, state_of(w).pointer_y))
      state_of(w).controls.handle_scroll(notches);
  });
  return window;
}

void Window::State::queue_pointer_event(PointerEvent event, int mods) {
  needs_redraw = true;
  event.x = pointer_x;
  event.y = pointer_y;
  event.control = (mods & GLFW_MOD_CONTROL) != 0;
  event.shift = (mods & GLFW_MOD_SHIFT) != 0;
  pointer_events.push_back(event);
}

void Window::State::set_detail(Detail detail) {
  const ScopedGlContext scope(glfw.window());
  quality = detail == Detail::kStill   ? RenderQuality::gpu()
            : detail == Detail::kVideo ? RenderQuality::video()
                                       : RenderQuality::fast();
  renderer = std::make_unique<Renderer>(spec, quality);
}

void Window::State::set_scene(const scene::SceneSpec& s) {
  const ScopedGlContext scope(glfw.window());
  spec = s;
  controls.set_surface(s.surface);
  overlay = Overlay(s.surface);
  hud.option_edits = make_option_edits(s.options);
  hud.inspected.invalidate();
  hud.plotted.invalidate();
  hud.entities = {};
  still_renderer.reset();
  renderer = std::make_unique<Renderer>(s, quality);
}

Commands Window::State::take_commands() {
  if (glfwWindowShouldClose(glfw.window())) controls.perform(UiAction::kQuit, status);
  Commands commands = controls.take_commands();
  if (commands.reset && commands.options.empty()) commands.options = changed_options(hud.option_edits);
  commands.display_lost = display_lost();
  return commands;
}

bool Window::State::render_frame(const FrameInput& input, const Status& new_status, common::Image* copy) {
  status = new_status;
  glfwPollEvents();
  needs_redraw = false;
  if (display_lost()) return false;
  // The loss is checked again afterwards: then the attribute is undefined.
  if (glfw.minimised() || !read_sizes()) return false;
  const auto start = Clock::now();
  const ScopedGlContext scope(glfw.window());
  handle_pointer(input);
  update_layout();
  controls.update_camera(input.snapshot, input.catalogue);
  controls.set_channels(input.channels);
  update_plots(input);
  draw_scene(input);
  record_video_frame(input);
  draw_panels(input);
  if (copy) *copy = read_framebuffer(0, width, height);
  glfwSwapBuffers(glfw.window());
  const double took_ms = milliseconds_since(start);
  if (software_rendering && !needs_full_resolution()) resolution.record_frame_time(took_ms);
  hud.render_ms += 0.2 * (took_ms - hud.render_ms);
  hud.interval_ms += 0.2 * (std::min(milliseconds_since(last_frame_at), 1000.0) - hud.interval_ms);
  last_frame_at = Clock::now();
  return true;
}

// A scene at rest, and every frame of a video, is drawn at full resolution.
bool Window::State::needs_full_resolution() const { return status.paused || status.banner || video_capture; }

void Window::State::draw_scene(const FrameInput& input) {
  const double scale = software_rendering && !needs_full_resolution() ? resolution.scale_factor() : 1.0;
  DrawOptions shown = make_draw_options(input, true);
  const int w = std::max(1, static_cast<int>(scale * scene_width)),
            h = std::max(1, static_cast<int>(scale * scene_height));
  scene_target.resize(w, h);
  shown.line_width *= static_cast<float>(scale);
  renderer->draw(input.snapshot, input.catalogue, controls.camera(), shown, scene_target.framebuffer.id(), w,
                 h);
  const float pixels_per_point = static_cast<float>(height) / static_cast<float>(height_points);
  const int left = static_cast<int>(hud.docks.scene.x * pixels_per_point),
            low = height - static_cast<int>(hud.docks.scene.y * pixels_per_point) - scene_height;
  glBindFramebuffer(GL_READ_FRAMEBUFFER, scene_target.framebuffer.id());
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, 0);
  glBlitFramebuffer(0, 0, w, h, left, low, left + scene_width, low + scene_height, GL_COLOR_BUFFER_BIT,
                    scale < 1.0 ? GL_LINEAR : GL_NEAREST);
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  glViewport(0, 0, width, height);
}

void Window::State::handle_pointer(const FrameInput& input) {
  const DockRect& scene = hud.docks.scene;
  for (PointerEvent event : std::exchange(pointer_events, {})) {
    event.x -= scene.x;
    event.y -= scene.y;
    controls.handle_pointer(event, input, status, scene.width, scene.height);
  }
}

// After a loss sizes are undefined, even before it is reported. Those of a window have 16 bits.
bool Window::State::read_sizes() {
  std::array<int, 4> sizes{};
  glfwGetFramebufferSize(glfw.window(), &sizes[0], &sizes[1]);
  glfwGetWindowSize(glfw.window(), &sizes[2], &sizes[3]);
  const auto is_valid = [](int size) { return size >= 1 && size <= 0xFFFF; };
  if (display_lost() || !std::ranges::all_of(sizes, is_valid)) return false;
  width = sizes[0], height = sizes[1], width_points = sizes[2], height_points = sizes[3];
  return true;
}

// Lays out the panels that are shown; the scene is drawn and framed beside them.
void Window::State::update_layout() {
  const DockContents contents{.panels = controls.panels_shown(),
                              .inspector = controls.tools().selected().has_value(),
                              .plots = controls.plots_shown(),
                              .bar_height = hud.bar_height,
                              .message_height = status.banner ? hud.message_height : 0.0f};
  hud.docks = lay_out_docks(static_cast<float>(width_points), static_cast<float>(height_points), contents,
                            hud.sizes, ui_scale);
  const float pixels_per_point = static_cast<float>(height) / static_cast<float>(height_points);
  scene_width = std::max(1, static_cast<int>(hud.docks.scene.width * pixels_per_point));
  scene_height = std::max(1, static_cast<int>(hud.docks.scene.height * pixels_per_point));
  controls.resize(static_cast<double>(scene_width) / scene_height);
}

void Window::State::save_layout() {
  if (hud.sizes != saved_sizes) common::write_user_file(kLayoutFile, format_sizes(hud.sizes));
  saved_sizes = hud.sizes;
}

// show_selection: also the selection and the spring of a pull, which screenshots omit.
DrawOptions Window::State::make_draw_options(const FrameInput& input, bool show_selection) {
  DrawOptions options;
  options.fill_mode = controls.fill_mode();
  options.stage = stage;
  options.grid = controls.grid_shown();
  options.line_width = 2.0f * ui_scale;
  overlay.settings = controls.overlay();
  overlay.apply(input, show_selection ? &controls.tools() : nullptr, options);
  return options;
}

void Window::State::update_plots(const FrameInput& input) {
  const auto& item = controls.tools().selected();
  hud.inspected.set(item ? signals_of(*item, input.channels) : std::vector<Signal>());
  hud.plot_file = output_file_name(input, "-plot");
  if (!input.history) return;
  if (item) hud.inspected.update(*input.history);
  if (!hud.plotted.empty()) hud.plotted.update(*input.history);
}

// The clipboard holds the value of --camera.
void Window::State::copy_camera() {
  const std::string pose = to_string(controls.camera().pose());
  glfwSetClipboardString(glfw.window(), pose.c_str());
  hud.message = "copied: --camera " + pose;
}

void Window::State::paste_camera() {
  const char* const text = glfwGetClipboardString(glfw.window());
  if (!controls.paste_camera(text ? text : "")) hud.message = "the clipboard holds no camera, X,Y,Z:X,Y,Z";
}

void Window::State::draw_panels(const FrameInput& input) {
  ImGui_ImplOpenGL3_NewFrame();
  ImGui_ImplGlfw_NewFrame();
  if (display_lost()) return;  // the display size that the backend read is invalid
  ImGui::NewFrame();
  draw_axis_labels(spec.surface, controls.camera(), hud.docks.scene);
  if (controls.labels_shown()) draw_object_labels(input, controls.camera(), hud.docks.scene);
  draw_hud(input, status, spec.surface, overlay, hud, controls, ui_scale);
  if (controls.help_shown()) draw_help_overlay(ui_scale);
  ImGui::Render();
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
}

void Window::State::record_video_frame(const FrameInput& input) {
  if (!video_capture || !video_capture->frame_due(input.snapshot.time_s)) return;
  try {
    video_capture->add(read_framebuffer(scene_target.framebuffer.id(), scene_width, scene_height),
                       input.snapshot.time_s);
  } catch (const std::runtime_error& error) {
    video_capture.reset();
    hud.recording_video = false;
    hud.message = error.what();
  }
}

void Window::State::toggle_video(const FrameInput& input) {
  try {
    if (const auto film = std::exchange(video_capture, nullptr)) {
      film->finish();
      hud.message = "wrote " + film->file();
    } else {
      video_capture = std::make_unique<VideoCapture>(output_file_name(input, ".mp4"), scene_width,
                                                     scene_height, input.snapshot.time_s);
      hud.message.clear();
    }
  } catch (const std::runtime_error& error) {
    hud.message = error.what();
  }
  hud.recording_video = video_capture != nullptr;
}

std::string Window::State::output_file_name(const FrameInput& input, const char* extension) const {
  char number[16];
  std::snprintf(number, sizeof(number), "-%06llu", static_cast<unsigned long long>(input.snapshot.tick));
  std::string name = std::filesystem::path(spec.file).stem().string();
  if (name.empty()) name = "smartsurf";
  return name + number + extension;
}

common::Image Window::State::render_still(const FrameInput& input, const DrawOptions& shown, int image_width,
                                          int image_height) {
  const ScopedGlContext scope(glfw.window());
  if (!still_renderer) still_renderer = std::make_unique<Renderer>(spec, RenderQuality::fine());
  RenderTarget canvas;
  canvas.resize(image_width, image_height);
  still_renderer->draw(input.snapshot, input.catalogue, controls.camera(), shown, canvas.framebuffer.id(),
                       image_width, image_height);
  common::Image image = read_framebuffer(canvas.framebuffer.id(), image_width, image_height);
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  return image;
}

void Window::State::save_screenshot(const FrameInput& input, Commands& commands) {
  const std::string path = output_file_name(input, ".png");
  try {
    common::write_png(path, render_still(input, make_draw_options(input, false), scene_width, scene_height));
    commands.screenshot_path = path;
    hud.message = "wrote " + path;
  } catch (const std::runtime_error& error) {
    hud.message = error.what();
  }
}

// Does not call glfwTerminate(): an X server may reset when its last client disconnects, and refuse the next
// connection.
bool Window::display_available() { return glfwInit() == GLFW_TRUE; }

Window::Window(const scene::SceneSpec& spec, const std::string& title, int width, int height,
               WindowPlacement placement)
    : state_(std::make_unique<State>(spec, title, width, height, placement)) {}

Window::~Window() {
  state_->save_layout();
  // After a display loss everything is leaked: the driver would wait for replies that never come.
  if (display_lost())
    static_cast<void>(state_.release());
  else
    glfwMakeContextCurrent(state_->glfw.window());
}

Commands Window::poll(const Status& status) {
  state_->status = status;
  glfwPollEvents();
  return state_->take_commands();
}

Commands Window::render_frame(const FrameInput& input, const Status& status) {
  State& s = *state_;
  const bool shown = s.render_frame(input, status, nullptr);
  Commands commands = s.take_commands();
  if (shown && s.controls.take_screenshot_request()) s.save_screenshot(input, commands);
  if (shown && s.controls.take_video_request()) s.toggle_video(input);
  return commands;
}

common::Image Window::capture_scene(const FrameInput& input, int width, int height) {
  return state_->render_still(input, {}, width, height);
}

common::Image Window::capture_frame(const FrameInput& input, const Status& status) {
  common::Image image;
  state_->render_frame(input, status, &image);
  return image;
}

bool Window::needs_redraw() const { return state_->needs_redraw; }
bool Window::wants_contacts() const { return state_->controls.overlay().contact_forces; }
void Window::perform(UiAction action) {
  state_->needs_redraw = true;
  state_->controls.perform(action, state_->status);
}
void Window::add_pointer_event(const PointerEvent& event) {
  state_->needs_redraw = true;
  state_->pointer_events.push_back(event);
}
void Window::set_scene(const scene::SceneSpec& spec, const std::string& title) {
  state_->set_scene(spec);
  glfwSetWindowTitle(state_->glfw.window(), title.c_str());
}
void Window::move_to_left() { state_->glfw.move_to_left(); }
void Window::apply(const ViewSettings& settings) {
  state_->controls.apply(settings);
  state_->stage = settings.stage;
  if (settings.detail && *settings.detail != Detail::kFinal) state_->set_detail(*settings.detail);
  state_->hud.plotted.set(settings.plots);
}
void Window::show_message(const std::string& message) { state_->hud.message = message; }

}  // namespace smartsurf::view
