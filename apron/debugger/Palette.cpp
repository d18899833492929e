#include "apron/debugger/Palette.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace apron::debugger {
namespace {

// A polynomial of degree 6 in t, fitted to the palette's table, for red, green and blue.
using Fit = std::array<std::array<double, 3>, 7>;
constexpr Fit kViridis = {{{0.2777273272234177, 0.005407344544966578, 0.3340998053353061},
                           {0.1050930431085774, 1.404613529898575, 1.384590162594685},
                           {-0.3308618287255563, 0.214847559468213, 0.09509516302823659},
                           {-4.634230498983486, -5.799100973351585, -19.33244095627987},
                           {6.228269936347081, 14.17993336680509, 56.69055260068105},
                           {4.776384997670288, -13.74514537774601, -65.35303263337234},
                           {-5.435455855934631, 4.645852612178535, 26.3124352495832}}};
constexpr Fit kMagma = {{{-0.002136485053939582, -0.000749655052795221, -0.005386127855323933},
                         {0.2516605407371642, 0.6775232436837668, 2.494026599312351},
                         {8.353717279216625, -3.577719514958484, 0.3144679030132573},
                         {-27.66873308576866, 14.26473078096533, -13.64921318813922},
                         {52.17613981234068, -27.94360607168351, 12.94416944238394},
                         {-50.76852536473588, 29.04658282127291, 4.23415299384598},
                         {18.65570506591883, -11.48977351997711, -5.601961508734096}}};
constexpr Fit kInferno = {{{0.0002189403691192265, 0.001651004631001012, -0.01948089843709184},
                           {0.1065134194856116, 0.5639564367884091, 3.932712388889277},
                           {11.60249308247187, -3.972853965665698, -15.9423941062914},
                           {-41.70399613139459, 17.43639888205313, 44.35414519872813},
                           {77.162935699427, -33.40235894210092, -81.80730925738993},
                           {-71.31942824499214, 32.62606426397723, 73.20951985803202},
                           {25.13112622477341, -12.24266895238567, -23.07032500287172}}};
constexpr Fit kPlasma = {{{0.05873234392399702, 0.02333670892565664, 0.5433401826748754},
                          {2.176514634195958, 0.2383834171260182, 0.7539604599784036},
                          {-2.689460476458034, -7.455851135738909, 3.110799939717086},
                          {6.130348345893603, 42.3461881477227, -28.51885465332158},
                          {-11.10743619062271, -82.66631109428045, 60.13984767418263},
                          {10.02306557647065, 71.41361770095349, -54.07218655560067},
                          {-3.658713842777788, -22.93153465461149, 18.19190778539828}}};

std::uint8_t level(double part) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(part, 0.0, 1.0) * 255.0));
}

Colour fitted(const Fit& fit, double t) {
  std::array<double, 3> rgb{};
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t i = fit.size(); i-- > 0;) rgb[c] = rgb[c] * t + fit[i][c];
  return {level(rgb[0]), level(rgb[1]), level(rgb[2])};
}

// Straight lines between colours at equal distances.
template <std::size_t N>
Colour between(const std::array<std::array<double, 3>, N>& stops, double t) {
  const double place = t * (N - 1);
  const std::size_t i = std::min(static_cast<std::size_t>(place), N - 2);
  const double f = place - static_cast<double>(i);
  const auto mix = [&](std::size_t c) { return level(stops[i][c] + f * (stops[i + 1][c] - stops[i][c])); };
  return {mix(0), mix(1), mix(2)};
}

constexpr std::array<std::array<double, 3>, 4> kFlame = {{{0, 0, 0}, {0.85, 0, 0}, {1, 0.85, 0}, {1, 1, 1}}};
constexpr std::array<std::array<double, 3>, 5> kSpectrum = {
    {{0, 0, 1}, {0, 1, 1}, {0, 1, 0}, {1, 1, 0}, {1, 0, 0}}};
constexpr std::array<std::array<double, 3>, 5> kDiverging = {
    {{0.02, 0.19, 0.38}, {0.40, 0.66, 0.81}, {0.97, 0.97, 0.97}, {0.94, 0.54, 0.38}, {0.40, 0.0, 0.12}}};

Colour in_palette(PaletteId palette, double t) {
  switch (palette) {
    case PaletteId::kGrey:
    case PaletteId::kRaw:
      return {level(t), level(t), level(t)};
    case PaletteId::kFlame:
      return between(kFlame, t);
    case PaletteId::kSpectrum:
      return between(kSpectrum, t);
    case PaletteId::kViridis:
      return fitted(kViridis, t);
    case PaletteId::kMagma:
      return fitted(kMagma, t);
    case PaletteId::kInferno:
      return fitted(kInferno, t);
    case PaletteId::kPlasma:
      return fitted(kPlasma, t);
    case PaletteId::kDiverging:
      return between(kDiverging, t);
  }
  return {};
}

constexpr std::size_t kShades = 256;

// Of a value; NaN for NaN.
float place(PaletteId palette, const Range& range, float value) {
  if (palette == PaletteId::kRaw) return value / 255.0F;
  if (range.high == range.low) return value > range.high ? 1.0F : value - range.low;
  return (value - range.low) / (range.high - range.low);
}

}  // namespace

Colour colour(PaletteId palette, float t) noexcept {
  return std::isnan(t) ? kNotANumber : in_palette(palette, std::clamp(t, 0.0F, 1.0F));
}

Colour colour(PaletteId palette, const Range& range, float value) noexcept {
  return colour(palette, place(palette, range, value));
}

void paint(PaletteId palette, const Range& range, const std::vector<float>& values,
           std::vector<std::uint8_t>& rgba) {
  std::array<Colour, kShades> shades;
  for (std::size_t i = 0; i < kShades; ++i)
    shades[i] = colour(palette, static_cast<float>(i) / (kShades - 1));
  rgba.resize(values.size() * 4);
  std::uint8_t* to = rgba.data();
  for (const float value : values) {
    const float t = place(palette, range, value);
    const Colour c = std::isnan(t)
                         ? kNotANumber
                         : shades[static_cast<std::size_t>(std::clamp(t, 0.0F, 1.0F) * (kShades - 1) + 0.5F)];
    *to++ = c.red;
    *to++ = c.green;
    *to++ = c.blue;
    *to++ = 255;
  }
}

}  // namespace apron::debugger
