#include "common/color/Palette.h"

#include <gtest/gtest.h>

using namespace common;

namespace {

TEST(Palette, NamesRoundTrip) {
  for (std::size_t i = 0; i < kPaletteCount; ++i) {
    const auto palette = static_cast<Palette>(i);
    EXPECT_EQ(find_palette(palette_name(palette)), palette);
  }
  EXPECT_EQ(palette_name(Palette::kDiverging), "diverging");
}

TEST(Palette, FindsAliasesInAnyCase) {
  EXPECT_EQ(find_palette("Gray"), Palette::kGrey);
  EXPECT_EQ(find_palette("JET"), Palette::kSpectrum);
  for (const char* unknown : {"gre", "greyer", ""}) EXPECT_FALSE(find_palette(unknown)) << unknown;
  for (const std::string& known : palette_names()) EXPECT_TRUE(find_palette(known)) << known;
  EXPECT_GT(palette_names().size(), kPaletteCount);
}

TEST(Palette, EndsAreTheDocumentedColours) {
  EXPECT_EQ(palette_color(Palette::kGrey, -1.0F), (Rgb{0, 0, 0}));
  EXPECT_EQ(palette_color(Palette::kFlame, 2.0F), (Rgb{1, 1, 1}));
  const Rgb dark = palette_color(Palette::kViridis, 0.0F), bright = palette_color(Palette::kViridis, 1.0F);
  EXPECT_NEAR(dark[0], 0.267, 0.011);  // the original table's ends: #440154 and #fde725
  EXPECT_NEAR(dark[2], 0.329, 0.011);
  EXPECT_NEAR(bright[0], 0.993, 0.011);
  EXPECT_NEAR(bright[1], 0.906, 0.011);
}

}  // namespace
