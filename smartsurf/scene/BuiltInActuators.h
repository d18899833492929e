// Declares the parameters and channels of the built-in actuators. Internal to this module.
#pragma once

#include <vector>

#include "smartsurf/scene/ActuatorSpec.h"

namespace smartsurf::scene {

std::vector<ActuatorKind> built_in_actuators();

}  // namespace smartsurf::scene
