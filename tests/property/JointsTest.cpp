// Joints against closed forms, over the step: pendulums, slopes, springs, motors, limits, momentum.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "tests/property/JointFixture.h"

using namespace physics_fixture;

namespace {

class Joints : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Steps, Joints, testing::Values(1.0 / 60, 1.0 / 120, 1.0 / 240, 1.0 / 960));

}  // namespace

// A joint's coordinate counts from where it was created.
TEST_P(Joints, PendulumHasThePeriodOfItsAmplitude) {
  for (const double amplitude : {0.05, 0.5 * M_PI, 0.9 * M_PI}) {
    PendulumFixture fixture(GetParam(), amplitude);
    const double expected = PendulumFixture::period_at(amplitude);
    double least = 0;
    const double period = fixture.period(fixture.hinge, -amplitude, 5.6 * expected);
    fixture.run(1.2 * expected, [&] { least = std::min(least, fixture.coordinate(fixture.hinge)); });
    EXPECT_NEAR(period / expected, 1.0, 1e-3) << "amplitude " << amplitude;
    EXPECT_NEAR(least, -2.0 * amplitude, 2e-3 * amplitude + 2e-4) << "amplitude " << amplitude;
  }
}

TEST_P(Joints, PivotHoldsTheRod) {
  PendulumFixture fixture(GetParam(), 0.5 * M_PI);
  double error = 0, out_of_plane = 0;
  fixture.run(10.0, [&] {
    const auto& s = fixture.snapshot();
    const auto& q = s.orientation[0];
    const Vector3d up =
        Eigen::Quaterniond(q[3], q[0], q[1], q[2]) * Vector3d(0, 0, 0.5 * PendulumFixture::kLength);
    error =
        std::max(error, (Eigen::Vector3f(s.position[0].data()).cast<double>() + up - fixture.pivot).norm());
    out_of_plane = std::max(out_of_plane, std::abs(up.y()));
  });
  EXPECT_LT(error, 1e-4);
  EXPECT_LT(out_of_plane, 1e-4);
}

// The tension in the lowest point is the weight and the centripetal force.
TEST_P(Joints, ForceIsThatOfTheClosedForm) {
  PendulumFixture fixture(GetParam(), 0.5 * M_PI);
  double greatest = 0;
  fixture.run(2.0,
              [&] { greatest = std::max(greatest, fixture.world().joint_state(fixture.hinge).force.z()); });
  const double m = PendulumFixture::mass(), l = 0.5 * PendulumFixture::kLength;
  const double expected = m * kGravity + m * l * 2.0 * PendulumFixture::torque() / PendulumFixture::moment();
  EXPECT_NEAR(greatest / expected, 1.0, 0.01);
}

// Released on a circle with the speed that keeps it there.
TEST_P(Joints, ConicalPendulumStaysOnItsCircle) {
  JointFixture fixture(GetParam());
  const double length = 2.0, angle = 0.5, radius = length * std::sin(angle);
  const double rate = std::sqrt(kGravity / (length * std::cos(angle)));
  // A ball that turns with the line: small, so that its own inertia hardly counts.
  auto bob = sphere(0.05, Vector3d(15 + radius, 15, 50 - length * std::cos(angle)));
  bob.velocity = {0, rate * radius, 0};
  bob.angular_velocity = {0, 0, rate};
  const ObjectId id = fixture.add(bob);
  fixture.join(JointKind::kBall, id, std::nullopt, {15, 15, 50});
  double least = 1e9, greatest = 0, turned = 0, before = 0;
  fixture.run(10.0, [&] {
    const Vector3d at = fixture.position(id).cast<double>() - Vector3d(15, 15, 50);
    least = std::min(least, at.head<2>().norm()), greatest = std::max(greatest, at.head<2>().norm());
    const double azimuth = std::atan2(at.y(), at.x());
    turned += std::remainder(azimuth - before, 2.0 * M_PI);
    before = azimuth;
  });
  EXPECT_NEAR(least / radius, 1.0, 2e-3);
  EXPECT_NEAR(greatest / radius, 1.0, 2e-3);
  EXPECT_NEAR(turned / (10.0 * rate), 1.0, 1e-3);
}

TEST_P(Joints, SliderOnASlopeAccelerates) {
  const double angle = 0.4, m = 2.0;
  for (const double friction : {0.0, 0.25, 2.0}) {  // relative to the pull
    JointFixture fixture(GetParam());
    const double pull = m * kGravity * std::sin(angle);
    auto block = box({1, 1, 1}, {15, 15, 50});
    block.mass = m;
    const JointId slider = fixture.join({.kind = JointKind::kSlider,
                                         .a = fixture.add(block),
                                         .anchor = {15, 15, 50},
                                         .axis = {std::cos(angle), 0, -std::sin(angle)},
                                         .friction = friction * pull});
    fixture.run(1.0);
    const double acceleration = std::max(0.0, 1.0 - friction) * pull / m;
    EXPECT_NEAR(fixture.speed(slider), acceleration, 1e-3) << "friction " << friction;
    EXPECT_NEAR(fixture.coordinate(slider), 0.5 * acceleration, 0.5 * acceleration * GetParam() + 1e-3);
    EXPECT_NEAR(fixture.effort(slider), -std::min(1.0, friction) * pull, 1e-3 * pull);
  }
}

