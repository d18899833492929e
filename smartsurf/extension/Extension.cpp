#include "smartsurf/extension/Extension.h"

#include <dlfcn.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <memory>
#include <mutex>

#include "common/arithmetic/StandardArithmetic.h"
#include "common/files/ElfFile.h"
#include "common/files/ReadFile.h"
#include "common/hash/Fnv.h"
#include "smartsurf/extension/PluginActuator.h"
#include "smartsurf/extension/PluginSensor.h"
#include "smartsurf/scene/ChannelName.h"
#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/surface/actuators/ActuatorRegistry.h"
#include "smartsurf/surface/sensors/SensorRegistry.h"

namespace smartsurf::extension {
namespace {

constexpr std::size_t kMaxFileBytes = std::size_t{1} << 30;
constexpr double kMaxHeight = 1e6;  // u, as of all coordinates

std::string hash_of(std::string_view content) {
  std::array<char, 17> text;
  std::snprintf(text.data(), text.size(), "%016llx", static_cast<unsigned long long>(common::fnv1a(content)));
  return text.data();
}

constexpr std::string_view kLuaKeywords[] = {
    "and", "break", "do",  "else", "elseif", "end",    "false",  "for",  "function", "goto",  "if",
    "in",  "local", "nil", "not",  "or",     "repeat", "return", "then", "true",     "until", "while"};

// What a script can write as a name.
bool is_identifier(std::string_view name) {
  if (std::ranges::find(kLuaKeywords, name) != std::end(kLuaKeywords)) return false;
  const auto is_part = [](unsigned char c) { return c < 0x80 && (std::isalnum(c) != 0 || c == '_'); };
  return !name.empty() && name.size() <= scene::kMaxSensorNameLength &&
         std::isdigit(static_cast<unsigned char>(name[0])) == 0 && std::ranges::all_of(name, is_part);
}

std::vector<scene::Parameter> read_parameters(const smartsurf_plugin_parameter* first, std::uint32_t count,
                                              const std::string& subject) {
  using Type = scene::Parameter::Type;
  static constexpr Type kTypes[] = {Type::kNumber, Type::kCount, Type::kFlag,
                                    Type::kSize,   Type::kRange, Type::kVector};
  static constexpr std::size_t kNumbers[] = {1, 1, 1, 2, 2, 3};
  std::vector<scene::Parameter> parameters;
  for (const smartsurf_plugin_parameter& given : read_array(first, count, subject)) {
    const std::string name = given.name == nullptr ? "" : given.name;
    const auto refuse = [&](const std::string& why) {
      throw common::UserError(subject + ": parameter '" + name + "': " + why);
    };
    const std::size_t dot = name.find('.');
    if (!is_identifier(name.substr(0, dot)) ||
        (dot != std::string::npos && !is_identifier(name.substr(dot + 1))))
      refuse("its name must be letters, digits and _, and no keyword of Lua, or two such words with a dot");
    if (given.type >= std::size(kTypes)) refuse("no type " + std::to_string(given.type));
    scene::Parameter& parameter = parameters.emplace_back(
        scene::Parameter{.name = name,
                         .description = given.description == nullptr ? "" : given.description,
                         .type = kTypes[given.type]});
    parameter.minimum = given.minimum, parameter.maximum = given.maximum;
    if (!(given.minimum <= given.maximum)) refuse("its minimum must not exceed its maximum");
    if (std::isnan(given.default_value.x)) continue;
    const double numbers[] = {given.default_value.x, given.default_value.y, given.default_value.z};
    parameter.default_value.assign(numbers, numbers + kNumbers[given.type]);
    if (!std::ranges::all_of(parameter.default_value, [&](double v) { return parameter.accepts(v); }))
      refuse("its default must be within its limits");
  }
  return parameters;
}

// Throws UserError for bits of which this program does not know what they ask of it.
void require_known_flags(std::uint32_t flags, std::uint32_t known, const std::string& subject) {
  if ((flags & ~known) == 0) return;
  std::array<char, 11> text;
  std::snprintf(text.data(), text.size(), "0x%x", flags & ~known);
  throw common::UserError(subject + ": its flags have the bits " + text.data() +
                          ": this program does not know them");
}

template <class Type>
constexpr bool is_sensor = std::is_same_v<Type, smartsurf_plugin_sensor>;
template <class Type>
constexpr std::uint32_t kMaxComponents = is_sensor<Type> ? 64 : 1;

// The result of configure() for an actuator's or a sensor's tables.
struct Configuration {
  std::vector<smartsurf_plugin_channel> channels;
  double min_height, max_height;
  std::string problem;  // "" or one clause
};

template <class Type>
Configuration configure(const Type& type, std::span<const scene::Parameter> parameters,
                        const scene::ParameterValues& values, double height) {
  // The channels keep the size that the extension gives them, by which it indexes them.
  std::vector<char> channels(std::size_t{type.channel_count} * type.channels->size);
  std::memcpy(channels.data(), type.channels, channels.size());
  auto* const first = reinterpret_cast<smartsurf_plugin_channel*>(channels.data());
  Message message{};
  smartsurf_plugin_configuration plugin{.size = sizeof plugin,
                                        .channel_count = type.channel_count,
                                        .channels = first,
                                        .min_height = height,
                                        .max_height = height,
                                        .message = message.data()};
  Configuration result;
  const std::vector<smartsurf_plugin_value> plugin_values = values_of(parameters, values);
  if (type.configure != nullptr && type.configure(plugin_values.data(), &plugin) != 0)
    result.problem = text_of(message).empty() ? "configure(): refuses these values" : text_of(message);
  result.channels = read_array(first, type.channel_count, type.name);
  const auto declared = read_array(type.channels, type.channel_count, type.name);
  for (std::size_t i = 0; i < declared.size(); ++i)
    result.channels[i].name = declared[i].name, result.channels[i].unit = declared[i].unit;
  result.min_height = plugin.min_height, result.max_height = plugin.max_height;
  for (const smartsurf_plugin_channel& channel : result.channels)
    if (result.problem.empty() && !(std::isfinite(channel.minimum) && std::isfinite(channel.maximum) &&
                                    channel.minimum < channel.maximum && channel.neutral >= channel.minimum &&
                                    channel.neutral <= channel.maximum && channel.components >= 1 &&
                                    channel.components <= kMaxComponents<Type>))
      result.problem = std::string("channels: '") + channel.name +
                       "' needs a finite range that holds its neutral value, and at most " +
                       std::to_string(kMaxComponents<Type>) + " components";
  for (const auto& [name, value] :
       {std::pair("min_height", result.min_height), std::pair("max_height", result.max_height)})
    if (result.problem.empty() && !(std::abs(value) <= kMaxHeight))
      result.problem =
          std::string(name) + " = " + scene::format_number(value) + ": must be in [-1000000, 1000000]";
  if (result.problem.empty() && !(result.min_height <= result.max_height))
    result.problem = "min_height: must not exceed max_height";
  return result;
}

// Throws UserError unless the table of one actuator or sensor is complete.
template <class Type>
void require_complete(const Type& type, const std::string& subject) {
  if (type.create == nullptr || type.destroy == nullptr)
    throw common::UserError(subject + ": create and destroy must not be null");
  if (type.channel_count == 0 || type.channel_count > 32)
    throw common::UserError(subject + ": must have 1 to 32 channels");
  std::vector<std::string> names;
  for (const smartsurf_plugin_channel& channel : read_array(type.channels, type.channel_count, subject)) {
    if (channel.name == nullptr || channel.unit == nullptr ||
        std::strlen(channel.unit) > scene::kMaxChannelUnitLength)
      throw common::UserError(subject + ": a channel has no name, or no unit of at most 15 bytes");
    const std::string name = std::string(is_sensor<Type> ? type.name : "") + channel.name;
    if (!scene::is_channel_name(name) || std::ranges::find(names, name) != names.end())
      throw common::UserError(subject + ": channel '" + name + "': must have a name of its own, " +
                              scene::kChannelNameRule);
    names.push_back(name);
    require_known_flags(channel.flags, SMARTSURF_EXACT, subject + ": channel '" + name + "'");
  }
}

void require_own_tables(const smartsurf_plugin_actuator& type, const std::string& subject) {
  require_known_flags(
      type.flags,
      SMARTSURF_MOVES_TOPS | SMARTSURF_MOVES_SURFACE | SMARTSURF_LIMITS_FORCE | SMARTSURF_EXERTS_FORCES,
      subject);
  if ((type.flags & SMARTSURF_LIMITS_FORCE) != 0 && (type.flags & SMARTSURF_MOVES_TOPS) == 0)
    throw common::UserError(subject + ": SMARTSURF_LIMITS_FORCE needs SMARTSURF_MOVES_TOPS");
  if (type.plan == nullptr || ((type.flags & SMARTSURF_EXERTS_FORCES) != 0 && type.add_forces == nullptr))
    throw common::UserError(subject + ": plan, and add_forces if it exerts forces, must not be null");
}

void require_own_tables(const smartsurf_plugin_sensor& type, const std::string& subject) {
  require_known_flags(type.flags, SMARTSURF_NEEDS_IMPULSES, subject);
  if (type.sense == nullptr || type.mask_channel > type.channel_count)
    throw common::UserError(subject + ": sense must not be null, mask_channel a channel or 0");
}

// The fields of every Lua table of an actuator or sensor that are not in its kind's parameters.
std::vector<std::string> common_fields(const smartsurf_plugin_actuator&) { return {"position"}; }

std::vector<std::string> common_fields(const smartsurf_plugin_sensor&) {
  std::vector<std::string> fields{"name", "calibration"};
  for (const scene::Parameter& p : scene::sensor_error_parameters()) fields.push_back(p.name);
  return fields;
}

// The name of an actuator or sensor of the extension `file`, as messages begin with it.
std::string subject_of(const std::string& file, const char* what, const char* name) {
  if (name == nullptr || !is_identifier(name))
    throw common::UserError(file + ": the name of its " + what +
                            ": must be 1 to 27 letters, digits and _, and no keyword of Lua");
  if (scene::find_actuator_kind(name) != nullptr || scene::find_sensor_kind(name) != nullptr)
    throw common::UserError(file + ": " + what + " '" + name +
                            "': an actuator or sensor of this name exists already");
  return file + ": " + what + " '" + name + "'";
}

scene::ActuatorKind kind_of(const smartsurf_plugin_actuator& type,
                            const std::vector<scene::Parameter>& parameters) {
  scene::ActuatorKind kind{.name = type.name, .parameters = scene::cell_body_parameters()};
  kind.parameters.insert(kind.parameters.end(), parameters.begin(), parameters.end());
  const auto configured = [&type, parameters](const scene::ActuatorSpec& spec) {
    return configure(type, parameters, spec.values, spec.number("height"));
  };
  kind.channels = [configured](const scene::ActuatorSpec& spec) {
    std::vector<scene::ActuatorChannel> channels;
    for (const smartsurf_plugin_channel& c : configured(spec).channels)
      channels.push_back({c.name, c.unit, c.minimum, c.maximum, c.neutral});
    return channels;
  };
  kind.height_limits = [configured](const scene::ActuatorSpec& spec) {
    const Configuration c = configured(spec);
    return std::array{c.min_height, c.max_height};
  };
  kind.check_constraints = [configured](const scene::ActuatorSpec& spec) {
    const std::string problem = configured(spec).problem;
    return problem.empty() ? "" : spec.model + "." + problem;
  };
  return kind;
}

scene::SensorKind kind_of(const smartsurf_plugin_sensor& type,
                          const std::vector<scene::Parameter>& parameters) {
  scene::SensorKind kind{.name = type.name, .parameters = parameters};
  kind.mask_channel = static_cast<int>(type.mask_channel) - 1;
  const auto configured = [&type, parameters](const scene::SensorSpec& spec) {
    return configure(type, parameters, spec.values, 0.0);
  };
  kind.channels = [configured](const scene::SensorSpec& spec) {
    std::vector<scene::SensorChannel> channels;
    for (const smartsurf_plugin_channel& c : configured(spec).channels)
      channels.push_back({.name = spec.name + c.name,
                          .unit = c.unit,
                          .minimum = c.minimum,
                          .maximum = c.maximum,
                          .no_detection = c.neutral,
                          .components = static_cast<int>(c.components),
                          .is_exact = (c.flags & SMARTSURF_EXACT) != 0});
    return channels;
  };
  kind.check_constraints = [configured](const scene::SensorSpec& spec) { return configured(spec).problem; };
  return kind;
}

// The tables of a loaded extension as this program reads them. They are never freed, as its code is not.
struct Tables {
  std::vector<smartsurf_plugin_actuator> actuators;
  std::vector<smartsurf_plugin_sensor> sensors;
  std::vector<std::vector<scene::Parameter>> parameters;  // of the actuators, then of the sensors
};

// Reads and checks everything, so that registering it cannot fail.
std::unique_ptr<Tables> read_tables(const smartsurf_plugin* plugin, const std::string& file) {
  if (plugin == nullptr) throw common::UserError(file + ": its smartsurf_plugin_get() returns no table");
  if (plugin->size < sizeof *plugin)
    throw common::UserError(file + ": its table has the size " + std::to_string(plugin->size) + ": must be " +
                            std::to_string(sizeof *plugin));
  if (plugin->version != SMARTSURF_PLUGIN_VERSION)
    throw common::UserError(file + ": was built for version " + std::to_string(plugin->version) +
                            " of smartsurf_plugin.h, and this program has version " +
                            std::to_string(SMARTSURF_PLUGIN_VERSION));
  auto tables = std::make_unique<Tables>();
  tables->actuators = read_array(plugin->actuators, plugin->actuator_count, file);
  tables->sensors = read_array(plugin->sensors, plugin->sensor_count, file);
  if (tables->actuators.empty() && tables->sensors.empty())
    throw common::UserError(file + ": adds no actuator and no sensor");
  std::vector<std::string> names;
  const auto require_valid = [&file](const auto& kind, std::vector<std::string> fields) {
    for (const scene::Parameter& p : kind.parameters) {
      if (std::ranges::any_of(fields, [&p](const std::string& other) {
            return other == p.name || other.starts_with(p.name + '.') || p.name.starts_with(other + '.');
          }))
        throw common::UserError(file + ": '" + kind.name + "' has two fields '" + p.name + "'");
      fields.push_back(p.name);
    }
    if (const std::string problem = kind.validate(kind.default_spec()); !problem.empty())
      throw common::UserError(file + ": with its default parameters, " + problem);
  };
  const auto read = [&](const auto& types, const char* what) {
    for (const auto& type : types) {
      const std::string subject = subject_of(file, what, type.name);
      require_complete(type, subject);
      if (std::ranges::find(names, type.name) != names.end())
        throw common::UserError(subject + ": the extension has two of this name");
      names.emplace_back(type.name);
      tables->parameters.push_back(read_parameters(type.parameters, type.parameter_count, subject));
      require_own_tables(type, subject);
      require_valid(kind_of(type, tables->parameters.back()), common_fields(type));
    }
  };
  read(tables->actuators, "actuator");
  read(tables->sensors, "sensor");
  return tables;
}

void register_kind(const scene::ActuatorKind& kind, const smartsurf_plugin_actuator& type,
                   const std::vector<scene::Parameter>& parameters) {
  surface::register_actuator(kind, [&type, &parameters, height_limits = kind.height_limits](
                                       const surface::ActuatorContext& context) {
    const auto min_height = static_cast<float>(height_limits(context.spec)[0]);
    return std::make_unique<PluginActuator>(type, parameters, min_height, context);
  });
}

void register_kind(const scene::SensorKind& kind, const smartsurf_plugin_sensor& type,
                   const std::vector<scene::Parameter>& parameters) {
  surface::register_sensor(kind, [&type, &parameters, channels = kind.channels](
                                     const surface::Field& field, const scene::SensorSpec& spec) {
    return std::make_unique<PluginSensor>(type, parameters, channels(spec), field, spec);
  });
}

void register_kinds(const Tables& tables, const scene::Extension& extension) {
  auto parameters = tables.parameters.begin();
  const auto add = [&](const auto& types) {
    for (const auto& type : types) {
      auto kind = kind_of(type, *parameters);
      kind.extension = extension;
      register_kind(kind, type, *parameters++);
    }
  };
  add(tables.actuators);
  add(tables.sensors);
}

}  // namespace

void load(const std::filesystem::path& path) {
  static std::mutex mutex;
  const std::scoped_lock lock(mutex);
  const std::string file = path.string();
  std::string content;
  if (const std::error_code error = common::read_file(path, kMaxFileBytes, content))
    throw common::UserError(file + ": cannot be read: " + error.message());
  const scene::Extension extension{path.filename().string(), hash_of(content)};
  for (const scene::Extension& loaded : scene::loaded_extensions()) {
    if (loaded == extension) return;
    if (loaded.name == extension.name)
      throw common::UserError(file + ": another extension of this name is loaded already");
  }
  if (const std::string cut = common::find_missing_segment(path); !cut.empty())
    throw common::UserError(file + ": " + cut);
  const common::StandardArithmetic arithmetic;
  // A path without a slash would be searched for in the system's folders.
  void* const library = dlopen(std::filesystem::absolute(path).c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) throw common::UserError(file + ": cannot be loaded: " + dlerror());
  const auto get = reinterpret_cast<decltype(&smartsurf_plugin_get)>(dlsym(library, "smartsurf_plugin_get"));
  if (get == nullptr)
    throw common::UserError(file +
                            ": is not an extension of SmartSurf: it has no function smartsurf_plugin_get");
  static std::vector<std::unique_ptr<Tables>> loaded_tables;  // the registered kinds refer to them
  loaded_tables.push_back(read_tables(get(), file));
  register_kinds(*loaded_tables.back(), extension);
}

}  // namespace smartsurf::extension
