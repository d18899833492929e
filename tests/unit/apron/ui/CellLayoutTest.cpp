// Where cells lie, against the lattice of their centres.
#include "apron/ui/CellLayout.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

namespace apron::ui::test {
namespace {

using Positions = std::vector<std::array<float, 3>>;

// docs/actuators.md: the southernmost row begins at x = 0; of the rows north of it the first, third, … are
// shifted east.
Positions hexagonal_positions(std::uint32_t rows, std::uint32_t columns, double pitch) {
  Positions positions;
  for (std::uint32_t y = 0; y < rows; ++y)
    for (std::uint32_t x = 0; x < columns; ++x) {
      const std::uint32_t from_south = rows - 1 - y;
      positions.push_back({static_cast<float>(pitch * (x + (from_south % 2 == 1 ? 0.5 : 0.0))),
                           static_cast<float>(pitch * from_south * std::numbers::sqrt3 / 2.0), 0.0F});
    }
  return positions;
}

TEST(CellLayout, RowsShiftAsOnTheTable) {
  std::mt19937 random(7);
  const auto draw = [&] { return static_cast<std::uint32_t>(random()); };
  for (int n = 0; n < 40; ++n) {
    const std::uint32_t rows = 2 + draw() % 30, columns = 1 + draw() % 30;
    const double pitch = 0.1 + 0.01 * (draw() % 1000);
    Positions positions = hexagonal_positions(rows, columns, pitch);
    const CellLayout layout = CellLayout::of_surface(positions, rows, columns, pitch);
    ASSERT_TRUE(layout.hexagonal());
    // Centres differ from each other as the cells on the table do.
    for (int pair = 0; pair < 20; ++pair) {
      const debugger::Cell a{draw() % columns, draw() % rows}, b{draw() % columns, draw() % rows};
      const auto &at_a = positions[a.y * columns + a.x], &at_b = positions[b.y * columns + b.x];
      EXPECT_NEAR(layout.centre(a).x - layout.centre(b).x, (at_a[0] - at_b[0]) / pitch, 1e-3);
      EXPECT_NEAR(layout.centre(b).y - layout.centre(a).y, (at_a[1] - at_b[1]) / pitch, 1e-3);
    }
    positions[draw() % positions.size()][draw() % 2] += static_cast<float>(0.02 * pitch);
    EXPECT_FALSE(CellLayout::of_surface(positions, rows, columns, pitch).hexagonal())
        << "a cell lies elsewhere";
  }
  EXPECT_FALSE(CellLayout::of_surface({}, 4, 4, 1.0).hexagonal());
}

TEST(CellLayout, PointsBelongToTheHexagonAroundThem) {
  std::mt19937 random(11);
  const auto draw = [&] { return static_cast<std::uint32_t>(random()); };
  for (const bool first_row_shifted : {false, true})
    for (int n = 0; n < 3000; ++n) {
      const CellLayout layout = CellLayout::hexagons(first_row_shifted);
      const std::uint32_t width = 1 + draw() % 9, height = 2 + draw() % 9;
      const CellPoint extent = layout.extent(width, height);
      std::uniform_real_distribution<float> x(-0.3F, extent.x + 0.3F), y(-0.3F, extent.y + 0.3F);
      const CellPoint point{x(random), y(random)};
      // A hexagon is what lies within half a width of its centre in the three directions across its sides.
      std::optional<debugger::Cell> right;
      float margin = 1.0F;  // from the nearest side of a hexagon
      for (std::uint32_t row = 0; row < height; ++row)
        for (std::uint32_t column = 0; column < width; ++column) {
          const CellPoint centre = layout.centre({column, row});
          float across = 0.0F;
          for (const double turn : {0.0, std::numbers::pi / 3.0, -std::numbers::pi / 3.0})
            across = std::max(across, std::abs((point.x - centre.x) * static_cast<float>(std::cos(turn)) +
                                               (point.y - centre.y) * static_cast<float>(std::sin(turn))));
          margin = std::min(margin, std::abs(across - 0.5F));
          if (across < 0.5F) right = debugger::Cell{column, row};
        }
      if (margin < 1e-4F) continue;
      EXPECT_EQ(layout.cell_at(point, width, height), right) << point.x << ' ' << point.y;
    }
}

TEST(CellLayout, SquaresAreTheArray) {
  const CellLayout layout;
  EXPECT_EQ(layout.cell_at({2.9F, 0.1F}, 4, 3), (debugger::Cell{2, 0}));
  EXPECT_EQ(layout.cell_at({4.1F, 0.1F}, 4, 3), std::nullopt);
  EXPECT_EQ(layout.cell_at({-0.1F, 0.1F}, 4, 3), std::nullopt);
  EXPECT_EQ(layout.cell_at({0.5F, 3.5F}, 4, 3), std::nullopt);
  EXPECT_EQ(layout.extent(4, 3).x, 4.0F);
}

}  // namespace
}  // namespace apron::ui::test
