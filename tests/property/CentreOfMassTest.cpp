// Bodies whose centre of mass is not the origin of their shape, against closed forms: pendulums, tipping,
// rolling, flight.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "tests/property/PhysicsFixture.h"
#include "tests/property/Swing.h"

using namespace physics_fixture;
using Eigen::Vector3d;
using smartsurf::scene::JointKind;
using smartsurf::scene::ObjectSpec;

namespace {

class CentreOfMass : public testing::TestWithParam<double> {
 protected:
  CentreOfMass() { fixture.scene.world.dt_s = GetParam(); }

  // Mean time between upward passages of value() through 0.
  template <class Value>
  double period_of(double seconds, Value value) {
    double t = 0, before = value(), first = -1, last = -1;
    int count = -1;
    fixture.run(seconds, [&] {
      t += GetParam();
      const double now = value();
      if (before < 0 && now >= 0) {
        last = t - GetParam() * now / (now - before);
        if (first < 0) first = last;
        ++count;
      }
      before = now;
    });
    return count > 0 ? (last - first) / count : 0.0;
  }

  PhysicsFixture fixture;
};
INSTANTIATE_TEST_SUITE_P(Steps, CentreOfMass, testing::Values(1.0 / 60, 1.0 / 240, 1.0 / 960));

Vector3d z_axis_of(PhysicsFixture& fixture, std::size_t i) {
  const auto& q = fixture.snapshot().orientation[i];
  return Eigen::Quaterniond(q[3], q[0], q[1], q[2]) * Vector3d::UnitZ();
}

}  // namespace

// A box on a hinge through its origin, from which its centre of mass hangs: T = 2π √((I + m d²)/(m g d)).
TEST_P(CentreOfMass, PendulumHasItsPeriod) {
  constexpr double kDepth = 0.7, kAmplitude = 0.02, kMass = 3.0;
  const Eigen::Quaterniond turned(Eigen::AngleAxisd(kAmplitude, Vector3d::UnitY()));
  ObjectSpec body = box({0.4, 0.4, 2.0}, {15, 15, 50});
  body.orientation = turned;
  body.mass = kMass;
  body.centre_of_mass = {0, 0, -kDepth};
  body.inertia = Vector3d(0.9, 1.3, 0.5).asDiagonal();
  const auto id = fixture.add(body);
  const auto hinge = fixture.world().add_joint(
      {.kind = JointKind::kHinge, .a = id, .anchor = body.position, .axis = Vector3d::UnitY()});
  const double expected = 2.0 * M_PI *
                          std::sqrt((1.3 + kMass * kDepth * kDepth) / (kMass * kGravity * kDepth)) *
                          (1.0 + kAmplitude * kAmplitude / 16.0);
  const double period =
      period_of(8.2 * expected, [&] { return fixture.world().joint_state(hinge).coordinate + kAmplitude; });
  EXPECT_NEAR(period / expected, 1.0, 1e-3);
  EXPECT_LT((fixture.position(id).cast<double>() - body.position).norm(), 1e-3);
}

// On a slope of angle α a box of half width w tips over its lower edge if tan α > w / height of the centre of
// mass.
TEST_P(CentreOfMass, BoxTipsOnItsSlope) {
  for (const double height : {-0.7, 0.0, 0.8})
    for (const double factor : {0.97, 1.03}) {
      PhysicsFixture slope;
      slope.scene.world.dt_s = GetParam();
      slope.scene.materials[0].friction = 5.0;
      const double angle = std::atan(factor * 1.0 / (1.5 + height));
      slope.scene.world.gravity = kGravity * Vector3d(std::sin(angle), 0, -std::cos(angle));
      ObjectSpec body = box({2, 2, 3}, {15.3, 15.3, 1.5});
      body.centre_of_mass = {0, 0, height};
      slope.add(body);
      slope.run(6.0);
      const bool tipped = z_axis_of(slope, 0).z() < 0.9;
      EXPECT_EQ(tipped, factor > 1.0) << "centre of mass at " << height << ", factor " << factor;
    }
}

// A box that overhangs the edge of a fixed one stays exactly if its centre of mass is over that.
TEST_P(CentreOfMass, OverhangingBoxFallsWithItsCentreOfMass) {
  for (const double beyond_edge : {-0.05, 0.05}) {
    PhysicsFixture ledge;
    ledge.scene.world.dt_s = GetParam();
    ObjectSpec base = box({6, 6, 4}, {15, 15, 2});
    base.fixed = true;
    ledge.add(base);
    ObjectSpec plank = box({4, 1, 0.5}, {19, 15, 4.25});  // a quarter of it is over the base
    plank.centre_of_mass = {-1.0 + beyond_edge, 0, 0};
    ledge.add(plank);
    ledge.run(4.0);
    EXPECT_EQ(ledge.position(1).z() < 4.0F, beyond_edge > 0.0) << beyond_edge;
  }
}

