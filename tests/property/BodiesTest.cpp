// Bodies against bodies: what closed forms say of collisions, stacks and tipping.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/property/PhysicsBench.h"

using namespace physics_bench;
using smartsurf::scene::ObjectId;

TEST(Collision, KeepsMomentumAndEnergy) {
  PhysicsBench bench;
  bench.scene.world.gravity = {0, 0, 0};
  bench.scene.materials[0].restitution = 1.0;
  bench.scene.materials[0].friction = 0.0;
  auto one = sphere(1.0, {10, 15, 20});
  auto two = sphere(2.0, {16, 15.8, 20});
  one.velocity = {6, 0, 0};
  two.velocity = {-1, 0.5, 0};
  const auto a = bench.add(one), b = bench.add(two);
  bench.run(2.0);
  const Eigen::Vector3d va = bench.world().state(a).velocity, vb = bench.world().state(b).velocity;
  const Eigen::Vector3d momentum = va + 8 * vb;
  EXPECT_LT((momentum - Eigen::Vector3d(6 - 8, 4, 0)).norm(), 0.01);
  EXPECT_NEAR(va.squaredNorm() + 8 * vb.squaredNorm(), 36 + 8 * 1.25, 0.02 * 46);
  EXPECT_GT((vb - Eigen::Vector3d(-1, 0.5, 0)).norm(), 0.5) << "they met";
}

TEST(Collision, EveryPairOfShapesBouncesApart) {
  const std::vector<smartsurf::scene::ObjectSpec> shapes = {
      sphere(1, {0, 0, 0}),     box({2, 2, 2}, {0, 0, 0}), cylinder(1, 2, {0, 0, 0}),
      capsule(1, 3, {0, 0, 0}), cone(1.2, 3, {0, 0, 0}),   wedge({0, 0, 0})};
  for (const auto& left : shapes)
    for (const auto& right : shapes) {
      PhysicsBench bench;
      bench.scene.world.gravity = {0, 0, 0};
      bench.scene.materials[0].restitution = 1.0;
      bench.scene.materials[0].friction = 0.3;
      auto a = left, b = right;
      a.position = {12, 15, 20};
      b.position = {18, 15.05, 20.02};
      a.velocity = {3, 0, 0};
      const auto ia = bench.add(a), ib = bench.add(b);
      const auto names = ::testing::Message()
                         << static_cast<int>(a.shape) << " on " << static_cast<int>(b.shape);
      bench.run(3.0);
      const auto sa = bench.world().state(ia), sb = bench.world().state(ib);
      const double ma = bench.world().bodies().mass[0], mb = bench.world().bodies().mass[1];
      EXPECT_LT((ma * sa.velocity + mb * sb.velocity - Eigen::Vector3d(3 * ma, 0, 0)).norm(), 0.02 * ma)
          << names;
      EXPECT_GT(sb.velocity.x(), 0.5) << names;
      EXPECT_GT(sb.position.x() - sa.position.x(), 1.2) << names;
    }
}

TEST(Collision, FacesThatMeetFlatPartWithoutATurn) {
  for (const double e : {0.4, 1.0}) {
    PhysicsBench bench;
    bench.scene.world.gravity = {0, 0, 0};
    bench.scene.materials[0].restitution = e;
    auto one = box({1, 1, 1}, {12, 15, 20}), two = box({1, 1, 3}, {16, 15, 20});
    one.velocity = {4, 0, 0};
    const auto a = bench.add(one), b = bench.add(two);
    bench.run(2.0);
    const auto sa = bench.world().state(a), sb = bench.world().state(b);
    const double parting = (1 + e) * 4.0 / 4.0;  // the speed of the one three times as heavy
    EXPECT_NEAR(sa.velocity.x(), 4.0 - 3 * parting, 0.01) << e;
    EXPECT_NEAR(sb.velocity.x(), parting, 0.01) << e;
    EXPECT_LT(sa.angular_velocity.norm(), 0.1) << e;
    EXPECT_LT(sb.angular_velocity.norm(), 0.1) << e;
  }
}

TEST(Bounce, ABoxThatFallsFlatReboundsUpright) {
  PhysicsBench bench;
  bench.scene.materials[0].restitution = 0.8;
  const auto id = bench.add(box({2, 2, 2}, {15, 15, 6}));
  double apex = 0;
  bool hit = false;
  bench.run(2.5, [&] {
    hit |= bench.velocity(id).z() > 0;
    if (hit) apex = std::max(apex, static_cast<double>(bench.position(id).z()) - 1);
  });
  EXPECT_NEAR(apex, 0.64 * 5, 0.15);
  EXPECT_NEAR(bench.position(id).x(), 15, 0.15);
  EXPECT_NEAR(bench.position(id).y(), 15, 0.15);
  EXPECT_LT(bench.world().state(id).angular_velocity.norm(), 0.1);
}

