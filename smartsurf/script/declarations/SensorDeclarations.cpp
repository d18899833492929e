// One function per kind of sensor (proximity, colour, …), surface.sensors and the sensor part of faults{}.
#include <algorithm>
#include <cctype>
#include <string>

#include "smartsurf/scene/ChannelName.h"
#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/script/ScriptContext.h"
#include "smartsurf/script/declarations/ParameterReader.h"
#include "smartsurf/script/lua/SandboxFiles.h"
#include "smartsurf/script/lua/Userdata.h"

namespace smartsurf::script {
namespace {

constexpr std::size_t kMaxSensors = 32;  // channels of the protocol
constexpr std::size_t kMaxDeclared = 1000;

// The userdata type that a sensor function returns. It holds an index into ScriptContext::sensors.
constexpr const char* kSensorType = "sensor";

// The channels of a sensor are called by its name with a suffix, such as "_height".
std::size_t max_name_length(const scene::SensorKind& kind, const scene::SensorSpec& spec) {
  std::size_t longest_suffix = 0;
  for (const scene::SensorChannel& channel : kind.channels(spec))
    if (channel.name.starts_with(spec.name))
      longest_suffix = std::max(longest_suffix, channel.name.size() - spec.name.size());
  return std::min(scene::kMaxSensorNameLength,
                  scene::kMaxChannelNameLength - std::min(longest_suffix, scene::kMaxChannelNameLength - 1));
}

bool is_sensor_name(const std::string& name, std::size_t max_length) {
  return !name.empty() && name.size() <= max_length && std::isalpha(static_cast<unsigned char>(name[0])) &&
         std::all_of(name.begin(), name.end(),
                     [](unsigned char c) { return c < 0x80 && (std::isalnum(c) || c == '_'); });
}

// Upvalue: the kind's name.
int declare_sensor(ScriptContext& context, lua_State* L) {
  const scene::SensorKind& kind = *scene::find_sensor_kind(lua_tostring(L, lua_upvalueindex(1)));
  require_loading(context, kind.name);
  std::vector<std::string> known = parameter_names(kind.parameters);
  for (const std::string& name : parameter_names(scene::sensor_error_parameters())) known.push_back(name);
  known.insert(known.end(), {"name", "calibration"});
  const TableReader fields(L, 1, kind.name, known);
  scene::SensorSpec spec = kind.default_spec();
  read_parameters(L, fields, kind.parameters, spec.values);
  read_parameters(L, fields, scene::sensor_error_parameters(), spec.values);
  fields.visit("calibration", [&](int i, const std::string& name) {
    NamedFile file = read_sandboxed_file(context, name, check_string(L, i, name));
    spec.calibration = {std::move(file.name), std::move(file.content)};
  });
  throw_if_invalid(kind.validate(spec));
  fields.visit("name", [&](int i, const std::string& name) {
    spec.name = check_string(L, i, name);
    const std::size_t max_length = max_name_length(kind, spec);
    if (!is_sensor_name(spec.name, max_length))
      throw_invalid_value(L, i, name,
                          "1 to " + std::to_string(max_length) + " letters, digits and _, a letter first");
  });
  scene::SurfaceSpec probe;
  probe.sensors = {spec};
  throw_if_invalid(validate(probe));
  if (context.sensors.size() >= kMaxDeclared) throw ScriptError(kind.name + ": more than 1000 sensors");
  context.sensors.push_back(std::move(spec));
  new (lua_newuserdatauv(L, sizeof(std::size_t), 0)) std::size_t(context.sensors.size() - 1);
  luaL_setmetatable(L, kSensorType);
  return 1;
}

const scene::SensorSpec& check_sensor(const ScriptContext& context, lua_State* L, int index,
                                      const std::string& name) {
  const auto* const slot = static_cast<const std::size_t*>(luaL_testudata(L, index, kSensorType));
  if (slot == nullptr) throw_invalid_value(L, index, name, "a sensor, proximity{range = ...}");
  return context.sensors[*slot];
}

}  // namespace

void read_sensors(const ScriptContext& context, lua_State* L, int index, const std::string& name,
                  std::vector<scene::SensorSpec>& sensors) {
  if (lua_type(L, index) == LUA_TUSERDATA) {
    sensors.push_back(check_sensor(context, L, index, name));
    return;
  }
  if (lua_type(L, index) != LUA_TTABLE)
    throw_invalid_value(L, index, name, "a list of sensors, {proximity{...}}");
  const lua_Unsigned count = lua_rawlen(L, index);
  if (count > kMaxSensors) throw ScriptError(name + ": more than 32 sensors");
  lua_Unsigned pairs = 0;
  for (lua_pushnil(L); lua_next(L, index) != 0; lua_pop(L, 1)) ++pairs;
  if (pairs != count) throw ScriptError(name + ": must be a list of sensors without names, {proximity{...}}");
  for_each_element(L, index, name, [&](int i, const std::string& element) {
    const scene::SensorSpec& found = check_sensor(context, L, i, element);
    for (const auto& other : sensors)
      if (other.name == found.name)
        throw ScriptError(name + ": two sensors are called '" + found.name + "'; rename one, " + found.model +
                          "{name = ...}");
    sensors.push_back(found);
  });
}

void read_sensor_faults(lua_State* L, int index, const std::string& name, scene::ParameterValues& values) {
  const TableReader fields(L, index, name, parameter_names(scene::sensor_error_parameters()));
  read_parameters(L, fields, scene::sensor_error_parameters(), values);
  throw_if_invalid(scene::validate_sensor_errors(name, values));
}

void bind_sensors(lua_State* L, const std::string& extension) {
  if (extension.empty()) register_userdata_type(L, kSensorType, {});
  for (const scene::SensorKind* kind : scene::sensor_kinds())
    if (kind->extension.name == extension) bind_kind(L, kind->name, guarded<declare_sensor>, extension);
}

}  // namespace smartsurf::script
