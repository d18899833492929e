// Rotation of free bodies and of a top, against Euler's equations in double precision and closed forms.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <utility>
#include <vector>

#include "smartsurf/scene/Axes.h"
#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using Eigen::Vector3d;

namespace {

template <class Draw>
Vector3d random_direction(Draw draw) {
  Vector3d at(1, 1, 1);
  while (at.norm() > 1 || at.norm() < 0.01) at = {draw(-1, 1), draw(-1, 1), draw(-1, 1)};
  return at.normalized();
}

// Principal moments of a solid box of density 1.
Vector3d box_moments(const Vector3d& size) {
  const Vector3d s = size.cwiseAbs2();
  return size.prod() / 12.0 * Vector3d(s.y() + s.z(), s.x() + s.z(), s.x() + s.y());
}

// Euler's equations without torque, in body axes, by fourth-order Runge-Kutta.
Vector3d euler_rotation(const Vector3d& moments, Vector3d omega, double seconds) {
  constexpr double kStep = 1e-3;
  const auto rate = [&](const Vector3d& w) -> Vector3d {
    return -w.cross(Vector3d(moments.cwiseProduct(w))).cwiseQuotient(moments);
  };
  for (long i = std::lround(seconds / kStep); i > 0; --i) {
    const Vector3d a = rate(omega), b = rate(omega + 0.5 * kStep * a), c = rate(omega + 0.5 * kStep * b),
                   d = rate(omega + kStep * c);
    omega += kStep / 6.0 * (a + 2.0 * b + 2.0 * c + d);
  }
  return omega;
}

// Times at which the second component changes its sign, within `seconds`.
std::vector<double> flip_times(const Vector3d& moments, Vector3d omega, double seconds) {
  constexpr double kInterval = 1e-3;
  std::vector<double> times;
  for (long i = 1; i <= std::lround(seconds / kInterval); ++i) {
    const double before = omega.y();
    omega = euler_rotation(moments, omega, kInterval);
    if ((before < 0) != (omega.y() < 0)) times.push_back(static_cast<double>(i) * kInterval);
  }
  return times;
}

// A box that floats and spins nearly about the axis of its middle moment.
struct TumblingBoxFixture : PhysicsFixture {
  const Vector3d size{1, 2, 3}, spin{0.01, 10, 0}, moments = box_moments(size);

  explicit TumblingBoxFixture(double dt) {
    scene.world.gravity = Vector3d::Zero();
    scene.world.dt_s = dt;
    auto object = box(size, {15, 15, 50});
    object.angular_velocity = spin;
    add(object);
  }
  Eigen::Quaterniond orientation() {
    const auto& q = snapshot().orientation[0];
    return Eigen::Quaterniond(q[3], q[0], q[1], q[2]);
  }
  Vector3d body_spin() { return orientation().conjugate() * angular_velocity(0).cast<double>(); }
  Vector3d momentum() { return orientation() * Vector3d(moments.cwiseProduct(body_spin())); }
  double energy() {
    const Vector3d w = body_spin();
    return 0.5 * w.dot(moments.cwiseProduct(w));
  }
};

class Rotation : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Steps, Rotation, testing::Values(1.0 / 60, 1.0 / 120, 1.0 / 240, 1.0 / 960));

}  // namespace

TEST_P(Rotation, FreeBoxKeepsMomentumAndEnergyForAMinute) {
  TumblingBoxFixture fixture(GetParam());
  const Vector3d momentum = fixture.momentum();
  const double energy = fixture.energy();
  double momentum_error = 0, energy_error = 0;
  fixture.run(60.0, [&] {
    momentum_error = std::max(momentum_error, (fixture.momentum() - momentum).norm() / momentum.norm());
    energy_error = std::max(energy_error, std::abs(fixture.energy() / energy - 1.0));
  });
  EXPECT_LT(momentum_error, 1e-3);
  EXPECT_LT(energy_error, 0.01);
  RecordProperty("momentum_error", std::to_string(momentum_error));
  RecordProperty("energy_error", std::to_string(energy_error));
}

