#include "smartsurf/run/Run.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <thread>

#include "common/files/Inputs.h"
#include "common/files/ReadFile.h"
#include "common/process/StopSignals.h"
#include "common/text/Printable.h"
#include "smartsurf/extension/Extension.h"
#include "smartsurf/mesh/SolidLibrary.h"
#include "smartsurf/record/OpenRecorder.h"
#include "smartsurf/run/ConfinedRuns.h"
#include "smartsurf/run/OutputFile.h"
#include "smartsurf/run/ScriptOverrun.h"
#include "smartsurf/scene/UnlikelyPlacements.h"
#include "smartsurf/simulation/Verdict.h"

namespace smartsurf::run {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using shm_protocol::Status;

constexpr auto kWindowWait = 8ms;      // longest wait between two polls of the window
constexpr auto kHeadlessWait = 100ms;  // longest wait between two checks of the controller, without a window

script::LoadOptions make_load_options(const RunOptions& options) {
  script::LoadOptions load_options;
  load_options.overrides = options.overrides;
  load_options.seed = options.seed;
  load_options.engine = options.engine;
  load_options.unsafe = options.unsafe;
  if (options.allow_extensions || options.unsafe) load_options.load_extension = extension::load;
  load_options.solid_factory = std::make_shared<mesh::SolidLibrary>(mesh::decomposition_folder());
  load_options.stop = &common::stop_flag();
  load_options.end_process = end_for_script;
  load_options.output_folder = script_output_folder(options);
  return load_options;
}

// Empty if there is no such file: the controller's own message follows.
std::string read_program(const std::string& file) {
  std::string text;
  if (common::read_file(file, common::kMaxTextBytes, text)) return "";
  return text;
}

std::optional<std::uint64_t> end_tick(const RunOptions& options, const scene::WorldSpec& world) {
  if (options.ticks) return options.ticks;
  if (!options.until_s) return std::nullopt;
  return static_cast<std::uint64_t>(std::ceil(*options.until_s / world.control_period_s - 1e-9));
}

std::unique_ptr<Display> reuse_or_open_display(const RunOptions& options,
                                               const simulation::Simulation& simulation,
                                               std::unique_ptr<Display> previous) {
  if (!previous) return std::make_unique<Display>(options, simulation);
  previous->restart(options, simulation.scene());
  return previous;
}

}  // namespace

script::Experiment Run::load(const RunOptions& options) {
  script::Experiment experiment = script::Experiment::load(options.experiment, make_load_options(options));
  simulation::Nuisances::check(experiment.scene(), experiment.variations());
  if (options.world_index.value_or(0) == 0)
    for (const std::string& line : scene::unlikely_placements(experiment.scene()))
      common::print_error_line("smartsurf", "warning: " + line);
  std::vector<std::string> metrics;
  for (const auto& [name, value] : experiment.metrics()) metrics.push_back(name);
  for (const std::string& name : options.render.plotted_metrics) require_metric("--plot", name, metrics);
  note_controller(options.controller);
  common::require_separate_outputs(named_outputs(options));
  return experiment;
}

Run::Run(const RunOptions& options, const std::atomic<bool>& stop_requested, script::Experiment experiment,
         std::unique_ptr<Display> display)
    : options_(options),
      stop_requested_(stop_requested),
      experiment_(std::move(experiment)),
      simulation_(experiment_, options.threads, options.no_controller),
      display_(reuse_or_open_display(options, simulation_, std::move(display))),
      media_(options.screenshots,
             options.confined ? options.confined->take_video(options.confined_number)
                              : start_video(options.video_file, options.render),
             options.render, experiment_.scene()),
      placement_check_(simulation_.scene().surface),
      progress_(options.world_index ? fmt::format("world {}", *options.world_index) : ""),
      pacer_(options.pace),
      experiment_file_(options.experiment, experiment_.scene().source),
      end_tick_(end_tick(options, experiment_.scene().world)) {
  if (!options.no_controller)
    link_ = std::make_unique<SurfaceLink>(
        segment_name(options), options.mode, experiment_.scene(),
        options.confined ? options.confined->surface_name(options.confined_number) : nullptr);
  channels_ = ViewChannels(options.registers);
  if (options.registers) options.registers->restart();
  open_recordings();
  requests_.paused = options.paused && display_->has_window();
  if (link_ && !options.controller.empty() && options.confined)
    controller_process_ = options.confined->start_controller(options.confined_number);
  else if (link_ && !options.controller.empty())
    controller_process_ = std::make_unique<ControllerProcess>(
        options.controller, link_->name(), options.window, options.controller_overrides,
        options.registers ? options.registers->argument() : "");
}

