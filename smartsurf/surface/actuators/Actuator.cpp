#include "smartsurf/surface/actuators/Actuator.h"

#include <map>

#include "smartsurf/surface/actuators/AirJets.h"
#include "smartsurf/surface/actuators/Deltas.h"
#include "smartsurf/surface/actuators/ForceFields.h"
#include "smartsurf/surface/actuators/Magnets.h"
#include "smartsurf/surface/actuators/Pins.h"
#include "smartsurf/surface/actuators/Rollers.h"
#include "smartsurf/surface/actuators/Rotors.h"
#include "smartsurf/surface/actuators/Tiles.h"
#include "smartsurf/surface/actuators/TiltingTiles.h"

namespace smartsurf::surface {
namespace {

template <class Model>
std::unique_ptr<Actuator> make(const ActuatorContext& context) {
  return std::make_unique<Model>(context);
}

std::unique_ptr<Actuator> make_tile(const ActuatorContext& context) {
  if (context.spec.number("command") == 0.0) return std::make_unique<Tiles>(context);
  return std::make_unique<TiltingTiles>(context);
}

std::map<std::string, ActuatorFactory>& actuator_factories() {
  static std::map<std::string, ActuatorFactory> all{{"pin", make<Pins>},
                                                    {"ball", make_ball},
                                                    {"wheels", make_wheels},
                                                    {"rotor", make<Rotors>},
                                                    {"force_field", make<ForceFields>},
                                                    {"magnet", make<Magnets>},
                                                    {"air_jet", make<AirJets>},
                                                    {"tile", make_tile},
                                                    {"delta", make<Deltas>}};
  return all;
}

}  // namespace

void register_actuator(scene::ActuatorKind kind, ActuatorFactory make) {
  actuator_factories()[kind.name] = std::move(make);
  scene::add_actuator_kind(std::move(kind));
}

std::unique_ptr<Actuator> make_actuator(const ActuatorContext& context) {
  const auto it = actuator_factories().find(context.spec.model);
  if (it == actuator_factories().end())
    throw scene::InputError("no actuator is called '" + context.spec.model + "'");
  return it->second(context);
}

}  // namespace smartsurf::surface
