// Colours for the numbers of a register.
#pragma once

#include <cstdint>
#include <vector>

#include "apron/program/PaletteId.h"

namespace apron::debugger {

// As a screen shows it, [0, 255] each.
struct Colour {
  std::uint8_t red = 0, green = 0, blue = 0;

  bool operator==(const Colour&) const = default;
};

// What is not a number, in every palette.
inline constexpr Colour kNotANumber{255, 0, 200};

using program::kPaletteCount;
using program::PaletteId;

// t in [0, 1] from the low to the high end of a range; clamped.
Colour colour(PaletteId, float t) noexcept;

// What values the ends of a palette stand for.
struct Range {
  float low = 0.0F, high = 1.0F;
};
Colour colour(PaletteId, const Range&, float value) noexcept;

// Red, green, blue and 255 for each of the values, in their order.
void paint(PaletteId, const Range&, const std::vector<float>& values, std::vector<std::uint8_t>& rgba);

}  // namespace apron::debugger
