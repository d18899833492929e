// Bodies at rest fall asleep; each cause of waking wakes them.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using smartsurf::scene::ObjectId;

namespace {

// A box asleep on the level field.
struct SleepingBoxFixture : PhysicsFixture {
  ObjectId id = 0;
  SleepingBoxFixture() {
    id = add(box({2, 2, 2}, {15.2, 15.3, 1.0}));
    run(2.0);
  }
};

}  // namespace

TEST(Sleep, RestingBoxFallsAsleepInPlace) {
  SleepingBoxFixture fixture;
  EXPECT_EQ(fixture.world().sleeping_count(), 1);
  EXPECT_NEAR(fixture.position(fixture.id).z(), 1.0, 2e-3);
  EXPECT_EQ(fixture.velocity(fixture.id).norm(), 0.0F);
}

TEST(Sleep, EveryShapeFallsAsleep) {
  PhysicsFixture fixture;
  fixture.scene.materials[0].rolling_friction = 0.02;
  fixture.add(sphere(1.5, {5, 5.3, 1.6}));
  fixture.add(cylinder(1, 2, {10, 5.3, 1.1}));
  fixture.add(capsule(0.8, 4, {16, 5.3, 2.2}));
  fixture.add(cone(1.5, 3, {22, 5.3, 0.9}));
  fixture.add(box({2, 3, 1}, {27, 5.3, 0.6}));
  fixture.run(8.0);
  EXPECT_EQ(fixture.world().sleeping_count(), 5);
}

// Limits of rest do not grow with the pitch alone, but with a finer unit, in which gravity is greater, too.
TEST(Sleep, SlowObjectsRollOnOverCoarseSurfaces) {
  for (const double pitch : {1.0, 10.0, 100.0}) {
    PhysicsFixture fixture;
    fixture.scene.surface.pitch = fixture.scene.surface.pin.top_x = fixture.scene.surface.pin.top_y = pitch;
    fixture.scene.materials[0].rolling_friction = 0.0;
    auto ball = sphere(2, {15 * pitch, 15 * pitch, 2});
    ball.velocity = {1, 0, 0}, ball.angular_velocity = {0, 0.5, 0};
    const auto id = fixture.add(ball);
    fixture.run(3.0);
    EXPECT_NEAR(static_cast<double>(fixture.position(id).x()) - 15 * pitch, 3.0, 0.02) << pitch;
  }
}

TEST(Sleep, RestsInMillimetres) {
  PhysicsFixture fixture;
  fixture.scene.surface.pitch = fixture.scene.surface.pin.top_x = fixture.scene.surface.pin.top_y = 10.0;
  fixture.scene.world.gravity *= 1000.0;
  fixture.add(box({20, 20, 20}, {150, 150, 10.2}));
  fixture.run(2.0);
  EXPECT_EQ(fixture.world().sleeping_count(), 1);
}

TEST(Sleep, FallingAsleepDoesNotChangeTheLoad) {
  PhysicsFixture fixture;
  fixture.add(box({2, 2, 2}, {15.2, 15.3, 1.0}));
  fixture.run(0.25);
  const double weight = 8.0 * 9.81;
  fixture.run(2.0, [&] {
    double load = 0;
    for (const float impulse : fixture.cells().field().impulse) load += static_cast<double>(impulse);
    ASSERT_NEAR(load / fixture.scene.world.dt_s, weight, 0.01 * weight);
  });
  EXPECT_EQ(fixture.world().sleeping_count(), 1);
}

TEST(Sleep, RisingCellWakes) {
  SleepingBoxFixture fixture;
  for (int c = 14; c <= 16; ++c) fixture.cells().set_target(0, 16, c, 1.0F);
  fixture.run(2.0);
  EXPECT_GT(fixture.position(fixture.id).z(), 1.3);
}

