#include "smartsurf/scene/CellOverlap.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace smartsurf::scene {
namespace {

SurfaceSpec cells_at(std::vector<CellPose> poses, double top_x = 0.8, double top_y = 0.8) {
  SurfaceSpec s;
  s.rows = 1;
  s.columns = static_cast<int>(poses.size());
  s.pin.top_x = top_x;
  s.pin.top_y = top_y;
  s.cell_poses = std::move(poses);
  return s;
}

TEST(CellOverlap, TouchingTopsDoNotOverlap) {
  EXPECT_FALSE(find_overlap(cells_at({})));
  EXPECT_FALSE(find_overlap(cells_at({{0, 0, 0}, {0.8, 0, 0}, {0.8, 0.8, 0}, {0, -0.8, 0}})));
  EXPECT_FALSE(find_overlap(cells_at({{0, 0, 0}, {0.8 * std::sqrt(0.5) + 0.4, 0, std::numbers::pi / 4}})));
  EXPECT_FALSE(find_overlap(cells_at({{0, 0, 0}, {0, 0.4, 0}}, 1.0, 0.4)));
}

TEST(CellOverlap, NamesThePairAndTheDepth) {
  const auto side = find_overlap(cells_at({{5, 5, 0}, {0.7, 0.2, 0}, {0, 0, 0}}));
  ASSERT_TRUE(side);
  EXPECT_EQ(side->first, 1);
  EXPECT_EQ(side->second, 2);
  EXPECT_NEAR(side->depth, 0.1, 1e-12);
  const auto corner =
      find_overlap(cells_at({{0, 0, 0}, {0.8 * std::sqrt(0.5) + 0.35, 0, std::numbers::pi / 4}}));
  ASSERT_TRUE(corner);
  EXPECT_NEAR(corner->depth, 0.05, 1e-12);
  EXPECT_TRUE(find_overlap(cells_at({{1, 2, 0.5}, {1, 2, 0.5}})));
  EXPECT_TRUE(find_overlap(cells_at(std::vector<CellPose>(200'000, CellPose{3, 3, 0})))) << "in linear time";
}

TEST(CellOverlap, EmptyCellsHaveNoTop) {
  SurfaceSpec s = cells_at({{0, 0, 0}, {0.1, 0, 0}});
  s.actuator_of_cell = {0, kEmptyCell};
  EXPECT_FALSE(find_overlap(s));
}

// Against all pairs, each tested by a grid of points of one top inside the other.
TEST(CellOverlap, MatchesPointsOfOneTopInsideAnother) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> coordinate(-1.5, 1.5), angle(-4, 4);
  int overlapping = 0;
  for (int trial = 0; trial < 300; ++trial) {
    std::vector<CellPose> poses;
    for (int i = 0; i < 3; ++i) poses.push_back({coordinate(random), coordinate(random), angle(random)});
    constexpr double kX = 1.0, kY = 0.4;
    bool expected = false;
    for (const CellPose& a : poses)
      for (const CellPose& b : poses)
        for (double u = -0.5; &a != &b && u <= 0.5001; u += 0.01)
          for (double v = -0.5; v <= 0.5001; v += 0.025) {
            const double x = a.x + u * kX * std::cos(a.angle) - v * kY * std::sin(a.angle) - b.x;
            const double y = a.y + u * kX * std::sin(a.angle) + v * kY * std::cos(a.angle) - b.y;
            expected |= std::abs(x * std::cos(b.angle) + y * std::sin(b.angle)) < kX / 2 &&
                        std::abs(y * std::cos(b.angle) - x * std::sin(b.angle)) < kY / 2;
          }
    const auto found = find_overlap(cells_at(poses, kX, kY));
    // Overlaps thinner than the grid of points may be missed by it.
    if (!found || found->depth > 0.02) {
      EXPECT_EQ(found.has_value(), expected) << trial;
    }
    overlapping += expected;
  }
  EXPECT_GT(overlapping, 50);
  EXPECT_LT(overlapping, 250);
}

}  // namespace
}  // namespace smartsurf::scene