TEST_P(Joints, SpringHasItsPeriod) {
  for (const double omega : {2.0, 12.0}) {
    JointFixture fixture(GetParam());
    fixture.scene.world.gravity = Vector3d::Zero();
    auto block = box({1, 1, 1}, {15, 15, 50});
    block.mass = 3.0;
    block.velocity = {1, 0, 0};
    const JointId slider = fixture.join({.kind = JointKind::kSlider,
                                         .a = fixture.add(block),
                                         .anchor = {15, 15, 50},
                                         .axis = {1, 0, 0},
                                         .spring = {{.stiffness = 3.0 * omega * omega}}});
    double greatest = 0;
    const double expected = 2.0 * M_PI / omega, period = fixture.period(slider, 0.0, 6.3 * expected);
    fixture.run(1.2 * expected, [&] { greatest = std::max(greatest, fixture.coordinate(slider)); });
    EXPECT_NEAR(period / expected, 1.0, 1e-3) << "omega " << omega;
    const double coarse = omega * GetParam();  // what sampling may miss of the peak
    EXPECT_NEAR(greatest * omega, 1.0, 2e-3 + 0.13 * coarse * coarse) << "omega " << omega;
  }
}

// A body of mass 1 on a slider with a spring of angular frequency `omega`, after a blow.
struct OscillatorFixture : JointFixture {
  JointId slider;
  OscillatorFixture(double dt, double omega) : JointFixture(dt) {
    scene.world.gravity = Vector3d::Zero();
    scene.world.sleep = false;
    auto block = box({1, 1, 1}, {0, 0, 50});
    block.velocity = {4, 0, 0};
    slider = join({.kind = JointKind::kSlider,
                   .a = add(block),
                   .anchor = {0, 0, 50},
                   .axis = {1, 0, 0},
                   .spring = {{.stiffness = omega * omega}}});
  }
};

// Where the period is about that of the steps, the energy varies within a period, and neither grows nor
// decays.
TEST_P(Joints, StiffSpringKeepsItsAmplitude) {
  const double omega = 4.0 / GetParam();
  OscillatorFixture fixture(GetParam(), omega);
  const auto greatest = [&](int steps) {
    double x = 0.0;
    for (int step = 0; step < steps; ++step) {
      fixture.run(GetParam());
      x = std::max(x, std::abs(fixture.coordinate(fixture.slider)) * omega);
    }
    return x;
  };
  const double first = greatest(100);
  EXPECT_GT(first, 3.5);
  EXPECT_LT(first, 6.0);
  greatest(800);
  EXPECT_NEAR(greatest(100) / first, 1.0, 0.02);
}

// tan(ω'h/2) = ωh/2 for the frequency ω' at substeps of h.
TEST_P(Joints, SpringHasThePeriodOfTheTrapezoidalRule) {
  OscillatorFixture fixture(GetParam(), 1.5 / GetParam());
  const double substeps = 5.0;  // of the default 10 iterations
  const double expected = M_PI * GetParam() / (substeps * std::atan(0.75 / substeps));
  EXPECT_NEAR(fixture.period(fixture.slider, 0.0, 400 * GetParam()) / expected, 1.0, 1e-3);
}

// x = e^(−δt)·sin(ω't)/ω' after a blow of speed 1.
TEST_P(Joints, DampedTorsionSpringDecays) {
  JointFixture fixture(GetParam());
  fixture.scene.world.gravity = Vector3d::Zero();
  auto disc = cylinder(1, 0.5, {15, 15, 50});
  const double moment = 0.5 * M_PI * 0.5, omega = 6.0, decay = 0.8;
  disc.angular_velocity = {0, 0, 1};
  const JointId hinge =
      fixture.join({.kind = JointKind::kHinge,
                    .a = fixture.add(disc),
                    .anchor = {15, 15, 50},
                    .axis = {0, 0, 1},
                    .spring = {{.stiffness = moment * omega * omega, .damping = 2.0 * moment * decay}}});
  const double damped = std::sqrt(omega * omega - decay * decay);
  double error = 0, t = 0;
  fixture.run(3.0, [&] {
    t += GetParam();
    error = std::max(
        error, std::abs(fixture.coordinate(hinge) - std::exp(-decay * t) * std::sin(damped * t) / damped));
  });
  EXPECT_LT(error * omega, 1e-3 + 0.6 * GetParam());
}

TEST_P(Joints, SpringBearsTheWeight) {
  for (const double stiffness : {40.0, 4000.0}) {
    JointFixture fixture(GetParam());
    fixture.scene.world.sleep = false;
    auto block = box({1, 1, 1}, {15, 15, 50});
    block.mass = 2.0;
    const JointId slider = fixture.join({.kind = JointKind::kSlider,
                                         .a = fixture.add(block),
                                         .anchor = {15, 15, 50},
                                         .axis = {0, 0, 1},
                                         .spring = {{.stiffness = stiffness, .damping = 20.0, .rest = 0.5}}});
    fixture.run(6.0);
    EXPECT_NEAR(fixture.coordinate(slider), 0.5 - 2.0 * kGravity / stiffness,
                2e-4 + 1e-3 * 2.0 * kGravity / stiffness);
    EXPECT_NEAR(fixture.effort(slider), 2.0 * kGravity, 0.02);
  }
}

TEST_P(Joints, MotorTurnsWithItsTorqueUpToItsSpeed) {
  JointFixture fixture(GetParam());
  const double moment = 0.5 * M_PI * 0.5, torque = 3.0, target = 5.0;
  const JointId hinge = fixture.join({.kind = JointKind::kHinge,
                                      .a = fixture.add(cylinder(1, 0.5, {15, 15, 50})),
                                      .anchor = {15, 15, 50},
                                      .axis = {0, 0, 1},
                                      .friction = 1.0,
                                      .motor = {{.speed = target, .max_effort = torque}}});
  const double acceleration = (torque - 1.0) / moment;
  fixture.run(1.0);
  EXPECT_NEAR(fixture.speed(hinge), acceleration, 2e-3 * acceleration);
  fixture.run(2.0);
  EXPECT_NEAR(fixture.speed(hinge), target, 1e-3);
  EXPECT_NEAR(fixture.angular_velocity(0).z(), target, 1e-3);
  EXPECT_NEAR(fixture.effort(hinge), 0.0, 1e-2);  // motor against friction
  fixture.world().set_motor(hinge, {.speed = -2.0, .max_effort = 1e3});
  fixture.run(0.1);
  EXPECT_NEAR(fixture.speed(hinge), -2.0, 1e-3);
}

