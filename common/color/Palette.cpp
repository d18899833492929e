#include "common/color/Palette.h"

#include <algorithm>
#include <cctype>
#include <utility>

namespace common {
namespace {

struct NamedPalette {
  std::string_view name;
  Palette palette;
};

// First each palette's own name, in the order of the enumeration, then aliases.
constexpr std::array kNames = {
    NamedPalette{"grey", Palette::kGrey},           NamedPalette{"raw", Palette::kRaw},
    NamedPalette{"flame", Palette::kFlame},         NamedPalette{"spectrum", Palette::kSpectrum},
    NamedPalette{"viridis", Palette::kViridis},     NamedPalette{"magma", Palette::kMagma},
    NamedPalette{"inferno", Palette::kInferno},     NamedPalette{"plasma", Palette::kPlasma},
    NamedPalette{"diverging", Palette::kDiverging}, NamedPalette{"default", Palette::kGrey},
    NamedPalette{"gray", Palette::kGrey},           NamedPalette{"greyscale", Palette::kGrey},
    NamedPalette{"grayscale", Palette::kGrey},      NamedPalette{"hot", Palette::kFlame},
    NamedPalette{"heat", Palette::kFlame},          NamedPalette{"fire", Palette::kFlame},
    NamedPalette{"thermal", Palette::kFlame},       NamedPalette{"jet", Palette::kSpectrum},
    NamedPalette{"turbo", Palette::kSpectrum},      NamedPalette{"rainbow", Palette::kSpectrum},
    NamedPalette{"hsv", Palette::kSpectrum},        NamedPalette{"parula", Palette::kViridis},
    NamedPalette{"cividis", Palette::kViridis},     NamedPalette{"coolwarm", Palette::kDiverging},
    NamedPalette{"bipolar", Palette::kDiverging},   NamedPalette{"seismic", Palette::kDiverging}};

// A polynomial of degree 6 in t for red, green and blue, fitted to the palette's table.
using Polynomial = std::array<std::array<double, 3>, 7>;
constexpr Polynomial kViridis = {{{0.2777273272234177, 0.005407344544966578, 0.3340998053353061},
                                  {0.1050930431085774, 1.404613529898575, 1.384590162594685},
                                  {-0.3308618287255563, 0.214847559468213, 0.09509516302823659},
                                  {-4.634230498983486, -5.799100973351585, -19.33244095627987},
                                  {6.228269936347081, 14.17993336680509, 56.69055260068105},
                                  {4.776384997670288, -13.74514537774601, -65.35303263337234},
                                  {-5.435455855934631, 4.645852612178535, 26.3124352495832}}};
constexpr Polynomial kMagma = {{{-0.002136485053939582, -0.000749655052795221, -0.005386127855323933},
                                {0.2516605407371642, 0.6775232436837668, 2.494026599312351},
                                {8.353717279216625, -3.577719514958484, 0.3144679030132573},
                                {-27.66873308576866, 14.26473078096533, -13.64921318813922},
                                {52.17613981234068, -27.94360607168351, 12.94416944238394},
                                {-50.76852536473588, 29.04658282127291, 4.23415299384598},
                                {18.65570506591883, -11.48977351997711, -5.601961508734096}}};
constexpr Polynomial kInferno = {{{0.0002189403691192265, 0.001651004631001012, -0.01948089843709184},
                                  {0.1065134194856116, 0.5639564367884091, 3.932712388889277},
                                  {11.60249308247187, -3.972853965665698, -15.9423941062914},
                                  {-41.70399613139459, 17.43639888205313, 44.35414519872813},
                                  {77.162935699427, -33.40235894210092, -81.80730925738993},
                                  {-71.31942824499214, 32.62606426397723, 73.20951985803202},
                                  {25.13112622477341, -12.24266895238567, -23.07032500287172}}};
constexpr Polynomial kPlasma = {{{0.05873234392399702, 0.02333670892565664, 0.5433401826748754},
                                 {2.176514634195958, 0.2383834171260182, 0.7539604599784036},
                                 {-2.689460476458034, -7.455851135738909, 3.110799939717086},
                                 {6.130348345893603, 42.3461881477227, -28.51885465332158},
                                 {-11.10743619062271, -82.66631109428045, 60.13984767418263},
                                 {10.02306557647065, 71.41361770095349, -54.07218655560067},
                                 {-3.658713842777788, -22.93153465461149, 18.19190778539828}}};

// Colours at equal distances, interpolated linearly.
constexpr std::array<Rgb, 4> kFlame = {{{0, 0, 0}, {0.85F, 0, 0}, {1, 0.85F, 0}, {1, 1, 1}}};
constexpr std::array<Rgb, 5> kSpectrum = {{{0, 0, 1}, {0, 1, 1}, {0, 1, 0}, {1, 1, 0}, {1, 0, 0}}};
constexpr std::array<Rgb, 5> kDiverging = {{{0.02F, 0.19F, 0.38F},
                                            {0.40F, 0.66F, 0.81F},
                                            {0.97F, 0.97F, 0.97F},
                                            {0.94F, 0.54F, 0.38F},
                                            {0.40F, 0.0F, 0.12F}}};

Rgb mix(const Rgb& low, const Rgb& high, float fraction) {
  Rgb color;
  for (std::size_t c = 0; c < 3; ++c) color[c] = low[c] + fraction * (high[c] - low[c]);
  return color;
}

Rgb evaluate(const Polynomial& fit, double t) {
  Rgb color;
  for (std::size_t c = 0; c < 3; ++c) {
    double value = 0.0;
    for (std::size_t i = fit.size(); i-- > 0;) value = value * t + fit[i][c];
    color[c] = static_cast<float>(std::clamp(value, 0.0, 1.0));
  }
  return color;
}

template <std::size_t N>
Rgb interpolate(const std::array<Rgb, N>& stops, float t) {
  const float position = t * static_cast<float>(N - 1);
  const std::size_t i = std::min(static_cast<std::size_t>(position), N - 2);
  return mix(stops[i], stops[i + 1], position - static_cast<float>(i));
}

// Does not change once threads run.
std::vector<CustomPalette>& custom_palettes() {
  static std::vector<CustomPalette> palettes;
  return palettes;
}

const CustomPalette* custom_palette(Palette palette) {
  const auto index = static_cast<std::size_t>(palette);
  return index < kPaletteCount ? nullptr : &custom_palettes()[index - kPaletteCount];
}

Rgb interpolate(const std::vector<CustomPalette::Stop>& stops, float t) {
  const auto above = std::find_if(stops.begin(), stops.end(),
                                  [&](const CustomPalette::Stop& stop) { return stop.position > t; });
  if (above == stops.begin()) return stops.front().color;
  if (above == stops.end()) return stops.back().color;
  const CustomPalette::Stop &low = *(above - 1), &high = *above;
  return mix(low.color, high.color, (t - low.position) / (high.position - low.position));
}

bool equals_ignoring_case(std::string_view one, std::string_view other) {
  const auto lower = [](char c) { return std::tolower(static_cast<unsigned char>(c)); };
  return std::equal(one.begin(), one.end(), other.begin(), other.end(),
                    [&](char x, char y) { return lower(x) == lower(y); });
}

}  // namespace

void add_palettes(std::vector<CustomPalette> palettes) {
  for (CustomPalette& palette : palettes) custom_palettes().push_back(std::move(palette));
}

std::size_t palette_count() noexcept { return kPaletteCount + custom_palettes().size(); }

std::string_view palette_name(Palette palette) noexcept {
  if (const CustomPalette* custom = custom_palette(palette)) return custom->name;
  return kNames[static_cast<int>(palette)].name;
}

std::optional<Palette> find_palette(std::string_view name) noexcept {
  const auto found = std::find_if(kNames.begin(), kNames.end(), [&](const NamedPalette& candidate) {
    return equals_ignoring_case(name, candidate.name);
  });
  if (found != kNames.end()) return found->palette;
  for (std::size_t i = kPaletteCount; i < palette_count(); ++i)
    if (equals_ignoring_case(name, palette_name(static_cast<Palette>(i)))) return static_cast<Palette>(i);
  return std::nullopt;
}

std::vector<std::string> palette_names() {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < palette_count(); ++i) names.emplace_back(palette_name(static_cast<Palette>(i)));
  for (std::size_t i = kPaletteCount; i < kNames.size(); ++i) names.emplace_back(kNames[i].name);
  return names;
}

Rgb palette_color(Palette palette, float t) noexcept {
  const float x = std::clamp(t, 0.0F, 1.0F);
  if (const CustomPalette* custom = custom_palette(palette)) return interpolate(custom->stops, x);
  switch (palette) {
    case Palette::kGrey:
    case Palette::kRaw:
      return {x, x, x};
    case Palette::kFlame:
      return interpolate(kFlame, x);
    case Palette::kSpectrum:
      return interpolate(kSpectrum, x);
    case Palette::kViridis:
      return evaluate(kViridis, x);
    case Palette::kMagma:
      return evaluate(kMagma, x);
    case Palette::kInferno:
      return evaluate(kInferno, x);
    case Palette::kPlasma:
      return evaluate(kPlasma, x);
    case Palette::kDiverging:
      return interpolate(kDiverging, x);
  }
  return {};
}

}  // namespace common
