// Jointed bodies fall asleep together, and wake when something drives or loads them; the same bits for any
// number of threads.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "tests/property/JointFixture.h"

using namespace physics_fixture;

TEST(JointSleep, RestsAndWakes) {
  if (on_bullet()) GTEST_SKIP() << "nothing sleeps on Bullet";
  JointFixture fixture(1.0 / 240);
  const ObjectId upper = fixture.add(capsule(0.2, 1.0, {15, 15, 49.5}));
  const ObjectId lower = fixture.add(capsule(0.2, 1.0, {15, 15, 48.5}));
  fixture.join(
      {.kind = JointKind::kHinge, .a = upper, .anchor = {15, 15, 50}, .axis = {0, 1, 0}, .friction = 0.05});
  const JointId hinge = fixture.join({.kind = JointKind::kHinge,
                                      .a = lower,
                                      .b = upper,
                                      .anchor = {15, 15, 49},
                                      .axis = {0, 1, 0},
                                      .friction = 0.05});
  fixture.run(2.0);
  EXPECT_EQ(fixture.world().sleeping_count(), 2);
  fixture.world().set_motor(hinge, {.speed = 1.0, .max_effort = 0.2});
  EXPECT_EQ(fixture.world().sleeping_count(), 0);
  fixture.run(0.2);
  EXPECT_GT(fixture.coordinate(hinge), 1e-3);
  fixture.world().set_motor(hinge, {.speed = 0.0, .max_effort = 10.0});
  fixture.run(10.0);
  EXPECT_EQ(fixture.world().sleeping_count(), 2);
  fixture.world().apply_force(lower, {0.5, 0, 0}, std::nullopt, 0.1);
  fixture.run(0.3);
  EXPECT_EQ(fixture.world().sleeping_count(), 0);
}

// A platform on a slider, and what sleeps on it.
TEST(JointSleep, MotorLiftsWhatSleepsOnIt) {
  if (on_bullet()) GTEST_SKIP() << "nothing sleeps on Bullet";
  for (const double dt : {1.0 / 60, 1.0 / 240})
    for (const double speed : {0.02, 0.05, 0.08, 0.5, -0.05, -0.5}) {
      SCOPED_TRACE(speed);
      JointFixture fixture(dt);
      auto platform = box({2, 2, 0.4}, {15, 15, 50});
      platform.mass = 1;
      const JointId slider = fixture.join({.kind = JointKind::kSlider,
                                           .a = fixture.add(platform),
                                           .anchor = {15, 15, 50},
                                           .axis = {0, 0, 1},
                                           .motor = {{.speed = 0.0, .max_effort = 500}}});
      ObjectId top = 0;
      for (int i = 0; i < 3; ++i) top = fixture.add(box({1, 1, 1}, {15, 15, 50.7 + i}));
      fixture.run(3.0);
      ASSERT_EQ(fixture.world().sleeping_count(), 4);
      fixture.world().set_motor(slider, {.speed = speed, .max_effort = 500});
      fixture.run(2.0);
      EXPECT_NEAR(fixture.world().state(top).position.z(), 52.7 + 2 * speed, 0.005 + 0.02 * std::abs(speed));
      EXPECT_NEAR(fixture.effort(slider), 4 * kGravity, 0.01 * 4 * kGravity);
      fixture.world().set_motor(slider, {.speed = 0.0, .max_effort = 2 * kGravity});  // it sinks
      fixture.run(0.5);
      EXPECT_LT(fixture.coordinate(slider), 2 * speed - 0.25);
    }
}

// More slowly than a body may move that falls asleep.
TEST(JointSleep, MotorPushesARowThatSleeps) {
  if (on_bullet()) GTEST_SKIP() << "nothing sleeps on Bullet";
  for (const double speed : {0.01, 0.03, 0.1}) {
    SCOPED_TRACE(speed);
    JointFixture fixture(1.0 / 120);
    const ObjectId pusher = fixture.add(box({1, 1, 1}, {10, 15, 0.51}));
    const JointId slider = fixture.join({.kind = JointKind::kSlider,
                                         .a = pusher,
                                         .anchor = {10, 15, 0.51},
                                         .axis = {1, 0, 0},
                                         .motor = {{.speed = 0.0, .max_effort = 500}}});
    ObjectId last = 0;
    for (int i = 1; i <= 4; ++i) last = fixture.add(box({1, 1, 1}, {10 + 1.001 * i, 15, 0.5}));
    fixture.run(3.0);
    ASSERT_EQ(fixture.world().sleeping_count(), 5);
    fixture.world().set_motor(slider, {.speed = speed, .max_effort = 500});
    fixture.run(4.0);
    EXPECT_NEAR(fixture.world().state(last).position.x(), 14 + 4 * speed, 0.005);
  }
}

