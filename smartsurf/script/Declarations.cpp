// world, material, surface, pin, proximity, record: what a script declares once, while it loads.
#include <algorithm>
#include <cctype>
#include <cstring>
#include <string>
#include <vector>

#include "smartsurf/script/Fields.h"
#include "smartsurf/script/Methods.h"
#include "smartsurf/script/Session.h"

namespace smartsurf::script {
namespace {

constexpr std::size_t kMostMaterials = 1000;
// Each sensor has two channels, NAME and NAME_hit, in a directory of 32 channels with names of 31 characters.
constexpr std::size_t kMostSensors = 15;
constexpr std::size_t kLongestSensorName = 27;

// What pin{} and proximity{} return; Lua owns the bytes, so they are plain.
constexpr const char* kPinType = "pin";
constexpr const char* kProximityType = "proximity";

struct ProximityValue {
  double range = 0.0;
  char name[kLongestSensorName + 1] = {};
};

void check(const std::string& problem) {
  if (!problem.empty()) throw Problem(problem);
}

template <typename T>
void push_value(lua_State* L, const char* type, const T& value) {
  static_assert(std::is_trivially_destructible_v<T>);
  new (lua_newuserdatauv(L, sizeof(T), 0)) T(value);
  luaL_setmetatable(L, type);
}

int world(Session& session, lua_State* L) {
  declare_once(session, L, "world");
  const Fields fields(L, 1, "world", {"gravity", "dt", "iterations", "control_period", "seed", "ground", "off_table"});
  scene::WorldSpec& spec = session.spec.world;
  fields.with("gravity", [&](int i, const std::string& name) {
    if (lua_type(L, i) == LUA_TNUMBER)
      spec.gravity = {0.0, 0.0, number_at(L, i, name)};
    else if (lua_type(L, i) == LUA_TTABLE)
      spec.gravity = vector_at(L, i, name);
    else
      must_be(L, i, name, "a number (along z) or {x, y, z}");
  });
  fields.read("dt", spec.dt_s);
  fields.read("iterations", spec.iterations, 1, 1000);
  fields.read("control_period", spec.control_period_s);
  fields.read("ground", spec.ground);
  fields.with("off_table", [&](int i, const std::string& name) {
    const std::string wanted = text_at(L, i, name);
    if (wanted != "keep" && wanted != "remove") must_be(L, i, name, "'keep' or 'remove'");
    spec.off_table = wanted == "keep" ? scene::OffTable::kKeep : scene::OffTable::kRemove;
  });
  fields.with("seed", [&](int i, const std::string& name) {
    const auto seed = static_cast<std::uint64_t>(integer_at(L, i, name, 0, INT64_MAX));
    if (session.options.seed) return;  // --seed wins
    if (session.random && seed != spec.seed)
      throw Problem("world.seed = " + std::to_string(seed) +
                    ": random numbers were already drawn with seed " + std::to_string(spec.seed) + " at " +
                    session.random_used_at + "; put world{} before");
    spec.seed = seed;
  });
  check(problem_with(spec));
  return 0;
}

int material(Session& session, lua_State* L) {
  require_loading(session, "material");
  const Fields fields(L, 1, "material", {"name", "friction", "rolling_friction", "restitution", "density"});
  fields.require("name");
  scene::Material m;
  fields.read("name", m.name);
  fields.read("friction", m.friction);
  fields.read("rolling_friction", m.rolling_friction);
  fields.read("restitution", m.restitution);
  fields.read("density", m.density);
  check(problem_with(m));
  declare_once(session, L, "material '" + one_line(m.name.substr(0, 60)) + "'");
  auto& all = session.spec.materials;
  if (m.name == all[0].name) {
    all[0] = m;  // "default" is there from the beginning, and may be changed
  } else {
    if (all.size() >= kMostMaterials) throw Problem("material: more than 1000 materials");
    all.push_back(m);
  }
  return 0;
}

int pin(Session& session, lua_State* L) {
  require_loading(session, "pin");
  const Fields fields(L, 1, "pin", {"top", "length", "range", "max_speed", "max_acceleration"});
  scene::PinSpec spec;
  fields.with("top", [&](int i, const std::string& name) {
    if (lua_type(L, i) == LUA_TNUMBER) {
      spec.top_x = spec.top_y = number_at(L, i, name);
      return;
    }
    const auto top = numbers_at(L, i, name, 2, "a number or {x, y}, the edges of the pin's top");
    spec.top_x = top[0];
    spec.top_y = top[1];
  });
  fields.with("range", [&](int i, const std::string& name) {
    const auto range = numbers_at(L, i, name, 2, "{lowest, highest}, the heights of the pin's top");
    spec.min_height = range[0];
    spec.max_height = range[1];
  });
  fields.read("length", spec.length);
  fields.read("max_speed", spec.max_speed);
  fields.read("max_acceleration", spec.max_acceleration);
  scene::SurfaceSpec alone;  // all rules but that of the pitch, which surface{} knows
  alone.pin = spec;
  alone.pitch = std::clamp(std::max(spec.top_x, spec.top_y), 1.0, 1e6);
  check(problem_with(alone));
  push_value(L, kPinType, spec);
  return 1;
}

bool is_sensor_name(const std::string& name) {
  return !name.empty() && name.size() <= kLongestSensorName &&
         std::isalpha(static_cast<unsigned char>(name[0])) &&
         std::all_of(name.begin(), name.end(),
                     [](unsigned char c) { return c < 0x80 && (std::isalnum(c) || c == '_'); });
}

int proximity(Session& session, lua_State* L) {
  require_loading(session, "proximity");
  const Fields fields(L, 1, "proximity", {"range", "name"});
  scene::SensorSpec sensor;
  fields.read("range", sensor.range);
  fields.with("name", [&](int i, const std::string& name) {
    sensor.name = text_at(L, i, name);
    if (!is_sensor_name(sensor.name)) must_be(L, i, name, "1 to 27 letters, digits and _, a letter first");
  });
  scene::SurfaceSpec alone;
  alone.sensors = {sensor};
  check(problem_with(alone));
  ProximityValue value;
  value.range = sensor.range;
  std::memcpy(value.name, sensor.name.data(), sensor.name.size());
  push_value(L, kProximityType, value);
  return 1;
}

scene::SensorSpec sensor_at(lua_State* L, int index, const std::string& name) {
  const auto* const value = static_cast<const ProximityValue*>(luaL_testudata(L, index, kProximityType));
  if (value == nullptr) must_be(L, index, name, "a sensor, proximity{range = ...}");
  scene::SensorSpec sensor;
  sensor.name = value->name;
  sensor.range = value->range;
  return sensor;
}

void read_sensors(lua_State* L, int index, const std::string& name, std::vector<scene::SensorSpec>& sensors) {
  if (lua_type(L, index) == LUA_TUSERDATA) {
    sensors.push_back(sensor_at(L, index, name));
    return;
  }
  if (lua_type(L, index) != LUA_TTABLE) must_be(L, index, name, "a list of sensors, {proximity{...}}");
  const lua_Unsigned count = lua_rawlen(L, index);
  if (count > kMostSensors) throw Problem(name + ": more than 15 sensors");
  lua_Unsigned pairs = 0;
  for (lua_pushnil(L); lua_next(L, index) != 0; lua_pop(L, 1)) ++pairs;
  if (pairs != count) throw Problem(name + ": must be a list of sensors without names, {proximity{...}}");
  for (lua_Unsigned i = 1; i <= count; ++i) {
    lua_rawgeti(L, index, static_cast<lua_Integer>(i));
    const scene::SensorSpec sensor = sensor_at(L, lua_gettop(L), name + "[" + std::to_string(i) + "]");
    for (const auto& other : sensors)
      if (other.name == sensor.name)
        throw Problem(name + ": two sensors are called '" + sensor.name + "'; give one another name, " +
                      "proximity{name = ...}");
    sensors.push_back(sensor);
    lua_pop(L, 1);
  }
}

int surface(Session& session, lua_State* L) {
  declare_once(session, L, "surface");
  const Fields fields(L, 1, "surface",
                      {"rows", "columns", "pitch", "actuator", "sensors", "border", "material"},
                      {{"layout", "rows, columns and pitch, a rectangular layout"},
                       {"positions", "rows, columns and pitch, a rectangular layout"},
                       {"modules", "rows, columns and pitch, one module"},
                       {"tilt", "a level surface; world.gravity takes {x, y, z}"}});
  scene::SurfaceSpec& spec = session.spec.surface;
  fields.read("rows", spec.rows, 1, 4096);
  fields.read("columns", spec.columns, 1, 4096);
  fields.read("pitch", spec.pitch);
  fields.with("actuator", [&](int i, const std::string& name) {
    const auto* const value = static_cast<const scene::PinSpec*>(luaL_testudata(L, i, kPinType));
    if (value == nullptr) must_be(L, i, name, "an actuator, pin{...}");
    spec.pin = *value;
  });
  fields.with("sensors", [&](int i, const std::string& name) { read_sensors(L, i, name, spec.sensors); });
  fields.with("border", [&](int i, const std::string& name) {
    const Fields border(L, i, name, {"height"});
    border.require("height");
    border.read("height", spec.border_height);
  });
  fields.with("material",
              [&](int i, const std::string& name) { spec.material = material_at(session, L, i, name); });
  check(problem_with(spec));
  return 0;
}

int record(Session& session, lua_State* L) {
  declare_once(session, L, "record");
  const Fields fields(L, 1, "record", {"objects", "sensors", "actuators", "every"});
  scene::RecordSpec& spec = session.spec.record;
  fields.read("objects", spec.objects);
  fields.read("sensors", spec.sensors);
  fields.read("actuators", spec.actuators);
  fields.read("every", spec.every, 1, 1'000'000);
  return 0;
}

}  // namespace

int material_at(const Session& session, lua_State* L, int index, const std::string& name) {
  const std::string wanted = text_at(L, index, name);
  std::vector<std::string> names;
  const auto& all = session.spec.materials;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i].name == wanted) return static_cast<int>(i);
    names.push_back(all[i].name);
  }
  const std::string near = suggestion(wanted, names);
  throw Problem(name + " = " + show(L, index) + ": no such material" +
                (near.empty() ? "; known: " + list_of(names) + "; declare it before with material{}" : near));
}

void bind_declarations(lua_State* L) {
  make_type(L, kPinType, {});
  make_type(L, kProximityType, {});
  lua_register(L, "world", guarded<world>);
  lua_register(L, "material", guarded<material>);
  lua_register(L, "pin", guarded<pin>);
  lua_register(L, "proximity", guarded<proximity>);
  lua_register(L, "surface", guarded<surface>);
  lua_register(L, "record", guarded<record>);
}

}  // namespace smartsurf::script
