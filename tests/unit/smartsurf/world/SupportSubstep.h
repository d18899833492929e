// A substep of the tests of support patches.
#pragma once

#include "smartsurf/world/solver/ContactBatch.h"

namespace smartsurf::world {

inline constexpr SubstepParams kSupportSubstep{.h_s = 1.0F / 960,
                                               .inverse_h = 960.0F,
                                               .bias_rate = 60.0F,
                                               .mass_scale = 0.8F,
                                               .impulse_scale = 0.2F,
                                               .steady_share = 0.9F,
                                               .steady_gain = 0.1F,
                                               .max_bias_velocity = 4.0F};

}  // namespace smartsurf::world