Run::~Run() = default;

void Run::open_recordings() {
  record::RunMetadata meta;
  meta.command_line = options_.command_line;
  meta.mode = options_.mode == RunMode::kTimeStep ? "time-step" : "passive";
  meta.program_file = options_.controller;
  if (is_apron_program(options_.controller)) meta.program_text = read_program(options_.controller);
  meta.driver = options_.no_controller ? "script" : "controller";
  for (const auto& [name, value] : options_.overrides) meta.overrides.push_back({name, value});
  meta.varied = simulation_.nuisances();
  meta.unsafe = options_.unsafe;
  meta.declares_success = experiment_.declares_success();
  meta.versions = {{"physics", simulation_.engine().version()}};
  for (const scene::Extension& extension : experiment_.scene().surface.extensions())
    meta.extensions.push_back({extension.name, extension.hash});
  for (const auto& file : options_.recording_files)
    recorders_.push_back(record::open_recorder(file, meta, experiment_.scene()));
}

int Run::execute() {
  try {
    start();
    while (!ending_ && wait_until_due() && tick()) {
    }
    experiment_.finish();
  } catch (const script::Interrupted&) {
    replace_ending(common::kDone, "stopped by the user");
  } catch (const scene::InputError& error) {
    replace_ending(common::kUserError, error.what());
    finish();
    keep_window_open();
    if (!restart_) throw;
    progress_.print_message(error.what());
    return common::kUserError;
  }
  finish();
  print_summary();
  keep_window_open();
  controller_process_.reset();
  return ending_->exit_status;
}

// The state before the first tick is frame 0, which the controller answers first and which is recorded first.
void Run::start() {
  start_time_ = Clock::now();
  warn_of_added_objects(simulation_.scene().objects.size());
  phase_times_.start();
  if (link_) {
    link_->endpoint().set_state(shm_protocol::State::kRunning);
    if (options_.mode == RunMode::kPassive && !controller_process_)
      progress_.print_message(fmt::format("running; a controller may attach with: {}", command_to_attach()));
    else if (!link_->endpoint().has_controller() && !wait_for_controller())
      return;
    if (!publish()) return;
  }
  record_tick();
  phase_times_ = {};
  start_time_ = Clock::now();
  pictures_time_ = {};
  progress_.restart();
}

// Runs the phases of one tick.
bool Run::tick() {
  phase_times_.start();
  const std::size_t known_objects = simulation_.catalogue().size();
  simulation_.run_script();
  if (simulation_.catalogue().size() > known_objects) warn_of_added_objects(known_objects);
  phase_times_.lap(Phase::kActuate);
  if (link_) {
    if (!receive_targets()) return false;
    if (options_.registers) options_.registers->read(simulation_.scene().surface);
  }
  apply_user_interaction();
  if (!advance_physics()) return false;
  simulation_.finish_tick();
  phase_times_.lap(Phase::kPhysics);
  simulation_.sense();
  phase_times_.lap(Phase::kSense);
  if (link_ && !publish()) return false;
  record_tick();
  phase_times_.end_tick();
  apply_script_requests();
  return !ending_;
}

