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

namespace {

// Straight lines between colours at equal distances.
template <std::size_t kCount>
Rgb between(const std::array<Rgb, kCount>& stops, float t) {
  const float at = t * static_cast<float>(kCount - 1);
  const std::size_t i = std::min(static_cast<std::size_t>(at), kCount - 2);
  const float part = at - static_cast<float>(i);
  Rgb colour;
  for (std::size_t c = 0; c < 3; ++c) colour[c] = stops[i][c] + part * (stops[i + 1][c] - stops[i][c]);
  return colour;
}

constexpr std::array<Rgb, 4> kFlameStops{{{0, 0, 0}, {0.8f, 0.1f, 0.05f}, {1.0f, 0.8f, 0.1f}, {1, 1, 1}}};
constexpr std::array<Rgb, 5> kSpectrumStops{
    {{0.1f, 0.1f, 0.7f}, {0, 0.7f, 0.9f}, {0.1f, 0.7f, 0.2f}, {1.0f, 0.85f, 0.1f}, {0.8f, 0.1f, 0.1f}}};
constexpr std::array<Rgb, 5> kDivergingStops{{{0.13f, 0.30f, 0.62f},
                                              {0.57f, 0.72f, 0.87f},
                                              {0.96f, 0.96f, 0.95f},
                                              {0.93f, 0.62f, 0.50f},
                                              {0.70f, 0.09f, 0.17f}}};

}  // namespace

Rgb colour_of(Palette palette, float t) {
  if (std::isnan(t) || palette == Palette::kViridis) return viridis(t);
  const float x = std::clamp(t, 0.0f, 1.0f);
  switch (palette) {
    case Palette::kFlame:
      return between(kFlameStops, x);
    case Palette::kSpectrum:
      return between(kSpectrumStops, x);
    case Palette::kDiverging:
      return between(kDivergingStops, x);
    default:
      return {x, x, x};
  }
}

Rgb linear_light(const Rgb& screen) {
  Rgb light;
  for (int c = 0; c < 3; ++c) light[c] = std::pow(std::clamp(screen[c], 0.0f, 1.0f), 2.2f);
  return light;
}

}  // namespace smartsurf::view
