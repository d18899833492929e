#include "smartsurf/run/Verify.h"

#include <fmt/format.h>
#include <unistd.h>

#include <bit>
#include <cstdint>
#include <cstring>
#include <filesystem>

#include "smartsurf/mesh/SolidLibrary.h"
#include "smartsurf/run/Simulation.h"

namespace smartsurf::run {
namespace {

namespace fs = std::filesystem;

// Where the script may write while it runs again; nobody wants those files.
class ScratchFolder {
 public:
  ScratchFolder() : path_((fs::temp_directory_path() / "smartsurf-verify-XXXXXX").string()) {
    if (::mkdtemp(path_.data()) == nullptr)
      throw std::runtime_error("cannot make a folder in " + fs::temp_directory_path().string());
  }
  ~ScratchFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  fs::path path() const { return path_; }

 private:
  std::string path_;
};

[[noreturn]] void refuse(const record::Recording& recording, const std::string& why) {
  throw scene::InputError(fmt::format("{}: cannot be run again: {}", recording.path().string(), why));
}

void require_repeatable(const record::Recording& recording, bool unsafe) {
  if (const auto tick = recording.touched_by_hand())
    refuse(recording, fmt::format("it was touched by hand after tick {}", *tick));
  if (recording.frames() == 0) refuse(recording, "it holds no frames");
  if (recording.meta().driver != "script" && recording.input_ticks() == 0)
    refuse(recording, "it does not hold what the controller told the actuators");
  if (recording.meta().unsafe && !unsafe)
    refuse(recording, "its script ran with --unsafe and may do anything again; give --unsafe to allow that");
}

void require_fitting_inputs(const record::Recording& recording, const Simulation& simulation) {
  std::size_t values = 0;
  for (const record::Channel& channel : simulation.actuators()) values += channel.values.size();
  if (recording.inputs(0).size() != values)
    refuse(recording, fmt::format("it holds {} actuator values a tick, and its experiment now has {}",
                                  recording.inputs(0).size(), values));
}

script::Experiment load_again(const record::Recording& recording, const fs::path& scratch) {
  script::LoadOptions load;
  for (const auto& setting : recording.meta().set) load.set.emplace_back(setting.name, setting.value);
  load.seed = recording.spec().world.seed;
  load.unsafe = recording.meta().unsafe;
  load.text = recording.spec().text;
  load.output_folder = scratch;
  load.solids = std::make_shared<mesh::SolidLibrary>();
  load.print = load.note = [](std::string_view) {};
  return script::Experiment::load(recording.spec().file, std::move(load));
}

// All channels one after another, as they were recorded.
void actuate(Simulation& simulation, std::span<const float> inputs) {
  int channel = 0;
  for (const record::Channel& told : simulation.actuators()) {
    simulation.actuate(channel++, inputs.first(told.values.size()));
    inputs = inputs.subspan(told.values.size());
  }
}

void advance(Simulation& simulation, std::optional<std::span<const float>> inputs) {
  simulation.run_script();
  if (inputs) actuate(simulation, *inputs);
  for (int i = simulation.scene().world.steps_per_tick(); i > 0; --i) {
    simulation.plan_cells();
    simulation.step_physics();
    simulation.move_cells();
  }
  simulation.look();
  simulation.sense();
  simulation.take_requests();
}

template <class Numbers>
bool same_bits(const Numbers& a, const Numbers& b) {
  return std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]) == 0;
}

std::string text(const std::array<float, 3>& v) { return fmt::format("({}, {}, {})", v[0], v[1], v[2]); }
std::string text(const std::array<float, 4>& q) {
  return fmt::format("({}, {}, {}, {})", q[0], q[1], q[2], q[3]);
}

template <class Rows>
std::optional<std::string> compare(const char* what, const Rows& recorded, std::size_t i, const Rows& now,
                                   std::size_t j) {
  if (same_bits(recorded[i], now[j])) return std::nullopt;
  return fmt::format("{} {} was recorded, {} comes out now", what, text(recorded[i]), text(now[j]));
}

