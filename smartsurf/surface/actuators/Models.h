// The factories of the built-in actuator models. Each model is private to the file that is named after it.
#pragma once

#include "smartsurf/surface/actuators/Actuator.h"

namespace smartsurf::surface {

std::unique_ptr<Actuator> make_air_jets(const ActuatorContext&);
std::unique_ptr<Actuator> make_ball(const ActuatorContext&);
std::unique_ptr<Actuator> make_conveyors(const ActuatorContext&);
std::unique_ptr<Actuator> make_deltas(const ActuatorContext&);
std::unique_ptr<Actuator> make_force_fields(const ActuatorContext&);
std::unique_ptr<Actuator> make_magnets(const ActuatorContext&);
std::unique_ptr<Actuator> make_pins(const ActuatorContext&);
std::unique_ptr<Actuator> make_rotors(const ActuatorContext&);
std::unique_ptr<Actuator> make_tiles(const ActuatorContext&);
std::unique_ptr<Actuator> make_tilting_tiles(const ActuatorContext&);
std::unique_ptr<Actuator> make_wheels(const ActuatorContext&);

}  // namespace smartsurf::surface
