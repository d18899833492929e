#include "smartsurf/script/Experiment.h"

#include <algorithm>
#include <cassert>
#include <filesystem>
#include <system_error>

#include "smartsurf/script/Fields.h"
#include "smartsurf/script/Files.h"
#include "smartsurf/script/Interpreter.h"
#include "smartsurf/script/Session.h"

namespace smartsurf::script {
namespace {

// An event counts as due this fraction of a control period early, so that rounding in the clock delays none.
constexpr double kEarly = 1e-3;

int bind_all(Session& session, lua_State* L) {
  bind_library(L, session);
  if (!session.options.unsafe) {
    bind_files(L);
    bind_denied(L);
  }
  bind_pairs(L);
  bind_declarations(L);
  bind_actuators(L);
  bind_sensors(L);
  bind_options(L);
  bind_objects(L);
  bind_events(L);
  bind_handles(L);
  bind_cells(L);
  guard_globals(L);
  return 0;
}

int run_script(Session& session, lua_State* L) {
  session.interpreter->compile(L, session.spec.text, session.spec.file);
  lua_call(L, 0, 1);
  if (!lua_isnil(L, -1)) session.returned = luaL_typename(L, -1);
  return 0;
}

// The table's axes stay x, y and z: what turns is gravity, the other way.
Eigen::Vector3d turned(const Eigen::Vector3d& gravity, const Eigen::Vector2d& tilt_rad) {
  if (tilt_rad.isZero(0.0)) return gravity;
  const Eigen::Quaterniond table = Eigen::AngleAxisd(tilt_rad.y(), Eigen::Vector3d::UnitY()) *
                                   Eigen::AngleAxisd(tilt_rad.x(), Eigen::Vector3d::UnitX());
  return table.conjugate() * gravity;
}

void check_whole(const Session& session) {
  const std::string& file = session.spec.file;
  std::vector<std::string> names, shown;
  for (const scene::OptionSpec& option : session.spec.options) {
    names.push_back(option.name);
    shown.push_back(option.name + "=" + one_line(option.value));
  }
  for (const auto& [name, value] : session.options.set) {
    if (std::find(names.begin(), names.end(), name) != names.end()) continue;
    throw scene::InputError(file + ": --set " + one_line(name + "=" + value) +
                            ": the script has no option '" + one_line(name) + "'" + suggestion(name, names) +
                            "; options: " + (shown.empty() ? "none" : list_of(shown)));
  }
  if (!session.declared_at.contains("surface") && !session.returned.empty())
    throw scene::InputError(file + ": no surface is declared, and it gives back a " + session.returned +
                            ": it looks like a file that experiments require; check one of those");
  if (!session.declared_at.contains("surface"))
    throw scene::InputError(file +
                            ": no surface is declared; an experiment needs one, surface{rows = 64, columns = "
                            "64, sensors = {proximity{}}}");
}

}  // namespace

struct Experiment::Parts {
  explicit Parts(LoadOptions options)
      : session(std::move(options)), interpreter(session, session.options.memory_bytes) {
    session.interpreter = &interpreter;
  }
  // Closing Lua may run code of an unsafe script: the host may be gone by then.
  ~Parts() { session.phase = Phase::kLoading; }

  void load() {
    lua_State* const L = interpreter.lua();
    lua_pushcfunction(L, guarded<bind_all>);
    interpreter.call(0, 0, session.options.load_budget, session.spec.file);
    lua_pushcfunction(L, guarded<run_script>);
    interpreter.call(0, 0, session.options.load_budget, session.spec.file);
    check_whole(session);
    session.spec.world.gravity = turned(session.spec.world.gravity, session.spec.surface.tilt_rad);
  }

  // Calls one function of the script with the time and the tick, behind the object's id where there is one;
  // whether it wants to be called again.
  bool call(int callback, std::optional<scene::ObjectId> object = {}) {
    lua_State* const L = interpreter.lua();
    const auto& [reference, place] = session.callbacks[static_cast<std::size_t>(callback)];
    const std::string registered_at = place;  // the call may move the list
    lua_rawgeti(L, LUA_REGISTRYINDEX, reference);
    if (object) lua_pushinteger(L, static_cast<lua_Integer>(*object));
    lua_pushnumber(L, session.time_s);
    lua_pushinteger(L, static_cast<lua_Integer>(session.tick));
    interpreter.call(object ? 3 : 2, 1, session.options.callback_budget, registered_at);
    const bool again = !(lua_isboolean(L, -1) && lua_toboolean(L, -1) == 0);
    lua_pop(L, 1);
    return again;
  }

