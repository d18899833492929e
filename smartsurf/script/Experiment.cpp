#include "smartsurf/script/Experiment.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <filesystem>
#include <limits>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "common/files/FileKind.h"
#include "common/hash/Fnv.h"
#include "smartsurf/script/ScriptContext.h"
#include "smartsurf/script/lua/Interpreter.h"
#include "smartsurf/script/lua/MeteredLibrary.h"
#include "smartsurf/script/lua/SandboxFiles.h"
#include "smartsurf/script/lua/StandardLibrary.h"
#include "smartsurf/script/lua/TableReader.h"
#include "smartsurf/script/lua/ValueText.h"

namespace smartsurf::script {
namespace {

// Events fire this fraction of a control period early, so that rounding of the clock does not delay them by a
// tick.
constexpr double kDueTolerance = 1e-3;

int register_bindings(ScriptContext& context, lua_State* L) {
  bind_standard_library(L, context);
  if (!context.options.unsafe) {
    bind_file_access(L);
    bind_denied_libraries(L);
    bind_value_text(L);
    bind_table_functions(L);
    bind_string_functions(L);
  }
  bind_ordered_pairs(L);
  bind_declarations(L);
  bind_actuators(L, "");
  bind_sensors(L, "");
  bind_extensions(L);
  bind_options(L);
  bind_objects(L);
  bind_events(L);
  bind_episodes(L);
  bind_object_handles(L);
  bind_joints(L);
  bind_models(L);
  bind_cells(L);
  guard_globals(L);
  return 0;
}

int run_script(ScriptContext& context, lua_State* L) {
  context.interpreter->compile(L, context.spec.source, context.spec.file);
  lua_call(L, 0, 1);
  if (!lua_isnil(L, -1)) context.returned_type = luaL_typename(L, -1);
  return 0;
}

int number_library(ScriptContext& context, lua_State* L) {
  context.state.number_library(L);
  return 0;
}

int number_script(ScriptContext& context, lua_State* L) {
  context.state.number_script(context, L);
  return 0;
}

int archive_script(ScriptContext& context, lua_State* L) {
  if (context.archive->saves())
    context.state.save(context, L, *context.archive);
  else
    context.state.restore(context, L, *context.archive);
  return 0;
}

// The table stays aligned with the world axes. Its tilt is modelled by the inverse rotation of gravity.
Eigen::Vector3d rotate_gravity(const Eigen::Vector3d& gravity, const Eigen::Vector2d& tilt_rad) {
  if (tilt_rad.isZero(0.0)) return gravity;
  const Eigen::Quaterniond tilt = Eigen::AngleAxisd(tilt_rad.y(), Eigen::Vector3d::UnitY()) *
                                  Eigen::AngleAxisd(tilt_rad.x(), Eigen::Vector3d::UnitX());
  return tilt.conjugate() * gravity;
}

constexpr std::string_view kVaryPrefix = "vary.";

// The nuisances of the options take the place of the script's with their names.
void add_variations(ScriptContext& context) {
  std::vector<scene::Variation>& all = context.vary;
  for (const auto& [name, value] : context.options.overrides) {
    if (!name.starts_with(kVaryPrefix)) continue;
    const std::string nuisance = name.substr(kVaryPrefix.size());
    std::erase_if(all, [&](const scene::Variation& v) { return v.name == nuisance; });
    all.push_back(scene::parse_variation(nuisance, value,
                                         to_single_line(context.spec.file + ": --vary " +
                                                        nuisance.substr(0, 60) + "=" + value.substr(0, 60))));
  }
  std::ranges::sort(all, {}, &scene::Variation::name);
}

void validate_declarations(const ScriptContext& context) {
  const std::string& file = context.spec.file;
  std::vector<std::string> names, assignments;
  for (const scene::OptionSpec& option : context.spec.options) {
    names.push_back(option.name);
    assignments.push_back(option.name + "=" + to_single_line(option.value));
  }
  for (const auto& [name, value] : context.options.overrides) {
    if (name.starts_with(kVaryPrefix)) continue;
    if (std::find(names.begin(), names.end(), name) != names.end()) continue;
    throw scene::InputError(file + ": --set " + to_single_line(name + "=" + value) +
                            ": the script has no option '" + to_single_line(name) + "'" +
                            did_you_mean(name, names) +
                            "; options: " + (assignments.empty() ? "none" : join_names(assignments)));
  }
  if (!context.declared_at.contains("surface") && !context.returned_type.empty())
    throw scene::InputError(file + ": no surface is declared, and the script returns a " +
                            context.returned_type +
                            ": it looks like a module; check an experiment that requires it");
  if (!context.declared_at.contains("surface"))
    throw scene::InputError(file +
                            ": no surface is declared; an experiment needs one, surface{rows = 64, columns = "
                            "64, sensors = {proximity{}}}");
}

}  // namespace

struct Experiment::Impl {
  explicit Impl(LoadOptions options)
      : session(std::move(options)), interpreter(session, session.options.memory_limit) {
    session.interpreter = &interpreter;
  }
  // Closing Lua may run finalizers of an unsafe script when the simulation no longer exists.
  ~Impl() { session.phase = Phase::kLoading; }

