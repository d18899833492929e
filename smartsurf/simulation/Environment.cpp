#include "smartsurf/simulation/Environment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <iterator>

#include "smartsurf/mesh/SolidLibrary.h"
#include "smartsurf/world/StateHash.h"

namespace smartsurf::simulation {
namespace {

struct Header {
  std::array<char, 8> magic{'s', 'm', 'a', 'r', 't', 's', 'r', '4'};
  std::uint64_t fingerprint = 0, seed = 0;
  std::uint64_t hash = 0;  // of all that follows
};

std::uint64_t hash_of(std::string_view text) {
  world::StateHash hash;
  std::vector<float> words((text.size() + sizeof(float) - 1) / sizeof(float));
  if (!text.empty()) std::memcpy(words.data(), text.data(), text.size());
  hash.add(words);
  hash.add(static_cast<std::uint32_t>(text.size()));
  return hash.value();
}

}  // namespace

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
  load_options.source = options_.source;
  load_options.savable = true;
  script::Experiment experiment = script::Experiment::load(options_.experiment, std::move(load_options));
  simulation_.reset();
  experiment_.emplace(std::move(experiment));
  draws_while_loading_ = experiment_->has_drawn();
  start_simulation();
}

void Environment::start_simulation() {
  failed_ = false;
  simulation_.emplace(*experiment_, options_.threads, /*scripted_actuators=*/true);
  experiment_->update_metrics(0.0, 0);
  end_tick_ = options_.max_ticks;
  if (const auto seconds = experiment_->episode_s())
    end_tick_ =
        std::min(end_tick_.value_or(UINT64_MAX),
                 static_cast<std::uint64_t>(std::ceil(*seconds / scene().world.control_period_s - 1e-9)));
}

void Environment::reset(std::uint64_t seed) {
  if (draws_while_loading_) return load(seed);
  simulation_.reset();
  experiment_->restart(seed);
  start_simulation();
}

// Differs for everything that makes a saved state useless: another program, script or option.
std::uint64_t Environment::fingerprint() const {
  std::string text = simulation().engine().version() + '\0' + scene().source;
  for (const scene::OptionSpec& option : scene().options) text += '\0' + option.name + '=' + option.value;
  for (const scene::Extension& extension : scene().surface.extensions())
    text += '\0' + extension.name + '=' + extension.hash;
  return hash_of(text) ^ experiment_->state_fingerprint();
}

std::string Environment::save() {
  Simulation& s = running();
  std::string payload;
  common::StateArchive archive(payload);
  experiment_->save(archive);
  s.archive(archive);
  Header header{.fingerprint = fingerprint(), .seed = seed(), .hash = hash_of(payload)};
  std::string bytes(reinterpret_cast<const char*>(&header), sizeof header);
  return bytes += payload;
}

void Environment::restore(std::string_view bytes) {
  Header header;
  common::StateArchive start(bytes.substr(0, std::min(bytes.size(), sizeof header)));
  const std::string prefix = scene().file + ": restore: ";
  if (bytes.size() < sizeof header || (start(header), header.magic != Header().magic))
    throw scene::InputError(prefix + "these bytes are not a saved state");
  if (header.fingerprint != fingerprint())
    throw scene::InputError(prefix + "the state is of another experiment, option, engine or version");
  const std::string_view payload = bytes.substr(sizeof header);
  if (header.hash != hash_of(payload)) throw scene::InputError(prefix + "the state is damaged");
  // What the seed determines besides the state: faults, and what the script draws while it loads.
  if (header.seed != seed()) reset(header.seed);
  failed_ = true;  // until everything is restored
  common::StateArchive archive(payload);
  experiment_->restore(archive);
  simulation_->archive(archive);
  failed_ = false;
}

const Simulation& Environment::simulation() const {
  if (!simulation_) throw scene::InputError(scene().file + ": the episode could not start: reset it");
  return *simulation_;
}

Simulation& Environment::running() {
  if (failed_) throw scene::InputError(scene().file + ": the episode has failed: reset it");
  if (!simulation_) throw scene::InputError(scene().file + ": the episode could not start: reset it");
  return *simulation_;
}

void Environment::set_targets(int channel, std::span<const float> targets) {
  running().actuator_array().set_targets(channel, targets);
}

void Environment::finish() {
  running();
  experiment_->finish();
}

void Environment::advance() {
  Simulation& s = running();
  failed_ = true;  // until the end of the tick
  s.run_script();
  for (int i = 0; i < s.scene().world.steps_per_tick(); ++i) {
    s.plan_actuators();
    if (!s.step_physics()) break;
    s.commit_actuators();
  }
  if (const auto failure = s.failure()) throw scene::InputError(scene().file + ": " + *failure);
  s.finish_tick();
  s.sense();
  experiment_->update_metrics(s.snapshot().time_s, s.snapshot().tick);
  failed_ = false;
}

StepResult Environment::step() {
  advance();
  Simulation& s = running();
  const double time_s = s.snapshot().time_s;
  const std::uint64_t tick = s.snapshot().tick;
  StepResult result;
  result.reward = experiment_->reward(time_s, tick);
  result.success = experiment_->success(time_s, tick).has_value();
  const ScriptRequests requests = s.take_requests();
  result.terminated = result.success || requests.stop || requests.quit;
  result.truncated = end_tick_ && tick >= *end_tick_;
  return result;
}

void Environment::info(std::span<double> values) {
  const scene::Snapshot& snapshot = running().snapshot();
  experiment_->info(snapshot.time_s, snapshot.tick, values);
}

std::size_t Environment::observation_size() const {
  std::size_t size = 0;
  for (const scene::ChannelData& channel : simulation().sensors()) size += channel.values.size();
  return size;
}

void Environment::observe(std::span<float> values) const {
  auto out = values.begin();
  for (const scene::ChannelData& channel : simulation().sensors())
    out = std::ranges::copy(channel.values, out).out;
}

}  // namespace smartsurf::simulation
