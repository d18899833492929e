#include "smartsurf/run/display/Display.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "common/process/WindowLibrary.h"
#include "shm-protocol/hardware/bridge/ControlSocket.h"
#include "smartsurf/run/ControllerProcess.h"
#include "smartsurf/run/display/PlotFile.h"
#include "smartsurf/view/output/OffscreenView.h"
#include "smartsurf/view/window/Window.h"

namespace smartsurf::run {
namespace {

using namespace std::chrono_literals;

constexpr auto kFrameInterval = 33ms;
constexpr auto kIdleFrameInterval = 100ms;  // if neither the simulation nor the user changes anything
// A run that reaches this share of its requested pace can spare time for drawing.
constexpr double kOnTimeFraction = 0.97;

std::string window_title(const scene::SceneSpec& scene) { return "smartsurf: " + scene.file; }

// Started by the run, or by the user in another terminal.
bool expects_controller_window(const RunOptions& options) {
  return !options.no_controller && (options.controller.empty() || is_apron_program(options.controller));
}

}  // namespace

Display::Display(const RunOptions& options, const simulation::Simulation& simulation)
    : scene_(simulation.scene()), history_(scene_.surface.columns), channels_(options.registers) {
  if (!options.window) return;
  const view::ViewSettings& settings = options.render.view;
  const std::span<const view::Channel> channels = channels_.update(simulation);
  if (!settings.overlay.channel.empty()) require_channel("--cells", settings.overlay.channel, channels);
  for (const view::Signal& signal : settings.plots)
    require_signal("--plot", signal, scene_.surface, channels);
  view::OffscreenView::require_available();
  common::require_window_library();
  if (!view::Window::display_available())
    throw scene::InputError("--window: there is no display here; run without it, or set DISPLAY");
  beside_controller_window_ = expects_controller_window(options);
  window_ = std::make_unique<view::Window>(
      scene_, window_title(scene_), 1280, 720,
      beside_controller_window_ ? view::WindowPlacement::kLeft : view::WindowPlacement::kDefault);
  window_->apply(settings);
}

Display::~Display() = default;

void Display::restart(const RunOptions& options, const scene::SceneSpec& scene) {
  scene_ = scene;
  history_ = RunHistory(scene_.surface.columns);
  marks_.clear();
  history_index_.reset();
  channels_ = ViewChannels(options.registers);
  frames_drawn_ = 0;
  if (!window_) return;
  window_->set_scene(scene_, window_title(scene_));
  const bool had_controller_window =
      std::exchange(beside_controller_window_, expects_controller_window(options));
  if (beside_controller_window_ && !had_controller_window) window_->move_to_left();
}

void Display::show_message(const std::string& message) {
  if (window_) window_->show_message(message);
}

void Display::record_tick(const simulation::Simulation& simulation, std::span<const scene::Metric> metrics) {
  if (!window_) return;
  history_.add(simulation.snapshot(), channels_.update(simulation), metrics);
}

// Marks that are older than the history are dropped.
void Display::mark(view::EventMark mark) {
  if (!window_) return;
  const double begin_s = history_.size() > 0 ? history_.at(0).snapshot.time_s : 0.0;
  std::erase_if(marks_, [&](const view::EventMark& old) { return old.time_s < begin_s; });
  marks_.insert(std::ranges::upper_bound(marks_, mark.time_s, {}, &view::EventMark::time_s), std::move(mark));
}

view::Status Display::make_view_status(const DisplayStatus& display_status, bool paused) const {
  view::Status status;
  status.mode = display_status.mode == RunMode::kTimeStep ? "time-step" : "passive";
  status.controller = display_status.controller;
  status.paused = paused;
  status.run_ended = display_status.run_ended;
  status.requested_pace = display_status.requested_pace.value_or(0.0);
  status.actual_pace = display_status.real_time_factor;
  status.physics_ms = display_status.physics_ms;
  status.metrics = display_status.metrics;
  status.has_contacts = !history_index_;
  status.accepts_interaction = status.accepts_faults = !history_index_ && !display_status.run_ended;
  status.can_reset = display_status.can_restart;
  status.notice = display_status.notice;
  status.banner = display_status.banner;
  if (history_.size() == 0) return status;
  const std::size_t last = history_.size() - 1;
  status.timeline = view::Timeline{history_.size(),
                                   history_index_.value_or(last),
                                   history_.at(0).snapshot.time_s,
                                   history_.at(last).snapshot.time_s,
                                   false,
                                   marks_};
  if (!history_index_) return status;
  past_metrics_ = history_.metrics(history_.at(*history_index_));
  status.metrics = past_metrics_;
  status.notice = fmt::format("history; the run is at {:.2f} s", history_.at(last).snapshot.time_s);
  return status;
}

bool Display::frame_due(const simulation::Simulation& simulation,
                        std::chrono::steady_clock::time_point now) const {
  const bool unchanged = simulation.snapshot().tick == last_drawn_tick_ && !window_->needs_redraw();
  return now >=
         (unchanged ? std::max(next_frame_time_, last_draw_time_ + kIdleFrameInterval) : next_frame_time_);
}

void Display::refresh(const simulation::Simulation& simulation, const DisplayStatus& display_status,
                      DisplayRequests& requests) {
  if (!window_) return;
  const view::Status status = make_view_status(display_status, requests.paused);
  const auto draw_start = std::chrono::steady_clock::now();
  view::Commands commands;
  if (!frame_due(simulation, draw_start)) {
    commands = window_->poll(status);
  } else {
    const RunHistory::Frame* const past = history_index_ ? &history_.at(*history_index_) : nullptr;
    const scene::Snapshot& shown = past ? past->snapshot : simulation.snapshot();
    // Contact forces are known only for the present.
    if (!history_index_ && window_->wants_contacts())
      contacts_ = contact_marks(simulation);
    else
      contacts_.clear();
    commands = window_->render_frame(
        {shown, simulation.catalogue(), past ? channels_.show(history_, *past) : channels_.update(simulation),
         contacts_, &history_},
        status);
    const auto draw_end = std::chrono::steady_clock::now();
    last_draw_time_ = draw_end;
    last_drawn_tick_ = simulation.snapshot().tick;
    ++frames_drawn_;
    // A run behind schedule gets at least half as much time as the last frame took to draw.
    const bool behind_schedule = !requests.paused && (!display_status.requested_pace ||
                                                      display_status.real_time_factor <
                                                          kOnTimeFraction * *display_status.requested_pace);
    const std::chrono::steady_clock::duration min_delay = behind_schedule ? (draw_end - draw_start) / 2 : 0ms;
    next_frame_time_ = draw_end + std::max<std::chrono::steady_clock::duration>(
                                      kFrameInterval - (draw_end - draw_start), min_delay);
  }
  apply_commands(commands, requests);
}

// Seeking, stepping backward, and stepping forward in the history show a snapshot and pause the run. Stepping
// forward at the present pauses the run, then runs single ticks.
void Display::apply_commands(const view::Commands& commands, DisplayRequests& requests) {
  const std::size_t last = history_.size() > 0 ? history_.size() - 1 : 0;
  const auto show_history_frame = [&](std::ptrdiff_t at) {
    const std::size_t frame = std::max<std::ptrdiff_t>(at, 0);
    history_index_ = frame < last ? std::optional(frame) : std::nullopt;
    requests.paused = true;
  };
  if (commands.toggle_pause) {
    requests.paused = !requests.paused;
    history_index_.reset();
  }
  if (commands.seek_time_s && history_.size() > 0)
    show_history_frame(history_.frame_at(*commands.seek_time_s) - history_.begin());
  if (commands.seek) show_history_frame(*commands.seek);
  if (commands.steps < 0 || (commands.steps > 0 && history_index_))
    show_history_frame(static_cast<std::ptrdiff_t>(history_index_.value_or(last)) + commands.steps);
  else if (commands.steps > 0 && !requests.paused)
    requests.paused = true;
  else
    requests.single_steps += commands.steps;
  requests.quit |= commands.quit;
  if (commands.pace) {
    requests.pace_changed = true;
    requests.pace = *commands.pace > 0.0 ? commands.pace : std::nullopt;
  }
  requests.interaction.pull = commands.pull;
  requests.interaction.poke = commands.poke;
  if (commands.drop) requests.interaction.dropped_objects.push_back(*commands.drop);
  if (commands.fault) requests.interaction.faults.push_back(*commands.fault);
  if (commands.reset) {
    requests.restart = true;
    requests.changed_options = commands.options;
  }
  if (!commands.open_file.empty()) requests.open_file = commands.open_file;
  requests.start_program |= commands.start_program;
  if (commands.stop_bridges && !commands.display_lost) window_->show_message(hardware::stop_all_bridges());
  if (commands.plot_export && !commands.display_lost)
    window_->show_message(write_plot_file(*commands.plot_export, scene_.file));
  if (!commands.display_lost) return;
  requests.display_lost = true;
  window_.reset();
}

}  // namespace smartsurf::run
