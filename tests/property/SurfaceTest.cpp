// What the surface does to objects, and what it feels of them.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/property/PhysicsBench.h"

using namespace physics_bench;

namespace {

// All cells drag eastward like wheels of that surface speed.
void drag(PhysicsBench& bench, float speed) {
  auto& field = bench.cells().field();
  field.surface_velocity_x.assign(field.height.size(), speed);
  field.surface_velocity_y.assign(field.height.size(), 0.0F);
}

double pressure(PhysicsBench& bench) {
  double sum = 0;
  for (const float impulse : bench.cells().field().impulse) sum += static_cast<double>(impulse);
  return sum / bench.scene.world.dt_s;
}

}  // namespace

TEST(Surface, ABoxOnAConveyorMovesWithIt) {
  PhysicsBench bench;
  drag(bench, 2.0F);
  const auto id = bench.add(box({2, 2, 1}, {6, 15.3, 0.5}));
  bench.run(3.0);
  // It slips for v/µg, half as far as the belt meanwhile.
  const double slip_s = 2.0 / (0.5 * 9.81);
  EXPECT_NEAR(bench.velocity(id).x(), 2.0, 1e-3);
  EXPECT_NEAR(bench.position(id).x(), 6 + 2.0 * (3.0 - 0.5 * slip_s), 0.03);
  EXPECT_NEAR(bench.position(id).y(), 15.3, 0.01);
}

TEST(Surface, ASphereOnAConveyorTakesTwoSeventhsOfItsSpeed) {
  PhysicsBench bench;
  drag(bench, 3.5F);
  const auto id = bench.add(sphere(1.5, {6, 15.3, 1.5}));
  bench.run(3.0);
  EXPECT_NEAR(bench.velocity(id).x(), 1.0, 0.01);
  EXPECT_NEAR(bench.angular_velocity(id).y(), -2.5 / 1.5, 0.02);
}

TEST(Surface, ATurningCellTurnsWhatStandsOnIt) {
  PhysicsBench bench;
  auto& field = bench.cells().field();
  field.surface_velocity_x.assign(field.height.size(), 0.0F);
  field.surface_velocity_y = field.surface_spin = field.surface_velocity_x;
  for (int r = 0; r < 32; ++r)
    for (int c = 0; c < 32; ++c) bench.cells().set_target(0, r, c, r == 16 && c == 15 ? 1.0F : 0.0F);
  bench.run(1.0);
  field.surface_spin[16 * 32 + 15] = 2.0F;
  const auto id = bench.add(box({0.5, 0.5, 0.4}, {15, 15, 1.2}));
  bench.run(1.0);
  EXPECT_NEAR(bench.angular_velocity(id).z(), 2.0, 0.05);
}

TEST(Surface, PressureIsTheWeight) {
  PhysicsBench bench;
  bench.add(sphere(1.5, {5, 5.3, 1.5}));
  bench.add(box({3, 2, 1}, {15.3, 15.1, 0.5}));
  bench.add(cylinder(1, 2, {24, 20, 1}));
  bench.add(box({1, 1, 1}, {15.3, 15.1, 1.5}));
  bench.run(1.0);
  const double weight = 9.81 * (4.0 / 3.0 * M_PI * 1.5 * 1.5 * 1.5 + 6 + M_PI * 2 + 1);
  EXPECT_NEAR(pressure(bench), weight, 0.01 * weight);
}

TEST(Surface, PressureIsNothingWhereNothingLies) {
  PhysicsBench bench;
  bench.add(sphere(1.5, {5, 5.3, 1.5}));
  bench.run(0.5);
  const auto& field = bench.cells().field();
  EXPECT_GT(field.impulse[static_cast<std::size_t>(field.index(31 - 5, 5))], 0.0F);
  EXPECT_EQ(field.impulse[static_cast<std::size_t>(field.index(20, 20))], 0.0F);
}

TEST(Surface, ABoxCrossesTheGapsOfALevelFieldWithoutSnagging) {
  for (const double yaw : {0.0, 0.3, 0.7854}) {
    PhysicsBench bench;
    bench.scene.materials[0].friction = 0.0;
    auto object = box({2, 1.5, 1}, {6, 6, 0.5});
    object.orientation = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ());
    object.velocity = {4, 3.7, 0};
    const auto id = bench.add(object);
    double highest = 0;
    bench.run(4.0, [&] { highest = std::max(highest, static_cast<double>(bench.position(id).z())); });
    EXPECT_NEAR(bench.position(id).x(), 22, 0.02) << yaw;
    EXPECT_NEAR(bench.position(id).y(), 20.8, 0.02) << yaw;
    EXPECT_LT(highest, 0.503) << yaw;
    EXPECT_LT(bench.angular_velocity(id).norm(), 0.01) << yaw;
  }
}

