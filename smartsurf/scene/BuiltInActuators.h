// The parameters and channels of the actuators that come with the program. Internal to this module.
#pragma once

#include <vector>

#include "smartsurf/scene/ActuatorSpec.h"

namespace smartsurf::scene {

std::vector<ActuatorKind> built_in_actuators();

}  // namespace smartsurf::scene