  void load() {
    lua_State* const L = interpreter.lua();
    const Budget budget{session.options.load_budget, session.options.load_time_s};
    lua_pushcfunction(L, guarded<register_bindings>);
    interpreter.call(0, 0, budget, session.spec.file);
    if (session.options.savable) call_unlimited(guarded<number_library>);
    call_unlimited(guarded<bind_loaded_extensions>);
    if (session.options.savable) session.files_hash = common::kFnvBasis;
    lua_pushcfunction(L, guarded<run_script>);
    interpreter.call(0, 0, budget, session.spec.file);
    validate_declarations(session);
    add_variations(session);
    session.spec.world.gravity = rotate_gravity(session.spec.world.gravity, session.spec.surface.tilt_rad);
    if (!session.options.savable) return;
    call_unlimited(guarded<number_script>);
    common::StateArchive state(loaded_state);
    archive(state);
  }

  void call_unlimited(lua_CFunction function) {
    lua_pushcfunction(interpreter.lua(), function);
    interpreter.call(0, 0, {session.options.load_budget, session.options.load_time_s}, session.spec.file);
  }

  void archive(common::StateArchive& a) {
    assert(session.options.savable);
    a(session.time_s, session.tick, session.random, session.named_random, session.random_first_use,
      session.event_queue, session.on_tick, session.on_leave, session.metrics, finished);
    session.archive = &a;
    call_unlimited(guarded<archive_script>);
    session.archive = nullptr;
  }

  // Calls a callback with (t, tick) or (object, t, tick) and leaves its result on the stack.
  void push_result(int callback, std::optional<scene::ObjectId> object = {}) {
    lua_State* const L = interpreter.lua();
    const auto& [reference, location] = session.callbacks[callback];
    lua_rawgeti(L, LUA_REGISTRYINDEX, reference);
    if (object) lua_pushinteger(L, static_cast<lua_Integer>(*object));
    lua_pushnumber(L, session.time_s);
    lua_pushinteger(L, static_cast<lua_Integer>(session.tick));
    interpreter.call(object ? 3 : 2, 1, {session.options.callback_budget, session.options.callback_time_s},
                     location);
  }

  // Returns false if the callback returned false, which unregisters it.
  bool invoke(int callback, std::optional<scene::ObjectId> object = {}) {
    push_result(callback, object);
    lua_State* const L = interpreter.lua();
    const bool keep_registered = !(lua_isboolean(L, -1) && lua_toboolean(L, -1) == 0);
    lua_pop(L, 1);
    return keep_registered;
  }

