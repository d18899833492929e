#include "smartsurf/run/Display.h"

#include <fmt/format.h>

#include <algorithm>

#include "smartsurf/run/ControllerProcess.h"
#include "smartsurf/view/OffscreenView.h"
#include "smartsurf/view/Window.h"

namespace smartsurf::run {
namespace {

using namespace std::chrono_literals;

constexpr auto kFrameInterval = 33ms;
constexpr auto kStillInterval = 100ms;  // where nothing moves and nobody does anything
constexpr double kOnTime =
    0.97;  // of the requested pace: a run that reaches it has time to spare for drawing

}  // namespace

Display::Display(const RunOptions& options, const scene::SceneSpec& scene) : scene_(scene) {
  if (!options.window) return;
  view::OffscreenView::require_view();
  if (!view::Window::display_available())
    throw scene::InputError("--window: there is no display here; run without it, or set DISPLAY");
  const bool beside_another = is_apron_program(options.controller);
  window_ = std::make_unique<view::Window>(scene_, "smartsurf: " + options.experiment, 1280, 720,
                                           beside_another ? view::Place::kLeft : view::Place::kAnywhere);
}

Display::~Display() = default;

void Display::begin_anew(const scene::SceneSpec& scene) {
  scene_ = scene;
  past_.clear();
  looking_.reset();
  channels_ = {};
  if (window_) window_->set_scene(scene_);
}

void Display::remember(const Simulation& simulation) {
  if (window_) past_.add(simulation.snapshot());
}

view::Status Display::status_of(const DisplayStatus& s, bool paused) const {
  view::Status status;
  status.mode = s.mode == RunMode::kTimeStep ? "time-step" : "passive";
  status.controller = s.controller;
  status.paused = paused;
  status.requested_pace = s.requested_pace.value_or(0.0);
  status.actual_pace = s.real_time_factor;
  status.physics_ms = s.physics_ms;
  status.purity = s.purity;
  status.forces_known = !looking_;
  status.touchable = status.breakable = !looking_ && !s.over;
  status.resettable = s.resettable;
  status.notice = s.notice;
  if (past_.size() == 0) return status;
  const std::size_t last = past_.size() - 1;
  status.timeline =
      view::Timeline{past_.size(), looking_.value_or(last), past_.at(0).time_s, past_.at(last).time_s, false};
  if (looking_)
    status.notice = fmt::format("looking back; the run stands at {:.2f} s", past_.at(last).time_s);
  return status;
}

bool Display::frame_due(const Simulation& simulation, std::chrono::steady_clock::time_point now) const {
  const bool still = simulation.snapshot().tick == drawn_tick_ && !window_->stirred();
  return now >= (still ? std::max(next_frame_, drawn_at_ + kStillInterval) : next_frame_);
}

void Display::refresh(const Simulation& simulation, const DisplayStatus& told, Controls& controls) {
  if (!window_) return;
  const view::Status status = status_of(told, controls.paused);
  const auto now = std::chrono::steady_clock::now();
  view::Commands commands;
  if (!frame_due(simulation, now)) {
    commands = window_->poll(status);
  } else {
    const scene::Snapshot& shown = looking_ ? past_.at(*looking_) : simulation.snapshot();
    // Of the past nobody knows the forces.
    if (!looking_ && window_->wants_contacts())
      contacts_ = contact_marks(simulation);
    else
      contacts_.clear();
    commands =
        window_->frame({shown, simulation.catalogue(), channels_.of(simulation, shown), contacts_}, status);
    const auto drawn = std::chrono::steady_clock::now();
    drawn_at_ = drawn;
    drawn_tick_ = simulation.snapshot().tick;
    // A run that wants all the time it can get has at least half as much of it as the drawing.
    const bool hurried =
        !controls.paused && (!told.requested_pace || told.real_time_factor < kOnTime * *told.requested_pace);
    const std::chrono::steady_clock::duration least = hurried ? (drawn - now) / 2 : 0ms;
    next_frame_ =
        drawn + std::max<std::chrono::steady_clock::duration>(kFrameInterval - (drawn - now), least);
  }
  obey(commands, controls);
}

void Display::obey(const view::Commands& commands, Controls& controls) {
  const std::size_t last = past_.size() > 0 ? past_.size() - 1 : 0;
  const auto look = [&](std::ptrdiff_t at) {
    const auto frame = static_cast<std::size_t>(std::max<std::ptrdiff_t>(at, 0));
    looking_ = frame < last ? std::optional(frame) : std::nullopt;
    controls.paused = true;
  };
  if (commands.toggle_pause) {
    controls.paused = !controls.paused;
    looking_.reset();
  }
  if (commands.seek) look(static_cast<std::ptrdiff_t>(*commands.seek));
  if (commands.steps < 0 || (commands.steps > 0 && looking_))
    look(static_cast<std::ptrdiff_t>(looking_.value_or(last)) + commands.steps);
  else if (commands.steps > 0 && !controls.paused)
    controls.paused = true;
  else
    controls.single_steps += commands.steps;
  controls.quit |= commands.quit;
  if (commands.pace) {
    controls.pace_changed = true;
    controls.pace = *commands.pace > 0.0 ? commands.pace : std::nullopt;
  }
  controls.hand.pull = commands.pull;
  controls.hand.poke = commands.poke;
  if (commands.drop) controls.hand.drops.push_back(*commands.drop);
  if (commands.fault) controls.hand.faults.push_back(*commands.fault);
  if (commands.reset) {
    controls.reset = true;
    controls.options = commands.options;
  }
  if (!commands.display_lost) return;
  controls.display_lost = true;
  window_.reset();
}

}  // namespace smartsurf::run