TEST_P(Joints, CoordinateCountsAllTurns) {
  if (on_bullet()) GTEST_SKIP() << "Bullet takes the nearest turn";
  for (const double speed : {300.0, -1000.0, 3000.0})
    for (const int iterations : {4, 10}) {
      JointFixture f(GetParam());
      f.scene.world.iterations = iterations;
      const auto wheel = f.add(cylinder(0.5, 1, {10, 10, 10}));
      const auto hinge = f.join({.kind = JointKind::kHinge,
                                 .a = wheel,
                                 .anchor = {10, 10, 10},
                                 .axis = Vector3d::UnitZ(),
                                 .motor = {{.speed = speed, .max_effort = 1e9}}});
      f.run(0.5);
      const double start = f.coordinate(hinge);
      f.run(0.5);
      EXPECT_NEAR(f.coordinate(hinge) - start, 0.5 * speed, 0.1) << speed << " rad/s, " << iterations;
    }
}

TEST_P(Joints, MotorDrivesASliderAlongItsAxis) {
  for (const double target : {-0.5, 2.0})
    for (const bool has_partner : {false, true}) {
      JointFixture fixture(GetParam());
      fixture.scene.world.gravity = Vector3d::Zero();
      const ObjectId a = fixture.add(box({1, 1, 1}, {15, 15, 50}));
      auto other = box({1, 1, 1}, {15, 15, 48});
      other.fixed = true;
      const std::optional<ObjectId> b = has_partner ? std::optional(fixture.add(other)) : std::nullopt;
      const JointId slider = fixture.join({.kind = JointKind::kSlider,
                                           .a = a,
                                           .b = b,
                                           .anchor = {15, 15, 50},
                                           .axis = {0, 0.6, 0.8},
                                           .motor = {{.speed = target, .max_effort = 1e3}}});
      fixture.run(1.0);
      EXPECT_NEAR(fixture.speed(slider), target, 1e-3 * std::abs(target));
      EXPECT_NEAR(fixture.coordinate(slider), target, 0.04 * std::abs(target));
      EXPECT_NEAR(fixture.world().state(a).position.y(), 15 + 0.6 * target, 0.04 * std::abs(target));
    }
}

// At any number of turns.
TEST_P(Joints, HingeSpringTurnsToItsRest) {
  for (const double rest : {-7.0, -M_PI, 1.0, 4.0, 20.0}) {
    JointFixture fixture(GetParam());
    fixture.scene.world.gravity = Vector3d::Zero();
    auto wheel = box({1, 1, 1}, {15, 15, 50});
    wheel.mass = 6;  // moment 1
    const JointId hinge = fixture.join({.kind = JointKind::kHinge,
                                        .a = fixture.add(wheel),
                                        .anchor = {15, 15, 50},
                                        .axis = {0, 0, 1},
                                        .spring = {{.stiffness = 100, .damping = 20, .rest = rest}}});
    fixture.run(3.0);
    EXPECT_NEAR(fixture.coordinate(hinge), rest, 1e-3);
    EXPECT_NEAR(fixture.speed(hinge), 0.0, 1e-3);
  }
}

// A motor of speed 0 holds the pendulum up to its torque.
TEST_P(Joints, MotorHoldsAgainstGravity) {
  PendulumFixture strong(GetParam(), 1.0), weak(GetParam(), 1.0);
  const double needed = PendulumFixture::torque() * std::sin(1.0);
  strong.world().set_motor(strong.hinge, {.speed = 0.0, .max_effort = 1.05 * needed});
  weak.world().set_motor(weak.hinge, {.speed = 0.0, .max_effort = 0.9 * needed});
  strong.run(2.0), weak.run(0.2);
  EXPECT_NEAR(strong.coordinate(strong.hinge), 0.0, 1e-3);
  EXPECT_NEAR(strong.effort(strong.hinge) / needed, 1.0, 1e-3);
  EXPECT_NEAR(weak.speed(weak.hinge), -0.2 * 0.1 * needed / PendulumFixture::moment(),
              0.01 * needed / PendulumFixture::moment());
  EXPECT_NEAR(weak.effort(weak.hinge) / needed, 0.9, 1e-3);
}

TEST_P(Joints, LimitsStopWithoutRebound) {
  PendulumFixture fixture(GetParam(), 0.5 * M_PI);
  const JointId first = fixture.hinge;
  fixture.world().remove_joint(first);
  const JointId hinge = fixture.join({.kind = JointKind::kHinge,
                                      .a = 0,
                                      .anchor = fixture.pivot,
                                      .axis = {0, 1, 0},
                                      .limits = {{.lower = -1.0, .upper = 2.0}}});
  EXPECT_FALSE(fixture.world().has_joint(first));
  EXPECT_EQ(hinge, first + 1);
  double least = 0;
  fixture.run(2.0, [&] { least = std::min(least, fixture.coordinate(hinge)); });
  EXPECT_GT(least, -1.0 - 1e-3);
  EXPECT_NEAR(fixture.coordinate(hinge), -1.0, 1e-3);
  EXPECT_NEAR(fixture.speed(hinge), 0.0, 1e-3);
  EXPECT_NEAR(fixture.effort(hinge) / (PendulumFixture::torque() * std::sin(0.5 * M_PI - 1.0)), 1.0, 2e-3);
}

