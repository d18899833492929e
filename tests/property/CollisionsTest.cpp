// Collisions of spheres against closed forms: restitution, mass ratios, oblique impact.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;

namespace {

struct CollisionCase {
  double restitution = 1.0;
  double mass_ratio = 1.0;  // second to first
  double offset = 0.0;      // of the second centre from the path of the first, u
};

struct FinalVelocities {
  Eigen::Vector3d first, second;
};

// A sphere at 5 u/s against one at rest, both of radius 1, without gravity and friction.
FinalVelocities simulate(const CollisionCase& m) {
  PhysicsFixture fixture;
  fixture.scene.world.gravity = {0, 0, 0};
  fixture.scene.materials[0].restitution = m.restitution;
  fixture.scene.materials[0].friction = 0.0;
  auto one = sphere(1.0, {10, 15, 20}), two = sphere(1.0, {16, 15 + m.offset, 20});
  one.velocity = {5, 0, 0};
  one.mass = 2.0;
  two.mass = 2.0 * m.mass_ratio;
  const auto a = fixture.add(one), b = fixture.add(two);
  fixture.run(1.5);
  return {fixture.world().state(a).velocity, fixture.world().state(b).velocity};
}

// The impulse acts along the line of centres at contact.
FinalVelocities solve_closed_form(const CollisionCase& m) {
  const double sine = m.offset / 2.0;
  const Eigen::Vector3d normal(std::sqrt(1 - sine * sine), sine, 0);
  const double approach = 5 * normal.x();
  const double gained_speed = (1 + m.restitution) * approach / (1 + m.mass_ratio);
  return {Eigen::Vector3d(5, 0, 0) - m.mass_ratio * gained_speed * normal, gained_speed * normal};
}

void expect_closed_form(const CollisionCase& m) {
  const FinalVelocities actual = simulate(m), predicted = solve_closed_form(m);
  const auto name = testing::Message()
                    << "e " << m.restitution << ", masses 1:" << m.mass_ratio << ", offset " << m.offset;
  EXPECT_LT((actual.first - predicted.first).norm(), 0.05) << name << ": " << actual.first.transpose();
  EXPECT_LT((actual.second - predicted.second).norm(), 0.05) << name << ": " << actual.second.transpose();
  const Eigen::Vector3d momentum = actual.first + m.mass_ratio * actual.second;
  EXPECT_LT((momentum - Eigen::Vector3d(5, 0, 0)).norm(), 1e-4) << name;
  const double energy = actual.first.squaredNorm() + m.mass_ratio * actual.second.squaredNorm();
  const double expected = predicted.first.squaredNorm() + m.mass_ratio * predicted.second.squaredNorm();
  EXPECT_NEAR(energy, expected, 0.01 * 25) << name;
}

}  // namespace

TEST(Collision, EqualMassesHeadOnExchangeVelocities) {
  const FinalVelocities actual = simulate({});
  EXPECT_LT(actual.first.norm(), 1e-3);
  EXPECT_LT((actual.second - Eigen::Vector3d(5, 0, 0)).norm(), 1e-3);
}

TEST(Collision, UnequalMassesHeadOn) {
  for (const double ratio : {0.1, 0.5, 3.0, 20.0})
    for (const double e : {0.0, 0.5, 1.0}) expect_closed_form({e, ratio, 0});
}

TEST(Collision, ObliqueImpulseActsAlongLineOfCentres) {
  for (const double offset : {0.3, 0.8, 1.2, 1.6})
    for (const double ratio : {1.0, 4.0})
      for (const double e : {0.5, 1.0}) expect_closed_form({e, ratio, offset});
}

TEST(Collision, EqualMassesSeparateAtRightAngle) {
  const FinalVelocities actual = simulate({1.0, 1.0, 1.0});
  EXPECT_NEAR(actual.first.normalized().dot(actual.second.normalized()), 0.0, 0.02);
}

TEST(Collision, NewtonsCradle) {
  // With gaps between the spheres, the last leaves at the speed of the first.
  PhysicsFixture fixture;
  fixture.scene.world.gravity = {0, 0, 0};
  fixture.scene.materials[0].restitution = 1.0;
  std::vector<smartsurf::scene::ObjectId> row;
  for (int i = 0; i < 5; ++i) {
    auto o = sphere(1.0, {5 + 2.2 * i, 15, 20});
    if (i == 0) o.velocity = {4, 0, 0};
    row.push_back(fixture.add(o));
  }
  fixture.run(1.0);
  for (const auto id : row) EXPECT_NEAR(fixture.velocity(id).x(), id == row.back() ? 4.0 : 0.0, 0.02) << id;
}

TEST(Collision, RockingSphereInGroove) {
  // The sphere rocks about one edge until it hits the other. The spin after the impact follows from
  // conservation of angular momentum about the edge that is hit.
  for (const double radius : {1.2, 1.8}) {
    PhysicsFixture fixture;
    fixture.scene.world.dt_s = 1.0 / 960;
    fixture.scene.materials[0].friction = 1.5;
    for (int r = 0; r < 32; ++r)
      for (int c = 0; c < 32; ++c) fixture.cells().set_target(0, r, c, c == 15 ? 0.0F : 2.0F);
    fixture.run(1.0);
    const double half = 0.6, lean = std::asin(half / radius), begin = -0.3 * lean;
    const double level = 2 + radius * std::cos(lean);
    const double left = std::pow((0.4 + std::cos(2 * lean)) / 1.4, 2);
    const auto id = fixture.add(
        sphere(radius, {15 + half + radius * std::sin(begin), 15.3, 2 + radius * std::cos(begin)}));
    double last = fixture.position(id).z() - level, height = 0;
    int blows = 0;
    // Each impact scales the height of the next apex above the level position by `left`.
    fixture.run(4.0, [&] {
      const double above = fixture.position(id).z() - level;
      if (fixture.velocity(id).z() > 0) height = std::max(height, above);
      if (fixture.velocity(id).z() > 0 || height == 0) return;
      if (++blows <= 2) {
        EXPECT_NEAR(height / last, left, 0.03 * left) << "radius " << radius << ", impact " << blows;
      }
      last = height, height = 0;
    });
    EXPECT_GT(blows, 2) << radius;
  }
}
