// Both engines against closed forms.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>

#include "smartsurf/world/bullet/EngineFactory.h"
#include "tests/property/PhysicsFixture.h"

namespace {

using namespace physics_fixture;
using namespace smartsurf;

class Engines : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    if (GetParam() == std::string("bullet") && !world::has_bullet())
      GTEST_SKIP() << "this build has no Bullet";
  }
  PhysicsFixture make() const {
    PhysicsFixture p;
    p.scene.world.engine = GetParam();
    return p;
  }
  // Sum of the cells' impulses over `seconds`, divided by the time: the load, mass·u/s².
  static double mean_load(PhysicsFixture& p, double seconds) {
    double impulse = 0.0;
    p.run(seconds, [&] {
      for (const float i : p.cells().field().impulse) impulse += static_cast<double>(i);
    });
    return impulse / seconds;
  }
};

TEST_P(Engines, NamesItself) {
  PhysicsFixture p = make();
  EXPECT_EQ(p.world().name(), GetParam());
}

// Semi-implicit Euler falls g·t·h/2 too far, with the substep h: 0.4 % here at most.
TEST_P(Engines, ProjectileFollowsItsParabola) {
  PhysicsFixture p = make();
  scene::ObjectSpec o = sphere(0.5, {10, 10, 20});
  o.velocity = {3, -2, 4};
  const auto id = p.add(o);
  p.run(1.0);
  const Eigen::Vector3d expected(13, 8, 20 + 4 - kGravity / 2);
  EXPECT_LT((p.position(id).cast<double>() - expected).norm(), 0.02);
}

TEST_P(Engines, RestingObjectsBearTheirWeight) {
  PhysicsFixture p = make();
  const auto ball = p.add(sphere(0.75, {5.0, 5.0, 0.75}));
  const auto brick = p.add(box({3, 2, 1}, {15.3, 15.2, 0.5}));
  p.add(cylinder(1.3, 2, {22.2, 8.1, 1.0}));
  p.add(cone(1.5, 2, {8, 22.3, 0.5}));
  p.add(cube({22, 22, 1}));
  p.run(1.0);
  const double weight = kGravity * (4.0 / 3.0 * std::numbers::pi * std::pow(0.75, 3) + 6.0 +
                                    std::numbers::pi * (1.69 * 2 + 2.25 * 2 / 3) + 8.0);
  EXPECT_NEAR(mean_load(p, 0.5), weight, 0.005 * weight);
  EXPECT_NEAR(p.position(ball).z(), 0.75, 0.005);
  EXPECT_NEAR(p.position(brick).z(), 0.5, 0.005);
}

TEST_P(Engines, SlidingBoxStopsAfterItsBrakingDistance) {
  for (const double step : {1.0 / 120, 1.0 / 240, 1.0 / 960}) {
    PhysicsFixture p = make();
    p.scene.world.dt_s = step;
    scene::ObjectSpec o = box({3, 3, 1}, {6, 10, 0.5});
    o.velocity = {6, 3, 0};
    const auto id = p.add(o);
    p.run(1.5);
    const double distance = 45.0 / (2 * 0.5 * kGravity);
    EXPECT_NEAR((p.position(id) - Eigen::Vector3f(6, 10, 0.5F)).norm(), distance, 0.02 * distance) << step;
    EXPECT_LT(p.velocity(id).norm(), 1e-3F) << step;
  }
}

// A sphere that starts to slide rolls with 5/7 of its speed.
TEST_P(Engines, SlidingSphereEndsRolling) {
  PhysicsFixture p = make();
  p.scene.surface.pin.top_x = p.scene.surface.pin.top_y = 1.0;
  scene::ObjectSpec o = sphere(1.0, {4, 10, 1.0});
  o.velocity = {7, 0, 0};
  const auto id = p.add(o);
  p.run(1.5);
  EXPECT_NEAR(p.velocity(id).x(), 5.0, 0.05);
  EXPECT_NEAR(p.angular_velocity(id).y(), 5.0, 0.05);
}

// With lever arm b a rolling ball slows by 5/7·g·b/r.
TEST_P(Engines, RollingResistanceIsProportionalToTheLoad) {
  for (const double density : {0.1, 100.0}) {
    PhysicsFixture p = make();
    p.scene.surface.pin.top_x = p.scene.surface.pin.top_y = 1.0;
    p.scene.materials[0].rolling_friction = 0.02;
    p.scene.materials[0].density = density;
    scene::ObjectSpec o = sphere(1.0, {4, 4, 1.0});
    o.velocity = {3, 3, 0};
    o.angular_velocity = {-3, 3, 0};
    const auto id = p.add(o);
    p.run(2.0);
    const double speed = std::sqrt(18.0) - 2.0 * kGravity * 0.02 * 5.0 / 7.0;
    EXPECT_NEAR(static_cast<double>(p.velocity(id).norm()), speed, 0.02 * speed) << density;
  }
}