// A ball with its centre of mass d below its centre rocks on the table: T = 2π √((I + m (r − d)²)/(m g d)).
TEST_P(CentreOfMass, LoadedBallRocksWithItsPeriod) {
  constexpr double kRadius = 1.5, kDepth = 0.5, kAmplitude = 0.1;
  fixture.scene.materials[0].rolling_friction = 0.0;
  ObjectSpec ball = sphere(kRadius, {15, 15, kRadius});
  ball.mass = 2.0;
  ball.centre_of_mass = {0, 0, -kDepth};
  ball.orientation = Eigen::AngleAxisd(kAmplitude, Vector3d::UnitY());
  fixture.add(ball);
  const double inertia = 0.4 * kRadius * kRadius, arm = kRadius - kDepth;
  const double expected = 2.0 * M_PI * std::sqrt((inertia + arm * arm) / (kGravity * kDepth));
  const double period = period_of(5.2 * expected, [&] { return -z_axis_of(fixture, 0).x(); });
  EXPECT_NEAR(period / expected, 1.0, 0.01);
}

// Random balls, cylinders and capsules whose centre of mass is below their axis, on cells, on a fixed body
// and on a heavy one, declared before or after it: what rocks without rolling friction neither gains nor
// loses.
TEST_P(CentreOfMass, LoadedRoundBodiesKeepTheirSwing) {
  const auto rock = [](PhysicsFixture& scene, const auto& draw, double greatest_amplitude) {
    scene.scene.materials[0].rolling_friction = 0.0;
    scene.scene.materials[0].friction = 1.0;
    const double on = draw(0, 4), ground = on < 1 ? 0.0 : 1.0;
    ObjectSpec slab = box({16, 16, 1}, {15, 15, 0.5});
    slab.fixed = on < 2;
    if (on >= 2) slab.mass = 1e5;
    if (on >= 1 && on < 3) scene.add(slab);
    const double radius = draw(0.6, 1.6), kind = draw(0, 3), height = draw(1, 3),
                 amplitude = draw(0.1, greatest_amplitude);
    const Vector3d at(15, 15, ground + radius);
    ObjectSpec body = kind < 1   ? sphere(radius, at)
                      : kind < 2 ? cylinder(radius, height, at)
                                 : capsule(radius, height + 2 * radius, at);
    body.centre_of_mass = {0, -draw(0.2, 0.6) * radius, 0};
    body.orientation =
        Eigen::AngleAxisd(amplitude, Vector3d::UnitY()) * Eigen::AngleAxisd(M_PI / 2, Vector3d::UnitX());
    const auto id = scene.add(body);
    if (on >= 3) scene.add(slab);
    // Positions are floats: at shorter intervals those near an extreme are equal.
    const int stride = static_cast<int>(std::lround(1.0 / 60 / GetParam()));
    Swing swing(1.0 / 60);
    int step = 0;
    scene.run(12.0, [&] {
      if (++step % stride == 0) swing.add(static_cast<double>(scene.position(id).x()));
    });
    EXPECT_LT(std::abs(swing.decrement() / swing.period_s()), 0.003)
        << "a second; kind " << kind << ", on " << on << ", radius " << radius << ", amplitude " << amplitude;
  };
  for (const double greatest_amplitude : {0.4, 1.2})
    for_random_fixtures(21, 24, GetParam(), [&](PhysicsFixture& scene, const auto& draw) {
      rock(scene, draw, greatest_amplitude);
    });
}

// A loaded ball and a loaded capsule right themselves, whatever side they lie on. On Bullet the ball may rest
// in a gap.
TEST_P(CentreOfMass, LoadedBodiesRightThemselves) {
  std::vector<ObjectSpec> bodies{sphere(1.0, {8, 15, 1.02}), capsule(1.0, 2.2, {20, 15, 1.12})};
  fixture.scene.materials[0].rolling_friction = 0.05;
  for (ObjectSpec& body : bodies) {
    body.centre_of_mass = {0, 0, -0.6};
    body.orientation = Eigen::AngleAxisd(2.6, Vector3d(1, 0.3, 0).normalized());
    fixture.add(body);
  }
  fixture.run(20.0);
  EXPECT_GT(z_axis_of(fixture, 0).z(), 0.98);
  EXPECT_NEAR(fixture.position(0).z(), 1.0, 6e-3);
  EXPECT_GT(z_axis_of(fixture, 1).z(), 0.98);
}

