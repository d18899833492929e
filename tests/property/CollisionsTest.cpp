// Collisions against closed forms: of spheres, restitution, mass ratios, oblique impact; of all shapes, the
// laws of momentum.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

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

namespace {

using Eigen::Vector3d;

struct SolidBody {
  smartsurf::scene::ObjectSpec spec;
  double radius;               // of the bounding sphere, u
  Vector3d principal_moments;  // per mass, u²
};

template <class Draw>
SolidBody draw_body(const Draw& draw) {
  const double kind = draw(0, 3), r = draw(0.3, 1), h = draw(0.4, 2);
  const Vector3d size{draw(0.5, 2), draw(0.5, 2), draw(0.5, 2)}, squares = size.cwiseAbs2();
  if (kind < 1) return {sphere(r, {0, 0, 0}), r, Vector3d::Constant(0.4 * r * r)};
  if (kind < 2)
    return {box(size, {0, 0, 0}), size.norm() / 2, (Vector3d::Constant(squares.sum()) - squares) / 12};
  return {cylinder(r, h, {0, 0, 0}),
          std::hypot(r, h / 2),
          {(3 * r * r + h * h) / 12, (3 * r * r + h * h) / 12, r * r / 2}};
}

template <class Draw>
Vector3d draw_direction(const Draw& draw) {
  const double z = draw(-1, 1), angle = draw(0, 2 * M_PI), across = std::sqrt(1 - z * z);
  return {across * std::cos(angle), across * std::sin(angle), z};
}

// Two bodies that spin meet off-centre in free flight, at 2 to 16 u/s. The change of their angular momentum
// about a point that moves with neither, relative to the sum of its parts.
std::vector<double> changes_of_angular_momentum(double restitution, double dt_s, int draws) {
  std::vector<double> changes;
  for_random_fixtures(7, draws, dt_s, [&](PhysicsFixture& fixture, const auto& draw) {
    fixture.scene.world.gravity = {0, 0, 0};
    fixture.scene.materials[0].restitution = restitution;
    fixture.scene.materials[0].friction = draw(0, 1);
    SolidBody bodies[] = {draw_body(draw), draw_body(draw)};
    const Vector3d centre(15, 15, 30), along = draw_direction(draw),
                                       aside = along.cross(draw_direction(draw));
    const double radii = bodies[0].radius + bodies[1].radius, gap = draw(0.3, 0.7), speed = draw(2, 16),
                 share = draw(0, 1);
    bodies[0].spec.position = centre;
    bodies[1].spec.position = centre + (radii + gap) * along + draw(0, 0.6) * radii * aside;
    bodies[0].spec.velocity = speed * share * along;
    bodies[1].spec.velocity = -speed * (1 - share) * along;
    for (SolidBody& b : bodies) {
      b.spec.mass = std::pow(10.0, draw(-0.5, 0.5));
      b.spec.orientation = Eigen::AngleAxisd{draw(0, 3), draw_direction(draw)};
      const double spin = draw(0, 10);
      b.spec.angular_velocity = spin * draw_direction(draw);
      fixture.add(b.spec);
    }
    double scale = 0;
    const auto angular_momentum = [&] {
      Vector3d sum(0, 0, 0);
      scale = 0;
      for (smartsurf::scene::ObjectId i = 0; i < 2; ++i) {
        const auto state = fixture.world().state(i);
        const Eigen::Matrix3d axes(state.orientation);
        const double mass = *bodies[i].spec.mass;
        const Vector3d spin = mass * (axes * bodies[i].principal_moments.asDiagonal() * axes.transpose() *
                                      state.angular_velocity),
                       orbit = mass * (state.position - centre).cross(state.velocity);
        sum += spin + orbit, scale += spin.norm() + orbit.norm();
      }
      return sum;
    };
    const Vector3d before = angular_momentum(), velocity_before = fixture.world().state(0).velocity;
    const double scale_before = scale;
    fixture.run(2 * (radii + gap) / speed + 0.2);
    if ((fixture.world().state(0).velocity - velocity_before).norm() < 1e-3)
      return;  // they passed each other
    changes.push_back((angular_momentum() - before).norm() / scale_before);
  });
  std::ranges::sort(changes);
  return changes;
}

}  // namespace

TEST(Collision, ImpactsKeepTheAngularMomentum) {
  for (const double e : {0.3, 0.7, 1.0})
    for (const double frequency : {60, 120, 240, 960}) {
      const auto changes = changes_of_angular_momentum(e, 1 / frequency, 120);
      ASSERT_GT(changes.size(), 60U);
      EXPECT_LT(changes[changes.size() / 2], 5e-4) << "e " << e << ", 1/" << frequency << " s";
      EXPECT_LT(changes[changes.size() * 95 / 100], 4e-3) << "e " << e << ", 1/" << frequency << " s";
      EXPECT_LT(changes.back(), 0.03) << "e " << e << ", 1/" << frequency << " s";
    }
}

// Their impulses are those of the substeps, with the points where the bodies were expected to meet.
TEST(Collision, PlasticImpactsKeepTheAngularMomentum) {
  for (const double frequency : {60, 240, 960}) {
    const auto changes = changes_of_angular_momentum(0, 1 / frequency, 120);
    ASSERT_GT(changes.size(), 60U);
    EXPECT_LT(changes[changes.size() / 2], 0.15 / frequency + 2e-4) << "1/" << frequency << " s";
    EXPECT_LT(changes.back(), 6 / frequency + 0.005) << "1/" << frequency << " s";
  }
}
