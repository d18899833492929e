#include "smartsurf/surface/actuators/ActuatorRegistry.h"

#include <string>

#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/scene/Registry.h"
#include "smartsurf/surface/actuators/Models.h"

namespace smartsurf::surface {
namespace {

std::unique_ptr<Actuator> make_tile(const ActuatorContext& context) {
  return context.spec.number("command") == 0.0 ? make_tiles(context) : make_tilting_tiles(context);
}

struct NamedActuator {
  std::string name;
  ActuatorFactory make;
};

scene::Registry<NamedActuator>& actuator_factories() {
  static scene::Registry<NamedActuator> all({{"pin", make_pins},
                                             {"ball", make_ball},
                                             {"wheels", make_wheels},
                                             {"conveyor", make_conveyors},
                                             {"rotor", make_rotors},
                                             {"force_field", make_force_fields},
                                             {"magnet", make_magnets},
                                             {"air_jet", make_air_jets},
                                             {"tile", make_tile},
                                             {"delta", make_deltas}});
  return all;
}

}  // namespace

void register_actuator(scene::ActuatorKind kind, ActuatorFactory make) {
  actuator_factories().add({kind.name, std::move(make)});
  scene::add_actuator_kind(std::move(kind));
}

std::unique_ptr<Actuator> make_actuator(const ActuatorContext& context) {
  const NamedActuator* const model = actuator_factories().find(context.spec.model);
  if (model == nullptr) throw scene::InputError("no actuator is called '" + context.spec.model + "'");
  return model->make(context);
}

}  // namespace smartsurf::surface
