// Declares the parameters and channels of the built-in actuators. Internal to this module.
#pragma once

#include <string>
#include <vector>

#include "smartsurf/scene/ActuatorSpec.h"

namespace smartsurf::scene {

std::vector<ActuatorKind> built_in_actuators();

// Checks a pin's tip against the final `top` of the surface. Returns "" or one clause.
std::string check_tip_size(const ActuatorSpec&);

}  // namespace smartsurf::scene
