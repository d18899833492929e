// What rests sleeps, and wakes for every reason that there is.
#include <gtest/gtest.h>

#include "tests/property/PhysicsBench.h"

using namespace physics_bench;
using smartsurf::scene::ObjectId;

namespace {

// A box lies on the level field, asleep.
struct Sleeper : PhysicsBench {
  ObjectId id = 0;
  Sleeper() {
    id = add(box({2, 2, 2}, {15.2, 15.3, 1.0}));
    run(2.0);
  }
};

}  // namespace

TEST(Sleep, WhatRestsFallsAsleepWhereItIs) {
  Sleeper bench;
  EXPECT_EQ(bench.world().sleeping_count(), 1);
  EXPECT_NEAR(bench.position(bench.id).z(), 1.0, 2e-3);
  EXPECT_EQ(bench.velocity(bench.id).norm(), 0.0F);
}

TEST(Sleep, EveryShapeFallsAsleep) {
  PhysicsBench bench;
  bench.scene.materials[0].rolling_friction = 0.02;
  bench.add(sphere(1.5, {5, 5.3, 1.6}));
  bench.add(cylinder(1, 2, {10, 5.3, 1.1}));
  bench.add(capsule(0.8, 4, {16, 5.3, 2.2}));
  bench.add(cone(1.5, 3, {22, 5.3, 0.9}));
  bench.add(box({2, 3, 1}, {27, 5.3, 0.6}));
  bench.run(8.0);
  EXPECT_EQ(bench.world().sleeping_count(), 5);
}

TEST(Sleep, ACellThatRisesUnderIt) {
  Sleeper bench;
  for (int c = 14; c <= 16; ++c) bench.cells().set_target(0, 16, c, 1.0F);
  bench.run(2.0);
  EXPECT_GT(bench.position(bench.id).z(), 1.3);
}

TEST(Sleep, ACellThatSinksAwayUnderIt) {
  PhysicsBench bench;
  std::vector<float> targets(32 * 32, 2.0F);
  bench.cells().set_targets(0, targets);
  bench.run(1.0);
  const auto id = bench.add(sphere(1.5, {15.0, 15.0, 3.5}));
  bench.run(2.0);
  ASSERT_EQ(bench.world().sleeping_count(), 1);
  targets.assign(targets.size(), 0.0F);
  bench.cells().set_targets(0, targets);
  bench.run(2.0);
  EXPECT_NEAR(bench.position(id).z(), 1.5, 0.01);
}

TEST(Sleep, AMovingCellFarAwayDoesNot) {
  Sleeper bench;
  bench.cells().set_target(0, 2, 2, 1.0F);
  bench.run(0.2);
  EXPECT_EQ(bench.world().sleeping_count(), 1);
}

TEST(Sleep, APushWakes) {
  Sleeper bench;
  bench.world().apply_force(bench.id, {200, 0, 0}, std::nullopt, 0.2);
  bench.run(0.2);
  EXPECT_GT(bench.velocity(bench.id).x(), 1.0F);
}

TEST(Sleep, AWrenchWakesAndLastsOneStep) {
  Sleeper bench;
  const double dt = bench.scene.world.dt_s, mass = 8;
  bench.world().wrenches()[0].force = {0, 0, 400};
  bench.run(dt);
  EXPECT_NEAR(bench.velocity(bench.id).z(), (400 / mass - 9.81) * dt, 1e-3);
  bench.run(dt);
  EXPECT_NEAR(bench.velocity(bench.id).z(), (400 / mass - 2 * 9.81) * dt, 1e-3);
}

TEST(Sleep, BeingPlacedWakes) {
  Sleeper bench;
  smartsurf::scene::ObjectStateUpdate up;
  up.position = Eigen::Vector3d(15, 15, 6);
  bench.world().place(bench.id, up);
  bench.run(0.3);
  EXPECT_NEAR(bench.position(bench.id).z(), 6 - 0.5 * 9.81 * 0.09, 0.05);
}

TEST(Sleep, WhatStoodOnARemovedBodyFalls) {
  Sleeper bench;
  const auto upper = bench.add(box({2, 2, 2}, {15.2, 15.3, 3.0}));
  bench.run(2.0);
  ASSERT_EQ(bench.world().sleeping_count(), 2);
  bench.world().remove(bench.id);
  bench.run(1.0);
  EXPECT_NEAR(bench.world().state(upper).position.z(), 1.0, 0.01);
}

TEST(Sleep, WhatStoodOnABodyThatIsPushedAwayFalls) {
  Sleeper bench;
  const auto upper = bench.add(box({2, 2, 2}, {15.2, 15.3, 3.0}));
  bench.run(2.0);
  ASSERT_EQ(bench.world().sleeping_count(), 2);
  bench.world().apply_force(bench.id, {3000, 0, 0}, std::nullopt, 0.1);
  bench.run(2.0);
  EXPECT_LT(bench.position(upper).z(), 1.5);
}

TEST(Sleep, ABlowIsPassedOn) {
  PhysicsBench bench;
  bench.scene.materials[0].restitution = 1.0;
  bench.scene.materials[0].friction = 0.0;
  const auto target = bench.add(sphere(1.0, {18, 15.0, 1.0}));
  bench.run(2.0);
  ASSERT_EQ(bench.world().sleeping_count(), 1);
  auto ball = sphere(1.0, {10, 15.0, 1.0});
  ball.velocity = {5, 0, 0};
  const auto hitting = bench.add(ball);
  bench.run(1.6);
  EXPECT_NEAR(bench.velocity(target).x(), 5.0, 0.1);
  EXPECT_NEAR(bench.velocity(hitting).x(), 0.0, 0.1);
}

TEST(Sleep, NothingSleepsInTheAir) {
  PhysicsBench bench;
  bench.scene.world.gravity = {0, 0, -0.05};  // so weak that it hangs at the top for long
  auto ball = sphere(1.0, {15, 15, 5});
  ball.velocity = {0, 0, 0.02};
  const auto id = bench.add(ball);
  bench.run(6.0);
  EXPECT_LT(bench.velocity(id).z(), -0.2F);
}

TEST(Sleep, APileComesToRest) {
  PhysicsBench bench;
  bench.scene.world.dt_s = 1.0 / 60;
  bench.scene.surface.rows = bench.scene.surface.columns = 16;
  bench.scene.surface.border_height = 6.0;
  bench.scene.materials[0].rolling_friction = 0.01;
  for (int i = 0; i < 40; ++i)
    bench.add(
        sphere(0.8 + 0.02 * (i % 20), {4.0 + (i % 4) * 2.5, 4.0 + (i / 4 % 4) * 2.5, 3.0 + (i / 16) * 2.5}));
  bench.run(25.0);
  EXPECT_EQ(bench.world().sleeping_count(), 40);
}

TEST(Sleep, TheSurfaceStillFeelsTheWeight) {
  Sleeper bench;
  const double dt = bench.scene.world.dt_s, weight = 8 * 9.81;
  bench.run(dt);
  double sum = 0;
  for (const float impulse : bench.cells().field().impulse) sum += static_cast<double>(impulse);
  ASSERT_EQ(bench.world().sleeping_count(), 1);
  EXPECT_NEAR(sum / dt, weight, 0.01 * weight);
}
