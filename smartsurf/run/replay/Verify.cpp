#include "smartsurf/run/replay/Verify.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <new>
#include <optional>

#include "common/files/ReadFile.h"
#include "common/process/ChildWork.h"
#include "smartsurf/extension/Extension.h"
#include "smartsurf/mesh/SolidLibrary.h"
#include "smartsurf/run/ScriptOverrun.h"
#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/simulation/Simulation.h"
#include "smartsurf/world/bullet/EngineFactory.h"

namespace smartsurf::run {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void throw_input_error(const record::Recording& recording, const std::string& why) {
  throw scene::InputError(fmt::format("{}: cannot be run again: {}", recording.path().string(), why));
}

void require_reproducible(const record::Recording& recording, const Allowed& allowed) {
  if (!recording.meta().is_simulated)
    throw_input_error(recording, "it is of a live surface, of which it holds no experiment");
  if (const auto tick = recording.first_interaction_tick())
    throw_input_error(recording, fmt::format("the user intervened after tick {}", *tick));
  if (recording.frames() == 0) throw_input_error(recording, "it holds no frames");
  if (recording.meta().driver != "script" && recording.input_tick_count() == 0)
    throw_input_error(recording, "it does not contain the controller's actuator targets");
  if (recording.meta().unsafe && !allowed.unsafe)
    throw_input_error(recording,
                      "its script ran with --unsafe and may do anything again; give --unsafe to allow that");
}

void require_engine(const record::Recording& recording) {
  try {
    world::require_engine(recording.spec());
  } catch (const scene::InputError& error) {
    throw_input_error(recording, error.what());
  }
}

// may_be_missing: the script has not run yet, and may load extensions.
void require_extensions(const record::Recording& recording, bool may_be_missing) {
  const std::vector<scene::Extension> loaded = scene::loaded_extensions();
  for (const auto& [name, hash] : recording.meta().extensions) {
    const auto it = std::ranges::find(loaded, name, &scene::Extension::name);
    if (it == loaded.end() && !may_be_missing)
      throw_input_error(recording, fmt::format("it needs the extension {}: give --load {}", name, name));
    if (it != loaded.end() && it->hash != hash)
      throw_input_error(
          recording, fmt::format("it was recorded with an extension {} of hash {}, and this one has {}", name,
                                 hash, it->hash));
  }
}

void require_same_physics(const record::Recording& recording, const simulation::Simulation& simulation) {
  const std::string now = simulation.engine().version();
  for (const record::NamedText& version : recording.meta().versions)
    if (version.name == "physics" && version.value != now)
      throw_input_error(recording,
                        fmt::format("it was recorded with physics {}, and this program has {}, which gives "
                                    "other bits",
                                    version.value, now));
}

void require_matching_inputs(const record::Recording& recording, const simulation::Simulation& simulation) {
  std::size_t values = 0;
  for (const scene::ChannelData& channel : simulation.actuators()) values += channel.values.size();
  if (recording.read_inputs(0).size() != values)
    throw_input_error(recording,
                      fmt::format("it holds {} actuator values per tick, but the experiment now has {}",
                                  recording.read_inputs(0).size(), values));
}

bool is_in_place(const std::string& file, const std::string& source) {
  std::string text;
  return !common::read_file(file, common::kMaxTextBytes, text) && text == source;
}

// Frames are at regular ticks, so that their number bounds the work.
void require_regular_ticks(const record::Recording& recording, const scene::SceneSpec& scene) {
  const auto interval = static_cast<std::uint64_t>(scene.record.tick_interval);
  for (std::size_t frame = 0; frame < recording.frames(); ++frame)
    if (recording.ticks()[frame] != frame * interval)
      throw_input_error(recording, fmt::format("frame {} is of tick {} instead of {}", frame,
                                               recording.ticks()[frame], frame * interval));
}

script::Experiment reload_experiment(const record::Recording& recording, const Allowed& allowed,
                                     const fs::path& output_directory, const std::atomic<bool>& stop) {
  script::LoadOptions options;
  options.stop = &stop;
  options.end_process = end_for_script;
  for (const auto& assignment : recording.meta().overrides)
    options.overrides.emplace_back(assignment.name, assignment.value);
  options.seed = recording.spec().world.seed;
  options.engine = recording.spec().world.engine;
  options.unsafe = recording.meta().unsafe;
  if (allowed.extensions || options.unsafe) options.load_extension = extension::load;
  options.source = recording.spec().source;
  options.output_folder = output_directory;
  if (!options.unsafe && !is_in_place(recording.spec().file, recording.spec().source))
    options.script_folder = output_directory;
  options.solid_factory = std::make_shared<mesh::SolidLibrary>();
  options.print_output = options.report_warning = [](std::string_view) {};
  return script::Experiment::load(recording.spec().file, std::move(options));
}

// Sets the targets of all channels from one recorded row, which concatenates them.
void apply_inputs(simulation::Simulation& simulation, std::span<const float> inputs) {
  int channel = 0;
  for (const scene::ChannelData& actuator : simulation.actuators()) {
    simulation.actuator_array().set_targets(channel++, inputs.first(actuator.values.size()));
    inputs = inputs.subspan(actuator.values.size());
  }
}

// Judges the state as Run does, because the script's functions may change its variables.
void evaluate(script::Experiment& experiment, const scene::Snapshot& snapshot) {
  experiment.update_metrics(snapshot.time_s, snapshot.tick);
  experiment.success(snapshot.time_s, snapshot.tick);
}

void run_tick(script::Experiment& experiment, simulation::Simulation& simulation,
              std::optional<std::span<const float>> inputs) {
  simulation.run_script();
  if (inputs) apply_inputs(simulation, *inputs);
  for (int i = simulation.scene().world.steps_per_tick(); i > 0; --i) {
    simulation.plan_actuators();
    simulation.step_physics();
    simulation.commit_actuators();
  }
  simulation.finish_tick();
  simulation.sense();
  evaluate(experiment, simulation.snapshot());
  simulation.take_requests();
}

template <class Numbers>
bool bitwise_equal(const Numbers& a, const Numbers& b) {
  return std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]) == 0;
}

