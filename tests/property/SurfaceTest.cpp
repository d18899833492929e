// Support, conveying and load of the surface against closed forms, also in free layouts.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;

namespace {

// All cells convey eastward, like wheels of that surface speed, u/s.
void set_belt_speed(PhysicsFixture& fixture, float speed) {
  auto& field = fixture.cells().field();
  field.surface_velocity_x.assign(field.height.size(), speed);
  field.surface_velocity_y.assign(field.height.size(), 0.0F);
}

double total_normal_force(PhysicsFixture& fixture) {
  double sum = 0;
  for (const float impulse : fixture.cells().field().impulse) sum += static_cast<double>(impulse);
  return sum / fixture.scene.world.dt_s;
}

}  // namespace

TEST(Surface, BoxReachesConveyorSpeed) {
  PhysicsFixture fixture;
  set_belt_speed(fixture, 2.0F);
  const auto id = fixture.add(box({2, 2, 1}, {6, 15.3, 0.5}));
  fixture.run(3.0);
  // The box slips for v/(µ·g) and moves half as far as the belt in that time.
  const double slip_s = 2.0 / (0.5 * 9.81);
  EXPECT_NEAR(fixture.velocity(id).x(), 2.0, 1e-3);
  EXPECT_NEAR(fixture.position(id).x(), 6 + 2.0 * (3.0 - 0.5 * slip_s), 0.03);
  EXPECT_NEAR(fixture.position(id).y(), 15.3, 0.01);
}

TEST(Surface, SphereReachesTwoSeventhsOfConveyorSpeed) {
  PhysicsFixture fixture;
  set_belt_speed(fixture, 3.5F);
  const auto id = fixture.add(sphere(1.5, {6, 15.3, 1.5}));
  fixture.run(3.0);
  EXPECT_NEAR(fixture.velocity(id).x(), 1.0, 0.01);
  EXPECT_NEAR(fixture.angular_velocity(id).y(), -2.5 / 1.5, 0.02);
}

TEST(Surface, SpinningCellRotatesBoxOnIt) {
  PhysicsFixture fixture;
  auto& field = fixture.cells().field();
  field.surface_velocity_x.assign(field.height.size(), 0.0F);
  field.surface_velocity_y = field.surface_spin = field.surface_velocity_x;
  for (int r = 0; r < 32; ++r)
    for (int c = 0; c < 32; ++c) fixture.cells().set_target(0, r, c, r == 16 && c == 15 ? 1.0F : 0.0F);
  fixture.run(1.0);
  field.surface_spin[16 * 32 + 15] = 2.0F;
  const auto id = fixture.add(box({0.5, 0.5, 0.4}, {15, 15, 1.2}));
  fixture.run(1.0);
  EXPECT_NEAR(fixture.angular_velocity(id).z(), 2.0, 0.05);
}

TEST(Surface, TotalForceEqualsWeight) {
  PhysicsFixture fixture;
  fixture.add(sphere(1.5, {5, 5.3, 1.5}));
  fixture.add(box({3, 2, 1}, {15.3, 15.1, 0.5}));
  fixture.add(cylinder(1, 2, {24, 20, 1}));
  fixture.add(box({1, 1, 1}, {15.3, 15.1, 1.5}));
  fixture.run(1.0);
  const double weight = 9.81 * (4.0 / 3.0 * M_PI * 1.5 * 1.5 * 1.5 + 6 + M_PI * 2 + 1);
  EXPECT_NEAR(total_normal_force(fixture), weight, 0.01 * weight);
}

TEST(Surface, NoImpulseOnUnloadedCells) {
  PhysicsFixture fixture;
  fixture.add(sphere(1.5, {5, 5.3, 1.5}));
  fixture.run(0.5);
  const auto& field = fixture.cells().field();
  EXPECT_GT(field.impulse[static_cast<std::size_t>(field.index(31 - 5, 5))], 0.0F);
  EXPECT_EQ(field.impulse[static_cast<std::size_t>(field.index(20, 20))], 0.0F);
}

TEST(Surface, BoxCrossesGapsWithoutSnagging) {
  for (const double yaw : {0.0, 0.3, 0.7854}) {
    PhysicsFixture fixture;
    fixture.scene.materials[0].friction = 0.0;
    auto object = box({2, 1.5, 1}, {6, 6, 0.5});
    object.orientation = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ());
    object.velocity = {4, 3.7, 0};
    const auto id = fixture.add(object);
    double highest = 0;
    fixture.run(4.0, [&] { highest = std::max(highest, static_cast<double>(fixture.position(id).z())); });
    EXPECT_NEAR(fixture.position(id).x(), 22, 0.02) << yaw;
    EXPECT_NEAR(fixture.position(id).y(), 20.8, 0.02) << yaw;
    EXPECT_LT(highest, 0.503) << yaw;
    EXPECT_LT(fixture.angular_velocity(id).norm(), 0.01) << yaw;
  }
}