// The intermediate axis is unstable: the box turns over again and again (Dzhanibekov).
TEST_P(Rotation, FreeBoxFlipsWhenEulersEquationsSay) {
  const double dt = GetParam();
  TumblingBoxFixture fixture(dt);
  const std::vector<double> expected = flip_times(fixture.moments, fixture.spin, 60.0);
  ASSERT_GT(expected.size(), 15U);
  EXPECT_NEAR(expected[1] - expected[0], 3.3, 0.1);
  std::vector<double> flips;
  double before = fixture.body_spin().y(), t = 0;
  fixture.run(60.0, [&] {
    t += dt;
    const double now = fixture.body_spin().y();
    if ((before < 0) != (now < 0)) flips.push_back(t);
    before = now;
  });
  ASSERT_EQ(flips.size(), expected.size());
  for (std::size_t i = 0; i < flips.size(); ++i)
    EXPECT_NEAR(flips[i], expected[i], dt + 50.0 * dt * dt * expected[i]) << "flip " << i;
}

TEST_P(Rotation, FreeBodyFollowsEulersEquations) {
  TumblingBoxFixture fixture(GetParam());
  fixture.run(2.0);
  const Vector3d expected = euler_rotation(fixture.moments, fixture.spin, 2.0);
  EXPECT_LT((fixture.body_spin() - expected).norm(),
            0.1 * fixture.spin.norm() * 240 * GetParam() * GetParam() + 2e-3);
}

// Steady precession: the axis of a body of revolution turns about the momentum at L / I₁, in closed form.
TEST_P(Rotation, FreeCylinderPrecessesAboutItsMomentum) {
  PhysicsFixture fixture;
  fixture.scene.world.gravity = Vector3d::Zero();
  fixture.scene.world.dt_s = GetParam();
  auto object = cylinder(1, 0.4, {15, 15, 50});
  const double across = M_PI * 0.4 * (0.25 + 0.16 / 12.0), along = M_PI * 0.4 * 0.5;
  object.angular_velocity = {3, 0, 20};
  fixture.add(object);
  fixture.run(10.0);
  const Vector3d momentum(3 * across, 0, 20 * along);
  const Vector3d expected =
      Eigen::AngleAxisd(10.0 * momentum.norm() / across, momentum.normalized()) * Vector3d::UnitZ();
  const auto& q = fixture.snapshot().orientation[0];
  const Vector3d axis = Eigen::Quaterniond(q[3], q[0], q[1], q[2]) * Vector3d::UnitZ();
  EXPECT_LT((axis - expected).norm(), 3e-3);
}

// A cone on its tip, which friction holds. A fast top precesses at m·g·l / (I₃·ω₃) and keeps its tilt.
TEST_P(Rotation, TopKeepsItsTiltAndPrecesses) {
  PhysicsFixture fixture;
  fixture.scene.world.dt_s = GetParam();
  fixture.scene.materials[0].friction = 1.0;
  const double radius = 1, height = 1, l = 0.75 * height, spin = 60, tilt = 20 * M_PI / 180;
  const double along = 0.3 * radius * radius;  // per mass
  const double across = 0.15 * radius * radius + 0.0375 * height * height + l * l;
  // Steady precession Ω about a fixed tip: (I₃·s − I₁·Ω·cos θ)·Ω = m·g·l, s being the spin about the axis.
  const double a = across * std::cos(tilt), b = along * spin, c = kGravity * l;
  const double precession = (b - std::sqrt(b * b - 4 * a * c)) / (2 * a);
  auto top = cone(radius, height, {0, 0, 0});
  // The cone's tip is its +z end; `axis` points from the tip to the base.
  const Vector3d axis(std::sin(tilt), 0, std::cos(tilt));
  top.orientation = smartsurf::scene::rotation_between(-Vector3d::UnitZ(), axis);
  top.position = Vector3d(15, 15, 0) + l * axis;
  const Vector3d omega = spin * axis + precession * (Vector3d::UnitZ() - std::cos(tilt) * axis);
  top.angular_velocity = omega;
  top.velocity = omega.cross(l * axis);
  const auto id = fixture.add(top);
  double least = 90, greatest = 0, angle = 0, previous = 0;
  fixture.run(10.0, [&] {
    const auto& q = fixture.snapshot().orientation[id];
    const Vector3d now = Eigen::Quaterniond(q[3], q[0], q[1], q[2]) * -Vector3d::UnitZ();
    const double degrees = std::acos(now.z()) * 180 / M_PI, azimuth = std::atan2(now.y(), now.x());
    least = std::min(least, degrees), greatest = std::max(greatest, degrees);
    angle += std::remainder(azimuth - previous, 2 * M_PI);
    previous = azimuth;
  });
  EXPECT_GT(least, 19.0);
  EXPECT_LT(greatest, 21.0);
  EXPECT_NEAR(angle / 10.0, precession, 0.03 * precession);
}

