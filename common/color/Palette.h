// Colour maps for numbers, by name.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace common {

enum class Palette : std::uint8_t {
  kGrey,      // black to white
  kRaw,       // the value itself as a grey level from 0 to 255, whatever the range
  kFlame,     // black, red, yellow, white
  kSpectrum,  // blue, cyan, green, yellow, red
  kViridis,   // perceptually uniform (CC0; S. van der Walt, N. Smith), as are the next three
  kMagma,
  kInferno,
  kPlasma,
  kDiverging,  // blue, white, red: for values of both signs
};
inline constexpr std::size_t kPaletteCount = 9;  // of the built-in palettes

using Rgb = std::array<float, 3>;  // sRGB, [0, 1] each

// A palette defined by the user: colours at ascending positions in [0, 1], between which it is linear. Two
// colours at one position make a step.
struct CustomPalette {
  struct Stop {
    float position = 0.0F;
    Rgb color{};
  };
  std::string name;
  std::vector<Stop> stops;  // at least two
};
inline constexpr std::size_t kMaxCustomPalettes = 200;

// Adds palettes, at most kMaxCustomPalettes in all, whose names find_palette() does not know yet. They follow
// the built-in ones: the first is static_cast<Palette>(kPaletteCount). Call it before other threads use
// palettes.
void add_palettes(std::vector<CustomPalette> palettes);
// The number of built-in and added palettes.
std::size_t palette_count() noexcept;

std::string_view palette_name(Palette) noexcept;
// Case-insensitive; also by the names that other tools give to the same colours ('gray', 'jet', 'hot').
std::optional<Palette> find_palette(std::string_view name) noexcept;
// All names that find_palette() knows; the first palette_count() are the palettes' own.
std::vector<std::string> palette_names();

// The colour at t in [0, 1]; t is clamped and must not be NaN. The uniform palettes are within 0.01 of their
// tables.
Rgb palette_color(Palette, float t) noexcept;

}  // namespace common
