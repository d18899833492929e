#include "apron/program/Palette.h"

#include <gtest/gtest.h>

namespace apron::program {
namespace {

TEST(PaletteName, EachPaletteIsFoundByItsName) {
  for (std::size_t i = 0; i < kPalettes; ++i) {
    const auto palette = static_cast<Palette>(i);
    EXPECT_EQ(find_palette(name(palette)), palette) << name(palette);
  }
  EXPECT_EQ(name(Palette::kDiverging), "diverging");
}

TEST(PaletteName, OtherNamesAndCases) {
  EXPECT_EQ(find_palette("Gray"), Palette::kGrey);
  EXPECT_EQ(find_palette("JET"), Palette::kSpectrum);
  EXPECT_EQ(find_palette("hot"), Palette::kFlame);
  EXPECT_EQ(find_palette("gre"), std::nullopt);
  EXPECT_EQ(find_palette("greyer"), std::nullopt);
  EXPECT_EQ(find_palette(""), std::nullopt);
}

TEST(PaletteName, AllNamesAreFound) {
  for (const std::string& one : palette_names()) EXPECT_TRUE(find_palette(one)) << one;
  EXPECT_GT(palette_names().size(), kPalettes);
}

}  // namespace
}  // namespace apron::program