std::string name_of(const std::vector<scene::ObjectSpec>& catalogue, scene::ObjectId id) {
  const std::string& label = catalogue[id].label;
  return label.empty() ? fmt::format("object {}", id) : fmt::format("object {} ('{}')", id, label);
}

std::optional<std::string> object_difference(const scene::Snapshot& recorded, const scene::Snapshot& now,
                                             const std::vector<scene::ObjectSpec>& catalogue) {
  for (std::size_t i = 0; i < recorded.objects() || i < now.objects(); ++i) {
    if (i >= now.objects() || (i < recorded.objects() && recorded.id[i] < now.id[i]))
      return fmt::format("object {} was there, and is not now", recorded.id[i]);
    if (i >= recorded.objects() || now.id[i] < recorded.id[i])
      return fmt::format("{} is there now, and was not", name_of(catalogue, now.id[i]));
    auto found = compare("position", recorded.position, i, now.position, i);
    if (!found) found = compare("orientation", recorded.orientation, i, now.orientation, i);
    if (!found) found = compare("velocity", recorded.velocity, i, now.velocity, i);
    if (found) return fmt::format("{}: {}", name_of(catalogue, now.id[i]), *found);
  }
  return std::nullopt;
}

std::optional<std::string> pin_difference(const scene::Snapshot& recorded, const scene::Snapshot& now,
                                          int columns) {
  for (std::size_t i = 0; i < recorded.height.size() && i < now.height.size(); ++i)
    if (std::bit_cast<std::uint32_t>(recorded.height[i]) != std::bit_cast<std::uint32_t>(now.height[i]))
      return fmt::format("pin row {}, column {}: height {} was recorded, {} comes out now",
                         i / static_cast<std::size_t>(columns), i % static_cast<std::size_t>(columns),
                         recorded.height[i], now.height[i]);
  return std::nullopt;
}

// What differs first in a frame whose hashes differ.
std::string difference(const record::Recording& recording, std::size_t frame, const Simulation& simulation) {
  const scene::Snapshot recorded = recording.snapshot(frame), &now = simulation.snapshot();
  if (recording.has_objects())
    if (auto found = object_difference(recorded, now, simulation.catalogue())) return *found;
  if (auto found = pin_difference(recorded, now, simulation.scene().surface.columns)) return *found;
  return fmt::format(
      "the state's hash {:016x} was recorded, {:016x} comes out now; nothing that is recorded differs",
      recorded.state_hash, now.state_hash);
}

}  // namespace

Verdict verify(const record::Recording& recording, int threads, bool unsafe, const std::atomic<bool>& stop,
               const std::function<void(double)>& progress) {
  require_repeatable(recording, unsafe);
  const ScratchFolder scratch;
  script::Experiment experiment = load_again(recording, scratch.path());
  const bool scripted = recording.meta().driver == "script";
  Simulation simulation(experiment, threads, scripted);
  if (!scripted) require_fitting_inputs(recording, simulation);
  Verdict verdict;
  for (std::size_t frame = 0; frame < recording.frames(); ++frame) {
    while (simulation.snapshot().tick < recording.tick()[frame]) {
      const std::uint64_t next = simulation.snapshot().tick + 1;
      if (!scripted && next >= recording.input_ticks()) return verdict;  // the run was killed
      advance(simulation, scripted ? std::nullopt : std::optional(recording.inputs(next)));
      if ((verdict.interrupted = stop)) return verdict;
    }
    progress(simulation.snapshot().time_s);
    ++verdict.frames;
    verdict.last_tick = simulation.snapshot().tick;
    if (simulation.snapshot().state_hash == recording.hash()[frame]) continue;
    verdict.different_tick = verdict.last_tick;
    verdict.difference = difference(recording, frame, simulation);
    return verdict;
  }
  return verdict;
}

}  // namespace smartsurf::run