TEST(Sleep, SinkingCellWakes) {
  PhysicsFixture fixture;
  std::vector<float> targets(32 * 32, 2.0F);
  fixture.cells().set_targets(0, targets);
  fixture.run(1.0);
  const auto id = fixture.add(sphere(1.5, {15.0, 15.0, 3.5}));
  fixture.run(2.0);
  ASSERT_EQ(fixture.world().sleeping_count(), 1);
  targets.assign(targets.size(), 0.0F);
  fixture.cells().set_targets(0, targets);
  fixture.run(2.0);
  EXPECT_NEAR(fixture.position(id).z(), 1.5, 0.01);
}

TEST(Sleep, DistantMovingCellDoesNotWake) {
  SleepingBoxFixture fixture;
  fixture.cells().set_target(0, 2, 2, 1.0F);
  fixture.run(0.2);
  EXPECT_EQ(fixture.world().sleeping_count(), 1);
}

TEST(Sleep, ForceWakes) {
  SleepingBoxFixture fixture;
  fixture.world().apply_force(fixture.id, {200, 0, 0}, std::nullopt, 0.2);
  fixture.run(0.2);
  EXPECT_GT(fixture.velocity(fixture.id).x(), 1.0F);
}

TEST(Sleep, WrenchWakesAndLastsOneStep) {
  SleepingBoxFixture fixture;
  const double dt = fixture.scene.world.dt_s, mass = 8;
  fixture.world().wrenches()[0].force = {0, 0, 400};
  fixture.run(dt);
  EXPECT_NEAR(fixture.velocity(fixture.id).z(), (400 / mass - 9.81) * dt, 1e-3);
  fixture.run(dt);
  EXPECT_NEAR(fixture.velocity(fixture.id).z(), (400 / mass - 2 * 9.81) * dt, 1e-3);
}

TEST(Sleep, PlacementWakes) {
  SleepingBoxFixture fixture;
  smartsurf::scene::ObjectStateUpdate up;
  up.position = Eigen::Vector3d(15, 15, 6);
  fixture.world().set_state(fixture.id, up);
  fixture.run(0.3);
  EXPECT_NEAR(fixture.position(fixture.id).z(), 6 - 0.5 * 9.81 * 0.09, 0.05);
}

TEST(Sleep, RemovedSupportWakes) {
  SleepingBoxFixture fixture;
  const auto upper = fixture.add(box({2, 2, 2}, {15.2, 15.3, 3.0}));
  fixture.run(2.0);
  ASSERT_EQ(fixture.world().sleeping_count(), 2);
  fixture.world().remove(fixture.id);
  fixture.run(1.0);
  EXPECT_NEAR(fixture.world().state(upper).position.z(), 1.0, 0.01);
}

TEST(Sleep, SupportPushedAwayWakes) {
  SleepingBoxFixture fixture;
  const auto upper = fixture.add(box({2, 2, 2}, {15.2, 15.3, 3.0}));
  fixture.run(2.0);
  ASSERT_EQ(fixture.world().sleeping_count(), 2);
  fixture.world().apply_force(fixture.id, {3000, 0, 0}, std::nullopt, 0.1);
  fixture.run(2.0);
  EXPECT_LT(fixture.position(upper).z(), 1.5);
}

TEST(Sleep, CollisionWakes) {
  PhysicsFixture fixture;
  fixture.scene.materials[0].restitution = 1.0;
  fixture.scene.materials[0].friction = 0.0;
  const auto target = fixture.add(sphere(1.0, {18, 15.0, 1.0}));
  fixture.run(2.0);
  ASSERT_EQ(fixture.world().sleeping_count(), 1);
  auto ball = sphere(1.0, {10, 15.0, 1.0});
  ball.velocity = {5, 0, 0};
  const auto hitting = fixture.add(ball);
  fixture.run(1.6);
  EXPECT_NEAR(fixture.velocity(target).x(), 5.0, 0.1);
  EXPECT_NEAR(fixture.velocity(hitting).x(), 0.0, 0.1);
}

TEST(Sleep, NoSleepInFlight) {
  PhysicsFixture fixture;
  fixture.scene.world.gravity = {0, 0, -0.05};  // so weak that the ball stays slow near its apex
  auto ball = sphere(1.0, {15, 15, 5});
  ball.velocity = {0, 0, 0.02};
  const auto id = fixture.add(ball);
  fixture.run(6.0);
  EXPECT_LT(fixture.velocity(id).z(), -0.2F);
}