TEST(Surface, WhatIsNarrowerThanAGapFallsIn) {
  PhysicsBench bench;
  bench.cells();
  std::vector<float> targets(32 * 32, 2.0F);
  bench.cells().set_targets(0, targets);
  bench.run(1.0);
  const auto id = bench.add(sphere(0.08, {15.5, 15.5, 2.5}));
  bench.run(1.0);
  EXPECT_LT(bench.position(id).z(), 1.0);
}

TEST(Surface, NoCellNoSupport) {
  PhysicsBench bench;
  auto& field = bench.cells().field();
  for (int r = 10; r < 22; ++r)
    for (int c = 10; c < 22; ++c)
      field.height[static_cast<std::size_t>(field.index(r, c))] = smartsurf::surface::kNoCellHeight;
  const auto through = bench.add(sphere(1.0, {15.5, 15.5, 2.0}));
  const auto held = bench.add(sphere(1.0, {5, 5, 2.0}));
  bench.run(1.0);
  EXPECT_LT(bench.position(through).z(), 0.0);
  EXPECT_NEAR(bench.position(held).z(), 1.0, 0.01);
}

TEST(Surface, TheGroundCatchesWhatFallsOff) {
  PhysicsBench bench;  // the floor is a pin's length under the lowest top
  const auto ball = bench.add(sphere(1.0, {-5, 15, 3}));
  const auto brick = bench.add(box({2, 2, 1}, {-5, 20, 3}));
  bench.run(3.0);
  EXPECT_NEAR(bench.position(ball).z(), -1.0, 0.01);
  EXPECT_NEAR(bench.position(brick).z(), -1.5, 0.01);
}

namespace {

// The same square field, its cells given one by one: every second row turned by a quarter.
void scatter(PhysicsBench& bench) {
  auto& field = bench.cells().field();
  for (int r = 0; r < field.rows; ++r)
    for (int c = 0; c < field.columns; ++c) {
      field.x.push_back(static_cast<float>(c));
      field.y.push_back(static_cast<float>(field.rows - 1 - r));
      field.angle.push_back(r % 2 ? 1.5707963F : 0.0F);
    }
}

}  // namespace

TEST(LooseLayout, ALevelFieldIsAPlaneThere) {
  PhysicsBench bench;
  scatter(bench);
  auto ball = sphere(1.5, {6, 15.3, 1.5});
  ball.velocity = {3, 0.4, 0};
  ball.angular_velocity = {-0.4 / 1.5, 3 / 1.5, 0};
  const auto rolling = bench.add(ball);
  auto brick = box({2, 2, 1}, {6, 24.2, 0.5});
  brick.velocity = {4, 0, 0};
  const auto sliding = bench.add(brick);
  double highest = 0;
  bench.run(4.0, [&] { highest = std::max(highest, static_cast<double>(bench.position(rolling).z())); });
  EXPECT_NEAR(bench.position(rolling).x(), 18, 0.1);
  EXPECT_NEAR(bench.position(rolling).y(), 16.9, 0.1);
  EXPECT_LT(highest, 1.505);
  EXPECT_NEAR(bench.position(sliding).x() - 6, 16 / (2 * 0.5 * 9.81), 0.05);
}

TEST(LooseLayout, CellsHoldAndPushFromWhereTheyStand) {
  PhysicsBench bench;
  scatter(bench);
  auto& field = bench.cells().field();
  // Two cells change places, far apart.
  const auto near = static_cast<std::size_t>(field.index(16, 15)),
             far = static_cast<std::size_t>(field.index(2, 2));
  std::swap(field.x[near], field.x[far]);
  std::swap(field.y[near], field.y[far]);
  const auto id = bench.add(sphere(0.6, {15, 15, 0.6}));
  bench.run(1.0);
  bench.cells().set_target(0, 2, 2, 3.0F);
  bench.run(1.0);
  EXPECT_GT(field.height[far], 2.9F);
  // It stood on the cell that rose, and rolled off it.
  EXPECT_GT((bench.position(id) - Eigen::Vector3f(15, 15, 0.6F)).norm(), 0.5F);
}