  // While it lives, the calls are those of a function that judges the state at (t_s, tick). Afterwards the
  // time is again that of the latest tick(), which on_finish is given.
  class Observing {
   public:
    Observing(Impl& impl, double t_s, std::uint64_t tick, std::string_view kind, std::string name = {})
        : context_(impl.session), time_before_s_(context_.time_s), tick_before_(context_.tick) {
      impl.set_time(t_s, tick);
      context_.observer.emplace(ScriptContext::Observer{kind, std::move(name), {}, {}});
    }
    ~Observing() {
      context_.observer.reset();
      context_.time_s = time_before_s_;
      context_.tick = tick_before_;
    }
    Observing(const Observing&) = delete;
    Observing& operator=(const Observing&) = delete;

   private:
    ScriptContext& context_;
    double time_before_s_;
    std::uint64_t tick_before_;
  };

  // The number that a callback returns; NaN for nil if that is allowed.
  double number_of(int callback, const std::string& subject, bool nil_is_nan) {
    push_result(callback);
    lua_State* const L = interpreter.lua();
    const int type = lua_type(L, -1);
    const double value = type == LUA_TBOOLEAN ? lua_toboolean(L, -1) : lua_tonumber(L, -1);
    const bool is_nan = type == LUA_TNIL && nil_is_nan;
    lua_pop(L, 1);
    if (is_nan) return std::numeric_limits<double>::quiet_NaN();
    if ((type == LUA_TNUMBER && std::isfinite(value)) || type == LUA_TBOOLEAN) return value;
    refuse_result(callback, subject, type, value, "a finite number");
  }

  // When the goal was reached, as the callback of success() says.
  std::optional<double> reached_s(int callback) {
    push_result(callback);
    lua_State* const L = interpreter.lua();
    const int type = lua_type(L, -1);
    const bool is_reached = lua_toboolean(L, -1) != 0;
    const double value = lua_tonumber(L, -1);
    lua_pop(L, 1);
    const double latest_s = session.time_s + kDueTolerance * session.spec.world.control_period_s;
    if (type == LUA_TNIL || type == LUA_TBOOLEAN)
      return is_reached ? std::optional(session.time_s) : std::nullopt;
    if (type == LUA_TNUMBER && value >= 0.0 && value <= latest_s) return value;
    refuse_result(callback, "success", type, value,
                  "true, false, nil or a time from 0 to now, " + format_value(session.time_s) + " s");
  }

  [[noreturn]] void refuse_result(int callback, const std::string& subject, int type, double value,
                                  const std::string& requirement) const {
    throw scene::InputError(
        session.callbacks[callback].location + ": " + subject + " returned " +
        (type == LUA_TNUMBER ? format_value(value) : lua_typename(interpreter.lua(), type)) + ": must be " +
        requirement);
  }

  void set_time(double t_s, std::uint64_t tick) {
    assert(session.phase == Phase::kRunning);
    session.time_s = t_s;
    session.tick = tick;
  }

  void release_callback(int callback) {
    luaL_unref(interpreter.lua(), LUA_REGISTRYINDEX, session.callbacks[callback].reference);
    session.free_callbacks.push_back(callback);
  }

  // Invokes the callbacks present at entry. Callbacks registered meanwhile run from the next tick on.
  void run_callbacks(std::vector<int>& callbacks, std::optional<scene::ObjectId> object = {}) {
    const std::size_t count = callbacks.size();
    std::vector<int> expired;
    for (std::size_t i = 0; i < count; ++i)
      if (!invoke(callbacks[i], object)) expired.push_back(callbacks[i]);
    for (const int callback : expired) {
      std::erase(callbacks, callback);
      release_callback(callback);
    }
  }