TEST_P(Engines, BallBouncesToItsRestitutionSquared) {
  PhysicsFixture p = make();
  p.scene.materials[0].restitution = 0.8;
  const auto id = p.add(sphere(0.5, {10, 10, 2.5}));
  float highest = 0.0F;
  double time = 0.0;
  p.run(1.2, [&] {
    time += p.scene.world.dt_s;
    if (time > 0.7) highest = std::max(highest, p.position(id).z());
  });
  EXPECT_NEAR(highest - 0.5F, 0.64 * 2.0, 0.05 * 0.64 * 2.0);
}

// A border is a wall down to the feet of the cells, however high it stands above actuators that do not move.
// Its face is 0.4 u west of the centres of its cells.
TEST_P(Engines, BorderHigherThanTheActuatorsStopsWhatSlidesBelowItsTop) {
  PhysicsFixture p = make();
  p.scene.surface.pin.max_height = p.scene.surface.pin.min_height = 0.0;
  p.scene.surface.border_height = 8.0;
  scene::ObjectSpec brick = box({3, 3, 1}, {26, 10, 0.5}), ball = sphere(0.75, {26, 20, 0.75});
  brick.velocity = ball.velocity = {8, 0, 0};
  const auto brick_id = p.add(brick), ball_id = p.add(ball);
  float furthest = 0.0F, furthest_ball = 0.0F;
  p.run(2.0, [&] {
    furthest = std::max(furthest, p.position(brick_id).x());
    furthest_ball = std::max(furthest_ball, p.position(ball_id).x());
  });
  EXPECT_NEAR(furthest, 31.0F - 0.4F - 1.5F, 0.05F);
  EXPECT_NEAR(furthest_ball, 31.0F - 0.4F - 0.75F, 0.05F);
}

TEST_P(Engines, ForcesAndPlacesAndRemovals) {
  PhysicsFixture p = make();
  p.scene.world.gravity = {0, 0, 0};
  scene::ObjectSpec o = box({1, 1, 1}, {10, 10, 5});
  o.mass = 2.0;
  const auto a = p.add(o), b = p.add(sphere(0.5, {20, 20, 5}));
  EXPECT_TRUE(p.world().apply_force(a, {0, 4, 0}, Eigen::Vector3d(10.5, 10, 5), 0.5));
  p.run(1.0);
  EXPECT_NEAR(p.velocity(a).y(), 1.0, 1e-3);
  // Torque 2 for 0.5 s on 2/6: the lever turns with the body.
  EXPECT_GT(p.angular_velocity(a).z(), 1.0F);
  scene::ObjectStateUpdate update;
  update.position = Eigen::Vector3d(3, 4, 7);
  update.velocity = Eigen::Vector3d(0, 0, 1);
  EXPECT_TRUE(p.world().set_state(b, update));
  p.run(0.5);
  EXPECT_NEAR(p.position(b).z(), 7.5, 1e-3);
  EXPECT_TRUE(p.world().remove(a));
  EXPECT_FALSE(p.world().alive(a));
  EXPECT_FALSE(p.world().remove(a));
  p.run(0.1);
  EXPECT_EQ(p.world().bodies().size(), 1u);
}

TEST_P(Engines, EqualInputsGiveEqualBits) {
  std::uint64_t hashes[2];
  for (auto& hash : hashes) {
    PhysicsFixture p = make();
    for (int i = 0; i < 4; ++i) {
      p.add(sphere(0.6, {8.1 + i, 8.0, 2.0 + 1.3 * i}));
      p.add(box({1, 2, 1.5}, {8.0, 9.0 + 0.4 * i, 3.0 + 2.0 * i}));
      p.add(cylinder(0.6, 1.5, {9.5, 10.0 + 0.4 * i, 3.5 + 2.0 * i}));
    }
    p.run(0.5);
    hash = p.snapshot().state_hash;
  }
  EXPECT_EQ(hashes[0], hashes[1]);
}

// The loads of equal compliances: least squares among those in equilibrium.
TEST(BulletEngine, CellsUnderARigidBoxBearEqualLoads) {
  if (!world::has_bullet()) GTEST_SKIP() << "this build has no Bullet";
  PhysicsFixture p;
  p.scene.world.engine = "bullet";
  scene::ObjectSpec o = box({5, 5, 1}, {10, 10, 0.5});
  o.mass = 25.0;
  p.add(o);
  p.run(0.5);
  int loaded = 0;
  for (const float impulse : p.cells().field().impulse) {
    if (impulse == 0.0F) continue;
    ++loaded;
    EXPECT_NEAR(static_cast<double>(impulse) / p.scene.world.dt_s, kGravity, 0.02 * kGravity);
  }
  EXPECT_EQ(loaded, 25);
}

INSTANTIATE_TEST_SUITE_P(All, Engines, testing::Values("native", "bullet"),
                         [](const auto& engine) { return std::string(engine.param); });

}  // namespace
