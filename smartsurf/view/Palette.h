// Colours for numbers, and the conversion between a screen's colours and linear light.
#pragma once

#include <array>

namespace smartsurf::view {

using Rgb = std::array<float, 3>;  // [0, 1] each

// The perceptually uniform palette "viridis" (CC0; S. van der Walt, N. Smith), dark violet at t = 0 to yellow
// at t = 1, as a screen shows it; t is clamped and a NaN gives grey. Within 0.01 of the original table.
Rgb viridis(float t);

// The palettes that a channel can be drawn with.
enum class Palette { kViridis, kGrey, kFlame, kSpectrum, kDiverging };
inline constexpr std::array<const char*, 5> kPaletteNames = {"viridis", "grey", "flame", "spectrum",
                                                             "diverging"};

// kGrey: black to white. kFlame: black over red and yellow to white. kSpectrum: blue over green to red.
// kDiverging: blue over white to red, for values on both sides of a middle. t as above.
Rgb colour_of(Palette palette, float t);

// A screen's colour (gamma 2.2) as linear light, in which lighting is computed.
Rgb linear_light(const Rgb& screen);

}  // namespace smartsurf::view
