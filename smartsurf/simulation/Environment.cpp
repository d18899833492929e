#include "smartsurf/simulation/Environment.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <iterator>

#include "common/arithmetic/StandardArithmetic.h"
#include "common/memory/Prefetch.h"
#include "smartsurf/mesh/SolidLibrary.h"
#include "smartsurf/simulation/EpisodeRandom.h"
#include "smartsurf/simulation/Nuisances.h"
#include "smartsurf/world/StateHash.h"

namespace smartsurf::simulation {
namespace {

struct Header {
  std::array<char, 8> magic{'s', 'm', 'a', 'r', 't', 's', 'r', 'a'};
  std::uint64_t hash = 0;  // of all that follows, to the end of the state
  std::uint64_t fingerprint = 0, seed = 0;
};
constexpr std::size_t kHashed = offsetof(Header, fingerprint);

std::uint64_t hash_of(std::string_view text) {
  world::StateHash hash;
  std::vector<float> words((text.size() + sizeof(float) - 1) / sizeof(float));
  if (!text.empty()) std::memcpy(words.data(), text.data(), text.size());
  hash.add(words);
  hash.add(static_cast<std::uint32_t>(text.size()));
  return hash.value();
}

// Stands for the files of meshes, which may refer to others.
std::uint64_t hash_of(const scene::Solid& solid) {
  std::string bytes;
  common::StateArchive archive(bytes);
  const auto add = [&archive](std::vector<Eigen::Vector3f> points) {
    for (Eigen::Vector3f& p : points) archive.bytes(p.data(), 3 * sizeof(float));
  };
  add(solid.vertices);
  for (const scene::ConvexHull& hull : solid.hulls) add(hull.vertices);
  for (const double number : solid.inertia.reshaped()) archive.value(number);
  archive.value(solid.volume);
  return hash_of(bytes);
}

// Differs for everything that makes a saved state useless except the engine: another script, file or option.
std::uint64_t fingerprint_of(const script::Experiment& experiment) {
  const scene::SceneSpec& scene = experiment.scene();
  std::string text = scene.source;
  for (const scene::OptionSpec& option : scene.options) text += '\0' + option.name + '=' + option.value;
  for (const scene::Variation& v : experiment.variations()) text += '\0' + v.name + '=' + to_text(v);
  for (const scene::Extension& extension : scene.surface.extensions())
    text += '\0' + extension.name + '=' + extension.hash;
  const scene::Solid* last = nullptr;
  for (const scene::ObjectSpec& object : scene.objects) {
    if (object.solid && object.solid.get() != last) text += '\0' + std::to_string(hash_of(*object.solid));
    last = object.solid.get();
  }
  return hash_of(text) ^ experiment.state_fingerprint();
}

// Sets the parameters in the scene. Throws scene::InputError, one clause.
void apply(const std::vector<std::pair<std::string, std::vector<double>>>& values, scene::SceneSpec& scene) {
  std::vector<SceneParameter> parameters;
  for (const auto& [name, numbers] : values) {
    parameters.push_back(SceneParameter::find(scene, name));
    if (numbers.size() != parameters.back().size())
      throw scene::InputError("parameter '" + name + "': the script declares another number of objects");
    parameters.back().set(scene, numbers);
  }
  for (const SceneParameter& parameter : parameters) parameter.check(scene);
}

// The names, with their sizes where these are not 1; "none" without any.
template <class Named, class Size>
std::string names_of(const std::vector<Named>& all, const Size& size) {
  std::string text;
  for (const Named& one : all) {
    text += (text.empty() ? "" : ", ") + one.name;
    if (size(one) != 1) text += fmt::format(" ({} numbers)", size(one));
  }
  return text.empty() ? "none" : text;
}

// Fetches memory part by part between other work: a core that asks for more than some 16 lines at once waits.
class Prefetch {
 public:
  Prefetch(std::span<const std::byte> memory, int parts)
      : rest_(memory), part_bytes_(memory.size() / parts / kLineBytes * kLineBytes + kLineBytes) {}
  void fetch_part() {
    const auto part = rest_.first(std::min(part_bytes_, rest_.size()));
    rest_ = rest_.subspan(part.size());
    for (std::size_t at = 0; at < part.size(); at += kLineBytes) common::prefetch(part.data() + at);
  }

