// What a run shows in its window, and what its user asks for there.
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <thread>

#include "smartsurf/run/Run.h"

namespace smartsurf::run {

void Run::refresh_display() {
  if (!display_->has_window()) return;
  times_.start();
  DisplayStatus status;
  status.real_time_factor = pacer_.measured(simulation_.snapshot().time_s);
  status.requested_pace = pacer_.factor();
  status.mode = options_.mode;
  status.controller = controller_phrase();
  status.physics_ms = times_.last_ms(Phase::kPhysics);
  if (std::isfinite(purity_.value())) status.purity = purity_.value();
  const bool was_paused = controls_.paused;
  status.resettable = recorders_.empty() && pictures_.all_taken();
  status.notice = notice_;
  if (notice_.empty() && !ending_ && program_is_held())
    status.notice = "the program is held: the run waits for it";
  status.over = ending_.has_value();
  display_->refresh(simulation_, status, controls_);
  if (controls_.display_lost) go_on_without_display();
  if (std::exchange(controls_.reset, false) && !successor_) begin_anew();
  if (std::exchange(controls_.pace_changed, false)) pacer_.set_factor(controls_.pace);
  if (link_ && was_paused != controls_.paused)
    link_->endpoint().set_state(controls_.paused ? shm_protocol::State::kPaused
                                                 : shm_protocol::State::kRunning);
  times_.lap(Phase::kRender);
}

std::string Run::controller_phrase() {
  if (ending_) return "";
  if (!link_) return "none: the script drives";
  if (!link_->endpoint().has_controller()) return "waiting for one on '" + link_->name() + "'";
  return fmt::format("process {}, {}", link_->endpoint().controller_pid(),
                     text(link_->endpoint().controller_state()));
}

bool Run::program_is_held() {
  return link_ && link_->endpoint().has_controller() &&
         link_->endpoint().controller_state() == shm_protocol::State::kPaused;
}

void Run::obey_hand() {
  if (!hand_.apply(controls_.hand, simulation_) || touched_) return;
  touched_ = simulation_.snapshot().tick;
  notice_ = fmt::format("touched by hand at {:.2f} s", simulation_.snapshot().time_s);
  for (const auto& r : recorders_) r->touched(*touched_);
}

// The new experiment is loaded before the old one is let go: a mistake in the options leaves all as it is.
void Run::begin_anew() {
  RunOptions options = options_;
  for (const auto& [name, value] : std::exchange(controls_.options, {}))
    options.set.emplace_back(name, value);
  options.paused = controls_.paused && !ending_;
  options.pace = pacer_.factor();
  try {
    successor_.emplace(Successor{options, load(options), nullptr});
    end(kDone, "begun anew by the user");
  } catch (const scene::InputError& mistake) {
    notice_ = mistake.what();
  }
}

void Run::linger() {
  if (!lingers_) return;
  notice_ = ending_->outcome;
  while (display_->has_window() && !controls_.quit && !successor_ && !stop_) {
    controls_.paused = true;
    refresh_display();
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

std::optional<Run::Successor> Run::take_successor() {
  if (successor_) successor_->display = std::move(display_);
  return std::exchange(successor_, std::nullopt);
}

// A run without an end of its own would be left without anybody to end it.
void Run::go_on_without_display() {
  controls_.display_lost = controls_.paused = false;
  if (!last_tick_) end(kFailed, "the display was lost");
  progress_.say(last_tick_ ? "the display is lost; the run goes on without its window"
                           : "the display is lost: the run ends (with --until or --ticks it would go on)");
}

}  // namespace smartsurf::run
