#include "apron/program/Palette.h"

#include <algorithm>
#include <array>
#include <cctype>

namespace apron::program {
namespace {

struct Named {
  std::string_view name;
  Palette palette;
};

// First each palette's own name, in their order, then what others call them.
constexpr std::array kNames = {
    Named{"grey", Palette::kGrey},           Named{"raw", Palette::kRaw},
    Named{"flame", Palette::kFlame},         Named{"spectrum", Palette::kSpectrum},
    Named{"viridis", Palette::kViridis},     Named{"magma", Palette::kMagma},
    Named{"inferno", Palette::kInferno},     Named{"plasma", Palette::kPlasma},
    Named{"diverging", Palette::kDiverging}, Named{"default", Palette::kGrey},
    Named{"gray", Palette::kGrey},           Named{"hot", Palette::kFlame},
    Named{"heat", Palette::kFlame},          Named{"fire", Palette::kFlame},
    Named{"jet", Palette::kSpectrum},        Named{"rainbow", Palette::kSpectrum},
    Named{"hsv", Palette::kSpectrum},        Named{"coolwarm", Palette::kDiverging}};

bool same(std::string_view a, std::string_view lower) {
  return std::equal(a.begin(), a.end(), lower.begin(), lower.end(),
                    [](char x, char y) { return std::tolower(static_cast<unsigned char>(x)) == y; });
}

}  // namespace

std::string_view name(Palette palette) noexcept { return kNames[static_cast<std::size_t>(palette)].name; }

std::optional<Palette> find_palette(std::string_view name) noexcept {
  const auto found =
      std::find_if(kNames.begin(), kNames.end(), [&](const Named& one) { return same(name, one.name); });
  return found == kNames.end() ? std::nullopt : std::optional(found->palette);
}

std::vector<std::string> palette_names() {
  std::vector<std::string> names;
  for (const Named& one : kNames) names.emplace_back(one.name);
  return names;
}

}  // namespace apron::program
