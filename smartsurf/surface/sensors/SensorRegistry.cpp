#include "smartsurf/surface/sensors/SensorRegistry.h"

#include <string>

#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/scene/Registry.h"
#include "smartsurf/surface/sensors/CameraSensor.h"
#include "smartsurf/surface/sensors/ColourSensor.h"
#include "smartsurf/surface/sensors/ForceSensors.h"
#include "smartsurf/surface/sensors/JointPositionSensor.h"
#include "smartsurf/surface/sensors/LightSensor.h"
#include "smartsurf/surface/sensors/ObjectTypeSensor.h"
#include "smartsurf/surface/sensors/PinHeightSensor.h"
#include "smartsurf/surface/sensors/ProximitySensor.h"
#include "smartsurf/surface/sensors/SkinSensors.h"

namespace smartsurf::surface {
namespace {

template <class Model>
std::unique_ptr<Sensor> make(const Field& field, const scene::SensorSpec& spec) {
  return std::make_unique<Model>(field, spec);
}

struct NamedSensor {
  std::string name;
  SensorFactory make;
};

scene::Registry<NamedSensor>& sensor_factories() {
  static scene::Registry<NamedSensor> all({{"proximity", make<ProximitySensor>},
                                           {"colour", make<ColourSensor>},
                                           {"object_type", make<ObjectTypeSensor>},
                                           {"light", make<LightSensor>},
                                           {"pressure", make<PressureSensor>},
                                           {"camera", make<CameraSensor>},
                                           {"pin_height", make<PinHeightSensor>},
                                           {"joint_position", make<JointPositionSensor>},
                                           {"tip_force", make<TipForceSensor>},
                                           {"skin_height", make<SkinHeightSensor>},
                                           {"skin_strain", make<SkinStrainSensor>},
                                           {"skin_contact", make<SkinContactSensor>}});
  return all;
}

}  // namespace

void register_sensor(scene::SensorKind kind, SensorFactory make) {
  sensor_factories().add({kind.name, std::move(make)});
  scene::add_sensor_kind(std::move(kind));
}

std::unique_ptr<Sensor> make_sensor(const Field& field, const scene::SensorSpec& spec) {
  const NamedSensor* const model = sensor_factories().find(spec.model);
  if (model == nullptr) throw scene::InputError("no sensor is called '" + spec.model + "'");
  return model->make(field, spec);
}

}  // namespace smartsurf::surface