TEST(Stacking, TenBoxesStandForAMinute) {
  PhysicsBench bench;
  bench.scene.world.dt_s = 1.0 / 120;
  std::vector<ObjectId> stack;
  for (int i = 0; i < 10; ++i) stack.push_back(bench.add(box({2, 2, 1}, {15.0, 15.0, 0.5 + i})));
  bench.run(60.0);
  for (int i = 0; i < 10; ++i) {
    const auto p = bench.position(stack[static_cast<std::size_t>(i)]);
    EXPECT_NEAR(p.z(), 0.5 + i, 0.02) << i;
    EXPECT_NEAR(p.x(), 15.0, 0.02) << i;
    EXPECT_NEAR(p.y(), 15.0, 0.02) << i;
  }
  EXPECT_EQ(bench.world().sleeping_count(), 10);
}

TEST(Stacking, AllShapesRestOnABox) {
  const std::vector<smartsurf::scene::ObjectSpec> shapes = {
      box({1, 1, 1}, {0, 0, 0.5}), cylinder(0.8, 1, {0, 0, 0.5}), cone(0.9, 2, {0, 0, 0.5}),
      wedge({0, 0, std::sqrt(3.0) / 3})};
  for (const auto& shape : shapes) {
    PhysicsBench bench;
    bench.add(box({4, 4, 1}, {15, 15, 0.5}));
    auto top = shape;
    top.position += Eigen::Vector3d(15.1, 15.2, 1.0);
    const auto id = bench.add(top);
    bench.run(3.0);
    EXPECT_NEAR(bench.position(id).z(), top.position.z(), 0.01) << static_cast<int>(shape.shape);
    EXPECT_NEAR(bench.position(id).x(), top.position.x(), 0.01) << static_cast<int>(shape.shape);
    EXPECT_EQ(bench.world().sleeping_count(), 2) << static_cast<int>(shape.shape);
  }
}

TEST(Tipping, ABoxTipsWhenGravityLeavesItsBase) {
  // A base of 1 under a height of 2 stands up to tan = 1/2.
  for (const double tangent : {0.45, 0.55}) {
    PhysicsBench bench;
    bench.scene.materials[0].friction = 2.0;
    const double angle = std::atan(tangent), g = 9.81;
    bench.scene.world.gravity = {g * std::sin(angle), 0, -g * std::cos(angle)};
    const auto id = bench.add(box({1, 1, 2}, {15.0, 15.0, 1.0}));
    bench.run(3.0);
    if (tangent < 0.5) {
      EXPECT_NEAR(bench.position(id).z(), 1.0, 0.01);
    } else {
      EXPECT_LT(bench.position(id).z(), 0.7);
    }
  }
}

TEST(Falling, NoShapeTunnels) {
  const std::vector<smartsurf::scene::ObjectSpec> shapes = {
      box({1, 1, 1}, {0, 0, 0}), cylinder(0.5, 1, {0, 0, 0}), capsule(0.4, 1.4, {0, 0, 0}),
      cone(0.7, 1.5, {0, 0, 0}), wedge({0, 0, 0})};
  for (const auto& shape : shapes)
    for (const double speed : {30.0, 300.0}) {
      PhysicsBench bench;
      auto object = shape;
      object.position = {15.1, 14.8, 20};
      object.velocity = {0, 0, -speed};
      const auto id = bench.add(object);
      double lowest = 1e9;
      bench.run(1.5, [&] { lowest = std::min(lowest, static_cast<double>(bench.position(id).z())); });
      EXPECT_GT(lowest, 0.1) << static_cast<int>(shape.shape) << " at " << speed;
    }
}

TEST(Solids, ACubeOfFacesIsABox) {
  for (const double tilt : {0.0, 0.4}) {
    PhysicsBench bench;
    auto one = box({2, 2, 2}, {8, 8, 3}), two = cube({20, 20, 3});
    one.orientation = two.orientation = Eigen::AngleAxisd(tilt, Eigen::Vector3d(1, 2, 0.5).normalized());
    const auto a = bench.add(one), b = bench.add(two);
    bench.run(3.0);
    EXPECT_NEAR(bench.position(a).z(), 1.0, 0.01);
    EXPECT_NEAR(bench.position(b).z(), 1.0, 0.01);
    EXPECT_LT(bench.velocity(b).norm(), 0.01);
  }
}
