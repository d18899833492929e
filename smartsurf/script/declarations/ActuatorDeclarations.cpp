// One function per kind of actuator (pin, ball, …), surface.actuator, surface.actuators and faults.actuator.
#include <algorithm>
#include <cctype>
#include <string>

#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/script/ScriptContext.h"
#include "smartsurf/script/declarations/ParameterReader.h"
#include "smartsurf/script/lua/TableReader.h"
#include "smartsurf/script/lua/Userdata.h"

namespace smartsurf::script {
namespace {

constexpr std::size_t kMaxDeclared = 1000;
constexpr lua_Unsigned kMaxActuators = 100;

// The userdata type that an actuator function returns. It holds an index into ScriptContext::actuators.
constexpr const char* kActuatorType = "actuator";

// Upvalue: the kind's name.
int declare_actuator(ScriptContext& context, lua_State* L) {
  const scene::ActuatorKind& kind = *scene::find_actuator_kind(lua_tostring(L, lua_upvalueindex(1)));
  require_loading(context, kind.name);
  if (lua_istable(L, 1) && lua_getfield(L, 1, "position") != LUA_TNIL)
    throw ScriptError(kind.name + ": is an actuator, surface{actuator = " + kind.name +
                      "{...}}, without a position; the objects are sphere, box, cylinder, capsule, cone, "
                      "hull and mesh");
  lua_settop(L, 1);
  const TableReader fields(L, 1, kind.name, parameter_names(kind.parameters));
  scene::ActuatorSpec spec = kind.default_spec();
  read_parameters(L, fields, kind.parameters, spec.values);
  throw_if_invalid(kind.validate(spec));
  if (!fields.has("top")) spec.values.erase("top");  // read_layout sets the default
  if (context.actuators.size() >= kMaxDeclared) throw ScriptError(kind.name + ": more than 1000 actuators");
  context.actuators.push_back(std::move(spec));
  new (lua_newuserdatauv(L, sizeof(std::size_t), 0)) std::size_t(context.actuators.size() - 1);
  luaL_setmetatable(L, kActuatorType);
  return 1;
}

const scene::ActuatorSpec& check_actuator(const ScriptContext& context, lua_State* L, int index,
                                          const std::string& name) {
  const auto* const slot = static_cast<const std::size_t*>(luaL_testudata(L, index, kActuatorType));
  if (slot == nullptr) throw_invalid_value(L, index, name, "an actuator, pin{...}");
  return context.actuators[*slot];
}

void read_fraction(const TableReader& fields, const char* field, double& value) {
  fields.visit(field, [&](int, const std::string& name) {
    fields.read(field, value);
    if (value < 0.0 || value > 1.0)
      throw ScriptError(name + " = " + format_value(value) + ": must be in [0, 1]");
  });
}

}  // namespace

NamedActuators check_single_actuator(const ScriptContext& context, lua_State* L, int index,
                                     const std::string& name) {
  return {{"1", check_actuator(context, L, index, name)}};
}

// Accepts a list, whose actuators get the names "1", "2", …, or a table keyed by single letters.
NamedActuators check_actuators(const ScriptContext& context, lua_State* L, int index,
                               const std::string& name) {
  const std::string requirement =
      "a list {pin{...}, ball{...}} or a table of letters {p = pin{...}, b = ball{...}}";
  if (lua_type(L, index) != LUA_TTABLE) throw_invalid_value(L, index, name, requirement);
  NamedActuators found;
  const lua_Unsigned count = lua_rawlen(L, index);
  for (lua_Unsigned i = 1; i <= std::min(count, kMaxActuators + 1); ++i) {
    lua_rawgeti(L, index, static_cast<lua_Integer>(i));
    const std::string key = std::to_string(i);
    found.push_back({key, check_actuator(context, L, lua_gettop(L), name + "[" + key + "]")});
    lua_pop(L, 1);
  }
  for (lua_pushnil(L); lua_next(L, index) != 0; lua_pop(L, 1)) {
    if (lua_type(L, -2) != LUA_TSTRING) continue;
    const std::string key = lua_tostring(L, -2);
    if (key.size() != 1 || !std::isalpha(static_cast<unsigned char>(key[0])) || count > 0)
      throw ScriptError(name + ": '" + to_single_line(key.substr(0, 40)) + "': must be " + requirement);
    found.push_back({key, check_actuator(context, L, lua_gettop(L), name + "." + key)});
  }
  if (found.empty() || found.size() > kMaxActuators) throw ScriptError(name + ": must be 1 to 100 actuators");
  std::ranges::sort(found, {}, [](const auto& a) { return std::pair(a.name.size(), a.name); });
  return found;
}

void read_actuator_faults(lua_State* L, int index, const std::string& name, scene::ActuatorFaultSpec& spec) {
  const TableReader fields(L, index, name, {"stuck", "dead", "weak", "latency"});
  read_fraction(fields, "stuck", spec.stuck_fraction);
  read_fraction(fields, "dead", spec.dead_fraction);
  fields.read("latency", spec.latency_ticks, 0, 1000);
  fields.visit("weak", [&](int i, const std::string& weak_name) {
    const TableReader weak(L, i, weak_name, {"fraction", "gain"});
    weak.require("fraction");
    weak.require("gain");
    read_fraction(weak, "fraction", spec.weak_fraction);
    read_fraction(weak, "gain", spec.weak_gain);
  });
  const double total = spec.stuck_fraction + spec.dead_fraction + spec.weak_fraction;
  if (total > 1.0 + 1e-9)
    throw ScriptError(name + ": stuck, dead and weak add up to " + format_value(total) +
                      " of the cells: must be at most 1");
}

void bind_actuators(lua_State* L, const std::string& extension) {
  if (extension.empty()) register_userdata_type(L, kActuatorType, {});
  for (const scene::ActuatorKind* kind : scene::actuator_kinds())
    if (kind->extension.name == extension) bind_kind(L, kind->name, guarded<declare_actuator>, extension);
}

}  // namespace smartsurf::script