// Two boxes that float and tumble with a joint between them.
TEST_P(Joints, KeepMomentum) {
  for (const JointKind kind : {JointKind::kHinge, JointKind::kSlider, JointKind::kBall, JointKind::kFixed}) {
    JointFixture fixture(GetParam());
    fixture.scene.world.gravity = Vector3d::Zero();
    const Vector3d size(1, 2, 0.5), other_size(0.6, 0.6, 1.5);
    auto a = box(size, {15, 15, 50}), b = box(other_size, {15, 17, 50});
    a.velocity = {0.3, 0, 0}, a.angular_velocity = {1, 2, 0.5}, b.angular_velocity = {0, -1, 1};
    fixture.add(a), fixture.add(b);
    JointSpec spec{.kind = kind, .a = 0, .b = 1, .anchor = {15, 16, 50}, .axis = {1, 1, 0}};
    if (spec.has_coordinate()) spec.limits = {{.lower = -1.0, .upper = 1.0}}, spec.friction = 0.01;
    fixture.join(spec);
    auto momenta = [&]() -> std::pair<Vector3d, Vector3d> {
      Vector3d linear(0, 0, 0), angular(0, 0, 0);
      for (ObjectId i = 0; i < 2; ++i) {
        const Vector3d s = (i == 0 ? size : other_size), s2 = s.cwiseAbs2();
        const double m = s.prod();
        const Vector3d moments = m / 12.0 * Vector3d(s2.y() + s2.z(), s2.x() + s2.z(), s2.x() + s2.y());
        const auto state = fixture.world().state(i);
        const Vector3d spin = state.orientation.conjugate() * state.angular_velocity;
        linear += m * state.velocity;
        angular += (state.position - Vector3d(15, 15, 50)).cross(m * state.velocity) +
                   state.orientation * Vector3d(moments.cwiseProduct(spin));
      }
      return {linear, angular};
    };
    const auto [linear, angular] = momenta();
    fixture.run(10.0);
    const auto [linear_after, angular_after] = momenta();
    const double scale = angular.norm();
    EXPECT_LT((linear_after - linear).norm(), 1e-4 * scale) << static_cast<int>(kind);
    EXPECT_LT((angular_after - angular).norm(), 2e-3 * scale) << static_cast<int>(kind);
  }
}

// A dumbbell of two boxes rotates as one body: about its middle, without energy going anywhere.
TEST_P(Joints, FixedJointMakesOneBody) {
  JointFixture fixture(GetParam());
  fixture.scene.world.gravity = Vector3d::Zero();
  auto a = box({1, 1, 1}, {14, 15, 50}), b = box({1, 1, 1}, {16, 15, 50});
  const double rate = 3.0;
  a.velocity = {0, -rate, 0}, b.velocity = {0, rate, 0};
  a.angular_velocity = b.angular_velocity = {0, 0, rate};
  fixture.add(a), fixture.add(b);
  fixture.join(JointKind::kFixed, 0, 1, {15, 15, 50});
  fixture.run(10.0);
  EXPECT_NEAR((fixture.position(0) - fixture.position(1)).norm(), 2.0, 1e-3);
  EXPECT_NEAR(fixture.angular_velocity(0).z(), rate, 2e-3 * rate);
  const Eigen::Vector3f apart = fixture.position(1) - fixture.position(0);
  EXPECT_NEAR(std::remainder(std::atan2(apart.y(), apart.x()) - 10.0 * rate, 2.0 * M_PI), 0.0,
              2e-3 * 10.0 * rate);
}

// A hinge whose axis is not principal for the body: what it takes to keep the axis must not slow the rotation
// down.
TEST_P(Joints, SkewAxisKeepsTheEnergy) {
  JointFixture fixture(GetParam());
  fixture.scene.world.gravity = Vector3d::Zero();
  const Vector3d axis = Vector3d(1, 0, 1).normalized();
  auto plate = box({2, 2, 0.2}, {15, 15, 50});
  plate.angular_velocity = 4.0 * axis;
  const JointId hinge = fixture.join(JointKind::kHinge, fixture.add(plate), std::nullopt, {15, 15, 50}, axis);
  double error = 0;
  fixture.run(10.0, [&] { error = std::max(error, std::abs(fixture.speed(hinge) / 4.0 - 1.0)); });
  EXPECT_LT(error, 2e-3);
  EXPECT_NEAR(fixture.coordinate(hinge), 40.0, 0.08);
}

TEST_P(Joints, ChainHangsWithItsWeight) {
  constexpr int kLinks = 8;
  JointFixture fixture(GetParam());
  std::vector<JointId> joints;
  for (int i = 0; i < kLinks; ++i) {
    const double top = 50.0 - i;
    const ObjectId link = fixture.add(capsule(0.2, 1.0, {15, 15, top - 0.5}));
    joints.push_back(
        fixture.join(JointKind::kBall, link, i == 0 ? std::nullopt : std::optional(link - 1), {15, 15, top}));
  }
  fixture.run(3.0);
  const double link_weight = kGravity * (M_PI * 0.04 * 0.6 + 4.0 / 3.0 * M_PI * 0.008);
  for (int i = 0; i < kLinks; ++i)
    EXPECT_NEAR(fixture.world().joint_state(joints[static_cast<std::size_t>(i)]).force.z() / link_weight,
                kLinks - i, 0.01 * (kLinks - i));
  EXPECT_NEAR(fixture.position(kLinks - 1).z(), 50.0 - kLinks + 0.5, 2e-3);
}

// On top of a joint: contacts load it, and the surface bears what it does not.
TEST_P(Joints, FlapOnAHingeBearsABall) {
  JointFixture fixture(GetParam());
  fixture.scene.materials[0].rolling_friction = 0.05;
  const ObjectId flap = fixture.add(box({4, 2, 0.2}, {15, 15, 3}));
  const JointId hinge = fixture.join({.kind = JointKind::kHinge,
                                      .a = flap,
                                      .anchor = {13, 15, 3},
                                      .axis = {0, 1, 0},
                                      .limits = {{.lower = -0.1, .upper = 0.0}}});
  auto ball = sphere(0.5, {16, 15, 3.62});
  ball.mass = 2.0;
  const ObjectId rider = fixture.add(ball);
  fixture.run(2.0);
  const double expected = kGravity * (4 * 2 * 0.2 * 2.0 + 2.0 * (fixture.position(rider).x() - 13.0));
  EXPECT_NEAR(-fixture.effort(hinge) / expected, 1.0, 0.02);
  EXPECT_NEAR(fixture.coordinate(hinge), 0.0, 2e-3);
}

