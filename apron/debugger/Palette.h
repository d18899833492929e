// Colours for the numbers of a register.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace apron::debugger {

// As a screen shows it, [0, 255] each.
struct Colour {
  std::uint8_t red = 0, green = 0, blue = 0;

  bool operator==(const Colour&) const = default;
};

// What is not a number, in every palette.
inline constexpr Colour kNotANumber{255, 0, 200};

enum class Palette : std::uint8_t {
  kGrey,      // black to white
  kRaw,       // the value itself as a grey level from 0 to 255, whatever the range
  kFlame,     // black, red, yellow, white
  kSpectrum,  // blue, cyan, green, yellow, red
  kViridis,   // perceptually uniform (CC0; S. van der Walt, N. Smith), as the next three
  kMagma,
  kInferno,
  kPlasma,
  kDiverging,  // blue, white, red: for values of both signs
};
inline constexpr std::size_t kPalettes = 9;

std::string_view name(Palette) noexcept;
// By name, upper or lower case, 'gray' and 'default' too; the grey one for names that there are not.
Palette palette(std::string_view name) noexcept;

// t in [0, 1] from the low to the high end of a range; clamped.
Colour colour(Palette, float t) noexcept;

// What values the ends of a palette stand for.
struct Range {
  float low = 0.0F, high = 1.0F;
};
Colour colour(Palette, const Range&, float value) noexcept;

// Red, green, blue and 255 for each of the values, in their order.
void paint(Palette, const Range&, const std::vector<float>& values, std::vector<std::uint8_t>& rgba);

}  // namespace apron::debugger
