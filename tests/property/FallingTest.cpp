#include <gtest/gtest.h>

#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;

TEST(FreeFall, FollowsParabola) {
  PhysicsFixture fixture;
  const auto id = fixture.add(sphere(1.0, {15, 15, 100}));
  fixture.run(2.0);
  // Semi-implicit Euler with five substeps per step falls exactly g·h·t/2 further than the parabola.
  const double g = 9.81, t = 2.0, h = fixture.scene.world.dt_s / 5;
  EXPECT_NEAR(fixture.position(id).z(), 100 - 0.5 * g * t * t - 0.5 * g * h * t, 2e-3);
  EXPECT_NEAR(fixture.velocity(id).z(), -g * t, 1e-3);
}

TEST(FreeFall, ErrorIsProportionalToStep) {
  auto error_with = [](double dt) {
    PhysicsFixture fixture;
    fixture.scene.world.dt_s = dt;
    const auto id = fixture.add(box({1, 1, 1}, {15, 15, 100}));
    fixture.run(2.0);
    return std::abs(fixture.position(id).z() - (100 - 0.5 * 9.81 * 4.0));
  };
  const double coarse = error_with(1.0 / 120), fine = error_with(1.0 / 480);
  EXPECT_NEAR(coarse / fine, 4.0, 0.3);
}

// A body's motion in a step may be less than the last bit of its position.
TEST(FreeMotion, SlowBodyFarAwayKeepsItsSpeed) {
  for (const double dt_s : {1.0 / 60, 1.0 / 240, 1.0 / 960})
    for (const double away : {200.0, 900.0})
      for (const double speed : {0.001, 0.01, 0.1}) {
        SCOPED_TRACE(testing::Message() << dt_s << " s, " << away << " u, " << speed << " u/s");
        PhysicsFixture fixture;
        fixture.scene.world.dt_s = dt_s;
        fixture.scene.world.gravity.setZero();
        fixture.scene.world.sleep = false;
        auto eccentric = box({1, 2, 1}, {-away, 5.3, 5});
        eccentric.centre_of_mass = {0.1, 0.2, 0};
        std::vector<smartsurf::scene::ObjectId> ids;
        for (auto o : {sphere(0.5, {away, 5, 5}), box({1, 1, 1}, {away, 8, 5}), eccentric}) {
          o.velocity = {-speed, 0, 0};
          ids.push_back(fixture.add(o));
        }
        const double seconds = 4.0, at[] = {away, away, -away};
        fixture.run(seconds);
        const double ulp = away * 1.2e-7;
        for (std::size_t i = 0; i < ids.size(); ++i)
          EXPECT_NEAR(fixture.position(ids[i]).x() - at[i], -speed * seconds, 1e-4 * speed * seconds + ulp);
      }
}

class Bounce : public testing::TestWithParam<double> {};

TEST_P(Bounce, ReboundHeightIsRestitutionSquaredTimesDrop) {
  const double e = GetParam();
  PhysicsFixture fixture;
  fixture.scene.materials[0].restitution = e;
  const double radius = 1.0, drop = 5.0;
  const auto id = fixture.add(sphere(radius, {15.3, 15.2, radius + drop}));
  double apex = 0, lowest = 1e9;
  bool hit = false;
  fixture.run(2.2, [&] {
    const double z = fixture.position(id).z() - radius;
    lowest = std::min(lowest, z);
    hit |= fixture.velocity(id).z() > 0;
    if (hit) apex = std::max(apex, z);
  });
  EXPECT_NEAR(apex, e * e * drop, 0.045 * drop);
  EXPECT_GT(lowest, -0.01);
}
INSTANTIATE_TEST_SUITE_P(Restitutions, Bounce, testing::Values(0.3, 0.5, 0.8, 1.0));

TEST(Bounce, ZeroRestitutionDoesNotRebound) {
  PhysicsFixture fixture;
  const auto id = fixture.add(sphere(1.5, {15.3, 15.2, 8}));
  fixture.run(3.0);
  EXPECT_NEAR(fixture.position(id).z(), 1.5, 0.01);
  EXPECT_LT(fixture.velocity(id).norm(), 0.01);
}

TEST(Falling, FastSpheresDoNotTunnel) {
  for (const double speed : {20.0, 100.0, 300.0})
    for (const double radius : {0.2, 0.5, 2.0}) {
      PhysicsFixture fixture;
      auto object = sphere(radius, {15.1, 14.8, 20});
      object.velocity = {0, 0, -speed};
      const auto id = fixture.add(object);
      double lowest = 1e9;
      fixture.run(3.0, [&] { lowest = std::min(lowest, static_cast<double>(fixture.position(id).z())); });
      EXPECT_NEAR(fixture.position(id).z(), radius, 0.02) << speed << " u/s, radius " << radius;
      EXPECT_GT(lowest, 0.5 * radius) << speed << " u/s, radius " << radius;
    }
}

TEST(Stacking, FiveBoxesStand) {
  PhysicsFixture fixture;
  std::vector<smartsurf::scene::ObjectId> stack;
  for (int i = 0; i < 5; ++i) stack.push_back(fixture.add(box({2, 2, 2}, {15.0, 15.0, 1.0 + 2.0 * i})));
  fixture.run(6.0);
  for (int i = 0; i < 5; ++i) {
    const auto p = fixture.position(stack[static_cast<std::size_t>(i)]);
    EXPECT_NEAR(p.z(), 1.0 + 2.0 * i, 0.03);
    EXPECT_NEAR(p.x(), 15.0, 0.05);
    EXPECT_NEAR(p.y(), 15.0, 0.05);
  }
}
