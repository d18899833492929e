// The palettes that a program may ask for, by name.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace apron::program {

enum class PaletteId : std::uint8_t {
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
inline constexpr std::size_t kPaletteCount = 9;

std::string_view palette_name(PaletteId) noexcept;
// Upper or lower case, and by names that other tools have for the same colours ('gray', 'jet', 'hot').
std::optional<PaletteId> find_palette(std::string_view name) noexcept;
// All that find_palette knows, for suggestions; the first kPalettes are the palettes' own.
std::vector<std::string> palette_names();

}  // namespace apron::program
