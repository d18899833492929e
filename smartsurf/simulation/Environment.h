// An experiment in this process, stepped by its caller: one episode after the other, each from a seed.
//
// Actuator targets go in, sensor readings, reward and ends of the episode come out, as for a learning
// environment. Independent of clocks, windows and shared memory. One thread at a time; different environments
// are independent.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "smartsurf/scene/NamedValues.h"
#include "smartsurf/simulation/ControllerLink.h"
#include "smartsurf/simulation/SceneParameter.h"
#include "smartsurf/simulation/Simulation.h"
#include "smartsurf/simulation/Verdict.h"

namespace smartsurf::simulation {

struct EnvironmentOptions {
  std::string experiment;             // path of the script
  std::optional<std::string> source;  // its text; nullopt: read the file
  scene::Overrides overrides;         // --set name=value
  std::optional<std::uint64_t> seed;  // of the first episode; nullopt: the script's
  std::optional<std::string> engine;
  int threads = 1;
  std::optional<std::uint64_t> max_ticks;  // after which an episode is truncated, besides episode.seconds
  // Commands the actuators in place of set_targets(), and restarts with each episode; null: none.
  std::shared_ptr<const common::ControllerFactory> controller;
  // For callers whose arrays have the sizes of the first episode: refuse seeds with which the script declares
  // another surface, other channels or another info{}.
  bool fixed_channels = false;
};

// The result of one step.
struct StepResult {
  double reward = 0.0;
  bool terminated = false;  // success(), stop() or quit() of the script, now or before
  bool truncated = false;   // episode.seconds or max_ticks are over
  bool success = false;     // Environment::has_succeeded()
};

class Environment {
 public:
  enum class Start { kNow, kLater };
  // Loads the experiment and starts its first episode, or leaves that to start(). Throws scene::InputError,
  // one line, for an error in the experiment or the options; as do the calls below that run the script.
  explicit Environment(EnvironmentOptions, Start = Start::kNow);
  ~Environment();
  // Call once, before the other functions, of an environment that is to start later.
  void start() { start_simulation(); }

  const scene::SceneSpec& scene() const { return experiment_->scene(); }
  const script::Experiment& experiment() const { return *experiment_; }
  // Throws scene::InputError if the episode could not start.
  const Simulation& simulation() const;
  std::uint64_t seed() const { return scene().world.seed; }
  // False if the episode could not start or has failed: only reset() and restore() may follow.
  bool has_running_episode() const { return simulation_ != nullptr && !failed_; }
  // Gives up the episode, as one that has failed.
  void fail() { failed_ = true; }

  // Starts the next episode with that seed. The result is that of a new environment with the seed. The script
  // runs again only if it draws random numbers while it loads; otherwise its variables return to their values
  // after loading.
  void reset(std::uint64_t seed);

  // The whole state between two steps, as bytes. Restored, in any environment of the same experiment, options
  // and version, for any number of threads, the simulation continues with the same bits. Both throw
  // scene::InputError: save() for what cannot be saved, restore() for bytes that are damaged or of another
  // experiment, which change nothing.
  std::string save();
  void restore(std::string_view);

  // The parameters of SceneParameter.h. Values apply from the next reset on, in the order of the calls, to
  // what the script declares: the episode is that of a script that declares them. All throw
  // scene::InputError, one line, and change nothing, for a name or a value that does not fit, and for a value
  // that changes a channel.
  SceneParameter find_parameter(std::string_view name) const;
  // The value of the next episode, if it is set, else of this one.
  std::vector<double> parameter(const SceneParameter&) const;
  void set_parameter(const SceneParameter&, std::span<const double> values);
  // True if this episode has parameter values that the script does not declare.
  bool has_parameters() const { return !applied_values_.empty(); }
  // Each reset draws the numbers from [low, high), independently, from streams of the episode's seed. Both
  // empty: no longer.
  void randomise(const SceneParameter&, std::span<const double> low, std::span<const double> high);

  // All that set_parameter() and randomise() have set, in the order in which it applies, and the same for
  // another environment of the experiment, of which it takes the place.
  using Values = std::vector<std::pair<std::string, std::vector<double>>>;
  struct NamedRange {
    std::string name;
    std::vector<double> low, high;
  };
  struct ParameterSettings {
    Values values;
    std::vector<NamedRange> ranges;
  };
  ParameterSettings parameter_settings() const;
  void set_parameter_settings(ParameterSettings);

