#include "smartsurf/view/model/Palette.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::view {

Rgb linear_light(const Rgb& srgb) {
  Rgb light;
  for (std::size_t c = 0; c < 3; ++c) light[c] = std::pow(std::clamp(srgb[c], 0.0F, 1.0F), 2.2F);
  return light;
}

}  // namespace smartsurf::view