  void forget(int callback) {
    luaL_unref(interpreter.lua(), LUA_REGISTRYINDEX,
               session.callbacks[static_cast<std::size_t>(callback)].reference);
    session.free_callbacks.push_back(callback);
  }

  // Calls all of `functions` that are there now; those that one of them adds wait for the next time.
  void run_all(std::vector<int>& functions, std::optional<scene::ObjectId> object = {}) {
    const std::size_t count = functions.size();
    std::vector<int> over;
    for (std::size_t i = 0; i < count; ++i)
      if (!call(functions[i], object)) over.push_back(functions[i]);
    for (const int callback : over) {
      std::erase(functions, callback);
      forget(callback);
    }
  }

  Session session;
  Interpreter interpreter;  // its bound functions use the session until it is gone
  bool finished = false;
};

Experiment::Experiment(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
Experiment::Experiment(Experiment&&) noexcept = default;
Experiment& Experiment::operator=(Experiment&&) noexcept = default;
Experiment::~Experiment() = default;

Experiment Experiment::load(const std::filesystem::path& path, LoadOptions options) {
  std::string problem;
  std::optional<std::string> text = options.text ? std::move(options.text) : read_script(path, problem);
  if (!text) throw scene::InputError(one_line(path.string()) + ": the experiment " + problem);
  std::unique_ptr<Parts> parts;
  try {
    parts = std::make_unique<Parts>(std::move(options));
  } catch (const std::bad_alloc&) {
    throw scene::InputError(one_line(path.string()) + ": the memory for scripts is too small to start one");
  }
  Session& session = parts->session;
  std::error_code error;
  session.folder =
      std::filesystem::weakly_canonical(std::filesystem::absolute(path, error), error).parent_path();
  session.spec.file = path.string();
  session.spec.text = std::move(*text);
  if (session.options.seed) session.spec.world.seed = *session.options.seed;
  parts->load();
  return Experiment(std::move(parts));
}

const scene::SceneSpec& Experiment::scene() const { return parts_->session.spec; }

const std::vector<std::pair<std::string, double>>& Experiment::metrics() const {
  return parts_->session.metrics;
}

bool Experiment::has_events() const {
  const Session& session = parts_->session;
  return session.schedule.size() > 0 || !session.on_tick.empty() || !session.on_leave.empty() ||
         !session.on_finish.empty();
}

void Experiment::start(Host& host) {
  Session& session = parts_->session;
  assert(session.phase == Phase::kLoading);
  session.phase = Phase::kRunning;
  session.host = &host;
  for (const auto& request : session.at_start) request(host);
  session.at_start.clear();
}

void Experiment::leave(double t_s, std::uint64_t tick, std::span<const scene::ObjectId> left) {
  Session& session = parts_->session;
  assert(session.phase == Phase::kRunning);
  session.time_s = t_s;
  session.tick = tick;
  for (const scene::ObjectId id : left)
    if (session.host->alive(id)) parts_->run_all(session.on_leave, id);
}

void Experiment::tick(double t_s, std::uint64_t tick) {
  Session& session = parts_->session;
  assert(session.phase == Phase::kRunning);
  session.time_s = t_s;
  session.tick = tick;
  const double horizon_s = t_s + kEarly * session.spec.world.control_period_s;
  session.schedule.run_due(horizon_s, [this](const Event& event) {
    const bool again = parts_->call(event.callback) && event.period_s > 0.0;
    if (!again) parts_->forget(event.callback);
    return again;
  });
  parts_->run_all(session.on_tick);
}

void Experiment::finish() {
  if (parts_->finished || parts_->session.phase != Phase::kRunning) return;
  parts_->finished = true;
  for (std::size_t i = 0; i < parts_->session.on_finish.size(); ++i)
    parts_->call(parts_->session.on_finish[i]);
}

}  // namespace smartsurf::script
