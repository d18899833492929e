// An experiment script: loads it into a SceneSpec and runs its callbacks during the simulation.
//
// Scripts run in a sandbox (docs/experiments.md): no processes, no native code, files only beside the script
// and in the output folder, bounded instructions and memory. The same script, options and seed make the same
// calls to the simulation in the same order. Not thread-safe. Every call allocates.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/SolidFactory.h"
#include "smartsurf/script/SimulationInterface.h"

namespace smartsurf::script {

struct LoadOptions {
  // --set name=value, in order; the last of a name wins.
  std::vector<std::pair<std::string, std::string>> overrides;
  std::optional<std::uint64_t> seed;  // --seed: wins over world.seed
  std::optional<std::string> source;  // the script itself, instead of what its file holds
  std::shared_ptr<scene::SolidFactory>
      solid_factory;    // makes what mesh and hull ask for; none: both are refused
  bool unsafe = false;  // --unsafe: the whole of Lua's standard library, native modules included
  std::filesystem::path output_folder;  // where the script may write files; empty = nowhere
  std::function<void(std::string_view)>
      print_output;  // takes what print and io.write say; stdout where absent
  std::function<void(std::string_view)>
      report_warning;  // takes lines for the author's eye; stderr where absent

  std::uint64_t load_budget = 500'000'000;     // Lua instructions to load the script
  std::uint64_t callback_budget = 50'000'000;  // and in one call of a timed function
  std::size_t memory_limit = std::size_t{1} << 30;
};

class Experiment {
 public:
  // Runs the script at `path` once, which declares the scene. Throws scene::InputError, one line
  // "FILE:LINE: message", for any mistake in the script or in `options`.
  static Experiment load(const std::filesystem::path& path, LoadOptions options = {});

  Experiment(Experiment&&) noexcept;
  Experiment& operator=(Experiment&&) noexcept;
  ~Experiment();

  const scene::SceneSpec& scene() const;  // of the load; does not change while the experiment runs
  bool has_callbacks() const;             // whether tick() or finish() would ever call the script

  // What the script has measured so far with metric(name, value), in the order of its names' first use.
  const std::vector<std::pair<std::string, double>>& metrics() const;

  // Before the first tick: `host` holds the objects of scene(), and outlives the calls of tick and finish.
  void start(SimulationInterface& simulation);
  // Before the tick: runs on_leave for each of these objects, in their order; it left the table in the tick
  // before, and is still alive. Throws as tick() does.
  void notify_departures(double t_s, std::uint64_t tick, std::span<const scene::ObjectId> departed);
  // Once a control period, before actuators and physics move; t_s is the simulated time then, 0 for the
  // first. Runs what is due: at and every in order of their times (in order of registration where equal),
  // then on_tick. Throws scene::InputError for a mistake in the script; the experiment is then over, but
  // finish() may be called.
  void tick(double t_s, std::uint64_t tick);
  // After the last tick: runs on_finish. A second call does nothing.
  void finish();

 private:
  struct Impl;
  explicit Experiment(std::unique_ptr<Impl>);
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartsurf::script
