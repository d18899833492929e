// The palettes that a channel can be drawn with, and the conversion from sRGB to linear light.
#pragma once

#include <array>

#include "common/color/Palette.h"

namespace smartsurf::view {

using common::Palette;
using common::Rgb;

// In the order of the menus; all of common's but kRaw, which ignores the range.
inline constexpr std::array kPalettes = {Palette::kViridis,  Palette::kGrey,      Palette::kFlame,
                                         Palette::kSpectrum, Palette::kDiverging, Palette::kMagma,
                                         Palette::kInferno,  Palette::kPlasma};
inline constexpr std::array<const char*, kPalettes.size()> kPaletteNames = {
    "viridis", "grey", "flame", "spectrum", "diverging", "magma", "inferno", "plasma"};

// Drawn for NaN.
inline constexpr Rgb kNanColour{0.5F, 0.5F, 0.5F};

// An sRGB colour (gamma 2.2) as linear light, in which lighting is computed; components in [0, 1].
Rgb linear_light(const Rgb& srgb);

}  // namespace smartsurf::view