// Warns, once for each kind of mistake, of the objects that the script has added.
void Run::warn_of_added_objects(std::size_t first) {
  if (options_.world_index.value_or(0) != 0) return;
  for (std::size_t i = first; i < simulation_.catalogue().size(); ++i) {
    const auto id = static_cast<scene::ObjectId>(i);
    const auto holds = [id](const scene::JointSpec& joint) { return joint.a == id || joint.b == id; };
    if (!simulation_.is_alive(id) || std::ranges::any_of(simulation_.joints(), holds)) continue;
    scene::ObjectSpec object = simulation_.catalogue()[i];
    const script::ObjectState state = simulation_.state(id);
    object.position = state.position;
    object.velocity = state.velocity;
    object.orientation = state.orientation;
    const auto mistake = placement_check_(object, i);
    if (!mistake || std::exchange(warned_of_[static_cast<std::size_t>(mistake->kind)], true)) continue;
    progress_.print_message("warning: " + mistake->line);
  }
}

bool Run::advance_physics() {
  const int steps = simulation_.scene().world.steps_per_tick();
  for (int i = 0; i < steps; ++i) {
    simulation_.plan_actuators();
    phase_times_.lap(Phase::kActuate);
    const bool stepped = simulation_.step_physics();
    phase_times_.lap(Phase::kPhysics);
    if (!stepped) break;
    simulation_.commit_actuators();
    phase_times_.lap(Phase::kActuate);
  }
  if (std::optional<std::string> failure = simulation_.failure()) {
    set_ending(common::kFailed, std::move(*failure));
    progress_.print_message(ending_->outcome);
    return false;
  }
  return true;
}

bool Run::receive_targets() {
  silent_since_ = Clock::now();
  silence_.clear();
  while (true) {
    const auto timeout = display_->has_window() ? kWindowWait : kHeadlessWait;
    const Status status =
        link_->receive(simulation_.snapshot().tick, timeout, stop_requested_, simulation_.actuator_array());
    phase_times_.lap(Phase::kWait);
    switch (status) {
      case Status::kOk:
      case Status::kRepeated:
        return true;
      case Status::kTimeout:
        check_silence();
        break;
      case Status::kTorn:
        break;
      case Status::kNoController:
      case Status::kControllerDead:
      case Status::kControllerClosed:
        if (options_.mode == RunMode::kPassive) return continue_without_controller(status);
        if (handle_controller_exit(status)) return false;
        if (status != Status::kNoController) {
          progress_.print_message("the controller is gone; the simulation is on hold");
          mark_controller_lost();
        }
        if (!wait_for_controller()) return false;
        break;
      default:
        break;  // interrupted: the stop flag is checked below
    }
    refresh_display();
    require_broker();
    if (stop_requested_) set_ending(common::kDone, "stopped by the user");
    if (requests_.quit) set_ending(common::kDone, "stopped by the user");
    if (ending_) return false;
  }
}

// Passive mode: physics does not wait; the actuators keep their last targets.
bool Run::continue_without_controller(Status status) {
  if (status != Status::kNoController) {
    progress_.print_message(fmt::format("{}; the actuators keep their last targets", text(status)));
    mark_controller_lost();
  }
  return !controller_process_ || !handle_controller_exit(status);
}

// Ends the run when the controller that it started exits. Returns false if the run started none.
bool Run::handle_controller_exit(Status status) {
  if (!controller_process_) return false;
  // The program has ended; its window stays open. A process that has died may be about to become a zombie.
  if (status != Status::kControllerDead && controller_has_window() && !controller_process_->exit_status()) {
    set_ending(common::kDone, "the controller exited");
    return true;
  }
  const auto exit_status = controller_process_->wait_for_exit(2000ms);
  // A broker that is killed takes the controller along.
  if (options_.confined) options_.confined->require_broker();
  if (stop_requested_) {  // a signal to the process group ends both
    set_ending(common::kDone, "stopped by the user");
  } else if (!exit_status) {
    set_ending(common::kPeerLost, "the controller detached from the surface but did not exit");
  } else if (*exit_status == 0) {
    set_ending(common::kDone, "the controller exited");
  } else if (*exit_status > 128) {
    set_ending(common::kPeerLost, fmt::format("the controller was lost (signal {})", *exit_status - 128));
  } else {
    set_ending(*exit_status == common::kUserError || *exit_status == common::kPeerLost ? *exit_status
                                                                                       : common::kFailed,
               fmt::format("the controller ended with exit status {}", *exit_status));
  }
  if (ending_->exit_status != common::kDone) {
    progress_.print_message(ending_->outcome);
    mark_controller_lost();
  }
  return true;
}

