#include "smartsurf/run/ConfinedRuns.h"

#include <fmt/format.h>
#include <shm_protocol/Segments.h>
#include <shm_protocol/SurfaceName.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "common/confine/OutputServices.h"
#include "common/files/AtomicFile.h"
#include "common/files/RealPath.h"
#include "smartsurf/mesh/DecompositionCache.h"
#include "smartsurf/record/OpenRecorder.h"
#include "smartsurf/run/OutputFile.h"
#include "smartsurf/run/SurfaceLink.h"
#include "smartsurf/run/output/MediaWriter.h"
#include "smartsurf/scene/KindRegistry.h"

namespace smartsurf::run {
namespace {

namespace fs = std::filesystem;

// The services of a run. Those of the outputs come first, and one that creates the scripts' folders last.
enum RunService : std::size_t {
  kPutInPlace,
  kRemoveSegment,
  kStartController,
  kControllerStatus,
  kTerminateController,
  kKillController,
  kRunServices
};
constexpr int kStillRuns = -1;
// Somebody has killed the broker, which takes its controller along.
constexpr int kLostWithBroker = 128 + SIGKILL;

// Why these runs cannot be confined; empty if they can.
std::string reason_for_freedom(const RunOptions& options) {
  if (options.unsafe) return "with --unsafe";
  if (options.allow_extensions) return "with --allow-extensions";
  if (!scene::loaded_extensions().empty()) return "with --load";
  if (options.window) return "with --window";
  return "";
}

// Ends the controllers of a simulator that was killed: asks them all, and again after a moment, which
// supervisors of commands take for the end of their patience.
void hurry(const std::vector<std::unique_ptr<ControllerProcess>>& controllers) {
  using namespace std::chrono_literals;
  const auto deadline = std::chrono::steady_clock::now() + 300ms;
  const auto ask_all = [&] {
    for (const auto& controller : controllers)
      if (controller) controller->send_signal(SIGTERM);
  };
  ask_all();
  for (const auto& controller : controllers)
    if (controller)
      controller->wait_for_exit(
          std::chrono::duration_cast<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now()));
  ask_all();
}

// The names of the segments that --shm has not chosen, also those of experiments that are opened in the
// window.
std::vector<std::string> unnamed_segments(std::span<const RunOptions> runs) {
  RunOptions opened;
  opened.controller = "PROGRAM.aps";
  std::vector<std::string> names;
  for (const RunOptions& options : runs) {
    if (options.shm.empty() && !options.no_controller) names.push_back(segment_name(options));
    if (options.window) names.push_back(segment_name(opened));
  }
  return names;
}

// Confined, the run cannot create the folder.
void add_mesh_cache(common::Confinement& confinement) {
  if (const fs::path folder = mesh::decomposition_folder();
      !folder.empty() && mesh::create_decomposition_folder(folder))
    confinement.write_folders.push_back(folder);
}

}  // namespace

struct ConfinedRuns::Prepared {
  struct OneRun {
    RunOptions options;
    std::shared_ptr<shm_protocol::SurfaceName> surface_name;  // null with --no-controller
    std::unique_ptr<common::VideoEncoder> video;
  };
  std::vector<OneRun> runs;
  std::vector<common::PreparedOutput> outputs;
  std::vector<fs::path> script_folders, created_folders;
  common::Confinement confinement;

  // Removes what was created and got no name. For the broker.
  void clean() noexcept {
    common::remove_unnamed(outputs);
    for (const fs::path& folder : created_folders) ::rmdir(folder.c_str());
  }

  void prepare(const RunOptions& options);
  void create_script_folders();
};

void ConfinedRuns::Prepared::create_script_folders() {
  for (const fs::path& folder : script_folders)
    if (::mkdir(folder.c_str(), 0777) == 0) created_folders.push_back(folder);
}

void ConfinedRuns::Prepared::prepare(const RunOptions& options) {
  runs.push_back({options, nullptr, nullptr});
  for (const std::string& file : options.recording_files) outputs.push_back(record::prepare_recording(file));
  if (!options.recording_files.empty()) script_folders.push_back(script_output_folder(options));
  if (!options.stats_file.empty()) outputs.push_back(prepare_replaced_file({"--stats", options.stats_file}));
  for (common::PreparedOutput& output : prepare_media(options.screenshots, options.video_file))
    outputs.push_back(std::move(output));
  if (!options.no_controller) runs.back().surface_name = reserve_name(segment_name(options));
}