// A joint pulls together what is apart without giving it a velocity.
TEST(JointSleep, StrainedJointStaysAwake) {
  if (on_bullet()) GTEST_SKIP() << "nothing sleeps on Bullet";
  for (const JointKind kind : {JointKind::kBall, JointKind::kHinge, JointKind::kSlider, JointKind::kFixed}) {
    JointFixture fixture(1.0 / 60);
    auto post = box({1, 1, 1}, {15, 15, 50});
    post.fixed = true;
    const ObjectId support = fixture.add(post), bob = fixture.add(box({1, 1, 1}, {15, 15, 48}));
    fixture.join(kind, bob, support, {15, 15, 49});
    fixture.run(1.0);
    smartsurf::scene::ObjectStateUpdate up;
    up.position = Vector3d(15, 15, 60);
    fixture.world().set_state(support, up);
    fixture.run(8.0);
    EXPECT_NEAR(fixture.world().state(bob).position.z(), 58.0, 0.03);
  }
}

// Four links lie on the table; a pin that rises slowly lifts the last one.
class LyingLinks : public testing::TestWithParam<JointKind> {};

TEST_P(LyingLinks, SleepAndWakeTogether) {
  if (on_bullet()) GTEST_SKIP() << "nothing sleeps on Bullet";
  JointFixture fixture(1.0 / 240);
  fixture.scene.surface.pin.max_speed = 0.02;
  std::vector<ObjectId> links;
  for (int i = 0; i < 4; ++i) {
    links.push_back(fixture.add(box({1, 0.8, 0.8}, {12 + 1.2 * i, 15, 0.4})));
    if (i > 0) fixture.join(GetParam(), links[i], links[i - 1], {11.4 + 1.2 * i, 15, 0.4});
  }
  fixture.run(3.0);
  ASSERT_EQ(fixture.world().sleeping_count(), 4);
  fixture.cells().set_target(0, 16, 16, 0.02F);  // x 16, y 15
  float fastest = 0.0F;
  fixture.run(2.0, [&] {
    const int asleep = fixture.world().sleeping_count();
    EXPECT_TRUE(asleep == 0 || asleep == 4) << asleep;
    for (const ObjectId id : links) fastest = std::max(fastest, fixture.velocity(id).norm());
  });
  EXPECT_LT(fastest, 0.1F);
  EXPECT_GT(fixture.position(links.back()).z(), 0.405F);
}
INSTANTIATE_TEST_SUITE_P(Joints, LyingLinks, testing::Values(JointKind::kBall, JointKind::kFixed),
                         [](const auto& kind) { return kind.param == JointKind::kBall ? "ball" : "fixed"; });

// The pendulum at its turning point is slow, but does not rest.
TEST(JointSleep, SlowPendulumStaysAwake) {
  PendulumFixture fixture(1.0 / 240, 0.01);
  fixture.run(20.0);
  EXPECT_EQ(fixture.world().sleeping_count(), 0);
}

TEST(JointThreads, GiveTheSameBits) {
  if (on_bullet()) GTEST_SKIP() << "Bullet runs on one thread";
  std::vector<std::uint64_t> hashes;
  for (const int threads : {1, 2, 3}) {
    JointFixture fixture(1.0 / 120);
    fixture.threads = threads;
    fixture.scene.surface.rows = fixture.scene.surface.columns = 64;
    // Pairs of boxes on hinges, which fall on the table and on each other.
    for (int i = 0; i < 200; ++i) {
      const Vector3d at(2.0 + 3.0 * (i % 20), 2.0 + 3.0 * (i / 20), 1.0 + 0.02 * (i % 7));
      const ObjectId a = fixture.add(box({0.8, 0.8, 0.8}, at)),
                     b = fixture.add(sphere(0.4, at + Vector3d(1, 0, 0)));
      fixture.join(i % 2 == 0 ? JointKind::kHinge : JointKind::kBall, a, b, at + Vector3d(0.5, 0, 0));
    }
    fixture.run(0.3);
    hashes.push_back(fixture.snapshot().state_hash);
  }
  EXPECT_EQ(hashes[0], hashes[1]);
  EXPECT_EQ(hashes[0], hashes[2]);
}
