// The parameters and channels of the sensors that come with the program. Internal to this module.
#pragma once

#include <vector>

#include "smartsurf/scene/SensorSpec.h"

namespace smartsurf::scene {

std::vector<SensorKind> built_in_sensors();

}  // namespace smartsurf::scene
