#include "smartsurf/simulation/Environment.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "smartsurf/mesh/SolidLibrary.h"

namespace smartsurf::simulation {

Environment::Environment(EnvironmentOptions options)
    : options_(std::move(options)), solids_(std::make_shared<mesh::SolidLibrary>()) {
  load(options_.seed);
}

Environment::~Environment() = default;

void Environment::load(std::optional<std::uint64_t> seed) {
  script::LoadOptions load_options;
  load_options.overrides = options_.overrides;
  load_options.seed = seed;
  load_options.engine = options_.engine;
  load_options.solid_factory = solids_;
  script::Experiment experiment = script::Experiment::load(options_.experiment, std::move(load_options));
  simulation_.reset();
  experiment_.emplace(std::move(experiment));
  simulation_.emplace(*experiment_, options_.threads, /*scripted_actuators=*/true);
  end_tick_.reset();
  if (const auto seconds = experiment_->episode_s())
    end_tick_ = static_cast<std::uint64_t>(std::ceil(*seconds / scene().world.control_period_s - 1e-9));
}

void Environment::reset(std::uint64_t seed) { load(seed); }

void Environment::set_targets(int channel, std::span<const float> targets) noexcept {
  simulation_->actuator_array().set_targets(channel, targets);
}

StepResult Environment::step() {
  Simulation& s = *simulation_;
  s.run_script();
  for (int i = 0; i < s.scene().world.steps_per_tick(); ++i) {
    s.plan_actuators();
    s.step_physics();
    s.commit_actuators();
  }
  s.finish_tick();
  if (const auto object = s.first_non_finite())
    throw scene::InputError(scene().file + ": tick " + std::to_string(s.snapshot().tick) + ": object " +
                            std::to_string(*object) + " has a position or velocity that is not finite");
  s.sense();
  const double time_s = s.snapshot().time_s;
  const std::uint64_t tick = s.snapshot().tick;
  StepResult result;
  result.reward = experiment_->reward(time_s, tick);
  result.success = experiment_->success(time_s, tick);
  const ScriptRequests requests = s.take_requests();
  result.terminated = result.success || requests.stop || requests.quit;
  result.truncated = end_tick_ && tick >= *end_tick_;
  return result;
}

void Environment::info(std::span<double> values) {
  experiment_->info(simulation_->snapshot().time_s, simulation_->snapshot().tick, values);
}

std::size_t Environment::observation_size() const {
  std::size_t size = 0;
  for (const scene::ChannelData& channel : simulation_->sensors()) size += channel.values.size();
  return size;
}

void Environment::observe(std::span<float> values) const {
  auto out = values.begin();
  for (const scene::ChannelData& channel : simulation_->sensors())
    out = std::ranges::copy(channel.values, out).out;
}

}  // namespace smartsurf::simulation