  // Between two steps, as the script's teleport; observations follow with the next step. False if the object
  // is not alive.
  bool place(scene::ObjectId, const scene::ObjectStateUpdate&);
  // Force and torque about the object's origin, in the world frame, in each step until the next call or the
  // end of the episode.
  bool set_wrench(scene::ObjectId, const surface::Wrench&);

  // Sets the targets of one actuator channel: rows × columns, row-major, row 0 north. Clamps as ActuatorArray
  // does.
  void set_targets(int channel, std::span<const float> targets);
  // Advances by one control period. Throws scene::InputError also for a state that is not finite, and if the
  // controller fails. After an exception it throws until reset() or restore(). A controller that has left
  // ends the episode: truncated, and nothing moves any more. `prefetched`: memory that the caller will need
  // next, which is fetched meanwhile.
  StepResult step(std::span<const std::byte> prefetched = {});
  bool has_controller() const { return options_.controller != nullptr; }
  // The values that the controller has set in the latest step: channels × rows × columns; empty without one.
  std::span<const float> controller_targets() const;
  // Runs on_finish, whose metrics are final; once per episode, which ends.
  void finish();

  // True if success() has said so in this episode or, once it has ended, the verdict does.
  bool has_succeeded() const;
  // As of the latest step, or of finish(). Throws as simulation() does.
  Verdict verdict() const;
  // Why the episode has ended, one line: "done", "stopped by the script: …", or its error. "done" while it
  // runs.
  std::string outcome() const { return ending_ ? ending_->outcome : "done"; }

  // The values of info{}, and of the episode's nuisances as "varied.NAME".
  std::vector<script::Experiment::InfoField> info_fields() const { return info_fields(*experiment_); }
  // Their values, one after the other.
  void info(std::span<double> values);
  const scene::Metrics& metrics() const { return experiment_->metrics(); }

  // The readings of the surface's observed_channels(), one after the other, each components × rows × columns.
  std::size_t observation_size() const;
  void observe(std::span<float> values) const;
  std::span<const float> occupancy() const { return occupancy_; }  // SurfaceSpec::occupancy()
  // How the surface, the channels or the fields of info{} of another environment differ from this one's, one
  // clause; "" if its arrays mean the same.
  std::string channel_difference(const Environment& other) const {
    return channel_difference(*other.experiment_);
  }

 private:
  struct Range {
    SceneParameter parameter;
    std::vector<double> low, high;
  };

  script::Experiment loaded(std::optional<std::uint64_t> seed) const;
  void adopt(script::Experiment);
  void require_same_channels(const script::Experiment&) const;
  std::string channel_difference(const script::Experiment&) const;
  static std::vector<script::Experiment::InfoField> info_fields(const script::Experiment&);
  // `experiment`: as loaded with that seed, if it has been already.
  void start_episode(std::uint64_t seed, const Values&, std::optional<script::Experiment> experiment = {});
  void start_simulation();
  Values draw_values(std::uint64_t seed) const;
  void require_valid(const Values&) const;
  void require_valid_ranges();
  const scene::SceneSpec& declared() const { return declared_ ? *declared_ : scene(); }
  Simulation& running();
  bool advance(std::span<const std::byte> prefetched);
  void ask_for_success();
  void end(std::string outcome, std::optional<bool> stop_success = std::nullopt);
  void end_failed(std::string outcome);
  template <class Work>
  auto end_on_error(const Work&);
  void refuse_controller(const char* call) const;

  EnvironmentOptions options_;
  std::shared_ptr<scene::SolidFactory> solids_;
  std::optional<script::Experiment> experiment_;
  // Before the nuisances and parameter values of an episode, if there are any.
  std::optional<scene::SceneSpec> declared_;
  std::unique_ptr<Simulation> simulation_;  // refers to experiment_; null: the episode could not start
  std::vector<float> occupancy_;
  std::uint64_t fingerprint_ = 0;  // of experiment_
  std::string engine_version_;     // of the latest simulation
  std::optional<ControllerLink> controller_;
  bool draws_while_loading_ = false;
  Values set_values_;  // of the next episode
  std::vector<Range> ranges_;
  bool ranges_are_valid_ = false;  // together
  Values applied_values_;          // of this episode, which the scene has
  bool failed_ = false;            // in this episode
  std::optional<std::uint64_t> end_tick_;
  struct Ending {
    std::string outcome;
    std::optional<bool> stop_success;  // as stop() says
    void archive(common::StateArchive& a) { a(outcome, stop_success); }
  };
  std::optional<Ending> ending_;     // the first one of the episode
  bool stopped_ = false;             // by stop() or quit(), in this episode
  std::optional<double> reached_s_;  // what success() returned when it first said so
};

}  // namespace smartsurf::simulation
