// The palettes of the heat maps and the conversion from sRGB to linear light.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "common/color/Palette.h"

namespace smartsurf::view {

using common::Palette;
using common::Rgb;

// In menu order. All palettes of common/color except kRaw, which ignores the range.
inline constexpr std::array kPalettes = {Palette::kViridis,  Palette::kGrey,      Palette::kFlame,
                                         Palette::kSpectrum, Palette::kDiverging, Palette::kMagma,
                                         Palette::kInferno,  Palette::kPlasma};
inline constexpr std::array<const char*, kPalettes.size()> kPaletteNames = {
    "viridis", "grey", "flame", "spectrum", "diverging", "magma", "inferno", "plasma"};

// The colour of NaN.
inline constexpr Rgb kNanColour{0.5F, 0.5F, 0.5F};

// Converts sRGB (gamma 2.2 approximation, clamped to [0, 1]) to linear light, in which lighting is computed.
Rgb linear_light(const Rgb& srgb);
// From [0, 1], to which values are clamped, to 0 to 255.
inline std::uint8_t to_byte(float value) {
  return static_cast<std::uint8_t>(std::clamp(value, 0.0F, 1.0F) * 255.0F + 0.5F);
}

}  // namespace smartsurf::view
