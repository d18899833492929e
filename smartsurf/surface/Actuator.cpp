#include "smartsurf/surface/Actuator.h"

#include <map>

#include "smartsurf/surface/AirJets.h"
#include "smartsurf/surface/ForceFields.h"
#include "smartsurf/surface/Magnets.h"
#include "smartsurf/surface/Pins.h"
#include "smartsurf/surface/Rollers.h"
#include "smartsurf/surface/Rotors.h"
#include "smartsurf/surface/Tiles.h"

namespace smartsurf::surface {
namespace {

template <class Model>
std::unique_ptr<Actuator> make(const Place& place) {
  return std::make_unique<Model>(place);
}

std::map<std::string, ActuatorFactory>& factories() {
  static std::map<std::string, ActuatorFactory> all{{"pin", make<Pins>},
                                                    {"ball", make_ball},
                                                    {"wheels", make_wheels},
                                                    {"rotor", make<Rotors>},
                                                    {"force_field", make<ForceFields>},
                                                    {"magnet", make<Magnets>},
                                                    {"air_jet", make<AirJets>},
                                                    {"tile", make<Tiles>}};
  return all;
}

}  // namespace

void add_actuator(scene::ActuatorKind kind, ActuatorFactory make) {
  factories()[kind.name] = std::move(make);
  scene::add_actuator_kind(std::move(kind));
}

std::unique_ptr<Actuator> make_actuator(const Place& place) {
  const auto it = factories().find(place.spec.model);
  if (it == factories().end()) throw scene::InputError("no actuator is called '" + place.spec.model + "'");
  return it->second(place);
}

}  // namespace smartsurf::surface
