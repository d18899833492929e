#include "smartsurf/python/Description.h"

namespace smartsurf::python {

py::dict option_values(const Environment& environment) {
  py::dict options;
  for (const scene::OptionSpec& option : environment.scene().options)
    options[py::str(option.name)] = option.value;
  return options;
}

py::dict describe(const Environment& environment) {
  const scene::SceneSpec& scene = environment.scene();
  py::list sensors, actuators, info, positions;
  for (const scene::SensorChannel& channel : scene.surface.observed_channels())
    sensors.append(
        py::make_tuple(channel.name, channel.components, channel.minimum, channel.maximum, channel.unit));
  for (const scene::ActuatorChannel& channel : scene.surface.actuator_channels())
    actuators.append(
        py::make_tuple(channel.name, channel.minimum, channel.maximum, channel.safe_value, channel.unit));
  for (const auto& field : environment.info_fields()) info.append(py::make_tuple(field.name, field.size));
  py::list extensions;
  for (const scene::Extension& extension : scene.surface.extensions()) extensions.append(extension.name);
  py::list objects;  // the labels of the declared ones
  for (const scene::ObjectSpec& object : scene.objects) objects.append(object.label);
  using namespace py::literals;
  return py::dict("rows"_a = scene.surface.rows, "columns"_a = scene.surface.columns,
                  "pitch"_a = scene.surface.pitch, "period"_a = scene.world.control_period_s,
                  "steps_per_tick"_a = scene.world.steps_per_tick(), "sensors"_a = sensors,
                  "actuators"_a = actuators, "info"_a = info, "options"_a = option_values(environment),
                  "has_reward"_a = environment.experiment().has_reward(),
                  "has_success"_a = environment.experiment().declares_success(),
                  "episode_seconds"_a = environment.experiment().episode_s(), "objects"_a = objects,
                  "extensions"_a = extensions, "engine"_a = scene.world.engine);
}

}  // namespace smartsurf::python