TEST(Surface, SphereNarrowerThanGapFallsIn) {
  PhysicsFixture fixture;
  fixture.cells();
  std::vector<float> targets(32 * 32, 2.0F);
  fixture.cells().set_targets(0, targets);
  fixture.run(1.0);
  const auto id = fixture.add(sphere(0.08, {15.5, 15.5, 2.5}));
  fixture.run(1.0);
  EXPECT_LT(fixture.position(id).z(), 1.0);
}

TEST(Surface, EmptyCellsGiveNoSupport) {
  PhysicsFixture fixture;
  auto& field = fixture.cells().field();
  for (int r = 10; r < 22; ++r)
    for (int c = 10; c < 22; ++c)
      field.height[static_cast<std::size_t>(field.index(r, c))] = smartsurf::surface::kNoCellHeight;
  const auto through = fixture.add(sphere(1.0, {15.5, 15.5, 2.0}));
  const auto held = fixture.add(sphere(1.0, {5, 5, 2.0}));
  fixture.run(1.0);
  EXPECT_LT(fixture.position(through).z(), 0.0);
  EXPECT_NEAR(fixture.position(held).z(), 1.0, 0.01);
}

TEST(Surface, GroundCatchesFallenBodies) {
  PhysicsFixture fixture;  // the ground lies one pin length below the lowest top
  const auto ball = fixture.add(sphere(1.0, {-5, 15, 3}));
  const auto brick = fixture.add(box({2, 2, 1}, {-5, 20, 3}));
  fixture.run(3.0);
  EXPECT_NEAR(fixture.position(ball).z(), -1.0, 0.01);
  EXPECT_NEAR(fixture.position(brick).z(), -1.5, 0.01);
}

namespace {

// The same square field as a free layout, with every second row rotated by 90°.
void use_free_layout(PhysicsFixture& fixture) {
  auto& field = fixture.cells().field();
  for (int r = 0; r < field.rows; ++r)
    for (int c = 0; c < field.columns; ++c) {
      field.x.push_back(static_cast<float>(c));
      field.y.push_back(static_cast<float>(field.rows - 1 - r));
      field.angle.push_back(r % 2 ? 1.5707963F : 0.0F);
    }
}

}  // namespace

TEST(FreeLayout, LevelFieldActsAsPlane) {
  PhysicsFixture fixture;
  use_free_layout(fixture);
  auto ball = sphere(1.5, {6, 15.3, 1.5});
  ball.velocity = {3, 0.4, 0};
  ball.angular_velocity = {-0.4 / 1.5, 3 / 1.5, 0};
  const auto rolling = fixture.add(ball);
  auto brick = box({2, 2, 1}, {6, 24.2, 0.5});
  brick.velocity = {4, 0, 0};
  const auto sliding = fixture.add(brick);
  double highest = 0;
  fixture.run(4.0, [&] { highest = std::max(highest, static_cast<double>(fixture.position(rolling).z())); });
  EXPECT_NEAR(fixture.position(rolling).x(), 18, 0.1);
  EXPECT_NEAR(fixture.position(rolling).y(), 16.9, 0.1);
  EXPECT_LT(highest, 1.505);
  EXPECT_NEAR(fixture.position(sliding).x() - 6, 16 / (2 * 0.5 * 9.81), 0.05);
}

TEST(FreeLayout, CellsActAtTheirPositions) {
  PhysicsFixture fixture;
  use_free_layout(fixture);
  auto& field = fixture.cells().field();
  // Swap the positions of two distant cells.
  const auto near = static_cast<std::size_t>(field.index(16, 15)),
             far = static_cast<std::size_t>(field.index(2, 2));
  std::swap(field.x[near], field.x[far]);
  std::swap(field.y[near], field.y[far]);
  const auto id = fixture.add(sphere(0.6, {15, 15, 0.6}));
  fixture.run(1.0);
  fixture.cells().set_target(0, 2, 2, 3.0F);
  fixture.run(1.0);
  EXPECT_GT(field.height[far], 2.9F);
  // The sphere stood on the cell that rose, and rolled off.
  EXPECT_GT((fixture.position(id) - Eigen::Vector3f(15, 15, 0.6F)).norm(), 0.5F);
}