// Bodies of a joint do not touch each other unless it says so.
TEST_P(Joints, ConnectedBodiesMayOverlap) {
  for (const bool collide : {false, true}) {
    JointFixture fixture(GetParam());
    fixture.scene.world.gravity = Vector3d::Zero();
    fixture.add(box({1, 1, 1}, {15, 15, 50})), fixture.add(box({1, 1, 1}, {15.5, 15, 50}));
    fixture.join({.kind = JointKind::kSlider,
                  .a = 0,
                  .b = 1,
                  .anchor = {15, 15, 50},
                  .axis = {1, 0, 0},
                  .collide = collide});
    fixture.run(1.0);
    EXPECT_EQ((fixture.position(1) - fixture.position(0)).norm() > 0.9, collide);
  }
}

// With a pitch of 1/10, everything in the scene is ten times as small.
TEST_P(Joints, ScaleWithThePitch) {
  std::vector<smartsurf::scene::JointState> states;
  for (const double unit : {1.0, 0.1}) {
    JointFixture fixture(GetParam());
    fixture.scene.surface.pitch = unit;
    fixture.scene.surface.pin.top_x = fixture.scene.surface.pin.top_y = 0.8 * unit;
    fixture.scene.world.gravity = {0, 0, -kGravity * unit};
    auto rod = box(Vector3d(0.3, 0.3, 2) * unit, Vector3d(15, 15, 49) * unit);
    rod.mass = 1.0;
    rod.velocity = Vector3d(1.5, 0, 0) * unit, rod.angular_velocity = {0, -1.5, 0};
    const ObjectId id = fixture.add(rod);
    const JointId hinge = fixture.join({.kind = JointKind::kHinge,
                                        .a = id,
                                        .anchor = Vector3d(15, 15, 50) * unit,
                                        .axis = {0, 1, 0},
                                        .limits = {{-2, 2}},
                                        .friction = 0.2 * unit * unit,
                                        .spring = {{5.0 * unit * unit, 0.1 * unit * unit, 0.1}}});
    auto block = box(Vector3d(1, 1, 1) * unit, Vector3d(20, 15, 50) * unit);
    block.mass = 1.0;
    const JointId slider = fixture.join({.kind = JointKind::kSlider,
                                         .a = fixture.add(block),
                                         .anchor = Vector3d(20, 15, 50) * unit,
                                         .axis = {0, 0, 1},
                                         .limits = {{-1.0 * unit, 1.0 * unit}},
                                         .friction = 0.5 * unit,
                                         .spring = {{30.0, 0.5, 0.3 * unit}},
                                         .motor = {{0.2 * unit, 1.0 * unit}}});
    fixture.run(1.0);
    auto h = fixture.world().joint_state(hinge), s = fixture.world().joint_state(slider);
    h.effort /= unit * unit, h.force /= unit;
    s.coordinate /= unit, s.speed /= unit, s.effort /= unit, s.force /= unit;
    states.push_back(h), states.push_back(s);
  }
  for (std::size_t i = 0; i < 2; ++i) {
    const auto &large = states[i], &small = states[i + 2];
    EXPECT_NEAR(small.coordinate, large.coordinate, 2e-4);
    EXPECT_NEAR(small.speed, large.speed, 2e-3);
    EXPECT_NEAR(small.effort, large.effort, 5e-3);
    EXPECT_LT((small.force - large.force).norm(), 0.02);
  }
}

// ---- chains and loops, drawn from a seed

namespace {

// Slender links in the plane y = 15, hinged along y; each lies in a layer of its own, so that they do not
// meet.
struct PlanarLinks : JointFixture {
  struct Link {
    double length, width, mass, angle;  // angle: from east upwards
    Vector3d size() const { return {length, width, width}; }
  };
  static constexpr double kFar = 100.0;  // the height of the pivot
  std::vector<Link> links;
  double total_mass = 0.0, total_length = 0.0;