TEST(Sleep, PileFallsAsleep) {
  PhysicsFixture fixture;
  fixture.scene.world.dt_s = 1.0 / 60;
  fixture.scene.surface.rows = fixture.scene.surface.columns = 16;
  fixture.scene.surface.border_height = 6.0;
  fixture.scene.materials[0].rolling_friction = 0.01;
  for (int i = 0; i < 40; ++i)
    fixture.add(
        sphere(0.8 + 0.02 * (i % 20), {4.0 + (i % 4) * 2.5, 4.0 + (i / 4 % 4) * 2.5, 3.0 + (i / 16) * 2.5}));
  fixture.run(25.0);
  EXPECT_EQ(fixture.world().sleeping_count(), 40);
}

TEST(Sleep, SleepingBodyStillLoadsSurface) {
  SleepingBoxFixture fixture;
  const double dt = fixture.scene.world.dt_s, weight = 8 * 9.81;
  fixture.run(dt);
  double sum = 0;
  for (const float impulse : fixture.cells().field().impulse) sum += static_cast<double>(impulse);
  ASSERT_EQ(fixture.world().sleeping_count(), 1);
  EXPECT_NEAR(sum / dt, weight, 0.01 * weight);
}

// ---- what accelerates does not sleep; tilting gravity stands for tilting the surface

class SlowStart : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Steps, SlowStart, testing::Values(1.0 / 60, 1.0 / 120, 1.0 / 240, 1.0 / 960));

TEST_P(SlowStart, SphereRollsDownTheSlightestSlope) {
  PhysicsFixture fixture;
  const double angle = 0.3 * M_PI / 180, g = 9.81;
  fixture.scene.world.dt_s = GetParam();
  fixture.scene.world.gravity = {g * std::sin(angle), 0, -g * std::cos(angle)};
  const auto id = fixture.add(sphere(1.5, {5, 15.3, 1.5}));
  fixture.run(20.0);
  const double expected = 0.5 * 5.0 / 7.0 * g * std::sin(angle) * 400.0;  // 7.33 u
  EXPECT_NEAR(fixture.position(id).x() - 5, expected, 0.01 * expected);
}

TEST_P(SlowStart, BoxSlidesFromTheAngleOfFriction) {
  for (const double offset : {-0.1, 0.1}) {
    PhysicsFixture fixture;
    const double mu = 0.5, angle = std::atan(mu) + offset * M_PI / 180, g = 9.81;
    fixture.scene.world.dt_s = GetParam();
    fixture.scene.world.gravity = {g * std::sin(angle), 0, -g * std::cos(angle)};
    const auto id = fixture.add(box({3, 3, 1}, {6, 15.3, 0.5}));
    fixture.run(10.0);
    const double expected = 0.5 * g * (std::sin(angle) - mu * std::cos(angle)) * 100.0;  // 0.957 u
    if (offset < 0) {
      EXPECT_NEAR(fixture.position(id).x(), 6.0, 0.01);
    } else {
      EXPECT_NEAR(fixture.position(id).x() - 6, expected, 0.1 * expected);
    }
  }
}