  ScriptContext session;
  Interpreter interpreter;  // destroyed before `session`, which its bound functions use
  bool finished = false;
  std::vector<std::string> events;  // of the latest tick
  std::string loaded_state;
};

Experiment::Experiment(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Experiment::Experiment(Experiment&&) noexcept = default;
Experiment& Experiment::operator=(Experiment&&) noexcept = default;
Experiment::~Experiment() = default;

// Refuses files whose first bytes Lua would call an unexpected symbol.
static void refuse_other_kinds(const std::filesystem::path& path, std::string_view text) {
  const std::string name = to_single_line(path.string());
  switch (common::file_kind(path, text)) {
    case common::FileKind::kRecording:
      throw scene::InputError(name + ": is a recording, not an experiment: smartsurf replay " + name +
                              " shows it");
    case common::FileKind::kProgram:
      throw scene::InputError(name + ": is an APRON program, not an experiment: apron run " + name +
                              " runs it, or smartsurf run EXPERIMENT.lua --controller " + name);
    case common::FileKind::kMesh:
      throw scene::InputError(name + ": is a mesh, not an experiment, in which mesh { file = '" +
                              to_single_line(path.filename().string()) + "', ... } makes an object of it");
    case common::FileKind::kModel:
      throw scene::InputError(name +
                              ": is a robot description, not an experiment, in which model { file = '" +
                              to_single_line(path.filename().string()) + "', ... } makes objects of it");
    case common::FileKind::kPicture:
      throw scene::InputError(name + ": is a picture, not an experiment");
    default:
      break;
  }
}

Experiment Experiment::load(const std::filesystem::path& path, LoadOptions options) {
  std::string reason;
  std::optional<std::string> source =
      options.source ? std::move(options.source) : read_text_file(path, reason);
  if (!source) throw scene::InputError(to_single_line(path.string()) + ": the experiment " + reason);
  refuse_other_kinds(path, *source);
  std::unique_ptr<Impl> impl;
  try {
    impl = std::make_unique<Impl>(std::move(options));
  } catch (const std::bad_alloc&) {
    throw scene::InputError(to_single_line(path.string()) +
                            ": the memory limit is too small to start a script");
  }
  ScriptContext& context = impl->session;
  std::error_code error;
  const std::filesystem::path folder =
      context.options.script_folder.value_or(std::filesystem::absolute(path, error).parent_path());
  context.script_folder = std::filesystem::weakly_canonical(folder, error);
  context.spec.file = context.file = path.string();
  context.spec.source = std::move(*source);
  if (context.options.seed) context.spec.world.seed = *context.options.seed;
  if (context.options.engine) context.spec.world.engine = *context.options.engine;
  impl->load();
  return Experiment(std::move(impl));
}

const scene::SceneSpec& Experiment::scene() const { return impl_->session.spec; }
scene::SceneSpec& Experiment::mutable_scene() { return impl_->session.spec; }
const std::vector<scene::Variation>& Experiment::variations() const { return impl_->session.vary; }

const scene::Metrics& Experiment::metrics() const { return impl_->session.metrics; }

const std::vector<std::string>& Experiment::events() const { return impl_->events; }

void Experiment::start(SimulationInterface& simulation) {
  ScriptContext& context = impl_->session;
  assert(context.phase == Phase::kLoading);
  context.phase = Phase::kRunning;
  context.simulation = &simulation;
  for (const auto& request : context.deferred_requests) request(simulation);
  if (context.on_reset.empty()) return;
  impl_->set_time(0.0, 0);
  context.resetting = true;
  for (std::size_t i = 0; i < context.on_reset.size(); ++i) impl_->invoke(context.on_reset[i]);
  context.resetting = false;
}

void Experiment::save(common::StateArchive& a) { impl_->archive(a); }
void Experiment::restore(common::StateArchive& a) { impl_->archive(a); }
std::uint64_t Experiment::state_fingerprint() const { return impl_->session.state.fingerprint(); }

void Experiment::restart(std::uint64_t seed) {
  ScriptContext& context = impl_->session;
  context.phase = Phase::kLoading;
  context.resetting = false;  // also after an on_reset that failed
  context.simulation = nullptr;
  context.spec.world.seed = seed;
  common::StateArchive state{std::string_view(impl_->loaded_state)};
  impl_->archive(state);
}

bool Experiment::has_drawn() const { return impl_->session.has_drawn(); }
bool Experiment::has_reset_hook() const { return !impl_->session.on_reset.empty(); }
bool Experiment::has_reward() const { return impl_->session.reward.has_value(); }
std::optional<double> Experiment::episode_s() const { return impl_->session.episode_s; }

double Experiment::reward(double t_s, std::uint64_t tick) {
  if (!impl_->session.reward) return 0.0;
  const Impl::Observing observing(*impl_, t_s, tick, "reward");
  return impl_->number_of(*impl_->session.reward, "reward", false);
}

bool Experiment::declares_success() const { return impl_->session.success.has_value(); }

std::optional<double> Experiment::success(double t_s, std::uint64_t tick) {
  if (!impl_->session.success) return std::nullopt;
  const Impl::Observing observing(*impl_, t_s, tick, "success");
  return impl_->reached_s(*impl_->session.success);
}

void Experiment::update_metrics(double t_s, std::uint64_t tick) {
  for (const auto& [metric, callback] : impl_->session.metric_functions) {
    const Impl::Observing observing(*impl_, t_s, tick, "metric", impl_->session.metrics[metric].first);
    const double value = impl_->number_of(callback, "metric", true);
    impl_->session.metrics[metric].second = value;
  }
}

std::vector<Experiment::InfoField> Experiment::info_fields() const {
  std::vector<InfoField> fields;
  for (const script::InfoField& field : impl_->session.info)
    fields.push_back({field.name, field.object ? kObjectStateSize : 1});
  return fields;
}

void Experiment::info(double t_s, std::uint64_t tick, std::span<double> values) {
  std::size_t i = 0;
  for (const script::InfoField& field : impl_->session.info) {
    if (!field.object) {
      const Impl::Observing observing(*impl_, t_s, tick, "info", field.name);
      values[i++] = impl_->number_of(field.callback, "info." + field.name, true);
      continue;
    }
    const std::span<double> state = values.subspan(i, kObjectStateSize);
    i += kObjectStateSize;
    if (!impl_->session.simulation->is_alive(*field.object)) {
      std::ranges::fill(state, std::numeric_limits<double>::quiet_NaN());
      continue;
    }
    const ObjectState s = impl_->session.simulation->state(*field.object);
    Eigen::Map<Eigen::Matrix<double, kObjectStateSize, 1>>(state.data()) << s.position,
        s.orientation.coeffs(), s.velocity, s.angular_velocity;
  }
}

void Experiment::notify_departures(double t_s, std::uint64_t tick,
                                   std::span<const scene::ObjectId> departed) {
  ScriptContext& context = impl_->session;
  assert(context.phase == Phase::kRunning);
  context.time_s = t_s;
  context.tick = tick;
  for (const scene::ObjectId id : departed)
    if (context.simulation->is_alive(id)) impl_->run_callbacks(context.on_leave, id);
}

void Experiment::tick(double t_s, std::uint64_t tick) {
  ScriptContext& context = impl_->session;
  assert(context.phase == Phase::kRunning);
  context.time_s = t_s;
  context.tick = tick;
  const double horizon_s = t_s + kDueTolerance * context.spec.world.control_period_s;
  impl_->events.clear();
  context.event_queue.run_due(horizon_s, [this](const TimedEvent& event) {
    if (event.period_s == 0.0) impl_->events.push_back(impl_->session.callbacks[event.callback].location);
    const bool keep_registered = impl_->invoke(event.callback) && event.period_s > 0.0;
    if (!keep_registered) impl_->release_callback(event.callback);
    return keep_registered;
  });
  impl_->run_callbacks(context.on_tick);
}

void Experiment::finish() {
  if (impl_->finished || impl_->session.phase != Phase::kRunning) return;
  impl_->finished = true;
  for (std::size_t i = 0; i < impl_->session.on_finish.size(); ++i)
    impl_->invoke(impl_->session.on_finish[i]);
}

}  // namespace smartsurf::script
