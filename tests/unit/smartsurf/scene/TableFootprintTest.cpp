#include "smartsurf/scene/TableFootprint.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace smartsurf::scene {
namespace {

SurfaceSpec grid(int rows, int columns, double pitch = 1.0) {
  SurfaceSpec surface;
  surface.rows = rows;
  surface.columns = columns;
  surface.pitch = pitch;
  return surface;
}

// Like `layout = 'hex'`: every second row is shifted by half a pitch.
SurfaceSpec hex(int rows, int columns, double pitch) {
  SurfaceSpec surface = grid(rows, columns, pitch);
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c)
      surface.cell_poses.push_back(
          {(c + 0.5 * (r % 2)) * pitch, (rows - 1 - r) * pitch * std::numbers::sqrt3 / 2.0, 0.0});
  return surface;
}

// The cells of a pitch-1 grid whose distance from the centre is between `hole` and `radius`.
SurfaceSpec disc(double radius, double hole) {
  const int n = 2 * static_cast<int>(radius) + 1;
  SurfaceSpec surface = grid(n, n);
  for (int r = 0; r < n; ++r)
    for (int c = 0; c < n; ++c) {
      const double from_middle = std::hypot(r - n / 2, c - n / 2);
      surface.actuator_of_cell.push_back(from_middle < hole || from_middle > radius ? kEmptyCell
                                                                                    : std::int8_t{0});
    }
  return surface;
}

TEST(TableOutline, RectangularGridIsExact) {
  const TableFootprint outline(grid(4, 8, 2.0));
  EXPECT_TRUE(outline.contains(-0.999, -0.999));
  EXPECT_TRUE(outline.contains(14.999, 6.999));
  EXPECT_FALSE(outline.contains(-1.001, 3));
  EXPECT_FALSE(outline.contains(15.001, 3));
  EXPECT_FALSE(outline.contains(3, -1.001));
  EXPECT_FALSE(outline.contains(3, 7.001));
  EXPECT_FALSE(outline.contains(std::numeric_limits<double>::quiet_NaN(), 3));
}

TEST(TableOutline, SkinCoversEmptyCells) {
  SurfaceSpec surface = grid(21, 21, 2.5);
  for (int i = 0; i < surface.cell_count(); ++i)
    surface.actuator_of_cell.push_back(i / 21 % 20 == 0 && i % 21 % 20 == 0 ? std::int8_t{0} : kEmptyCell);
  EXPECT_FALSE(TableFootprint(surface).contains(25, 25));
  surface.skin.emplace();
  const TableFootprint outline(surface);
  EXPECT_TRUE(outline.contains(25, 25));
  EXPECT_TRUE(outline.contains(51.2, 10));
  EXPECT_FALSE(outline.contains(51.3, 10));
}

TEST(TableOutline, HexLayoutFollowsRows) {
  const double pitch = 2.0;
  const TableFootprint outline(hex(10, 12, pitch));
  const double north = 9 * pitch * std::numbers::sqrt3 / 2.0, east = 11.5 * pitch, rim = pitch / 2.0;
  EXPECT_TRUE(outline.contains(10, north + 0.7 * rim));
  EXPECT_FALSE(outline.contains(10, north + 1.3 * rim)) << "a rectangle of ten rows would reach beyond";
  EXPECT_TRUE(outline.contains(east + 0.7 * rim, north / 2));
  EXPECT_FALSE(outline.contains(east + 1.3 * rim, north / 2));
  EXPECT_TRUE(outline.contains(-0.7 * rim, north / 2));
  EXPECT_FALSE(outline.contains(-1.3 * rim, north / 2));
  EXPECT_FALSE(outline.contains(-1e30, std::numeric_limits<double>::infinity()));
}

