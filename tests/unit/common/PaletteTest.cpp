#include "common/color/Palette.h"

#include <gtest/gtest.h>

#include "common/color/PaletteFile.h"
#include "common/error/UserError.h"

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

TEST(PaletteFile, PlacesColorsAndInterpolates) {
  add_palettes(
      parse_palettes("// mine\n\nramp #000000 #ff0000@0.5 #ffffff\n"
                     "step #000000 #0000ff@0.25 #00ff00@0.25 #00ff00\n",
                     "palettes.txt"));
  ASSERT_EQ(palette_count(), kPaletteCount + 2);
  const Palette ramp = *find_palette("RAMP"), step = *find_palette("step");
  EXPECT_EQ(palette_name(ramp), "ramp");
  EXPECT_EQ(palette_names()[kPaletteCount], "ramp");
  EXPECT_EQ(palette_color(ramp, 0.25F), (Rgb{0.5F, 0, 0}));
  EXPECT_EQ(palette_color(ramp, 0.75F), (Rgb{1, 0.5F, 0.5F}));
  EXPECT_EQ(palette_color(ramp, 2.0F), (Rgb{1, 1, 1}));
  EXPECT_GT(palette_color(step, 0.249F)[2], 0.99F);
  EXPECT_EQ(palette_color(step, 0.25F), (Rgb{0, 1, 0}));
}

TEST(PaletteFile, SpacesUnplacedColorsEqually) {
  const std::vector<CustomPalette> all =
      parse_palettes("even #000000 #111111 #222222@0.8 #333333 #444444", "f");
  const float expected[] = {0.0F, 0.4F, 0.8F, 0.9F, 1.0F};
  for (std::size_t i = 0; i < 5; ++i) EXPECT_FLOAT_EQ(all.at(0).stops.at(i).position, expected[i]) << i;
}

TEST(PaletteFile, NamesFileLineAndWordOfErrors) {
  const struct {
    const char *text, *expected;
  } kCases[] = {{"\nbad #000", "f:2: palette 'bad' has 1 colours"},
                {"a #000000 red", "f:1: 'red' is not a colour"},
                {"a #000000 #12345g", "f:1: '#12345g' is not a colour"},
                {"a #000000 #ffffff@2", "f:1: '#ffffff@2': the position"},
                {"a #000000 #ffffff@", "f:1: '#ffffff@': the position"},
                {"a #000000@0.5 #ffffff@0.2", "f:1: '#ffffff@0.2': positions must ascend"},
                {"1a #000000 #ffffff", "f:1: '1a' is not a palette's name"},
                {"Jet #000000 #ffffff", "f:1: there is already a palette 'Jet'"},
                {"b #000000 #ffffff\nb #000000 #ffffff", "f:2: there is already a palette 'b'"}};
  for (const auto& [text, expected] : kCases) {
    try {
      (void)parse_palettes(text, "f");
      ADD_FAILURE() << text;
    } catch (const UserError& error) {
      EXPECT_EQ(std::string(error.what()).rfind(expected, 0), 0U) << error.what();
    }
  }
}

}  // namespace
