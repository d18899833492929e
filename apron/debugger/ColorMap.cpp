#include "apron/debugger/ColorMap.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace apron::debugger {
namespace {

std::uint8_t to_byte(float part) { return static_cast<std::uint8_t>(std::lround(part * 255.0F)); }

constexpr std::size_t kTableSize = 256;

// Maps a value to [0, 1], unclamped; NaN stays NaN.
float normalized_value(common::Palette palette, const ValueRange& range, float value) {
  if (palette == common::Palette::kRaw) return value / 255.0F;
  if (range.high == range.low) return value > range.high ? 1.0F : value - range.low;
  return (value - range.low) / (range.high - range.low);
}

}  // namespace

Rgb8 palette_rgb8(common::Palette palette, float t) noexcept {
  if (std::isnan(t)) return kNanColor;
  const common::Rgb color = common::palette_color(palette, t);
  return {to_byte(color[0]), to_byte(color[1]), to_byte(color[2])};
}

Rgb8 palette_rgb8(common::Palette palette, const ValueRange& range, float value) noexcept {
  return palette_rgb8(palette, normalized_value(palette, range, value));
}

void apply_palette(common::Palette palette, const ValueRange& range, const std::vector<float>& values,
                   std::vector<std::uint8_t>& rgba) {
  std::array<Rgb8, kTableSize> table;
  for (std::size_t i = 0; i < kTableSize; ++i)
    table[i] = palette_rgb8(palette, static_cast<float>(i) / (kTableSize - 1));
  rgba.resize(values.size() * 4);
  std::uint8_t* to = rgba.data();
  for (const float value : values) {
    const float t = normalized_value(palette, range, value);
    const Rgb8 c = std::isnan(t)
                       ? kNanColor
                       : table[static_cast<std::size_t>(std::clamp(t, 0.0F, 1.0F) * (kTableSize - 1) + 0.5F)];
    *to++ = c.red;
    *to++ = c.green;
    *to++ = c.blue;
    *to++ = 255;
  }
}

}  // namespace apron::debugger