void Run::end_without_name() {
  set_ending(common::kFailed,
             fmt::format("no controller can attach: another process has removed the shared memory of '{}'",
                         link_->name()));
  progress_.print_message(ending_->outcome);
}

std::string Run::command_to_attach() const {
  return attach_command(options_.experiment, link_->name(), display_->has_window());
}

// Names a controller that is alive and does not answer, with the likely cause.
void Run::check_silence() {
  constexpr auto kPatience = 2s;
  if (options_.mode == RunMode::kPassive || requests_.paused || controller_is_paused()) {
    silent_since_ = Clock::now();
    silence_.clear();
  }
  if (!silence_.empty() || Clock::now() - silent_since_ < kPatience) return;
  const bool starting = link_->endpoint().controller_state() == shm_protocol::State::kLoading;
  silence_ =
      fmt::format("the controller (process {}) has not answered tick {} for 2 s: {}",
                  link_->endpoint().controller_pid(), simulation_.snapshot().tick,
                  starting ? "it is still starting"
                           : "does its program reach surface.step, or publish, in every turn of its loop?");
  progress_.print_message(silence_);
}

// Waits for a controller to attach, the first or a successor. Returns false if the run ends meanwhile.
bool Run::wait_for_controller() {
  if (!link_->endpoint().is_reachable()) end_without_name();
  if (ending_) return false;
  announced_waiting_ = !controller_process_;
  if (announced_waiting_)
    progress_.print_message(
        fmt::format("waiting for a controller; attach one with: {}", command_to_attach()));
  while (true) {
    const auto timeout = display_->has_window() ? kWindowWait : kHeadlessWait;
    if (link_->endpoint().await_controller({timeout, &stop_requested_}) == Status::kOk) {
      if (std::exchange(announced_waiting_, false))
        progress_.print_message(
            fmt::format("controller attached (process {})", link_->endpoint().controller_pid()));
      return true;
    }
    refresh_display();
    require_broker();
    if (stop_requested_ || requests_.quit) set_ending(common::kDone, "stopped by the user");
    if (controller_process_ && controller_process_->exit_status())
      handle_controller_exit(Status::kNoController);
    if (!link_->endpoint().is_reachable()) end_without_name();
    if (ending_) return false;
  }
}

bool Run::publish() {
  const scene::Snapshot& snapshot = simulation_.snapshot();
  const Status status = link_->publish(snapshot.tick, snapshot.time_s, simulation_.sensors());
  phase_times_.lap(Phase::kPublish);
  if (status == Status::kOk) return true;
  set_ending(common::kFailed, fmt::format("failed at tick {}: cannot publish the sensor frame: {}",
                                          snapshot.tick, text(status)));
  progress_.print_message(ending_->outcome);
  return false;
}

