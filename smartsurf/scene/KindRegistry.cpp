#include "smartsurf/scene/KindRegistry.h"

#include <algorithm>

#include "smartsurf/scene/BuiltInActuators.h"
#include "smartsurf/scene/BuiltInSensors.h"
#include "smartsurf/scene/Registry.h"

namespace smartsurf::scene {
namespace {

Registry<ActuatorKind>& actuators() {
  static Registry<ActuatorKind> kinds(built_in_actuators());
  return kinds;
}

Registry<SensorKind>& sensors() {
  static Registry<SensorKind> kinds(built_in_sensors());
  return kinds;
}

}  // namespace

std::vector<const ActuatorKind*> actuator_kinds() { return actuators().all(); }
const ActuatorKind* find_actuator_kind(std::string_view name) { return actuators().find(name); }
void add_actuator_kind(ActuatorKind kind) { actuators().add(std::move(kind)); }

std::vector<const SensorKind*> sensor_kinds() { return sensors().all(); }
const SensorKind* find_sensor_kind(std::string_view name) { return sensors().find(name); }
void add_sensor_kind(SensorKind kind) { sensors().add(std::move(kind)); }

std::vector<Extension> loaded_extensions() {
  std::vector<Extension> extensions;
  const auto collect = [&extensions](const auto& kinds) {
    for (const auto* kind : kinds)
      if (!kind->extension.name.empty() && std::ranges::find(extensions, kind->extension) == extensions.end())
        extensions.push_back(kind->extension);
  };
  collect(actuator_kinds());
  collect(sensor_kinds());
  return extensions;
}

std::vector<SensorChannel> collect_channels(std::span<const SensorSpec> specs) {
  std::vector<SensorChannel> all;
  for (const SensorSpec& sensor : specs)
    for (SensorChannel& channel : find_sensor_kind(sensor.model)->channels(sensor))
      all.push_back(std::move(channel));
  return all;
}

}  // namespace smartsurf::scene