std::unique_ptr<ConfinedRuns> ConfinedRuns::confine(std::span<RunOptions> runs,
                                                    const std::vector<common::NamedOutput>& others) {
  // The destructor ends what has begun before an exception.
  std::unique_ptr<ConfinedRuns> confined(new ConfinedRuns(runs));
  if (common::confinement_mode() == common::ConfinementMode::kOff) return confined;
  if (const std::string reason = reason_for_freedom(runs.front()); !reason.empty())
    common::leave_unconfined(reason);
  else
    confined->confine_to(runs, others);
  return confined;
}

ConfinedRuns::ConfinedRuns(std::span<const RunOptions> runs) : prepared_(std::make_unique<Prepared>()) {
  const std::vector<std::string> names = unnamed_segments(runs);
  if (names.empty()) return;
  // For a moment a segment may still look alive, or another cleaner may hold its lock.
  guardian_ = std::make_unique<common::Guardian>([&names] {
    using namespace std::chrono_literals;
    const auto deadline = std::chrono::steady_clock::now() + 5s;
    for (const std::string& name : names)
      while (!shm_protocol::remove_orphans_of(name) && std::chrono::steady_clock::now() < deadline)
        std::this_thread::sleep_for(10ms);
  });
}

void ConfinedRuns::confine_to(std::span<RunOptions> runs, const std::vector<common::NamedOutput>& others) {
  common::Confinement& confinement = prepared_->confinement;
  confinement.calls = common::Confinement::Calls::kSimulator;
  common::add_system_files(confinement);
  add_experiment_files(confinement, runs.front().experiment);
  add_mesh_cache(confinement);
  common::note_input(fs::path(runs.front().experiment));
  std::vector<common::NamedOutput> named = others;
  for (const RunOptions& options : runs) {
    note_controller(options.controller);
    if (is_apron_program(options.controller)) {
      confinement.read.emplace_back(options.controller);
    }
    for (common::NamedOutput& output : named_outputs(options)) named.push_back(std::move(output));
  }
  common::require_separate_outputs(named);
  {
    const common::SignalsDeferred deferred;
    for (const RunOptions& options : runs) prepared_->prepare(options);
    for (const common::NamedOutput& output : others)
      prepared_->outputs.push_back(prepare_replaced_file(output));
    if (needs_broker()) start_broker();
    for (Prepared::OneRun& run : prepared_->runs)
      run.video = start_video(run.options.video_file, run.options.render);
  }
  common::add_outputs(confinement, prepared_->outputs);
  // A link would lead the script's files elsewhere.
  for (const fs::path& folder : prepared_->script_folders)
    if (std::error_code error; fs::is_directory(fs::symlink_status(folder, error)))
      confinement.write_folders.push_back(folder);
  // The segment's file, and the process table, which shows whether a controller without a lock lives.
  for (const Prepared::OneRun& run : prepared_->runs) {
    if (run.surface_name) {
      confinement.write.emplace_back(run.surface_name->file());
      confinement.read.emplace_back("/proc");
    }
    if (!run.options.screenshots.empty() || run.video) {
      confinement.calls = common::Confinement::Calls::kPictures;
      common::add_picture_files(confinement);
    }
  }
  if (!others.empty()) common::add_picture_files(confinement);  // reports have figures
  common::confine(confinement);
  for (std::size_t i = 0; i < runs.size(); ++i) {
    runs[i].confined = this;
    runs[i].confined_number = i;
  }
}

bool ConfinedRuns::needs_broker() const {
  return !prepared_->outputs.empty() ||
         std::ranges::any_of(prepared_->runs, [](const auto& run) { return run.surface_name != nullptr; });
}

// The services run in the forked broker, on its copy of what is prepared.
void ConfinedRuns::start_broker() {
  std::vector<common::Broker::Service> services = common::output_services(prepared_->outputs);
  auto controllers =
      std::make_shared<std::vector<std::unique_ptr<ControllerProcess>>>(prepared_->runs.size());
  for (std::size_t i = 0; i < prepared_->runs.size(); ++i) {
    Prepared::OneRun& run = prepared_->runs[i];
    const auto signal = [controllers, i](int number) {
      if (auto& controller = (*controllers)[i]) controller->send_signal(number);
      return 0;
    };
    services.emplace_back([&run] {
      if (run.surface_name) run.surface_name->put_in_place();
      return 0;
    });
    services.emplace_back([&run] {
      if (run.surface_name) run.surface_name->remove();
      return 0;
    });
    services.emplace_back([controllers, i, &run] {
      (*controllers)[i] = std::make_unique<ControllerProcess>(
          run.options.controller, run.surface_name->name(), false, run.options.controller_overrides,
          run.options.registers ? run.options.registers->argument() : "");
      return 0;
    });
    services.emplace_back([controllers, i] {
      auto& controller = (*controllers)[i];
      return controller ? controller->exit_status().value_or(kStillRuns) : 0;
    });
    services.emplace_back([signal] { return signal(SIGTERM); });
    services.emplace_back([signal] { return signal(SIGKILL); });
  }
  Prepared* const prepared = prepared_.get();
  services.emplace_back([prepared] {
    prepared->create_script_folders();
    return 0;
  });
  broker_ = std::make_unique<common::Broker>(std::move(services), [prepared, controllers](bool ordered) {
    if (ordered) {  // else one that the user has named stays to be looked at
      for (const Prepared::OneRun& run : prepared->runs)
        if (run.surface_name) run.surface_name->remove();
    } else {
      hurry(*controllers);
    }
    controllers->clear();
    for (const Prepared::OneRun& run : prepared->runs)
      if (run.surface_name) ::unlink(run.surface_name->file().c_str());
    prepared->clean();
  });
  common::use_outputs_of(*broker_, prepared->outputs);
  broker_->ask(first_service_of(prepared->runs.size()));
}