void Run::record_tick() {
  const scene::Snapshot& snapshot = simulation_.snapshot();
  experiment_.update_metrics(snapshot.time_s, snapshot.tick);
  if (const auto success_s = experiment_.success(snapshot.time_s, snapshot.tick); success_s && !success_s_) {
    success_s_ = success_s;
    display_->mark({view::EventMark::Kind::kSuccess, *success_s, "success"});
  }
  const scene::RecordSpec& record_spec = simulation_.scene().record;
  for (const auto& recorder : recorders_) {
    recorder->record_inputs(simulation_.actuators());
    if (options_.registers) recorder->record_registers(options_.registers->values());
    recorder->record_frame(
        snapshot, simulation_.catalogue(),
        record_spec.sensors != scene::SensorRecording::kNever ? simulation_.sensors()
                                                              : std::span<const scene::ChannelData>{},
        record_spec.actuators ? simulation_.actuators() : std::span<const scene::ChannelData>{},
        experiment_.metrics());
  }
  phase_times_.lap(Phase::kRecord);
  if (observer_) observer_(simulation_);
  if (display_->has_window()) mark_events();
  const bool is_last = end_tick_ && snapshot.tick >= *end_tick_;
  const double next_time_s =
      static_cast<double>(snapshot.tick + 1) * simulation_.scene().world.control_period_s;
  const auto before_pictures = Clock::now();
  media_.write_due(frame_input(), is_last ? std::nullopt : std::optional(next_time_s));
  const auto drawn_for = Clock::now() - before_pictures;
  pictures_time_ += drawn_for;
  progress_.leave_out(drawn_for);
  phase_times_.lap(Phase::kRender);
  if (is_last) set_ending(common::kDone, "done");
}

view::FrameInput Run::frame_input() {
  return {simulation_.snapshot(), simulation_.catalogue(), channels_.update(simulation_)};
}

std::optional<double> Run::end_time_s() const {
  if (!end_tick_) return std::nullopt;
  return static_cast<double>(*end_tick_) * simulation_.scene().world.control_period_s;
}

void Run::apply_script_requests() {
  const simulation::ScriptRequests requests = simulation_.take_requests();
  if (requests.pace_changed) pacer_.set_factor(requests.pace);
  if (requests.pause && display_->has_window()) requests_.paused = true;
  quit_by_script_ = requests.quit;
  if (!requests.stop && !requests.quit) return;
  set_ending(common::kDone, simulation::outcome_of(requests), requests.stop_message, requests.success);
}

void Run::require_broker() {
  constexpr auto kInterval = 100ms;
  if (!options_.confined || Clock::now() < next_broker_check_) return;
  next_broker_check_ = Clock::now() + kInterval;
  options_.confined->require_broker();
}

bool Run::wait_until_due() {
  const auto due = pacer_.due_time(simulation_.snapshot().time_s);
  while (true) {
    refresh_display();
    require_broker();
    if (!display_->has_window()) progress_.update(simulation_.snapshot().time_s, end_time_s());
    if (stop_requested_ || requests_.quit) set_ending(common::kDone, "stopped by the user");
    if (ending_) return false;
    if (requests_.paused) {
      pacer_.restart();
      if (requests_.single_steps > 0) {
        --requests_.single_steps;
        return true;
      }
      std::this_thread::sleep_for(kWindowWait);
      continue;
    }
    const auto now = Clock::now();
    if (now >= due) return true;
    // Sleeps in short intervals, so that the window and signals stay responsive at a slow pace.
    std::this_thread::sleep_for(std::min<Clock::duration>(due - now, kWindowWait));
  }
}

void Run::set_ending(int exit_status, std::string outcome, std::string title, std::optional<bool> success) {
  if (!ending_) ending_ = Ending{exit_status, std::move(outcome), std::move(title), success};
}

// Ends a run that failed in on_finish only. What the script said of success stays.
void Run::replace_ending(int exit_status, std::string outcome) {
  if (ending_ && ending_->exit_status != common::kDone) return;
  ending_ = Ending{exit_status, std::move(outcome), "", ending_ ? ending_->success : std::nullopt};
}

void Run::finish() {
  wall_s_ = std::chrono::duration<double>(Clock::now() - start_time_ - pictures_time_).count();
  frames_drawn_ = display_->frames_drawn();
  const double end_s = simulation_.snapshot().time_s;
  progress_.finish(end_s);
  if (!failed_to_start()) finish_pictures(end_s);
  final_summary_ = summary();
  const RunSummary& s = *final_summary_;
  for (const auto& recorder : recorders_)
    recorder->close({s.outcome, s.ticks, s.simulated_s, s.state_hash, s.success, s.success_s, s.metrics});
  if (!options_.stats_file.empty()) write_stats();
  // Closing the surface lets the controller exit by itself before it is terminated, unless it has a window,
  // which stays open as long as this run's.
  link_.reset();
  if (!controller_process_ || controller_has_window()) return;
  controller_process_->wait_for_exit(2000ms);
  controller_process_.reset();
}

