// The part of Run that deals with its window: status, user interaction, restart.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ranges>
#include <thread>
#include <utility>

#include "common/text/Words.h"
#include "smartsurf/record/Recording.h"
#include "smartsurf/run/Run.h"

namespace smartsurf::run {

void Run::refresh_display() {
  if (!display_->has_window()) return;
  phase_times_.start();
  DisplayStatus status;
  status.real_time_factor = pacer_.update_real_time_factor(simulation_.snapshot().time_s);
  status.requested_pace = pacer_.factor();
  status.mode = options_.mode;
  status.controller = describe_controller();
  status.physics_ms = phase_times_.last_ms(Phase::kPhysics);
  status.metrics = experiment_.metrics();
  const bool was_paused = requests_.paused;
  status.can_restart = can_restart();
  status.notice = notice_;
  if (notice_.empty() && !ending_ && controller_is_paused())
    status.notice = "the controller is paused; the run waits for it";
  if (status.notice.empty()) status.notice = silence_;
  status.run_ended = ending_.has_value();
  if (!ending_ && announced_waiting_ && !controller_process_) status.banner = waiting_banner();
  if (ending_ && !restart_) status.banner = result_banner();
  display_->refresh(simulation_, status, requests_);
  if (requests_.display_lost) handle_display_loss();
  if (std::exchange(requests_.restart, false) && !restart_) prepare_restart();
  if (const std::string file = std::exchange(requests_.open_file, ""); !file.empty() && !restart_)
    open_file(file);
  if (std::exchange(requests_.start_program, false)) start_program();
  if (experiment_file_.changed() && !restart_) reload();
  if (std::exchange(requests_.pace_changed, false)) pacer_.set_factor(requests_.pace);
  if (link_ && was_paused != requests_.paused)
    link_->endpoint().set_state(requests_.paused ? shm_protocol::State::kPaused
                                                 : shm_protocol::State::kRunning);
  phase_times_.lap(Phase::kRender);
}

std::string Run::describe_controller() {
  if (ending_) return "";
  if (!link_) return "none (scripted)";
  if (!link_->endpoint().has_controller()) return "waiting for one on '" + link_->name() + "'";
  return fmt::format("process {}, {}", link_->endpoint().controller_pid(),
                     text(link_->endpoint().controller_state()));
}

// Files that a run writes hold one run.
bool Run::can_restart() const { return recorders_.empty() && media_.only_final_left(); }

bool Run::controller_is_paused() {
  return link_ && link_->endpoint().has_controller() &&
         link_->endpoint().controller_state() == shm_protocol::State::kPaused;
}

void Run::apply_user_interaction() {
  const bool interacted_before =
      std::exchange(interacted_, interaction_.apply(requests_.interaction, simulation_));
  if (interacted_ && !interacted_before)
    display_->mark({view::EventMark::Kind::kTouched, simulation_.snapshot().time_s, "the user intervened"});
  if (!interacted_ || first_interaction_tick_) return;
  first_interaction_tick_ = simulation_.snapshot().tick;
  notice_ = fmt::format("user intervened at {:.2f} s", simulation_.snapshot().time_s);
  for (const auto& recorder : recorders_) recorder->mark_user_interaction(*first_interaction_tick_);
}

void Run::mark_events() {
  const double time_s = simulation_.snapshot().time_s;
  for (const std::string& location : experiment_.events())
    display_->mark({view::EventMark::Kind::kScript, time_s, "at() of " + location});
  display_->record_tick(simulation_, experiment_.metrics());
}

void Run::mark_controller_lost() {
  display_->mark(
      {view::EventMark::Kind::kControllerLost, simulation_.snapshot().time_s, "the controller was lost"});
}

RunOptions Run::options_of_restart() const {
  RunOptions options = options_;
  options.paused = requests_.paused && !ending_;
  options.pace = pacer_.factor();
  return options;
}

void Run::prepare_restart() {
  RunOptions options = options_of_restart();
  for (const auto& [name, value] : std::exchange(requests_.changed_options, {}))
    options.overrides.emplace_back(name, value);
  prepare_restart(std::move(options));
}

void Run::reload() {
  if (!can_restart()) {
    notice_ = options_.experiment + " has changed; a run that writes files is not reloaded";
    return;
  }
  prepare_restart(options_of_restart());
  if (restart_)
    display_->show_message("reloaded " + options_.experiment);
  else
    notice_ = "not reloaded: " + notice_;
}

void Run::start_program() {
  const std::string program = program_beside(options_.experiment);
  if (program.empty() || !link_ || controller_process_ || ending_) return;
  controller_process_ = std::make_unique<ControllerProcess>(program, link_->name(), options_.window,
                                                            options_.controller_overrides);
  options_.controller = program;
}

// Loads the new experiment before the old run ends, so that an invalid one leaves the run unchanged.
void Run::prepare_restart(RunOptions options) {
  try {
    script::Experiment experiment = load(options);
    restart_.emplace(Restart{std::move(options), std::move(experiment), nullptr});
    set_ending(common::kDone, options_.experiment == restart_->options.experiment ? "restarted by the user"
                                                                                  : "replaced by the user");
  } catch (const scene::InputError& error) {
    notice_ = error.what();
  }
}

// An experiment starts with the APRON program beside it that has its name, else without a controller.
void Run::open_file(const std::string& file) {
  if (!can_restart()) {
    notice_ = "a run that is recorded cannot be replaced: " + file;
  } else if (file.ends_with(".h5")) {
    try {
      record::Recording::open(file);
      recording_to_open_ = file;
      requests_.quit = true;
    } catch (const scene::InputError& error) {
      notice_ = error.what();
    }
  } else {
    prepare_restart(options_for_opened(file, options_));
  }
}

bool Run::controller_has_window() const {
  return controller_process_ && options_.window && is_apron_program(options_.controller);
}

view::Banner Run::waiting_banner() const {
  view::Banner banner;
  banner.title = "Waiting for a controller";
  banner.program = program_beside(options_.experiment);
  banner.lines = {banner.program.empty() ? "Run this in another terminal:"
                                         : "Start it here, or run this in another terminal:"};
  banner.command = command_to_attach();
  return banner;
}

view::Banner Run::result_banner() const {
  const RunSummary s = summary();
  std::optional<bool> success = s.success;
  if (ending_->exit_status != common::kDone) success = false;
  view::Banner banner;
  if (success) banner.tone = *success ? view::Banner::Tone::kSuccess : view::Banner::Tone::kFailure;
  banner.title = common::with_capital(ending_->title.empty() ? ending_->outcome : ending_->title);
  banner.lines.push_back(fmt::format("{:.2f} s simulated in {:.1f} s ({:.3g}x real time)", s.simulated_s,
                                     s.wall_s, s.real_time_factor()));
  constexpr std::size_t kMaxMetrics = 8;
  for (const auto& [name, value] : s.metrics | std::views::take(kMaxMetrics))
    banner.lines.push_back(fmt::format("{}: {:.6g}", name, value));
  if (s.metrics.size() > kMaxMetrics)
    banner.lines.push_back(fmt::format("and {} more metrics", s.metrics.size() - kMaxMetrics));
  for (const std::string& file : written_files()) banner.lines.push_back("wrote " + file);
  banner.lines.push_back("The timeline looks back.  Q closes the window.");
  return banner;
}

void Run::keep_window_open() {
  if (options_.close || quit_by_script_ || restart_) return;
  while (display_->has_window() && !requests_.quit && !restart_ && !stop_requested_) {
    requests_.paused = true;
    refresh_display();
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

std::optional<Run::Restart> Run::take_restart() {
  if (restart_) restart_->display = std::move(display_);
  return std::exchange(restart_, std::nullopt);
}

// A run that has neither a window nor an end tick could not be ended, so it ends here.
void Run::handle_display_loss() {
  requests_.display_lost = requests_.paused = false;
  if (!end_tick_) set_ending(common::kFailed, "the display was lost");
  progress_.print_message(end_tick_
                              ? "the display was lost; the run continues without a window"
                              : "the display was lost; the run ends (it continues with --until or --ticks)");
}

}  // namespace smartsurf::run