// However fast it turns in a step.
TEST_P(Rotation, FastFreeBodyKeepsItsEnergyAndMomentum) {
  for_random_fixtures(5, 12, GetParam(), [](PhysicsFixture& fixture, auto draw) {
    fixture.scene.world.gravity = Vector3d::Zero();
    const double dt_s = fixture.scene.world.dt_s;
    const Vector3d size(draw(0.5, 3), draw(0.5, 3), draw(0.5, 3));
    auto object = box(size, {15, 15, 500});
    const Vector3d axis = random_direction(draw);
    object.angular_velocity = draw(0.1, 30) / dt_s * axis;
    const auto id = fixture.add(object);
    const Vector3d moments = box_moments(size);
    const auto energy_and_momentum = [&] {
      const auto& q = fixture.snapshot().orientation[id];
      const Eigen::Quaterniond turn(q[3], q[0], q[1], q[2]);
      const Vector3d spin = turn.conjugate() * fixture.angular_velocity(id).cast<double>();
      return std::pair(0.5 * spin.dot(moments.cwiseProduct(spin)),
                       Vector3d(turn * moments.cwiseProduct(spin)));
    };
    const auto [energy, momentum] = energy_and_momentum();
    fixture.run(120 * dt_s, [&, energy = energy, momentum = momentum] {
      const auto [now, turned] = energy_and_momentum();
      EXPECT_NEAR(now, energy, 0.02 * energy);
      EXPECT_LT((turned - momentum).norm(), 1e-4 * momentum.norm());
    });
  });
}

// A body that turns above the cells, where no point of it comes near them.
TEST_P(Rotation, SpinningBodyIsNotPushedByWhatItDoesNotReach) {
  for_random_fixtures(90, 200, GetParam(), [](PhysicsFixture& fixture, auto draw) {
    fixture.scene.world.gravity = Vector3d::Zero();
    const bool is_box = draw(0, 1) < 0.5;
    smartsurf::scene::ObjectSpec object;
    if (is_box) {
      object = box({draw(0.5, 4), draw(0.5, 4), draw(0.5, 4)}, {15, 15, 0});
    } else {
      const double height = draw(0.5, 4), radius = draw(0.3, 2);
      object = cylinder(radius, height, {15, 15, 0});
    }
    const double reach = is_box ? 0.5 * object.size.norm() : std::hypot(object.radius, 0.5 * object.height);
    object.position.z() = reach + draw(0.05, 1.0);
    const Vector3d axis = random_direction(draw);
    object.angular_velocity = draw(0.05, 6) / fixture.scene.world.dt_s * axis;
    const auto id = fixture.add(object);
    fixture.run(0.5);
    EXPECT_EQ(fixture.velocity(id), Eigen::Vector3f(0, 0, 0));
  });
}