  explicit PlanarLinks(double dt) : JointFixture(dt) { scene.world.sleep = false; }
  static Link random_link(std::mt19937& random) {
    auto between = [&](double low, double high) { return std::uniform_real_distribution(low, high)(random); };
    return {between(0.5, 1.5), between(0.04, 0.3), std::exp(between(-1.2, 1.2)), between(-3.1, 3.1)};
  }
  // Each link goes on where the one before ends; the first hangs from the table.
  void hang(const std::vector<Link>& chain) {
    links = chain;
    Vector3d end(15, 15, kFar);
    for (std::size_t i = 0; i < links.size(); ++i) {
      const Link& l = links[i];
      const Vector3d along(std::cos(l.angle), 0, std::sin(l.angle)), layer(0, static_cast<double>(i), 0);
      auto rod = box(l.size(), end + 0.5 * l.length * along + layer);
      rod.mass = l.mass;
      rod.orientation = Eigen::AngleAxisd(-l.angle, Vector3d::UnitY());
      const ObjectId id = add(rod);
      join(JointKind::kHinge, id, i == 0 ? std::nullopt : std::optional(id - 1), end);
      end += l.length * along;
      total_mass += l.mass, total_length += l.length;
    }
  }
  double energy() {
    double sum = 0.0;
    for (std::size_t i = 0; i < links.size(); ++i) {
      const auto s = world().state(static_cast<ObjectId>(i));
      const Vector3d s2 = links[i].size().cwiseAbs2(), spin = s.orientation.conjugate() * s.angular_velocity;
      const Vector3d moments = Vector3d(s2.y() + s2.z(), s2.x() + s2.z(), s2.x() + s2.y()) / 12.0;
      sum += links[i].mass * (0.5 * s.velocity.squaredNorm() + kGravity * (s.position.z() - kFar) +
                              0.5 * moments.dot(spin.cwiseAbs2()));
    }
    return sum;
  }
  // The greatest change of the energy, relative to that of all mass at the chain's length, and the greatest
  // spin out of the plane.
  std::pair<double, double> errors_over(double seconds) {
    const double first = energy();
    double error = 0.0, spin = 0.0;
    run(seconds, [&] {
      error = std::max(error, std::abs(energy() - first));
      for (std::size_t i = 0; i < links.size(); ++i) {
        const auto w = angular_velocity(static_cast<ObjectId>(i));
        spin = std::max({spin, static_cast<double>(std::abs(w.x())), static_cast<double>(std::abs(w.z()))});
      }
    });
    return {error / (total_mass * kGravity * total_length), spin};
  }
};

// The same chain in the angles of its links, by the Runge–Kutta method with steps of 1/20000 s.
Vector3d end_of_chain_after(double seconds, const std::vector<PlanarLinks::Link>& links) {
  using Eigen::VectorXd;
  const auto n = static_cast<Eigen::Index>(links.size());
  Eigen::MatrixXd coupling(n, n);
  VectorXd lever(n), state(2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto& l = links[static_cast<std::size_t>(i)];
    double beyond = 0.0;
    for (std::size_t k = static_cast<std::size_t>(i) + 1; k < links.size(); ++k) beyond += links[k].mass;
    lever[i] = l.length * (0.5 * l.mass + beyond);
    for (Eigen::Index j = 0; j < i; ++j)
      coupling(i, j) = coupling(j, i) = links[static_cast<std::size_t>(j)].length * lever[i];
    coupling(i, i) =
        l.mass * (l.length * l.length / 3.0 + l.width * l.width / 12.0) + beyond * l.length * l.length;
    state[i] = l.angle, state[n + i] = 0.0;
  }
  auto rate = [&](const VectorXd& x) {
    Eigen::MatrixXd mass(n, n);
    VectorXd force(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      force[i] = -kGravity * lever[i] * std::cos(x[i]);
      for (Eigen::Index j = 0; j < n; ++j) {
        mass(i, j) = coupling(i, j) * std::cos(x[i] - x[j]);
        force[i] -= coupling(i, j) * std::sin(x[i] - x[j]) * x[n + j] * x[n + j];
      }
    }
    return (VectorXd(2 * n) << x.tail(n), mass.ldlt().solve(force)).finished();
  };
  const int steps = static_cast<int>(std::lround(seconds * 20000));
  const double h = seconds / steps;
  for (int step = 0; step < steps; ++step) {
    const VectorXd a = rate(state), b = rate(state + 0.5 * h * a), c = rate(state + 0.5 * h * b),
                   d = rate(state + h * c);
    state += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
  }
  Vector3d end(15, 15, PlanarLinks::kFar);
  for (Eigen::Index i = 0; i < n; ++i)
    end += (i + 1 < n ? 1.0 : 0.5) * links[static_cast<std::size_t>(i)].length *
           Vector3d(std::cos(state[i]), 0, std::sin(state[i]));
  return end;
}

}  // namespace

TEST_P(Joints, ChainsMoveAsInReducedCoordinates) {
  for (unsigned seed = 0; seed < 12; ++seed) {
    std::mt19937 random(seed);
    std::vector<PlanarLinks::Link> links(2 + seed % 4);
    for (auto& l : links) l = PlanarLinks::random_link(random);
    PlanarLinks fixture(GetParam());
    fixture.hang(links);
    fixture.run(0.5);
    const auto last = static_cast<ObjectId>(links.size() - 1);
    const Vector3d found = fixture.position(last).cast<double>() - Vector3d(0, last, 0);
    EXPECT_LT((found - end_of_chain_after(0.5, links)).norm(), 1e-3 + 1.0 * GetParam()) << "seed " << seed;
  }
}

// The whip of a long chain's end is what limits it.
TEST_P(Joints, ChainsKeepTheirEnergyInTheirPlane) {
  for (unsigned seed = 0; seed < 8; ++seed) {
    std::mt19937 random(seed);
    std::vector<PlanarLinks::Link> links(2 + random() % 29);
    for (auto& l : links) l = PlanarLinks::random_link(random);
    PlanarLinks fixture(GetParam());
    fixture.hang(links);
    const auto [energy, spin] = fixture.errors_over(GetParam() < 0.002 ? 0.5 : 3.0);
    EXPECT_LT(energy, 0.005) << "seed " << seed << ", " << links.size() << " links";
    EXPECT_LT(spin, 1e-3) << "seed " << seed << ", " << links.size() << " links";
  }
}

