#include "apron/debugger/ColorMap.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <limits>

namespace apron::debugger {
namespace {

void expect_near(const Rgb8& c, double red, double green, double blue, const char* what) {
  constexpr double kTolerance = 7.0;  // of 255: the approximation error of the polynomials
  EXPECT_NEAR(c.red, red * 255.0, kTolerance) << what;
  EXPECT_NEAR(c.green, green * 255.0, kTolerance) << what;
  EXPECT_NEAR(c.blue, blue * 255.0, kTolerance) << what;
}

// The expected values are entries 0, 128 and 255 of the published tables.
TEST(ColorMap, PerceptualMapsMatchPublishedTables) {
  expect_near(palette_rgb8(common::Palette::kViridis, 0.0F), 0.267004, 0.004874, 0.329415, "viridis");
  expect_near(palette_rgb8(common::Palette::kViridis, 0.5F), 0.127568, 0.566949, 0.550556, "viridis");
  expect_near(palette_rgb8(common::Palette::kViridis, 1.0F), 0.993248, 0.906157, 0.143936, "viridis");
  expect_near(palette_rgb8(common::Palette::kMagma, 0.0F), 0.001462, 0.000466, 0.013866, "magma");
  expect_near(palette_rgb8(common::Palette::kMagma, 0.5F), 0.716387, 0.214982, 0.475290, "magma");
  expect_near(palette_rgb8(common::Palette::kMagma, 1.0F), 0.987053, 0.991438, 0.749504, "magma");
  expect_near(palette_rgb8(common::Palette::kInferno, 0.5F), 0.735683, 0.215906, 0.330245, "inferno");
  expect_near(palette_rgb8(common::Palette::kInferno, 1.0F), 0.988362, 0.998364, 0.644924, "inferno");
  expect_near(palette_rgb8(common::Palette::kPlasma, 0.0F), 0.050383, 0.029803, 0.527975, "plasma");
  expect_near(palette_rgb8(common::Palette::kPlasma, 0.5F), 0.798216, 0.280197, 0.469538, "plasma");
}

TEST(ColorMap, SimpleMapsHaveExpectedEnds) {
  EXPECT_EQ(palette_rgb8(common::Palette::kGrey, 0.0F), (Rgb8{0, 0, 0}));
  EXPECT_EQ(palette_rgb8(common::Palette::kGrey, 0.5F), (Rgb8{128, 128, 128}));
  EXPECT_EQ(palette_rgb8(common::Palette::kGrey, 1.0F), (Rgb8{255, 255, 255}));
  EXPECT_EQ(palette_rgb8(common::Palette::kFlame, 0.0F), (Rgb8{0, 0, 0}));
  EXPECT_EQ(palette_rgb8(common::Palette::kFlame, 1.0F), (Rgb8{255, 255, 255}));
  EXPECT_EQ(palette_rgb8(common::Palette::kSpectrum, 0.0F), (Rgb8{0, 0, 255}));
  EXPECT_EQ(palette_rgb8(common::Palette::kSpectrum, 0.5F), (Rgb8{0, 255, 0}));
  EXPECT_EQ(palette_rgb8(common::Palette::kSpectrum, 1.0F), (Rgb8{255, 0, 0}));
  // kRaw ignores the range: the value is the grey level.
  EXPECT_EQ(palette_rgb8(common::Palette::kRaw, ValueRange{0.0F, 1.0F}, 100.0F), (Rgb8{100, 100, 100}));
}

TEST(ColorMap, ClampsValuesAndMarksNaN) {
  EXPECT_EQ(palette_rgb8(common::Palette::kGrey, ValueRange{2.0F, 4.0F}, 1.0F), (Rgb8{0, 0, 0}));
  EXPECT_EQ(palette_rgb8(common::Palette::kGrey, ValueRange{2.0F, 4.0F}, 3.0F), (Rgb8{128, 128, 128}));
  EXPECT_EQ(palette_rgb8(common::Palette::kGrey, ValueRange{2.0F, 4.0F}, INFINITY), (Rgb8{255, 255, 255}));
  EXPECT_EQ(palette_rgb8(common::Palette::kGrey, ValueRange{3.0F, 3.0F}, 3.0F), (Rgb8{0, 0, 0}));
  EXPECT_EQ(palette_rgb8(common::Palette::kViridis, NAN), kNanColor);
}

TEST(ColorMap, ApplyPaletteMatchesSingleColors) {
  std::vector<float> values{-1.0F, 0.0F, 0.3F, 1.0F, 2.0F, NAN};
  std::vector<std::uint8_t> rgba;
  for (std::size_t i = 0; i < common::kPaletteCount; ++i) {
    const auto palette = static_cast<common::Palette>(i);
    apply_palette(palette, {0.0F, 1.0F}, values, rgba);
    ASSERT_EQ(rgba.size(), values.size() * 4);
    for (std::size_t k = 0; k < values.size(); ++k) {
      const Rgb8 c = palette_rgb8(palette, ValueRange{0.0F, 1.0F}, values[k]);
      EXPECT_LE(std::abs(rgba[4 * k] - c.red), 3) << palette_name(palette) << " " << values[k];
      EXPECT_LE(std::abs(rgba[4 * k + 1] - c.green), 3) << palette_name(palette) << " " << values[k];
      EXPECT_LE(std::abs(rgba[4 * k + 2] - c.blue), 3) << palette_name(palette) << " " << values[k];
      EXPECT_EQ(rgba[4 * k + 3], 255);
    }
  }
}

}  // namespace
}  // namespace apron::debugger
