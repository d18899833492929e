// Contact between bodies against closed forms: collisions, stacks, tipping.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using smartsurf::scene::ObjectId;

// Also of parts of a step.
TEST(Force, ActsForItsDuration) {
  for (const double dt : {1.0 / 60, 1.0 / 240})
    for (const double seconds : {0.001, 0.01, 0.1, 0.1234, 0.5}) {
      PhysicsFixture fixture;
      fixture.scene.world.gravity = {0, 0, 0};
      fixture.scene.world.dt_s = dt;
      const ObjectId id = fixture.add(box({1, 1, 1}, {15, 15, 20}));
      fixture.world().apply_force(id, {100, 0, 0}, Eigen::Vector3d(15, 15.1, 20), seconds);
      fixture.run(1.0);
      EXPECT_NEAR(fixture.velocity(id).x(), 100 * seconds, 1e-4 * 100 * seconds);
      if (seconds < 0.05) {
        EXPECT_NEAR(fixture.angular_velocity(id).z(), -10 * seconds * 6, 0.01 * 60 * seconds);
      }
    }
}

TEST(Collision, ConservesMomentumAndEnergy) {
  PhysicsFixture fixture;
  fixture.scene.world.gravity = {0, 0, 0};
  fixture.scene.materials[0].restitution = 1.0;
  fixture.scene.materials[0].friction = 0.0;
  auto one = sphere(1.0, {10, 15, 20});
  auto two = sphere(2.0, {16, 15.8, 20});
  one.velocity = {6, 0, 0};
  two.velocity = {-1, 0.5, 0};
  const auto a = fixture.add(one), b = fixture.add(two);
  fixture.run(2.0);
  const Eigen::Vector3d va = fixture.world().state(a).velocity, vb = fixture.world().state(b).velocity;
  const Eigen::Vector3d momentum = va + 8 * vb;
  EXPECT_LT((momentum - Eigen::Vector3d(6 - 8, 4, 0)).norm(), 0.01);
  EXPECT_NEAR(va.squaredNorm() + 8 * vb.squaredNorm(), 36 + 8 * 1.25, 0.02 * 46);
  EXPECT_GT((vb - Eigen::Vector3d(-1, 0.5, 0)).norm(), 0.5) << "the spheres collide";
}

TEST(Collision, EveryPairOfShapesBouncesApart) {
  const std::vector<smartsurf::scene::ObjectSpec> shapes = {
      sphere(1, {0, 0, 0}),     box({2, 2, 2}, {0, 0, 0}), cylinder(1, 2, {0, 0, 0}),
      capsule(1, 3, {0, 0, 0}), cone(1.2, 3, {0, 0, 0}),   wedge({0, 0, 0})};
  for (const auto& left : shapes)
    for (const auto& right : shapes) {
      PhysicsFixture fixture;
      fixture.scene.world.gravity = {0, 0, 0};
      fixture.scene.materials[0].restitution = 1.0;
      fixture.scene.materials[0].friction = 0.3;
      auto a = left, b = right;
      a.position = {12, 15, 20};
      b.position = {18, 15.05, 20.02};
      a.velocity = {3, 0, 0};
      const auto ia = fixture.add(a), ib = fixture.add(b);
      const auto names = ::testing::Message()
                         << static_cast<int>(a.shape) << " on " << static_cast<int>(b.shape);
      fixture.run(3.0);
      const auto sa = fixture.world().state(ia), sb = fixture.world().state(ib);
      const double ma = fixture.world().bodies().mass[0], mb = fixture.world().bodies().mass[1];
      EXPECT_LT((ma * sa.velocity + mb * sb.velocity - Eigen::Vector3d(3 * ma, 0, 0)).norm(), 0.02 * ma)
          << names;
      EXPECT_GT(sb.velocity.x(), 0.5) << names;
      EXPECT_GT(sb.position.x() - sa.position.x(), 1.2) << names;
    }
}

TEST(Collision, FlatFaceImpactCausesNoRotation) {
  for (const double e : {0.4, 1.0}) {
    PhysicsFixture fixture;
    fixture.scene.world.gravity = {0, 0, 0};
    fixture.scene.materials[0].restitution = e;
    auto one = box({1, 1, 1}, {12, 15, 20}), two = box({1, 1, 3}, {16, 15, 20});
    one.velocity = {4, 0, 0};
    const auto a = fixture.add(one), b = fixture.add(two);
    fixture.run(2.0);
    const auto sa = fixture.world().state(a), sb = fixture.world().state(b);
    const double parting = (1 + e) * 4.0 / 4.0;  // speed of the second box, which is three times as heavy
    EXPECT_NEAR(sa.velocity.x(), 4.0 - 3 * parting, 0.01) << e;
    EXPECT_NEAR(sb.velocity.x(), parting, 0.01) << e;
    EXPECT_LT(sa.angular_velocity.norm(), 0.1) << e;
    EXPECT_LT(sb.angular_velocity.norm(), 0.1) << e;
  }
}