// Polygons whose last corner is hinged to the table (four-bar linkages, say), or to the first link. The
// hinges hold each other's axes: they have more rows than the links can obey one by one.
TEST_P(Joints, LoopsKeepTheirEnergyInTheirPlane) {
  for (unsigned seed = 0; seed < 8; ++seed) {
    std::mt19937 random(seed);
    const std::size_t n = 3 + random() % 10;
    const bool is_ring = seed % 2 == 1;
    std::vector<PlanarLinks::Link> links(n);
    Vector3d end(15, 15, PlanarLinks::kFar);
    for (std::size_t i = 0; i < n; ++i) {
      links[i] = PlanarLinks::random_link(random);
      links[i].length = is_ring ? 0.8 : 0.6 + 0.1 * static_cast<double>(i % 3);
      links[i].angle = (is_ring ? 2.0 : 1.3) * M_PI * static_cast<double>(i) / static_cast<double>(n);
      end += links[i].length * Vector3d(std::cos(links[i].angle), 0, std::sin(links[i].angle));
    }
    PlanarLinks fixture(GetParam());
    fixture.hang(links);
    fixture.join(JointKind::kHinge, static_cast<ObjectId>(n - 1),
                 is_ring ? std::optional<ObjectId>(0) : std::nullopt, end);
    const auto [energy, spin] = fixture.errors_over(GetParam() < 0.002 ? 0.5 : 3.0);
    EXPECT_LT(energy, 0.005) << "seed " << seed << ", " << n << " links";
    EXPECT_LT(spin, 1e-3) << "seed " << seed << ", " << n << " links";
  }
}

// Thin rods on hinges along axes of any direction, which limits stop in quick succession: without a motor, no
// limit adds energy.
TEST_P(Joints, LimitsOfSkewChainsAddNoEnergy) {
  if (on_bullet()) GTEST_SKIP() << "Bullet's limits rebound";
  constexpr int kLinks = 5;
  std::mt19937 random(12);
  std::normal_distribution<> normal;
  for (int chain = 0; chain < 12; ++chain) {
    SCOPED_TRACE(chain);
    JointFixture fixture(GetParam());
    const double width = chain % 2 == 0 ? 0.05 : 0.2;
    for (int i = 0; i < kLinks; ++i) {
      auto rod = box({1, width, width}, {i + 0.5, 0, 50});
      rod.mass = 1;
      const ObjectId link = fixture.add(rod);
      fixture.join({.kind = JointKind::kHinge,
                    .a = link,
                    .b = i > 0 ? std::optional<ObjectId>(link - 1) : std::nullopt,
                    .anchor = Vector3d(i, 0, 50),
                    .axis = Vector3d(normal(random), normal(random), normal(random)),
                    .limits = {{-0.4, 0.5}}});
    }
    const Vector3d moments(width * width / 6, (1 + width * width) / 12, (1 + width * width) / 12);
    const auto energy = [&] {
      double sum = 0;
      for (ObjectId i = 0; i < kLinks; ++i) {
        const auto state = fixture.world().state(i);
        const Vector3d spin = state.orientation.conjugate() * state.angular_velocity;
        sum += kGravity * (state.position.z() - 50) + 0.5 * state.velocity.squaredNorm() +
               0.5 * moments.dot(spin.cwiseAbs2());
      }
      return sum;
    };
    double most = 0;
    fixture.run(GetParam() < 0.002 ? 0.7 : 2.0, [&] { most = std::max(most, energy()); });
    EXPECT_LT(most, 0.02 * kLinks * kGravity);
  }
}

// ---- coordinates along and about axes that turn

namespace {

// Numbers and directions from a seed.
struct Draw {
  std::mt19937 random;
  double operator()(double low, double high) { return std::uniform_real_distribution(low, high)(random); }
  Vector3d direction() { return Vector3d((*this)(-1, 1), (*this)(-1, 1), (*this)(-1, 1)).normalized(); }
};

// A hub at the pivot, which a motor turns at `spin`, and a bob of this mass on a slider: at `at` from the
// pivot, at rest relative to the hub.
struct TurningSlider : JointFixture {
  static constexpr double kStrong = 1e6;
  const Vector3d pivot{15, 15, 50};
  JointId slider;

  TurningSlider(double dt, const Vector3d& spin, const Vector3d& at, double mass, JointSpec spec)
      : JointFixture(dt) {
    scene.world.gravity = Vector3d::Zero();
    auto hub = box({1, 1, 1}, pivot), bob = box({0.5, 0.4, 0.3}, pivot + at);
    hub.angular_velocity = bob.angular_velocity = spin;
    bob.velocity = spin.cross(at), bob.mass = mass;
    add(hub), add(bob);
    join({.kind = JointKind::kHinge,
          .a = 0,
          .anchor = pivot,
          .axis = spin,
          .motor = {{.speed = spin.norm(), .max_effort = kStrong}}});
    spec.kind = JointKind::kSlider, spec.a = 1, spec.b = 0;
    slider = join(spec);
  }
};

}  // namespace

// Two boxes tumble freely. A motor, friction or equal limits hold the joint's coordinate to rounding, at any
// step.
TEST_P(Joints, HeldCoordinatesOfTumblingBodiesDoNotCreep) {
  if (on_bullet()) GTEST_SKIP() << "On Bullet they creep";
  for (unsigned seed = 0; seed < 4; ++seed)
    for (const JointKind kind : {JointKind::kSlider, JointKind::kHinge})
      for (const char* holder : {"motor", "friction", "limits"}) {
        SCOPED_TRACE((kind == JointKind::kSlider ? "slider, " : "hinge, ") + std::string(holder) + ", seed " +
                     std::to_string(seed));
        Draw draw{std::mt19937(seed)};
        JointFixture fixture(GetParam());
        fixture.scene.world.gravity = Vector3d::Zero();
        for (int i = 0; i < 2; ++i) {
          auto o =
              box({draw(0.4, 1.6), draw(0.4, 1.6), draw(0.4, 1.6)}, Vector3d(15, 15, 50) + draw.direction());
          o.mass = std::exp(draw(-1.5, 1.5));
          o.orientation = Eigen::AngleAxisd(draw(-3, 3), draw.direction());
          o.velocity = draw.direction(), o.angular_velocity = draw(1, 5) * draw.direction();
          fixture.add(o);
        }
        JointSpec spec{.kind = kind,
                       .a = 0,
                       .b = 1,
                       .anchor = Vector3d(15, 15, 50) + draw.direction(),
                       .axis = draw.direction()};
        double speed = 0;
        if (*holder == 'm')
          spec.motor = {{.speed = speed = draw(-1, 1), .max_effort = 1e6}};
        else if (*holder == 'f')
          spec.friction = 1e6;
        else
          spec.limits = {{0, 0}};
        const JointId joint = fixture.join(spec);
        double t = 0, error = 0, speed_error = 0;
        fixture.run(0.5, [&] {
          t += GetParam();
          error = std::max(error, std::abs(fixture.coordinate(joint) - speed * t));
          speed_error = std::max(speed_error, std::abs(fixture.speed(joint) - speed));
        });
        EXPECT_LT(error, 1e-6);
        EXPECT_LT(speed_error, 1e-5);
      }
}

