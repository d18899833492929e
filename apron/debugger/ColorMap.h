// Maps register values to colours.
#pragma once

#include <cstdint>
#include <vector>

#include "common/color/Palette.h"

namespace apron::debugger {

// sRGB, 8 bits per channel.
struct Rgb8 {
  std::uint8_t red = 0, green = 0, blue = 0;

  bool operator==(const Rgb8&) const = default;
};

// The colour of NaN in every palette.
inline constexpr Rgb8 kNanColor{255, 0, 200};

// The colour at t, clamped to [0, 1]; kNanColor for NaN.
Rgb8 palette_rgb8(common::Palette, float t) noexcept;

// The values mapped to the two ends of a palette.
struct ValueRange {
  float low = 0.0F, high = 1.0F;
};
Rgb8 palette_rgb8(common::Palette, const ValueRange&, float value) noexcept;

// Writes R, G, B and an alpha of 255 for each value, in order. Resizes rgba.
void apply_palette(common::Palette, const ValueRange&, const std::vector<float>& values,
                   std::vector<std::uint8_t>& rgba);

}  // namespace apron::debugger