 private:
  static constexpr std::size_t kLineBytes = 64;
  std::span<const std::byte> rest_;
  std::size_t part_bytes_;
};

}  // namespace

Environment::Environment(EnvironmentOptions options, Start start)
    : options_(std::move(options)),
      solids_(std::make_shared<mesh::SolidLibrary>(mesh::decomposition_folder())) {
  const common::StandardArithmetic arithmetic;
  adopt(loaded(options_.seed));
  Nuisances::check(scene(), experiment_->variations());
  if (start == Start::kNow) start_simulation();
}

Environment::~Environment() = default;

script::Experiment Environment::loaded(std::optional<std::uint64_t> seed) const {
  script::LoadOptions load_options;
  load_options.overrides = options_.overrides;
  load_options.seed = seed;
  load_options.engine = options_.engine;
  load_options.solid_factory = solids_;
  load_options.source = options_.source;
  load_options.savable = true;
  script::Experiment experiment = script::Experiment::load(options_.experiment, std::move(load_options));
  if (options_.fixed_channels && experiment_) require_same_channels(experiment);
  return experiment;
}

void Environment::adopt(script::Experiment experiment) {
  simulation_.reset();
  experiment_.emplace(std::move(experiment));
  fingerprint_ = fingerprint_of(*experiment_);
  applied_values_.clear();
  draws_while_loading_ = experiment_->has_drawn();
  declared_.reset();
  if (!experiment_->variations().empty()) declared_ = scene();
}

void Environment::require_same_channels(const script::Experiment& other) const {
  const std::string difference = channel_difference(other);
  if (!difference.empty())
    throw scene::InputError(scene().file + ": with seed " + std::to_string(other.scene().world.seed) +
                            ", the script declares another surface, other channels or another info{}: " +
                            difference + "; all episodes must have the same");
}

std::string Environment::channel_difference(const script::Experiment& other) const {
  const scene::SurfaceSpec &a = scene().surface, &b = other.scene().surface;
  const auto differ = [](const std::string& what, const auto& own, const auto& others, const auto& size) {
    const std::string had = names_of(own, size), has = names_of(others, size);
    return had == has ? "" : what + " " + has + ", not " + had;
  };
  if (a.rows != b.rows || a.columns != b.columns) {
    const auto cells = [](const auto& s) { return fmt::format("{} × {}", s.rows, s.columns); };
    return "rows × columns are " + cells(b) + ", not " + cells(a);
  }
  std::string difference = differ("the actuator channels are", a.actuator_channels(), b.actuator_channels(),
                                  [](const auto&) { return 1; });
  if (difference.empty())
    difference = differ("the sensor channels are", a.observed_channels(), b.observed_channels(),
                        [](const auto& c) { return c.components; });
  if (difference.empty())
    difference = differ("the fields of info{} are", info_fields(*experiment_), info_fields(other),
                        [](const auto& field) { return field.size; });
  return difference;
}

void Environment::start_episode(std::uint64_t seed, const Values& values,
                                std::optional<script::Experiment> experiment) {
  ending_.reset();
  stopped_ = false;
  reached_s_.reset();
  simulation_.reset();
  if (draws_while_loading_ && !experiment) experiment = loaded(seed);
  if (experiment) {
    adopt(std::move(*experiment));
  } else {
    if (declared_) experiment_->mutable_scene() = *declared_;
    experiment_->restart(seed);
  }
  applied_values_ = values;
  if (!values.empty()) {
    if (!declared_) declared_ = scene();
    try {
      apply(values, experiment_->mutable_scene());
    } catch (const scene::InputError& error) {
      throw scene::InputError(scene().file + ": " + error.what());
    }
  }
  start_simulation();
}

void Environment::start_simulation() try {
  const common::StandardArithmetic arithmetic;
  failed_ = false;
  occupancy_ = scene().surface.occupancy();
  simulation_ = std::make_unique<Simulation>(*experiment_, options_.threads,
                                             /*scripted_actuators=*/!has_controller());
  engine_version_ = simulation_->engine().version();
  simulation_->complete_snapshots_when_asked();
  if (options_.controller) {
    if (!controller_) controller_.emplace(options_.controller);
    controller_->start_episode(scene());
  }
  experiment_->update_metrics(0.0, 0);
  ask_for_success();
  end_tick_ = options_.max_ticks;
  if (const auto seconds = experiment_->episode_s())
    end_tick_ =
        std::min(end_tick_.value_or(UINT64_MAX),
                 static_cast<std::uint64_t>(std::ceil(*seconds / scene().world.control_period_s - 1e-9)));
} catch (...) {
  simulation_.reset();
  throw;
}

void Environment::reset(std::uint64_t seed) {
  const common::StandardArithmetic arithmetic;
  if (ranges_.empty()) return start_episode(seed, set_values_);
  require_valid_ranges();
  start_episode(seed, draw_values(seed));
}

// Each is valid at its ends; together, where all are at theirs.
void Environment::require_valid_ranges() {
  if (ranges_are_valid_) return;
  for (const auto end : {&Range::low, &Range::high}) {
    Values values = set_values_;
    for (const Range& range : ranges_) values.emplace_back(range.parameter.name(), range.*end);
    require_valid(values);
  }
  ranges_are_valid_ = true;
}

Environment::Values Environment::draw_values(std::uint64_t seed) const {
  Values values = set_values_;
  for (const auto& [parameter, low, high] : ranges_) {
    std::vector<double> drawn(low.size());
    draw_parameter(seed, parameter.name(), parameter.is_whole(), low, high, drawn);
    values.emplace_back(parameter.name(), std::move(drawn));
  }
  return values;
}

SceneParameter Environment::find_parameter(std::string_view name) const {
  try {
    return SceneParameter::find(scene(), name);
  } catch (const scene::InputError& error) {
    throw scene::InputError(scene().file + ": " + error.what());
  }
}

std::vector<double> Environment::parameter(const SceneParameter& parameter) const {
  const auto is_drawn = [&](const auto& value) {
    return std::ranges::any_of(ranges_, [&](const Range& r) { return r.parameter.name() == value.first; });
  };
  // The values of the next episode that differ from this one's. Drawn values apply after those that are set.
  Values changes;
  std::ranges::copy_if(set_values_, std::back_inserter(changes), [&](const auto& value) {
    return std::ranges::find(applied_values_, value) == applied_values_.end();
  });
  std::vector<double> numbers(parameter.size());
  if (changes.empty()) {
    parameter.get(scene(), numbers);
    return numbers;
  }
  std::ranges::copy_if(applied_values_, std::back_inserter(changes), is_drawn);
  scene::SceneSpec next = scene();
  simulation::apply(changes, next);
  parameter.get(next, numbers);
  return numbers;
}

// Refuses values with which no episode could start, or with other channels.
void Environment::require_valid(const Values& values) const {
  try {
    scene::SceneSpec next = declared();
    apply(values, next);
    if (!have_same_channels(declared(), next))
      throw scene::InputError(
          "parameter '" + values.back().first +
          "': the value changes the range of a channel: give it to the script by an option");
    validate_surface(next);
  } catch (const scene::InputError& error) {
    throw scene::InputError(scene().file + ": " + error.what());
  }
}

void Environment::set_parameter(const SceneParameter& parameter, std::span<const double> numbers) {
  const common::StandardArithmetic arithmetic;
  const auto is_this = [&](const auto& value) { return value.first == parameter.name(); };
  Values values = set_values_;
  std::erase_if(values, is_this);
  values.emplace_back(parameter.name(), std::vector<double>(numbers.begin(), numbers.end()));
  require_valid(values);
  set_values_ = std::move(values);
  ranges_are_valid_ = false;
}

void Environment::randomise(const SceneParameter& parameter, std::span<const double> low,
                            std::span<const double> high) {
  const common::StandardArithmetic arithmetic;
  const auto is_this = [&](const Range& range) { return range.parameter.name() == parameter.name(); };
  for (const std::span<const double> end : {low, high}) {
    if (end.empty()) continue;
    Values values = set_values_;
    values.emplace_back(parameter.name(), std::vector<double>(end.begin(), end.end()));
    require_valid(values);
  }
  std::erase_if(ranges_, is_this);
  if (!low.empty()) ranges_.push_back({parameter, {low.begin(), low.end()}, {high.begin(), high.end()}});
  ranges_are_valid_ = false;
}

Environment::ParameterSettings Environment::parameter_settings() const {
  ParameterSettings settings{set_values_, {}};
  for (const auto& [parameter, low, high] : ranges_) settings.ranges.push_back({parameter.name(), low, high});
  return settings;
}

void Environment::set_parameter_settings(ParameterSettings settings) {
  std::vector<Range> ranges;
  for (auto& [name, low, high] : settings.ranges) {
    const SceneParameter parameter = find_parameter(name);
    if (low.size() != parameter.size() || high.size() != parameter.size())
      throw scene::InputError(scene().file + ": parameter '" + name + "' has another number of values");
    ranges.push_back({parameter, std::move(low), std::move(high)});
  }
  if (!settings.values.empty()) require_valid(settings.values);
  set_values_ = std::move(settings.values);
  ranges_ = std::move(ranges);
  ranges_are_valid_ = false;
}

bool Environment::place(scene::ObjectId id, const scene::ObjectStateUpdate& update) {
  const common::StandardArithmetic arithmetic;
  return running().place(id, update);
}

bool Environment::set_wrench(scene::ObjectId id, const surface::Wrench& wrench) {
  const common::StandardArithmetic arithmetic;
  return running().set_wrench(id, wrench);
}

void Environment::refuse_controller(const char* call) const {
  if (options_.controller)
    throw scene::InputError(scene().file + ": " + call + ": the state of a controller cannot be saved");
}

std::string Environment::save() {
  refuse_controller("save");
  Simulation& s = running();
  std::string bytes(sizeof(Header), '\0');
  common::StateArchive archive(bytes);
  archive(applied_values_, ending_, stopped_, reached_s_);
  experiment_->save(archive);
  s.archive(archive);
  Header header{.fingerprint = fingerprint_ ^ hash_of(engine_version_), .seed = seed()};
  std::memcpy(bytes.data(), &header, sizeof header);
  header.hash = hash_of(std::string_view(bytes).substr(kHashed));
  std::memcpy(bytes.data(), &header, sizeof header);
  return bytes;
}

// Changes nothing until the whole state is known to be of this experiment.
void Environment::restore(std::string_view bytes) {
  const common::StandardArithmetic arithmetic;
  refuse_controller("restore");
  Header header;
  common::StateArchive start(bytes.substr(0, std::min(bytes.size(), sizeof header)));
  const std::string prefix = scene().file + ": restore: ";
  if (bytes.size() < sizeof header || (start(header), header.magic != Header().magic))
    throw scene::InputError(prefix + "these bytes are not a saved state");
  if (header.hash != hash_of(bytes.substr(kHashed))) throw scene::InputError(prefix + "the state is damaged");
  common::StateArchive archive(bytes.substr(sizeof header));
  Values values;
  std::optional<Ending> ending;
  bool stopped = false;
  std::optional<double> reached_s;
  archive(values, ending, stopped, reached_s);
  // Seed and parameters also determine faults, actuators, shapes, and the numbers that the script draws while
  // it loads.
  const bool restarts = !simulation_ || header.seed != seed() || values != applied_values_;
  std::optional<script::Experiment> experiment;
  if (restarts && draws_while_loading_) experiment = loaded(header.seed);
  const std::uint64_t fingerprint = experiment ? fingerprint_of(*experiment) : fingerprint_;
  const auto require_same_experiment = [&] {
    if (header.fingerprint != (fingerprint ^ hash_of(engine_version_)))
      throw scene::InputError(prefix + "the state is of another experiment, file, option, engine or version");
  };
  const bool has_engine = !engine_version_.empty();  // since the first episode that could start
  if (has_engine) require_same_experiment();
  if (restarts) start_episode(header.seed, values, std::move(experiment));
  if (!has_engine) require_same_experiment();
  failed_ = true;  // until everything is restored
  experiment_->restore(archive);
  simulation_->archive(archive);
  ending_ = std::move(ending);
  stopped_ = stopped;
  reached_s_ = reached_s;
  failed_ = false;
}

const Simulation& Environment::simulation() const {
  if (!simulation_) throw scene::InputError(scene().file + ": the episode could not start: reset it");
  return *simulation_;
}

Simulation& Environment::running() {
  if (!has_running_episode()) throw scene::InputError(scene().file + ": the episode has failed: reset it");
  return *simulation_;
}

void Environment::set_targets(int channel, std::span<const float> targets) {
  const common::StandardArithmetic arithmetic;
  running().actuator_array().set_targets(channel, targets);
}

template <class Work>
auto Environment::end_on_error(const Work& work) {
  try {
    return work();
  } catch (const std::exception& error) {
    if (!failed_) end_failed(error.what());
    throw;
  }
}

void Environment::finish() {
  running();
  end_on_error([&] { experiment_->finish(); });
  end("done");
}

Verdict Environment::verdict() const {
  return judge(*experiment_, reached_s_, ending_ ? ending_->stop_success : std::nullopt,
               simulation().partial_snapshot().time_s);
}

bool Environment::has_succeeded() const { return reached_s_ || (ending_ && verdict().success == true); }

// Asks success() about the latest state.
void Environment::ask_for_success() {
  const scene::Snapshot& state = simulation_->partial_snapshot();
  const std::optional<double> reached_s = experiment_->success(state.time_s, state.tick);
  if (!reached_s_) reached_s_ = reached_s;
}

void Environment::end(std::string outcome, std::optional<bool> stop_success) {
  if (!ending_) ending_ = Ending{std::move(outcome), stop_success};
}

// Also after another end, before or in on_finish. What the script said of success stays.
void Environment::end_failed(std::string outcome) {
  failed_ = true;
  ending_ = Ending{std::move(outcome), ending_ ? ending_->stop_success : std::nullopt};
}

std::span<const float> Environment::controller_targets() const {
  return controller_ ? controller_->targets() : std::span<const float>();
}

// Returns false if the controller has left.
bool Environment::advance(std::span<const std::byte> prefetched) {
  Simulation& s = running();
  const int steps = s.scene().world.steps_per_tick();
  Prefetch prefetch(prefetched, 3 * steps + 2);
  s.run_script();
  prefetch.fetch_part();
  if (controller_ && !controller_->command(s)) return false;
  for (int i = 0; i < steps; ++i) {
    s.plan_actuators();
    prefetch.fetch_part();
    if (!s.step_physics()) break;
    prefetch.fetch_part();
    s.commit_actuators();
    prefetch.fetch_part();
  }
  if (const auto failure = s.failure()) {
    end_failed(*failure);
    throw scene::InputError(scene().file + ": " + *failure);
  }
  s.finish_tick();
  s.sense();
  prefetch.fetch_part();
  experiment_->update_metrics(s.partial_snapshot().time_s, s.partial_snapshot().tick);
  return true;
}

StepResult Environment::step(std::span<const std::byte> prefetched) {
  const common::StandardArithmetic arithmetic;
  Simulation& s = running();
  StepResult result;
  const bool has_advanced = end_on_error([&] {
    const bool advanced = advance(prefetched);
    result.reward = experiment_->reward(s.partial_snapshot().time_s, s.partial_snapshot().tick);
    ask_for_success();
    return advanced;
  });
  const ScriptRequests requests = s.take_requests();
  result.truncated = !has_advanced || (end_tick_ && s.partial_snapshot().tick >= *end_tick_);
  // As in Run, which goes on after success().
  if (result.truncated) end(has_advanced ? "done" : "the controller exited");
  if (requests.stop || requests.quit) {
    stopped_ = true;
    end(outcome_of(requests), requests.success);
  }
  result.terminated = stopped_ || reached_s_;
  result.success = has_succeeded();
  return result;
}

std::vector<script::Experiment::InfoField> Environment::info_fields(const script::Experiment& experiment) {
  std::vector<script::Experiment::InfoField> fields = experiment.info_fields();
  for (const scene::Variation& v : experiment.variations()) fields.push_back({"varied." + v.name, 1});
  return fields;
}

void Environment::info(std::span<double> values) {
  const scene::Snapshot& snapshot = running().partial_snapshot();
  const std::vector<scene::Variation>& vary = simulation_->nuisances();
  end_on_error(
      [&] { experiment_->info(snapshot.time_s, snapshot.tick, values.first(values.size() - vary.size())); });
  std::ranges::transform(vary, values.last(vary.size()).begin(),
                         [](const auto& v) { return v.drawn.value_or(NAN); });
}

std::size_t Environment::observation_size() const {
  std::size_t planes = 0;
  for (const scene::SensorChannel& channel : scene().surface.observed_channels())
    planes += channel.components;
  return planes * scene().surface.cell_count();
}

void Environment::observe(std::span<float> values) const {
  float* out = values.data();
  for (const scene::ChannelData& channel : simulation().sensors())
    out = std::copy_n(channel.values.data(), channel.values.size(), out);
  std::ranges::copy(occupancy_, out);
}

}  // namespace smartsurf::simulation
