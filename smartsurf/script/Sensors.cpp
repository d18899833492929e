// One function a kind of sensor (proximity, colour, …), and the list of sensors of surface{}.
#include <algorithm>
#include <cctype>
#include <string>

#include "smartsurf/script/Files.h"
#include "smartsurf/script/Methods.h"
#include "smartsurf/script/Parameters.h"
#include "smartsurf/script/Session.h"

namespace smartsurf::script {
namespace {

constexpr std::size_t kMostSensors = 32;  // as many as the protocol has channels
constexpr std::size_t kLongestSensorName =
    27;  // leaves room for "_hit" in the 31 characters of a channel's name
constexpr std::size_t kMostDeclared = 1000;

// What a sensor's function returns to Lua: the sensor's place in Session::sensors.
constexpr const char* kSensorType = "sensor";

bool is_sensor_name(const std::string& name) {
  return !name.empty() && name.size() <= kLongestSensorName &&
         std::isalpha(static_cast<unsigned char>(name[0])) &&
         std::all_of(name.begin(), name.end(),
                     [](unsigned char c) { return c < 0x80 && (std::isalnum(c) || c == '_'); });
}

void check(const std::string& problem) {
  if (!problem.empty()) throw Problem(problem);
}

// Upvalue: the index of the kind.
int sensor(Session& session, lua_State* L) {
  const scene::SensorKind& kind =
      scene::sensor_kinds()[static_cast<std::size_t>(lua_tointeger(L, lua_upvalueindex(1)))];
  require_loading(session, kind.name);
  std::vector<std::string> known = names_of(kind.parameters);
  for (const std::string& name : names_of(scene::imperfections())) known.push_back(name);
  known.insert(known.end(), {"name", "calibration"});
  const Fields fields(L, 1, kind.name, known);
  scene::SensorSpec spec = kind.standard();
  read_parameters(L, fields, kind.parameters, spec.values);
  read_parameters(L, fields, scene::imperfections(), spec.values);
  fields.with("name", [&](int i, const std::string& name) {
    spec.name = text_at(L, i, name);
    if (!is_sensor_name(spec.name)) must_be(L, i, name, "1 to 27 letters, digits and _, a letter first");
  });
  fields.with("calibration", [&](int i, const std::string& name) {
    NamedText file = text_of_file(session, name, text_at(L, i, name));
    spec.calibration = {std::move(file.name), std::move(file.text)};
  });
  check(kind.problem_with(spec));
  scene::SurfaceSpec alone;
  alone.sensors = {spec};
  check(problem_with(alone));
  if (session.sensors.size() >= kMostDeclared) throw Problem(kind.name + ": more than 1000 sensors");
  session.sensors.push_back(std::move(spec));
  new (lua_newuserdatauv(L, sizeof(std::size_t), 0)) std::size_t(session.sensors.size() - 1);
  luaL_setmetatable(L, kSensorType);
  return 1;
}

const scene::SensorSpec& sensor_at(const Session& session, lua_State* L, int index, const std::string& name) {
  const auto* const place = static_cast<const std::size_t*>(luaL_testudata(L, index, kSensorType));
  if (place == nullptr) must_be(L, index, name, "a sensor, proximity{range = ...}");
  return session.sensors[*place];
}

}  // namespace

void read_sensors(const Session& session, lua_State* L, int index, const std::string& name,
                  std::vector<scene::SensorSpec>& sensors) {
  if (lua_type(L, index) == LUA_TUSERDATA) {
    sensors.push_back(sensor_at(session, L, index, name));
    return;
  }
  if (lua_type(L, index) != LUA_TTABLE) must_be(L, index, name, "a list of sensors, {proximity{...}}");
  const lua_Unsigned count = lua_rawlen(L, index);
  if (count > kMostSensors) throw Problem(name + ": more than 32 sensors");
  lua_Unsigned pairs = 0;
  for (lua_pushnil(L); lua_next(L, index) != 0; lua_pop(L, 1)) ++pairs;
  if (pairs != count) throw Problem(name + ": must be a list of sensors without names, {proximity{...}}");
  for (lua_Unsigned i = 1; i <= count; ++i) {
    lua_rawgeti(L, index, static_cast<lua_Integer>(i));
    const scene::SensorSpec& found =
        sensor_at(session, L, lua_gettop(L), name + "[" + std::to_string(i) + "]");
    for (const auto& other : sensors)
      if (other.name == found.name)
        throw Problem(name + ": two sensors are called '" + found.name + "'; give one another name, " +
                      found.model + "{name = ...}");
    sensors.push_back(found);
    lua_pop(L, 1);
  }
}

void read_sensor_faults(lua_State* L, int index, const std::string& name, scene::ParameterValues& values) {
  const Fields fields(L, index, name, names_of(scene::imperfections()));
  read_parameters(L, fields, scene::imperfections(), values);
  check(scene::problem_with_imperfections(name, values));
}

void bind_sensors(lua_State* L) {
  make_type(L, kSensorType, {});
  const std::span<const scene::SensorKind> kinds = scene::sensor_kinds();
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    lua_pushinteger(L, static_cast<lua_Integer>(i));
    lua_pushcclosure(L, guarded<sensor>, 1);
    lua_setglobal(L, kinds[i].name.c_str());
  }
}

}  // namespace smartsurf::script
