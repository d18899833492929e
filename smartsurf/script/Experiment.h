// Loads an experiment script into a SceneSpec and runs its callbacks during the simulation.
//
// Scripts run in a sandbox (docs/experiments.md): no processes, no native code, file access only in the
// script's folder and the output folder, bounded instruction count and memory. The same script, options and
// seed make the same simulation calls in the same order. Not thread-safe. Every call may allocate.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/state/StateArchive.h"
#include "smartsurf/scene/NamedValues.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Variation.h"
#include "smartsurf/script/LoadOptions.h"
#include "smartsurf/script/SimulationInterface.h"

namespace smartsurf::script {

class Experiment {
 public:
  // Runs the script at `path` once to declare the scene. Throws scene::InputError, one line "FILE:LINE:
  // message", for any error in the script or in `options`; Interrupted as every call that runs the script.
  static Experiment load(const std::filesystem::path& path, LoadOptions options = {});

  Experiment(Experiment&&) noexcept;
  Experiment& operator=(Experiment&&) noexcept;
  ~Experiment();

  // The declared scene.
  const scene::SceneSpec& scene() const;
  // Between load() or restart() and start(), the scene may be changed into another one that the script could
  // have declared, with the same objects, channels and seed.
  scene::SceneSpec& mutable_scene();
  // The nuisances that the script and the options declare, ascending by name; none is drawn.
  const std::vector<scene::Variation>& variations() const;

  // The values that the script has passed to metric(name, value), by name, in order of first use.
  const scene::Metrics& metrics() const;

  // The callbacks of at() that the latest tick() ran, as "FILE:LINE" of their registration. Valid until the
  // next tick().
  const std::vector<std::string>& events() const;

  // True if the script has drawn random numbers so far.
  bool has_drawn() const;
  // True if start() runs on_reset.
  bool has_reset_hook() const;

  // Call once before the first tick: runs on_reset, if the script has such a hook. `simulation` must hold the
  // objects of scene() and outlive all calls of notify_departures, tick and finish. Throws as tick() does.
  void start(SimulationInterface& simulation);
  // Call before tick(): runs on_leave, in order, for each object that left the table in the previous tick.
  // Skips objects that are no longer alive. Throws as tick() does.
  void notify_departures(double t_s, std::uint64_t tick, std::span<const scene::ObjectId> departed);
  // Call once per control period, before actuators and physics advance. t_s is the simulated time, 0 at the
  // first tick. Runs the callbacks of at and every that are due, in order of time and then registration, then
  // on_tick. Throws scene::InputError for an error in the script; after that only finish() may be called.
  void tick(double t_s, std::uint64_t tick);
  // The functions by which the script judges the state. Call these after tick and physics, with the time and
  // tick of the new state. All throw as tick() does.
  struct InfoField {
    std::string name;
    int size = 1;  // 1: a number; kObjectStateSize: the state of an object
  };
  // Position, orientation (x y z w), velocity, angular velocity.
  static constexpr int kObjectStateSize = 13;
  bool has_reward() const;
  // The value of reward(); 0 without one.
  double reward(double t_s, std::uint64_t tick);
  bool declares_success() const;
  // When the goal was reached: the time that success() returns, or t_s if it returns true. nullopt if the
  // goal is not reached, or without success().
  std::optional<double> success(double t_s, std::uint64_t tick);
  // Sets the metrics that the script declares by a function to the function's value, NaN for nil.
  void update_metrics(double t_s, std::uint64_t tick);
  std::vector<InfoField> info_fields() const;
  // Writes the values of all info fields, in their order; NaN for nil and for removed objects.
  void info(double t_s, std::uint64_t tick, std::span<double> values);
  // episode.seconds; nullopt = unlimited.
  std::optional<double> episode_s() const;

  // The state of the script between two ticks: its variables, events, random numbers and metrics. save()
  // throws scene::InputError for what cannot be saved: functions, coroutines and files that the running
  // script has created. restore(): in an experiment loaded from the same script with the same options and
  // seed, that runs; throws scene::InputError if the state is not such a one, and the experiment is then good
  // for restart() only.
  void save(common::StateArchive&);
  void restore(common::StateArchive&);
  // Identifies the script's functions and the files that it has read while it loaded, except meshes: a state
  // fits experiments of equal value.
  std::uint64_t state_fingerprint() const;
  // Back to the state after loading, with another seed. Call start() next. Requires !has_drawn() after
  // loading.
  void restart(std::uint64_t seed);

  // Call after the last tick: runs on_finish. Further calls do nothing.
  void finish();

 private:
  struct Impl;
  explicit Experiment(std::unique_ptr<Impl>);
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartsurf::script
