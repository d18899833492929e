// One function a kind of actuator (pin, ball, …), the actuators of surface{}, and the actuators' part of
// faults{}.
#include <algorithm>
#include <cctype>
#include <string>

#include "smartsurf/script/Fields.h"
#include "smartsurf/script/Methods.h"
#include "smartsurf/script/Parameters.h"
#include "smartsurf/script/Session.h"

namespace smartsurf::script {
namespace {

constexpr std::size_t kMostDeclared = 1000;
constexpr lua_Unsigned kMostActuators = 100;

// What an actuator's function returns to Lua: the actuator's place in Session::actuators.
constexpr const char* kActuatorType = "actuator";

// Upvalue: the kind's name.
int actuator(Session& session, lua_State* L) {
  const scene::ActuatorKind& kind = *scene::find_actuator_kind(lua_tostring(L, lua_upvalueindex(1)));
  require_loading(session, kind.name);
  const Fields fields(L, 1, kind.name, names_of(kind.parameters));
  scene::ActuatorSpec spec = kind.standard();
  read_parameters(L, fields, kind.parameters, spec.values);
  if (const std::string problem = kind.problem_with(spec); !problem.empty()) throw Problem(problem);
  if (!fields.has("top")) spec.values.erase("top");  // the surface knows the usual one
  if (session.actuators.size() >= kMostDeclared) throw Problem(kind.name + ": more than 1000 actuators");
  session.actuators.push_back(std::move(spec));
  new (lua_newuserdatauv(L, sizeof(std::size_t), 0)) std::size_t(session.actuators.size() - 1);
  luaL_setmetatable(L, kActuatorType);
  return 1;
}

const scene::ActuatorSpec& actuator_at(const Session& session, lua_State* L, int index,
                                       const std::string& name) {
  const auto* const place = static_cast<const std::size_t*>(luaL_testudata(L, index, kActuatorType));
  if (place == nullptr) must_be(L, index, name, "an actuator, pin{...}");
  return session.actuators[*place];
}

void read_fraction(const Fields& fields, const char* field, double& value) {
  fields.with(field, [&](int, const std::string& name) {
    fields.read(field, value);
    if (value < 0.0 || value > 1.0) throw Problem(name + " = " + show(value) + ": must be in [0, 1]");
  });
}

}  // namespace

NamedActuators one_actuator_at(const Session& session, lua_State* L, int index, const std::string& name) {
  return {{"1", actuator_at(session, L, index, name)}};
}

// A list, whose names are then "1", "2", …, or a table of names of one letter each.
NamedActuators actuators_at(const Session& session, lua_State* L, int index, const std::string& name) {
  const std::string rule = "a list {pin{...}, ball{...}} or a table of letters {p = pin{...}, b = ball{...}}";
  if (lua_type(L, index) != LUA_TTABLE) must_be(L, index, name, rule);
  NamedActuators found;
  const lua_Unsigned count = lua_rawlen(L, index);
  for (lua_Unsigned i = 1; i <= std::min(count, kMostActuators + 1); ++i) {
    lua_rawgeti(L, index, static_cast<lua_Integer>(i));
    const std::string key = std::to_string(i);
    found.push_back({key, actuator_at(session, L, lua_gettop(L), name + "[" + key + "]")});
    lua_pop(L, 1);
  }
  for (lua_pushnil(L); lua_next(L, index) != 0; lua_pop(L, 1)) {
    if (lua_type(L, -2) != LUA_TSTRING) continue;
    const std::string key = lua_tostring(L, -2);
    if (key.size() != 1 || !std::isalpha(static_cast<unsigned char>(key[0])) || count > 0)
      throw Problem(name + ": '" + one_line(key.substr(0, 40)) + "': must be " + rule);
    found.push_back({key, actuator_at(session, L, lua_gettop(L), name + "." + key)});
  }
  if (found.empty() || found.size() > kMostActuators) throw Problem(name + ": must be 1 to 100 actuators");
  std::ranges::sort(found, {}, [](const auto& a) { return std::pair(a.name.size(), a.name); });
  return found;
}

void read_actuator_faults(lua_State* L, int index, const std::string& name, scene::ActuatorFaultSpec& spec) {
  const Fields fields(L, index, name, {"stuck", "dead", "weak", "latency"});
  read_fraction(fields, "stuck", spec.stuck);
  read_fraction(fields, "dead", spec.dead);
  fields.read("latency", spec.latency, 0, 1000);
  fields.with("weak", [&](int i, const std::string& weak_name) {
    const Fields weak(L, i, weak_name, {"fraction", "gain"});
    weak.require("fraction");
    weak.require("gain");
    read_fraction(weak, "fraction", spec.weak_fraction);
    read_fraction(weak, "gain", spec.weak_gain);
  });
  const double all = spec.stuck + spec.dead + spec.weak_fraction;
  if (all > 1.0 + 1e-9)
    throw Problem(name + ": stuck, dead and weak are " + show(all) +
                  " of the cells together: must be at most 1");
}

void bind_actuators(lua_State* L) {
  make_type(L, kActuatorType, {});
  for (const scene::ActuatorKind& kind : scene::actuator_kinds()) {
    lua_pushlstring(L, kind.name.data(), kind.name.size());
    lua_pushcclosure(L, guarded<actuator>, 1);
    lua_setglobal(L, kind.name.c_str());
  }
}

}  // namespace smartsurf::script
