#include "apron/program/PaletteId.h"

#include <algorithm>
#include <array>
#include <cctype>

namespace apron::program {
namespace {

struct PaletteAlias {
  std::string_view name;
  PaletteId palette;
};

// First each palette's own name, in their order, then what others call them.
constexpr std::array kPaletteAliases = {
    PaletteAlias{"grey", PaletteId::kGrey},           PaletteAlias{"raw", PaletteId::kRaw},
    PaletteAlias{"flame", PaletteId::kFlame},         PaletteAlias{"spectrum", PaletteId::kSpectrum},
    PaletteAlias{"viridis", PaletteId::kViridis},     PaletteAlias{"magma", PaletteId::kMagma},
    PaletteAlias{"inferno", PaletteId::kInferno},     PaletteAlias{"plasma", PaletteId::kPlasma},
    PaletteAlias{"diverging", PaletteId::kDiverging}, PaletteAlias{"default", PaletteId::kGrey},
    PaletteAlias{"gray", PaletteId::kGrey},           PaletteAlias{"greyscale", PaletteId::kGrey},
    PaletteAlias{"grayscale", PaletteId::kGrey},      PaletteAlias{"hot", PaletteId::kFlame},
    PaletteAlias{"heat", PaletteId::kFlame},          PaletteAlias{"fire", PaletteId::kFlame},
    PaletteAlias{"thermal", PaletteId::kFlame},       PaletteAlias{"jet", PaletteId::kSpectrum},
    PaletteAlias{"turbo", PaletteId::kSpectrum},      PaletteAlias{"rainbow", PaletteId::kSpectrum},
    PaletteAlias{"hsv", PaletteId::kSpectrum},        PaletteAlias{"parula", PaletteId::kViridis},
    PaletteAlias{"cividis", PaletteId::kViridis},     PaletteAlias{"coolwarm", PaletteId::kDiverging},
    PaletteAlias{"bipolar", PaletteId::kDiverging},   PaletteAlias{"seismic", PaletteId::kDiverging}};

bool equals_ignoring_case(std::string_view a, std::string_view lower) {
  return std::equal(a.begin(), a.end(), lower.begin(), lower.end(),
                    [](char x, char y) { return std::tolower(static_cast<unsigned char>(x)) == y; });
}

}  // namespace

std::string_view palette_name(PaletteId palette) noexcept {
  return kPaletteAliases[static_cast<std::size_t>(palette)].name;
}

std::optional<PaletteId> find_palette(std::string_view name) noexcept {
  const auto found =
      std::find_if(kPaletteAliases.begin(), kPaletteAliases.end(),
                   [&](const PaletteAlias& one) { return equals_ignoring_case(name, one.name); });
  return found == kPaletteAliases.end() ? std::nullopt : std::optional(found->palette);
}

std::vector<std::string> palette_names() {
  std::vector<std::string> names;
  for (const PaletteAlias& alias : kPaletteAliases) names.emplace_back(alias.name);
  return names;
}

}  // namespace apron::program