TEST(TableOutline, RoundTable) {
  const double radius = 12.0;
  const TableFootprint outline(disc(radius, 0.0));
  for (int k = 0; k < 64; ++k) {
    const double angle = k * std::numbers::pi / 32, x = std::cos(angle), y = std::sin(angle);
    EXPECT_TRUE(outline.contains(12 + (radius - 1) * x, 12 + (radius - 1) * y)) << k;
    EXPECT_FALSE(outline.contains(12 + (radius + 1.5) * x, 12 + (radius + 1.5) * y)) << k;
  }
  EXPECT_FALSE(outline.contains(0, 0)) << "a corner of the array";
}

TEST(TableOutline, FillsHolesAndNarrowGaps) {
  const TableFootprint ring(disc(12.0, 5.0));
  EXPECT_TRUE(ring.contains(12, 12));
  SurfaceSpec modules = grid(2, 4);
  for (int r = 0; r < 2; ++r)
    for (int c = 0; c < 4; ++c) modules.cell_poses.push_back({c + (c < 2 ? 0.0 : 1.5), 1.0 - r, 0.0});
  const TableFootprint narrow(modules);
  EXPECT_TRUE(narrow.contains(2.25, 0.5)) << "a gap of 1.5";
  EXPECT_FALSE(narrow.contains(2.25, 1.8));
  for (CellPose& place : modules.cell_poses) place.x += place.x > 2 ? 3.0 : 0.0;
  const TableFootprint wide(modules);
  EXPECT_FALSE(wide.contains(3.75, 0.5)) << "a gap of 4.5";
  EXPECT_TRUE(wide.contains(6.5, 0.5));
}

TEST(TableOutline, LShapeKeepsInnerCorner) {
  SurfaceSpec surface = grid(20, 20);
  for (int r = 0; r < 20; ++r)
    for (int c = 0; c < 20; ++c)
      surface.actuator_of_cell.push_back(r < 10 && c >= 10 ? kEmptyCell : std::int8_t{0});
  const TableFootprint outline(surface);
  EXPECT_TRUE(outline.contains(9, 18));
  EXPECT_TRUE(outline.contains(18, 9));
  EXPECT_FALSE(outline.contains(10.2, 10.2));
  EXPECT_FALSE(outline.contains(15, 15));
}

TEST(TableOutline, RotatedTable) {
  SurfaceSpec surface = grid(5, 5);
  const double turn = std::numbers::pi / 4, k = std::sqrt(0.5);
  for (int r = 0; r < 5; ++r)
    for (int c = 0; c < 5; ++c)
      surface.cell_poses.push_back({k * (c - 2) - k * (2 - r), k * (c - 2) + k * (2 - r), turn});
  const TableFootprint outline(surface);
  EXPECT_TRUE(outline.contains(3.0, 0)) << "towards a corner";
  EXPECT_FALSE(outline.contains(3.9, 0));
  EXPECT_TRUE(outline.contains(1.55, 1.55)) << "towards an edge";
  EXPECT_FALSE(outline.contains(2.05, 2.05));
}

TEST(TableOutline, SparseCellsUseNeighbourDistance) {
  SurfaceSpec surface = grid(5, 5);
  for (int r = 0; r < 5; ++r)
    for (int c = 0; c < 5; ++c) surface.cell_poses.push_back({6.0 * c, 6.0 * r, 0.0});
  const TableFootprint outline(surface);
  EXPECT_TRUE(outline.contains(9, 9)) << "between four";
  EXPECT_TRUE(outline.contains(-2.5, 12));
  EXPECT_FALSE(outline.contains(-3.5, 12));
}

TEST(TableOutline, DistantAndEmptyCellsLimitRasterSize) {
  SurfaceSpec surface = grid(1, 3);
  surface.cell_poses = {{0, 0, 0}, {1, 0, 0}, {1e6, 1e6, 0}};
  const TableFootprint outline(surface);
  EXPECT_TRUE(outline.contains(0.5, 0));
  EXPECT_FALSE(outline.contains(5e5, 5e5));
  surface.cell_poses.clear();
  surface.actuator_of_cell.assign(3, kEmptyCell);
  EXPECT_FALSE(TableFootprint(surface).contains(0, 0));
}

}  // namespace
}  // namespace smartsurf::scene
