#include "smartsurf/run/Run.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include "smartsurf/mesh/SolidLibrary.h"
#include "smartsurf/run/OutputFile.h"

namespace smartsurf::run {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using shm_protocol::Status;

constexpr auto kFrameSlice = 8ms;       // how long a wait may keep the window from drawing
constexpr auto kHeadlessSlice = 100ms;  // … and a headless run from looking after its child

script::LoadOptions load_options(const RunOptions& options) {
  script::LoadOptions load;
  load.set = options.set;
  load.seed = options.seed;
  load.unsafe = options.unsafe;
  load.solids = std::make_shared<mesh::SolidLibrary>();
  // Where a script may write: beside the run's other output, else nowhere.
  if (!options.recordings.empty()) {
    const std::filesystem::path folder = std::filesystem::path(options.recordings.front()).parent_path();
    load.output_folder = folder.empty() ? "." : folder;
  }
  return load;
}

std::string text_of(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

std::optional<std::uint64_t> last_tick(const RunOptions& options, const scene::WorldSpec& world) {
  if (options.ticks) return options.ticks;
  if (!options.until_s) return std::nullopt;
  return static_cast<std::uint64_t>(std::ceil(*options.until_s / world.control_period_s - 1e-9));
}

std::string segment_name(const RunOptions& options) {
  if (!options.shm.empty()) return options.shm;
  // A controller of our own needs no name that a person can type.
  return options.controller.empty() ? "surface" : fmt::format("run-{}", getpid());
}

std::unique_ptr<Display> display_for(const RunOptions& options, const scene::SceneSpec& scene,
                                     std::unique_ptr<Display> before) {
  if (!before) return std::make_unique<Display>(options, scene);
  before->begin_anew(scene);
  return before;
}

}  // namespace

script::Experiment Run::load(const RunOptions& options) {
  return script::Experiment::load(options.experiment, load_options(options));
}

Run::Run(const RunOptions& options, const std::atomic<bool>& stop, script::Experiment experiment,
         std::unique_ptr<Display> display)
    : options_(options),
      stop_(stop),
      experiment_(std::move(experiment)),
      simulation_(experiment_, options.threads, options.no_controller),
      display_(display_for(options, experiment_.scene(), std::move(display))),
      pictures_(options.screenshots, options.video_file, options.look, experiment_.scene()),
      progress_(options.world ? fmt::format("world {}", *options.world) : ""),
      pacer_(options.pace),
      purity_(experiment_.scene().surface),
      last_tick_(last_tick(options, experiment_.scene().world)) {
  if (!options.no_controller)
    link_ = std::make_unique<SurfaceLink>(segment_name(options), options.mode, experiment_.scene());
  open_recordings();
  controls_.paused = options.paused && display_->has_window();
  if (link_ && !options.controller.empty())
    child_ = std::make_unique<ControllerProcess>(options.controller, link_->name(), options.window);
}

Run::~Run() = default;

void Run::open_recordings() {
  record::Meta meta;
  meta.command_line = options_.command_line;
  meta.mode = options_.mode == RunMode::kTimeStep ? "time-step" : "passive";
  meta.program_file = options_.controller;
  if (options_.controller.ends_with(".aps")) meta.program_text = text_of(options_.controller);
  meta.driver = options_.no_controller ? "script" : "controller";
  for (const auto& [name, value] : options_.set) meta.set.push_back({name, value});
  meta.unsafe = options_.unsafe;
  meta.versions = {{"physics", world::physics_version()}};
  for (const auto& file : options_.recordings)
    recorders_.push_back(record::Recorder::open(file, meta, experiment_.scene()));
}

int Run::execute() {
  try {
    begin();
    while (!ending_ && hold_pace() && tick()) {
    }
    experiment_.finish();
  } catch (const scene::InputError& mistake) {
    end(kUserError, mistake.what());
    finish();
    throw;
  }
  finish();
  linger();
  return ending_->exit_status;
}

// The state before the first tick is frame 0: what the controller answers first, and the recording's first
// line.
void Run::begin() {
  started_ = Clock::now();
  purity_.add(simulation_.snapshot(), simulation_.catalogue());
  times_.start();
  if (link_) {
    link_->endpoint().set_state(shm_protocol::State::kRunning);
    if (options_.mode == RunMode::kPassive && !child_)
      progress_.say(fmt::format("running; a controller may attach with: {}", attach_command(link_->name())));
    else if (!link_->endpoint().has_controller() && !replace_controller())
      return;
    if (!publish()) return;
  }
  record();
  times_ = {};
  started_ = Clock::now();
  progress_.restart();
}

// One tick is one list of phases.
bool Run::tick() {
  times_.start();
  simulation_.run_script();
  times_.lap(Phase::kActuate);
  if (link_) {
    if (!receive_actuators()) return false;
    for (int channel = 0; channel < link_->actuator_channels(); ++channel)
      simulation_.actuate(channel, link_->targets(channel));
    times_.lap(Phase::kActuate);
  }
  obey_hand();
  if (!advance_physics()) return false;
  simulation_.look();
  times_.lap(Phase::kPhysics);
  simulation_.sense();
  times_.lap(Phase::kSense);
  if (link_ && !publish()) return false;
  record();
  times_.end_tick();
  obey_script();
  return !ending_;
}

bool Run::advance_physics() {
  const int steps = simulation_.scene().world.steps_per_tick();
  for (int i = 0; i < steps; ++i) {
    simulation_.plan_cells();
    times_.lap(Phase::kActuate);
    simulation_.step_physics();
    times_.lap(Phase::kPhysics);
    simulation_.move_cells();
    times_.lap(Phase::kActuate);
  }
  if (const auto bad = simulation_.first_not_finite()) {
    end(kFailed, fmt::format("failed at tick {}: object {} has a position or velocity that is not finite",
                             simulation_.snapshot().tick + 1, *bad));
    progress_.say(ending_->outcome);
    return false;
  }
  return true;
}

bool Run::receive_actuators() {
  while (true) {
    const auto slice = display_->has_window() ? kFrameSlice : kHeadlessSlice;
    const Status status = link_->receive(simulation_.snapshot().tick, slice, stop_);
    times_.lap(Phase::kWait);
    switch (status) {
      case Status::kOk:
        had_controller_ = true;
        return true;
      case Status::kRepeated:
        return true;
      case Status::kTimeout:
      case Status::kTorn:
        break;
      case Status::kNoController:
      case Status::kControllerDead:
      case Status::kControllerClosed:
        if (options_.mode == RunMode::kPassive) return fly_on_without_controller(status);
        if (child_ended() || !replace_controller()) return false;
        break;
      default:
        break;  // interrupted: the stop flag is looked at below
    }
    refresh_display();
    if (stop_) end(kDone, "stopped by the user");
    if (controls_.quit) end(kDone, "stopped by the user");
    if (ending_) return false;
  }
}

// Passive: physics does not wait; the actuators keep their last targets.
bool Run::fly_on_without_controller(Status status) {
  if (status != Status::kNoController)
    progress_.say(fmt::format("{}; the actuators keep their last targets", text(status)));
  return !child_ || !child_ended();
}

// Our own controller's end is the run's end: in good order, or as its exit status says.
bool Run::child_ended() {
  if (!child_) return false;
  const auto status = child_->wait_for_exit(2000ms);
  if (!status) {
    end(kPeerLost, "the controller let go of the surface without ending");
  } else if (*status == 0) {
    end(kDone, "the controller's program ended");
  } else if (*status > 128) {
    end(kPeerLost, fmt::format("the controller was lost (signal {})", *status - 128));
  } else {
    end(*status == kUserError || *status == kPeerLost ? *status : kFailed,
        fmt::format("the controller ended with exit status {}", *status));
  }
  if (ending_->exit_status != kDone) progress_.say(ending_->outcome);
  return true;
}

// Waits for a controller to attach: the first, or one that takes over from one that died or left.
bool Run::replace_controller() {
  if (had_controller_) {
    progress_.say("the controller is gone; the surface holds still");
    announced_waiting_ = false;
    had_controller_ = false;
  }
  if (!child_ && !announced_waiting_) {
    progress_.say(
        fmt::format("waiting for a controller; attach one with: {}", attach_command(link_->name())));
    announced_waiting_ = true;
  }
  while (true) {
    const auto slice = display_->has_window() ? kFrameSlice : kHeadlessSlice;
    if (link_->endpoint().await_controller({slice, &stop_}) == Status::kOk) {
      if (announced_waiting_)
        progress_.say(fmt::format("controller attached (process {})", link_->endpoint().controller_pid()));
      return true;
    }
    refresh_display();
    if (stop_ || controls_.quit) end(kDone, "stopped by the user");
    if (child_ && child_->exit_status()) child_ended();
    if (ending_) return false;
  }
}

bool Run::publish() {
  const scene::Snapshot& snapshot = simulation_.snapshot();
  const Status status = link_->publish(snapshot.tick, snapshot.time_s, simulation_.sensors());
  times_.lap(Phase::kPublish);
  if (status == Status::kOk) return true;
  end(kFailed,
      fmt::format("failed at tick {}: cannot publish the sensor frame: {}", snapshot.tick, text(status)));
  progress_.say(ending_->outcome);
  return false;
}

void Run::record() {
  const scene::Snapshot& snapshot = simulation_.snapshot();
  const scene::RecordSpec& kept = simulation_.scene().record;
  for (const auto& r : recorders_) {
    r->inputs(simulation_.actuators());
    r->frame(snapshot, simulation_.catalogue(),
             kept.sensors ? simulation_.sensors() : std::span<const record::Channel>{},
             kept.actuators ? simulation_.actuators() : std::span<const record::Channel>{});
  }
  times_.lap(Phase::kRecord);
  purity_.add(snapshot, simulation_.catalogue());
  display_->remember(simulation_);
  pictures_.take(moment());
  times_.lap(Phase::kRender);
  if (last_tick_ && snapshot.tick >= *last_tick_) end(kDone, "done");
}

view::Moment Run::moment() {
  return {simulation_.snapshot(), simulation_.catalogue(), channels_.of(simulation_, simulation_.snapshot())};
}

std::optional<double> Run::last_time_s() const {
  if (!last_tick_) return std::nullopt;
  return static_cast<double>(*last_tick_) * simulation_.scene().world.control_period_s;
}

void Run::obey_script() {
  const ScriptRequests requests = simulation_.take_requests();
  if (requests.pace_changed) pacer_.set_factor(requests.pace);
  if (requests.pause && display_->has_window()) controls_.paused = true;
  if (requests.stop || requests.quit) end(kDone, "stopped by the script");
  lingers_ = requests.stop && !requests.quit;
}

bool Run::hold_pace() {
  const auto due = pacer_.due(simulation_.snapshot().time_s);
  while (true) {
    refresh_display();
    if (!display_->has_window()) progress_.show(simulation_.snapshot().time_s, last_time_s());
    if (stop_ || controls_.quit) end(kDone, "stopped by the user");
    if (ending_) return false;
    if (controls_.paused) {
      pacer_.restart();
      if (controls_.single_steps > 0) {
        --controls_.single_steps;
        return true;
      }
      std::this_thread::sleep_for(kFrameSlice);
      continue;
    }
    const auto now = Clock::now();
    if (now >= due) return true;
    // The last stretch is short, so that neither the window nor a signal waits for a slow pace.
    std::this_thread::sleep_for(std::min<Clock::duration>(due - now, kFrameSlice));
  }
}

void Run::end(int exit_status, std::string outcome) {
  if (!ending_) ending_ = Ending{exit_status, std::move(outcome)};
}

void Run::finish() {
  wall_s_ = std::chrono::duration<double>(Clock::now() - started_).count();
  progress_.finish(simulation_.snapshot().time_s);
  const scene::Snapshot& snapshot = simulation_.snapshot();
  pictures_.take_last(moment());
  for (const auto& r : recorders_)
    r->close({ending_->outcome, snapshot.tick, snapshot.time_s, snapshot.state_hash});
  if (!options_.stats_file.empty()) write_stats();
  // The controller sees the surface close, and ends by itself; only then is it made to.
  link_.reset();
  if (child_) child_->wait_for_exit(2000ms);
  child_.reset();
}

RunSummary Run::summary() const {
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
  s.objects = snapshot.objects();
  s.contacts = snapshot.contacts;
  s.metrics = experiment_.metrics();
  s.state_hash = snapshot.state_hash;
  if (std::isfinite(purity_.value())) s.purity = purity_.value();
  s.sorted_at_s = purity_.sorted_at();
  s.off_surface = simulation_.table().off();
  s.left_table = simulation_.table().left_so_far();
  if (link_) {
    s.sensor_frames_skipped = link_->endpoint().controller_counters().skipped;
    s.actuator_frames_repeated = link_->endpoint().counters().repeated;
    s.actuator_values_clamped = link_->endpoint().counters().clamped;
  }
  return s;
}

void Run::write_stats() const { write_whole_file("--stats", options_.stats_file, stats_json()); }

}  // namespace smartsurf::run