std::string format_components(const std::array<float, 3>& v) {
  return fmt::format("({}, {}, {})", v[0], v[1], v[2]);
}
std::string format_components(const std::array<float, 4>& q) {
  return fmt::format("({}, {}, {}, {})", q[0], q[1], q[2], q[3]);
}

template <class Rows>
std::optional<std::string> compare_element(const char* what, const Rows& recorded, std::size_t i,
                                           const Rows& now, std::size_t j) {
  if (bitwise_equal(recorded[i], now[j])) return std::nullopt;
  return fmt::format("{} {} recorded, {} now", what, format_components(recorded[i]),
                     format_components(now[j]));
}

std::string object_name(const std::vector<scene::ObjectSpec>& catalogue, scene::ObjectId id) {
  const std::string& label = catalogue[id].label;
  return label.empty() ? fmt::format("object {}", id) : fmt::format("object {} ('{}')", id, label);
}

std::optional<std::string> find_object_difference(const scene::Snapshot& recorded,
                                                  const scene::Snapshot& replayed,
                                                  const std::vector<scene::ObjectSpec>& catalogue) {
  for (std::size_t i = 0; i < recorded.object_count() || i < replayed.object_count(); ++i) {
    if (i >= replayed.object_count() || (i < recorded.object_count() && recorded.id[i] < replayed.id[i]))
      return fmt::format("object {} is missing now", recorded.id[i]);
    if (i >= recorded.object_count() || replayed.id[i] < recorded.id[i])
      return fmt::format("{} exists now but not in the recording", object_name(catalogue, replayed.id[i]));
    auto mismatch = compare_element("position", recorded.position, i, replayed.position, i);
    if (!mismatch)
      mismatch = compare_element("orientation", recorded.orientation, i, replayed.orientation, i);
    if (!mismatch) mismatch = compare_element("velocity", recorded.velocity, i, replayed.velocity, i);
    if (mismatch) return fmt::format("{}: {}", object_name(catalogue, replayed.id[i]), *mismatch);
  }
  return std::nullopt;
}

std::optional<std::string> find_height_difference(const scene::Snapshot& recorded,
                                                  const scene::Snapshot& replayed, int columns) {
  for (std::size_t i = 0; i < recorded.height.size() && i < replayed.height.size(); ++i)
    if (std::bit_cast<std::uint32_t>(recorded.height[i]) != std::bit_cast<std::uint32_t>(replayed.height[i]))
      return fmt::format("pin row {}, column {}: height {} recorded, {} now", i / columns, i % columns,
                         recorded.height[i], replayed.height[i]);
  return std::nullopt;
}

