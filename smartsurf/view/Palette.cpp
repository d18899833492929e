#include "smartsurf/view/Palette.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::view {

Rgb viridis(float t) {
  if (std::isnan(t)) return {0.5f, 0.5f, 0.5f};
  // A polynomial of degree 6 fitted to the table, per channel.
  static constexpr double kFit[7][3] = {{0.2777273272234177, 0.005407344544966578, 0.3340998053353061},
                                        {0.1050930431085774, 1.404613529898575, 1.384590162594685},
                                        {-0.3308618287255563, 0.214847559468213, 0.09509516302823659},
                                        {-4.634230498983486, -5.799100973351585, -19.33244095627987},
                                        {6.228269936347081, 14.17993336680509, 56.69055260068105},
                                        {4.776384997670288, -13.74514537774601, -65.35303263337234},
                                        {-5.435455855934631, 4.645852612178535, 26.3124352495832}};
  const double x = std::clamp(t, 0.0f, 1.0f);
  Rgb colour;
  for (int c = 0; c < 3; ++c) {
    double value = 0.0;
    for (int i = 6; i >= 0; --i) value = value * x + kFit[i][c];
    colour[c] = static_cast<float>(std::clamp(value, 0.0, 1.0));
  }
  return colour;
}

Rgb linear_light(const Rgb& screen) {
  Rgb light;
  for (int c = 0; c < 3; ++c) light[c] = std::pow(std::clamp(screen[c], 0.0f, 1.0f), 2.2f);
  return light;
}

}  // namespace smartsurf::view
