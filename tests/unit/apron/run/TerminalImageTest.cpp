#include "apron/run/cli/TerminalImage.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace apron::run {
namespace {

vm::ConstPlane plane(const std::vector<float>& cells, std::uint32_t width) {
  return {cells.data(), width, static_cast<std::uint32_t>(cells.size()) / width, std::ptrdiff_t{width}};
}

TEST(TerminalImage, MapsMinimumToDarkAndMaximumToBright) {
  const std::vector<float> cells{0, 1, 2, 3, 4, 5, 6, 7, 8, 9};
  EXPECT_EQ(render_ascii(plane(cells, 10), {}), " .:-=+*#%@\n");
  EXPECT_EQ(render_ascii(plane(cells, 5), {}), " .:-=\n+*#%@\n");
}

TEST(TerminalImage, ConstantImageIsDark) { EXPECT_EQ(render_ascii(plane({3, 3, 3, 3}, 2), {}), "  \n  \n"); }

TEST(TerminalImage, DrawsNonFiniteAsMinimum) {
  EXPECT_EQ(render_ascii(plane({NAN, 1, INFINITY, 2}, 4), {}), "   @\n");
  EXPECT_EQ(render_ascii(plane({NAN, NAN}, 2), {}), "  \n");
}

// 4x4 cells in 2x2 blocks with the means 0, 9, 1 and 5.
TEST(TerminalImage, DownscalesLargeArrays) {
  const std::vector<float> cells{0, 0, 9, 9, 0, 0, 9, 9, 1, 1, 10, 0, 1, 1, 0, 10};
  EXPECT_EQ(render_ascii(plane(cells, 4), {2, 20}), " @\n.+\n");
  EXPECT_EQ(render_ascii(plane(cells, 4), {20, 2}), " @\n.+\n");
  EXPECT_EQ(render_ascii(plane(cells, 4), {1, 1}), " \n");
}

TEST(TerminalImage, AnsiShowsTwoRowsPerLine) {
  EXPECT_EQ(render_ansi(plane({0, 1}, 1), {}), "\x1b[38;5;17m\x1b[48;5;227m\u2580\x1b[0m\x1b[K\n");
  EXPECT_EQ(render_ansi(plane({0, 0, 1}, 1), {}),
            "\x1b[38;5;17m\x1b[48;5;17m\u2580\x1b[0m\x1b[K\n\x1b[38;5;227m\u2580\x1b[0m\x1b[K\n");
}

}  // namespace
}  // namespace apron::run
