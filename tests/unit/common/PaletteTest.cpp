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

TEST(Palette, ViridisMatchesPublishedTable) {
  const struct {
    float t;
    Rgb color;
  } kTable[] = {
      {-1.0F, {0.267F, 0.005F, 0.329F}}, {0.5F, {0.128F, 0.567F, 0.551F}}, {2.0F, {0.993F, 0.906F, 0.144F}}};
  for (const auto& entry : kTable) {
    const Rgb color = palette_color(Palette::kViridis, entry.t);
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(color[c], entry.color[c], 0.015F) << entry.t;
  }
}

TEST(Palette, EndsHaveDocumentedColours) {
  EXPECT_EQ(palette_color(Palette::kGrey, -1.0F), (Rgb{0, 0, 0}));
  EXPECT_EQ(palette_color(Palette::kFlame, 2.0F), (Rgb{1, 1, 1}));
  const Rgb dark = palette_color(Palette::kViridis, 0.0F), bright = palette_color(Palette::kViridis, 1.0F);
  EXPECT_NEAR(dark[0], 0.267, 0.011);  // the original table's ends: #440154 and #fde725
  EXPECT_NEAR(dark[2], 0.329, 0.011);
  EXPECT_NEAR(bright[0], 0.993, 0.011);
  EXPECT_NEAR(bright[1], 0.906, 0.011);
}

}  // namespace