// A beam in balance on a post: what is left on it tips it.
TEST(Sleep, WhatLiesOnAWokenBodyPressesOnIt) {
  std::mt19937 random(1);
  const auto draw = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int trial = 0; trial < 12; ++trial) {
    SCOPED_TRACE(trial);
    PhysicsFixture fixture;
    const double x = draw(14, 16), y = draw(14, 16), arm = draw(2.5, 3.5);
    auto post = box({0.8, 2, 1}, {x, y, 2.5});
    post.fixed = true;
    fixture.add(post);
    auto beam = box({8, 1, 0.2}, {x, y, 3.1});
    beam.mass = 1;
    fixture.add(beam);
    ObjectId weights[2];
    for (const int side : {0, 1}) {
      const Eigen::Vector3d at(x + (side == 0 ? -arm : arm), y, 3.7);
      auto weight = trial % 3 == 0 ? cylinder(0.5, 1, at) : box({1, 1, 1}, at);
      weight.mass = 2;
      weights[side] = fixture.add(weight);
    }
    fixture.run(3.0);
    ASSERT_EQ(fixture.world().sleeping_count(), 3);
    switch (trial % 4) {
      case 0:
        fixture.world().remove(weights[0]);
        break;
      case 1: {
        smartsurf::scene::ObjectStateUpdate aside;
        aside.position = Eigen::Vector3d(3, 3, 0.5);
        fixture.world().set_state(weights[0], aside);
        break;
      }
      case 2:
        fixture.world().apply_force(weights[0], {0, 0, 30}, std::nullopt, 3.0);
        break;
      default:
        fixture.world().apply_force(weights[0], {0, 80, 0}, std::nullopt, 1.0);
    }
    fixture.run(4.0);
    EXPECT_LT(fixture.world().state(weights[1]).position.z(), 2.5);
  }
}

// A ball rocks the plank on which it falls, and comes to rest before it.
TEST(Sleep, BallFallsAsleepWithThePlankThatBearsIt) {
  std::mt19937 random(3);
  const auto draw = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int trial = 0; trial < 40; ++trial) {
    SCOPED_TRACE(trial);
    PhysicsFixture fixture;
    fixture.scene.world.dt_s = 1.0 / 60;
    fixture.scene.materials[0].rolling_friction = 0.01;
    fixture.scene.materials[0].restitution = 0.2;
    const double thickness = draw(0.3, 0.6), length = draw(4, 9), height = draw(0.01, 2);
    auto plank = box({length, draw(0.6, 1.5), thickness}, {15, 15, thickness / 2});
    auto ball = sphere(0.5, {15 + draw(-0.4, 0.4) * length, 15, thickness + 0.5 + height});
    plank.mass = draw(0.5, 4), ball.mass = draw(0.5, 4);
    const double weight = kGravity * (*plank.mass + *ball.mass);
    fixture.add(plank);
    fixture.run(draw(0, 1));
    fixture.add(ball);
    fixture.run(4.0);
    double load = 0;
    for (const float impulse : fixture.cells().field().impulse) load += static_cast<double>(impulse);
    EXPECT_NEAR(load * 60, weight, 0.001 * weight);
  }
}

// A beam in balance on a post does not bear what is placed on its end, or on a body there, however softly.
TEST(Sleep, WhatIsPlacedOnASleeperTipsIt) {
  for (const double gap : {0.0, 1e-4, 1e-3})
    for (const bool is_ball : {false, true})
      for (const bool on_others : {false, true}) {
        SCOPED_TRACE(gap);
        PhysicsFixture fixture;
        auto post = box({0.8, 2, 1}, {15, 15, 2.5});
        post.fixed = true;
        fixture.add(post);
        auto beam = box({8, 1, 0.2}, {15, 15, 3.1});
        beam.mass = 1;
        fixture.add(beam);
        for (const double x : {12.0, 18.0})
          if (on_others) fixture.add(box({1, 1, 1}, {x, 15, 3.7}));
        fixture.run(1.0);
        ASSERT_EQ(fixture.world().sleeping_count(), on_others ? 3 : 1);
        const Eigen::Vector3d at(18, 15, (on_others ? 4.7 : 3.7) + gap);
        auto weight = is_ball ? sphere(0.5, at) : box({1, 1, 1}, at);
        weight.mass = 2;
        const auto id = fixture.add(weight);
        fixture.run(3.0);
        EXPECT_LT(fixture.position(id).z(), 2.5F);
      }
}

TEST(Sleep, NoneIfSwitchedOff) {
  PhysicsFixture fixture;
  fixture.scene.world.sleep = false;
  const auto id = fixture.add(box({2, 2, 2}, {15.2, 15.3, 1.0}));
  fixture.run(3.0);
  EXPECT_EQ(fixture.world().sleeping_count(), 0);
  EXPECT_NEAR(fixture.position(id).z(), 1.0, 2e-3);
}