void ConfinedRuns::require_broker() {
  if (broker_) broker_->require();
}

ConfinedRuns::~ConfinedRuns() {
  for (Prepared::OneRun& run : prepared_->runs)
    run.video.reset();  // the broker removes what ffmpeg has begun
  common::use_prepared_outputs({}, {});
  try {
    require_broker();
  } catch (const std::runtime_error&) {
    if (guardian_) guardian_->stay();
  }
  broker_.reset();
}

std::size_t ConfinedRuns::first_service_of(std::size_t run) const {
  return common::output_services(prepared_->outputs).size() + run * kRunServices;
}

std::shared_ptr<shm_protocol::SurfaceName> ConfinedRuns::surface_name(std::size_t run) const {
  const auto& name = prepared_->runs[run].surface_name;
  const std::size_t first = first_service_of(run);
  if (name)
    name->delegate([broker = broker_.get(), first] { broker->ask(first + kPutInPlace); },
                   [broker = broker_.get(), first] { broker->ask(first + kRemoveSegment); });
  return name;
}

std::unique_ptr<common::VideoEncoder> ConfinedRuns::take_video(std::size_t run) {
  return std::move(prepared_->runs[run].video);
}

std::unique_ptr<ControllerProcess> ConfinedRuns::start_controller(std::size_t run) {
  const std::size_t first = first_service_of(run);
  common::Broker* const broker = broker_.get();
  return std::make_unique<ControllerProcess>(ControllerProcess::Remote{
      [broker, first] { broker->ask(first + kStartController); },
      [broker, first]() -> std::optional<int> {
        try {
          const int status = broker->ask(first + kControllerStatus);
          return status == kStillRuns ? std::nullopt : std::optional(status);
        } catch (const std::runtime_error&) {
          return kLostWithBroker;
        }
      },
      [broker, first](int signal) {
        try {
          broker->ask(first + (signal == SIGKILL ? kKillController : kTerminateController));
        } catch (const std::runtime_error&) {
        }
      }});
}

void add_experiment_files(common::Confinement& confinement, const std::string& experiment) {
  std::error_code error;
  const fs::path path = fs::absolute(experiment, error);
  confinement.read.push_back(path);
  confinement.read.push_back(path.parent_path());
}

void confine_to_experiment(const std::string& experiment, bool allow_extensions) {
  RunOptions options;
  options.allow_extensions = allow_extensions;
  if (const std::string reason = reason_for_freedom(options); !reason.empty()) {
    common::leave_unconfined(reason);
    return;
  }
  common::Confinement confinement;
  confinement.calls = common::Confinement::Calls::kSimulator;
  common::add_system_files(confinement);
  add_experiment_files(confinement, experiment);
  add_mesh_cache(confinement);
  common::confine(confinement);
}

common::PreparedOutput prepare_replaced_file(const common::NamedOutput& output) {
  require_writable(output.flag, output.file.string());
  return common::prepare_output(output.flag + " " + output.file.string(), output.file,
                                common::part_of(output.file));
}

std::vector<common::PreparedOutput> prepare_media(std::span<const Screenshot> screenshots,
                                                  const std::string& video_file) {
  std::vector<common::PreparedOutput> outputs;
  for (const Screenshot& screenshot : screenshots)
    outputs.push_back(prepare_replaced_file({"--screenshot", screenshot.file}));
  if (video_file.empty()) return outputs;
  const std::filesystem::path video = common::replaced_path(video_file);  // NewPart creates its part
  outputs.push_back({.subject = "", .name = video, .part = common::part_of(video), .is_new = true});
  return outputs;
}

}  // namespace smartsurf::run
