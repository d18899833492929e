// Maps register values to colours.
#pragma once

#include <cstdint>
#include <vector>

#include "common/color/Palette.h"

namespace apron::debugger {

// As a screen shows it, [0, 255] each.
struct Rgb8 {
  std::uint8_t red = 0, green = 0, blue = 0;

  bool operator==(const Rgb8&) const = default;
};

// What is not a number, in every palette.
inline constexpr Rgb8 kNanColor{255, 0, 200};


// t in [0, 1] from the low to the high end of a range; clamped.
Rgb8 palette_rgb8(common::Palette, float t) noexcept;

// What values the ends of a palette stand for.
struct ValueRange {
  float low = 0.0F, high = 1.0F;
};
Rgb8 palette_rgb8(common::Palette, const ValueRange&, float value) noexcept;

// Red, green, blue and 255 for each of the values, in their order.
void apply_palette(common::Palette, const ValueRange&, const std::vector<float>& values,
                   std::vector<std::uint8_t>& rgba);

}  // namespace apron::debugger