// A controller that refuses its program, for example, leaves nothing to show.
bool Run::failed_to_start() const {
  return simulation_.snapshot().tick == 0 && ending_->exit_status != common::kDone;
}

void Run::finish_pictures(double end_s) {
  for (const Screenshot& screenshot : options_.screenshots)
    if (screenshot.time_s && *screenshot.time_s > end_s + 1e-9)
      progress_.print_message(fmt::format("{} shows the end at {:.4g} s: the run did not reach {:.4g} s",
                                          screenshot.file, end_s, *screenshot.time_s));
  media_.finish(frame_input());
}

RunSummary Run::summary() const {
  if (final_summary_) return *final_summary_;
  const scene::Snapshot& snapshot = simulation_.snapshot();
  const scene::WorldSpec& world = simulation_.scene().world;
  RunSummary s;
  s.experiment = options_.experiment;
  s.mode = options_.mode == RunMode::kTimeStep ? "time-step" : "passive";
  s.outcome = ending_->outcome;
  s.seed = world.seed;
  s.ticks = snapshot.tick;
  s.physics_steps = snapshot.tick * static_cast<std::uint64_t>(world.steps_per_tick());
  s.simulated_s = snapshot.time_s;
  s.wall_s = wall_s_;
  s.frames_drawn = frames_drawn_;
  s.objects = snapshot.object_count();
  s.contacts = snapshot.contact_count;
  s.metrics = experiment_.metrics();
  for (const scene::Variation& v : simulation_.nuisances())
    s.varied.emplace_back(v.name, v.drawn.value_or(0.0));
  s.state_hash = snapshot.state_hash;
  const simulation::Verdict verdict =
      simulation::judge(experiment_, success_s_, ending_->success, snapshot.time_s);
  s.success = verdict.success;
  s.success_s = verdict.success_s;
  s.off_surface = simulation_.departures().off_table_count();
  s.left_table = simulation_.departures().total_departures();
  s.actuator_values_clamped = simulation_.clamped_targets();
  if (link_) {
    s.sensor_frames_skipped = link_->endpoint().controller_counters().skipped;
    s.actuator_frames_repeated = link_->endpoint().counters().repeated;
    s.actuator_values_clamped += link_->endpoint().counters().clamped;
  }
  // The link's counter lies in memory that another process may have written.
  s.actuator_values_nan = std::min(simulation_.nan_targets(), s.actuator_values_clamped);
  return s;
}

std::vector<std::string> Run::written_files() const {
  std::vector<std::string> files = options_.recording_files;
  for (const Screenshot& screenshot : options_.screenshots) files.push_back(screenshot.file);
  for (const std::string& file : {options_.video_file, options_.stats_file})
    if (!file.empty()) files.push_back(file);
  return files;
}

// A failure was reported when it happened and stays the last line.
void Run::print_summary() {
  if (!options_.summary || ending_->exit_status != common::kDone) return;
  const RunSummary s = summary();
  if (const std::uint64_t beyond = s.actuator_values_clamped - s.actuator_values_nan; beyond > 0)
    progress_.print_message(
        fmt::format("warning: {} commands were outside their channel's range and clamped to it", beyond));
  if (s.actuator_values_nan > 0)
    progress_.print_message(fmt::format(
        "warning: {} commands were NaN and replaced by their channel's safe value", s.actuator_values_nan));
  const std::vector<std::string> files = written_files();
  progress_.print_message(fmt::format("{}: {:.2f} s simulated in {:.1f} s ({:.3g}x real time){}{}",
                                      ending_->outcome, s.simulated_s, s.wall_s, s.real_time_factor(),
                                      files.empty() ? "" : "; wrote ", fmt::join(files, ", ")));
}

void Run::write_stats() const { replace_output_file("--stats", options_.stats_file, stats_json()); }

}  // namespace smartsurf::run