// Describes the first difference in a frame whose state hashes differ.
std::string describe_difference(const record::Recording& recording, std::size_t frame,
                                const simulation::Simulation& simulation) {
  const scene::Snapshot recorded = recording.read_snapshot(frame), &replayed = simulation.snapshot();
  if (recording.has_objects())
    if (auto found = find_object_difference(recorded, replayed, simulation.catalogue())) return *found;
  if (recording.has_heights())
    if (auto found = find_height_difference(recorded, replayed, simulation.scene().surface.columns))
      return *found;
  return fmt::format("state hash {:016x} recorded, {:016x} now; all recorded values are equal",
                     recorded.state_hash, replayed.state_hash);
}

}  // namespace

TemporaryFolder::TemporaryFolder() {
  std::error_code error;
  const fs::path parent = fs::temp_directory_path(error);
  if (error) {
    const char* const chosen = std::getenv("TMPDIR");
    throw scene::InputError(fmt::format("TMPDIR = {}: must be a folder: the script's output goes there",
                                        chosen != nullptr ? chosen : ""));
  }
  path_ = (parent / "smartsurf-verify-XXXXXX").string();
  if (::mkdtemp(path_.data()) == nullptr)
    throw std::runtime_error(
        fmt::format("cannot create a folder in {} (TMPDIR): {}", parent.string(), std::strerror(errno)));
  unfinished_.emplace(path_);
}

TemporaryFolder::~TemporaryFolder() {
  try {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  } catch (const std::bad_alloc&) {  // it needs memory to look for files, of which there may be none
    ::rmdir(path_.c_str());
  }
}

std::optional<fs::path> find_unchanged_experiment(const fs::path& recording) {
  const common::ChildLimits limits{
      .cpu_s = 15.0, .memory_bytes = record::memory_to_read(recording), .readable = {recording}};
  const common::ChildResult read = common::run_in_child(
      [&] {
        const scene::SceneSpec spec = record::Recording::open_here(recording).spec();
        return spec.file + '\0' + spec.source;
      },
      limits);
  const std::size_t end = read.bytes.find('\0');
  if (read.end != common::ChildResult::End::kReturned || end == std::string::npos) return std::nullopt;
  const std::string file = read.bytes.substr(0, end);
  if (!is_in_place(file, read.bytes.substr(end + 1))) return std::nullopt;
  return file;
}

VerificationResult verify(const record::Recording& recording, int threads, const Allowed& allowed,
                          const fs::path& output_folder, const std::atomic<bool>& stop,
                          const std::function<void(double)>& progress,
                          const std::function<bool(const simulation::Simulation&)>& observe) {
  require_reproducible(recording, allowed);
  require_engine(recording);
  require_extensions(recording, /*may_be_missing=*/allowed.extensions || recording.meta().unsafe);
  script::Experiment experiment = reload_experiment(recording, allowed, output_folder, stop);
  require_extensions(recording, /*may_be_missing=*/false);
  require_regular_ticks(recording, experiment.scene());
  // What Python and the script commanded together is in the recorded inputs, which come after the script.
  const std::string& driver = recording.meta().driver;
  const bool has_inputs = driver != "script";
  simulation::Simulation simulation(experiment, threads,
                                    /*scripted_actuators=*/!has_inputs || driver == "python");
  require_same_physics(recording, simulation);
  if (has_inputs) require_matching_inputs(recording, simulation);
  evaluate(experiment, simulation.snapshot());
  VerificationResult result;
  for (std::size_t frame = 0; frame < recording.frames(); ++frame) {
    while (simulation.snapshot().tick < recording.ticks()[frame]) {
      const std::uint64_t next = simulation.snapshot().tick + 1;
      if (has_inputs && next >= recording.input_tick_count()) return result;  // the run was killed
      run_tick(experiment, simulation,
               has_inputs ? std::optional(recording.read_inputs(next)) : std::nullopt);
      if ((result.interrupted = stop)) return result;
    }
    progress(simulation.snapshot().time_s);
    ++result.frames_compared;
    result.last_tick = simulation.snapshot().tick;
    if (simulation.snapshot().state_hash == recording.state_hashes()[frame]) {
      if (observe && !observe(simulation)) return result;
      continue;
    }
    result.first_different_tick = result.last_tick;
    result.difference = describe_difference(recording, frame, simulation);
    return result;
  }
  return result;
}

}  // namespace smartsurf::run
