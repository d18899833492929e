// The palettes of the heat maps and the conversion from sRGB to linear light.
#pragma once

#include <array>

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

}  // namespace smartsurf::view