// Loaded capsules bounce over corners of uneven cells: each step ends where their speed takes them.
TEST_P(CentreOfMass, BouncingCapsulesDoNotJump) {
  for_random_fixtures(5, 12, GetParam(), [](PhysicsFixture& f, auto draw) {
    f.scene.world.sleep = false;
    f.scene.materials[0].friction = draw(0.0, 0.5);
    f.scene.materials[0].restitution = 0.7;
    for (int i = 0; i < 32 * 32; ++i)
      f.scene.surface.base_heights.push_back(static_cast<float>(draw(0.0, 0.8)));
    constexpr int kCount = 16;
    for (int i = 0; i < kCount; ++i) {
      const double radius = draw(0.4, 0.7);
      ObjectSpec body =
          capsule(radius, 2.0 * radius + draw(0.3, 1.0), {5.0 + i % 4 * 6, 5.0 + i / 4 * 6, 3.0});
      body.orientation =
          Eigen::AngleAxisd(draw(0.0, 3.0), Vector3d(draw(-1, 1), draw(-1, 1), 1).normalized());
      body.angular_velocity = {draw(-5, 5), draw(-5, 5), draw(-5, 5)};
      body.centre_of_mass = {draw(-0.15, 0.15), draw(-0.15, 0.15), draw(-0.15, 0.15)};
      f.add(body);
    }
    std::vector<Eigen::Vector3f> position(kCount), velocity(kCount);
    const auto state = [&](std::uint32_t i) { position[i] = f.position(i), velocity[i] = f.velocity(i); };
    for (std::uint32_t i = 0; i < kCount; ++i) state(i);
    float furthest = 0.0F;
    f.run(2.0, [&] {
      for (std::uint32_t i = 0; i < kCount; ++i) {
        const float moved = (f.position(i) - position[i]).norm(),
                    speed = std::max(velocity[i].norm(), f.velocity(i).norm());
        furthest = std::max(furthest, moved - speed * static_cast<float>(GetParam()));
        state(i);
      }
    });
    EXPECT_LT(furthest, 0.1F);
  });
}

// In flight the centre of mass follows its parabola, and the origin turns about it.
TEST_P(CentreOfMass, FliesOnItsParabola) {
  const Vector3d offset(0.5, -0.2, 0.3), start(15, 15, 60), spin(0, 0, 3), velocity(1, 2, 4);
  ObjectSpec body = cylinder(0.5, 2.0, start);
  body.centre_of_mass = offset;
  body.inertia = Vector3d::Constant(0.8).asDiagonal();  // so that the spin stays
  body.angular_velocity = spin;
  body.velocity = velocity;
  fixture.add(body);
  fixture.run(1.0);
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(3.0, Vector3d::UnitZ()));
  const Vector3d centre_velocity = velocity + spin.cross(offset);
  const Vector3d centre = start + offset + centre_velocity - Vector3d(0, 0, 0.5 * kGravity);
  const Vector3d expected = centre - turn * offset;
  // Half a substep of gravity, as for every body.
  EXPECT_LT((fixture.position(0).cast<double>() - expected).norm(), 0.5 * kGravity * GetParam() / 5 + 1e-3);
  const Vector3d expected_velocity = centre_velocity - Vector3d(0, 0, kGravity) - spin.cross(turn * offset);
  EXPECT_LT((fixture.velocity(0).cast<double>() - expected_velocity).norm(), 2e-3);
}

// A force at the origin turns the body, one without a point does not.
TEST_P(CentreOfMass, ForcesActWhereTheySay) {
  fixture.scene.world.gravity = Vector3d::Zero();
  for (const double x : {5.0, 25.0}) {
    ObjectSpec body = box({1, 1, 1}, {x, 15, 50});
    body.mass = 2.0;
    body.centre_of_mass = {0, 0.4, 0};
    body.inertia = Vector3d(0.5, 0.6, 0.7).asDiagonal();
    fixture.add(body);
  }
  fixture.world().apply_force(0, {3, 0, 0}, std::nullopt, 0.1);
  fixture.world().apply_force(1, {3, 0, 0}, Vector3d(25, 15, 50), 0.1);
  fixture.run(0.2);
  EXPECT_LT(fixture.angular_velocity(0).norm(), 1e-6);
  EXPECT_NEAR(fixture.velocity(0).x(), 0.15, 1e-4);
  const double torque_impulse = 0.4 * 3 * 0.1;  // the arm is (0, −0.4, 0): about +z
  EXPECT_NEAR(fixture.angular_velocity(1).z(), torque_impulse / 0.7, 2e-3);
}

// Placed objects keep what is not set, also where their origin is not the centre of mass.
TEST_P(CentreOfMass, PlacingSetsTheOrigin) {
  ObjectSpec body = cylinder(0.5, 2.0, {15, 15, 50});
  body.centre_of_mass = {0, 0, -0.7};
  body.velocity = {1, 0, 0};
  fixture.add(body);
  auto& world = fixture.world();
  const Eigen::Quaterniond turned(Eigen::AngleAxisd(1.0, Vector3d::UnitX()));
  scene::ObjectStateUpdate turn;
  turn.orientation = turned;
  turn.angular_velocity = Vector3d(0, 2, 0);
  world.set_state(0, turn);
  auto state = world.state(0);
  EXPECT_LT((state.position - Vector3d(15, 15, 50)).norm(), 1e-5);
  EXPECT_LT((state.velocity - Vector3d(1, 0, 0)).norm(), 1e-5);
  scene::ObjectStateUpdate move;
  move.position = Vector3d(3, 4, 40);
  world.set_state(0, move);
  state = world.state(0);
  EXPECT_LT((state.position - Vector3d(3, 4, 40)).norm(), 1e-5);
  EXPECT_GT(state.orientation.dot(turned), 0.9999);
}