TEST(Bounce, FlatBoxReboundsUpright) {
  PhysicsFixture fixture;
  fixture.scene.materials[0].restitution = 0.8;
  const auto id = fixture.add(box({2, 2, 2}, {15, 15, 6}));
  double apex = 0;
  bool hit = false;
  fixture.run(2.5, [&] {
    hit |= fixture.velocity(id).z() > 0;
    if (hit) apex = std::max(apex, static_cast<double>(fixture.position(id).z()) - 1);
  });
  EXPECT_NEAR(apex, 0.64 * 5, 0.15);
  EXPECT_NEAR(fixture.position(id).x(), 15, 0.15);
  EXPECT_NEAR(fixture.position(id).y(), 15, 0.15);
  EXPECT_LT(fixture.world().state(id).angular_velocity.norm(), 0.1);
}

TEST(Stacking, TenBoxesStandForAMinute) {
  PhysicsFixture fixture;
  fixture.scene.world.dt_s = 1.0 / 120;
  std::vector<ObjectId> stack;
  for (int i = 0; i < 10; ++i) stack.push_back(fixture.add(box({2, 2, 1}, {15.0, 15.0, 0.5 + i})));
  fixture.run(60.0);
  for (int i = 0; i < 10; ++i) {
    const auto p = fixture.position(stack[static_cast<std::size_t>(i)]);
    EXPECT_NEAR(p.z(), 0.5 + i, 0.02) << i;
    EXPECT_NEAR(p.x(), 15.0, 0.02) << i;
    EXPECT_NEAR(p.y(), 15.0, 0.02) << i;
  }
  EXPECT_EQ(fixture.world().sleeping_count(), 10);
}

TEST(Stacking, AllShapesRestOnABox) {
  const std::vector<smartsurf::scene::ObjectSpec> shapes = {
      box({1, 1, 1}, {0, 0, 0.5}), cylinder(0.8, 1, {0, 0, 0.5}), cone(0.9, 2, {0, 0, 0.5}),
      wedge({0, 0, std::sqrt(3.0) / 3})};
  for (const auto& shape : shapes) {
    PhysicsFixture fixture;
    fixture.add(box({4, 4, 1}, {15, 15, 0.5}));
    auto top = shape;
    top.position += Eigen::Vector3d(15.1, 15.2, 1.0);
    const auto id = fixture.add(top);
    fixture.run(3.0);
    EXPECT_NEAR(fixture.position(id).z(), top.position.z(), 0.01) << static_cast<int>(shape.shape);
    EXPECT_NEAR(fixture.position(id).x(), top.position.x(), 0.01) << static_cast<int>(shape.shape);
    EXPECT_EQ(fixture.world().sleeping_count(), 2) << static_cast<int>(shape.shape);
  }
}

TEST(Tipping, BoxTipsWhenGravityLeavesItsBase) {
  // A base of 1 and a height of 2 give a critical slope of tan = 1/2.
  for (const double tangent : {0.45, 0.55}) {
    PhysicsFixture fixture;
    fixture.scene.materials[0].friction = 2.0;
    const double angle = std::atan(tangent), g = 9.81;
    fixture.scene.world.gravity = {g * std::sin(angle), 0, -g * std::cos(angle)};
    const auto id = fixture.add(box({1, 1, 2}, {15.0, 15.0, 1.0}));
    fixture.run(3.0);
    if (tangent < 0.5) {
      EXPECT_NEAR(fixture.position(id).z(), 1.0, 0.01);
    } else {
      EXPECT_LT(fixture.position(id).z(), 0.7);
    }
  }
}

TEST(Falling, FastShapesDoNotTunnel) {
  const std::vector<smartsurf::scene::ObjectSpec> shapes = {
      box({1, 1, 1}, {0, 0, 0}), cylinder(0.5, 1, {0, 0, 0}), capsule(0.4, 1.4, {0, 0, 0}),
      cone(0.7, 1.5, {0, 0, 0}), wedge({0, 0, 0})};
  for (const auto& shape : shapes)
    for (const double speed : {30.0, 300.0}) {
      PhysicsFixture fixture;
      auto object = shape;
      object.position = {15.1, 14.8, 20};
      object.velocity = {0, 0, -speed};
      const auto id = fixture.add(object);
      double lowest = 1e9;
      fixture.run(1.5, [&] { lowest = std::min(lowest, static_cast<double>(fixture.position(id).z())); });
      EXPECT_GT(lowest, 0.1) << static_cast<int>(shape.shape) << " at " << speed;
    }
}

TEST(Solids, CubeHullBehavesLikeBox) {
  for (const double tilt : {0.0, 0.4}) {
    PhysicsFixture fixture;
    auto one = box({2, 2, 2}, {8, 8, 3}), two = cube({20, 20, 3});
    one.orientation = two.orientation = Eigen::AngleAxisd(tilt, Eigen::Vector3d(1, 2, 0.5).normalized());
    const auto a = fixture.add(one), b = fixture.add(two);
    fixture.run(3.0);
    EXPECT_NEAR(fixture.position(a).z(), 1.0, 0.01);
    EXPECT_NEAR(fixture.position(b).z(), 1.0, 0.01);
    EXPECT_LT(fixture.velocity(b).norm(), 0.01);
  }
}
