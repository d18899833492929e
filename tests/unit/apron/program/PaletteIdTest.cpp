#include "apron/program/PaletteId.h"

#include <gtest/gtest.h>

namespace apron::program {
namespace {

TEST(PaletteName, EachPaletteIsFoundByItsName) {
  for (std::size_t i = 0; i < kPaletteCount; ++i) {
    const auto palette = static_cast<PaletteId>(i);
    EXPECT_EQ(find_palette(palette_name(palette)), palette) << palette_name(palette);
  }
  EXPECT_EQ(palette_name(PaletteId::kDiverging), "diverging");
}

TEST(PaletteName, OtherNamesAndCases) {
  EXPECT_EQ(find_palette("Gray"), PaletteId::kGrey);
  EXPECT_EQ(find_palette("JET"), PaletteId::kSpectrum);
  EXPECT_EQ(find_palette("hot"), PaletteId::kFlame);
  EXPECT_EQ(find_palette("gre"), std::nullopt);
  EXPECT_EQ(find_palette("greyer"), std::nullopt);
  EXPECT_EQ(find_palette(""), std::nullopt);
}

TEST(PaletteName, AllNamesAreFound) {
  for (const std::string& one : palette_names()) EXPECT_TRUE(find_palette(one)) << one;
  EXPECT_GT(palette_names().size(), kPaletteCount);
}

}  // namespace
}  // namespace apron::program