// The effort of the motor is the component of the centripetal force along the axis, which may point anywhere.
TEST_P(Joints, MotorOfATurningSliderBearsTheCentripetalForce) {
  if (on_bullet()) GTEST_SKIP() << "Bullet's motor gives way first";
  for (unsigned seed = 0; seed < 8; ++seed) {
    SCOPED_TRACE(seed);
    Draw draw{std::mt19937(seed)};
    const Vector3d spin = draw(1, 10) * draw.direction(), at = draw(0.5, 3) * draw.direction(),
                   axis = draw.direction();
    const double speed = draw(-0.5, 0.5), mass = std::exp(draw(-1.5, 1.5)), time = 0.5;
    TurningSlider fixture(GetParam(), spin, at, mass,
                          {.anchor = Vector3d(15, 15, 50) + draw.direction(),
                           .axis = axis,
                           .motor = {{.speed = speed, .max_effort = TurningSlider::kStrong}}});
    fixture.run(time);
    const Vector3d r = at + (time - 0.5 * GetParam()) * speed * axis;  // in the middle of the last step
    const double right = mass * axis.dot(spin.cross(spin.cross(r)));
    EXPECT_NEAR(fixture.coordinate(fixture.slider), time * speed, 2e-6);
    EXPECT_NEAR(fixture.effort(fixture.slider), right, 3e-4 * mass * spin.squaredNorm() * r.norm());
  }
}

// k·x = m·ω²·(r + x), at any stiffness.
TEST_P(Joints, SpringOfATurningSliderBearsTheCentripetalForce) {
  const double spin = 8, radius = 2;
  for (const double stiffness : {300.0, 1e5}) {
    TurningSlider fixture(
        GetParam(), {0, 0, spin}, {radius, 0, 0}, 1.0,
        {.anchor = {17, 15, 50}, .axis = {1, 0, 0}, .spring = {{.stiffness = stiffness, .damping = 40}}});
    fixture.run(2.0);
    const double right = spin * spin * radius / (stiffness - spin * spin);
    EXPECT_NEAR(fixture.coordinate(fixture.slider), right, 1e-5 + 0.3 * GetParam() * GetParam());
    EXPECT_NEAR(fixture.effort(fixture.slider), -stiffness * right, 0.01 * stiffness * right);
  }
}

// Nothing holds the bob: r·cosh ωt, with errors of second order.
TEST_P(Joints, FreeSliderOnATurningAxisRunsAway) {
  const double spin = 3, radius = 1, time = 0.5;
  TurningSlider fixture(GetParam(), {0, 0, spin}, {radius, 0, 0}, 1.0,
                        {.anchor = {16, 15, 50}, .axis = {1, 0, 0}});
  fixture.run(time);
  const double bound = 3 * GetParam() * GetParam() + 1e-5;
  EXPECT_NEAR(fixture.coordinate(fixture.slider), radius * (std::cosh(spin * time) - 1), bound);
  EXPECT_NEAR(fixture.speed(fixture.slider), radius * spin * std::sinh(spin * time), spin * bound);
}

// Two pistons push a platform away from a base that turns. Each of them alone would hold it.
TEST_P(Joints, PistonsOnATurningBaseShareTheForce) {
  if (on_bullet()) GTEST_SKIP() << "Bullet's motors give way first";
  const double spin = 6, speed = 0.3, mass = 2, time = 0.5;
  TurningSlider fixture(GetParam(), {0, 0, spin}, {3, 0, 0}, mass,
                        {.anchor = {18, 17, 50}, .axis = {1, 0, 0}, .motor = {{speed, 1e6}}});
  const JointId other = fixture.join({.kind = JointKind::kSlider,
                                      .a = 1,
                                      .b = 0,
                                      .anchor = {18, 13, 50},
                                      .axis = {1, 0, 0},
                                      .motor = {{speed, 1e6}}});
  fixture.run(time);
  const double right = -mass * spin * spin * (3 + speed * (time - 0.5 * GetParam()));
  for (const JointId id : {fixture.slider, other}) EXPECT_NEAR(fixture.coordinate(id), time * speed, 2e-6);
  EXPECT_NEAR(fixture.effort(fixture.slider) + fixture.effort(other), right, -1e-3 * right);
}

TEST(JointLife, GoesWithItsObject) {
  JointFixture fixture(1.0 / 240);
  for (int i = 0; i < 3; ++i) fixture.add(box({0.5, 0.5, 0.5}, {15.0 + i, 15, 50}));
  const JointId first = fixture.join(JointKind::kBall, 0, 1, {15.5, 15, 50});
  const JointId second = fixture.join(JointKind::kBall, 2, std::nullopt, {17, 15, 51});
  fixture.run(0.1);
  fixture.world().remove(0);
  EXPECT_FALSE(fixture.world().has_joint(first));
  EXPECT_TRUE(fixture.world().has_joint(second));
  fixture.run(0.5);
  EXPECT_NEAR(fixture.world().state(2).position.z(), 50.0, 1e-3);
  EXPECT_NEAR(fixture.world().state(1).position.z(), 50.0 - 0.5 * kGravity * 0.36, 0.05);
}
