// Declares the parameters and channels of the built-in sensors. Internal to this module.
#pragma once

#include <vector>

#include "smartsurf/scene/SensorSpec.h"

namespace smartsurf::scene {

std::vector<SensorKind> built_in_sensors();

}  // namespace smartsurf::scene
