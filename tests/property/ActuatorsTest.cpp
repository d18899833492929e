// Effects of actuators on objects against closed forms.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "smartsurf/scene/KindRegistry.h"
#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;

namespace {

void set_actuator(PhysicsFixture& fixture, const std::string& model, const scene::ParameterValues& values) {
  scene::ActuatorSpec spec = scene::find_actuator_kind(model)->default_spec();
  for (const auto& [name, value] : values) spec.values[name] = value;
  fixture.scene.surface.actuators = {spec};
  derive_pin_spec(fixture.scene.surface);
}

void set_all_targets(PhysicsFixture& fixture, int channel, float value) {
  fixture.cells().set_targets(channel, std::vector<float>(fixture.cells().field().height.size(), value));
}

// A disc of all cells that turns about `middle` at `rate`, rad/s.
void turn_table(PhysicsFixture& fixture, const Eigen::Vector2f& middle, float rate) {
  const surface::Field& field = fixture.cells().field();
  std::array<std::vector<float>, 3> targets;  // east, north, turn
  for (std::size_t i = 0; i < field.height.size(); ++i) {
    const Eigen::Vector2f from_middle = field.centre(static_cast<int>(i)) - middle;
    targets[0].push_back(-rate * from_middle.y());
    targets[1].push_back(rate * from_middle.x());
    targets[2].push_back(rate);
  }
  for (int channel = 0; channel < 3; ++channel) fixture.cells().set_targets(channel, targets[channel]);
}

class Turntable : public testing::TestWithParam<int> {
 protected:
  static constexpr int kDraws = 6;
  static constexpr double kSeconds = 4.0;

  // Calls run(fixture, draw) for random tables; draw(low, high) is uniform.
  template <class Run>
  void on_random_tables(unsigned seed, Run run) const {
    for_random_fixtures(seed, kDraws, 1.0 / GetParam(), [&](PhysicsFixture& fixture, const auto& draw) {
      fixture.scene.materials[0].rolling_friction = 0;
      fixture.scene.materials[0].friction = draw(0.2, 1.0);
      set_actuator(fixture, "conveyor",
                   {{"max_speed", {100}},
                    {"max_acceleration", {1e6}},
                    {"max_turn", {100}},
                    {"max_turn_acceleration", {1e6}}});
      run(fixture, draw);
    });
  }
};

constexpr double kTableMiddle = 15.5;

}  // namespace

TEST_P(Turntable, CarriesRidersOnCircles) {
  on_random_tables(1, [](PhysicsFixture& fixture, const auto& draw) {
    const double rate = draw(0.3, 2.0) * (draw(0, 1) < 0.5 ? -1 : 1), start = draw(-3.1, 3.1);
    const double grip = fixture.scene.materials[0].friction * kGravity;
    const double distance = std::min(8.0, draw(0.2, 0.7) * grip / (rate * rate));
    const Eigen::Vector3d at(kTableMiddle + distance * std::cos(start),
                             kTableMiddle + distance * std::sin(start), 0.2);
    scene::ObjectSpec rider =
        draw(0, 1) < 0.5 ? box({draw(1.5, 4), draw(1.5, 4), 0.4}, at) : cylinder(draw(1, 2), 0.4, at);
    rider.velocity = rate * Eigen::Vector3d(kTableMiddle - at.y(), at.x() - kTableMiddle, 0);
    rider.angular_velocity = {0, 0, rate};
    const scene::ObjectId id = fixture.add(rider);
    turn_table(fixture, {kTableMiddle, kTableMiddle}, static_cast<float>(rate));
    fixture.run(kSeconds);
    const double angle = start + rate * kSeconds;
    const Eigen::Vector3d expected(kTableMiddle + distance * std::cos(angle),
                                   kTableMiddle + distance * std::sin(angle), 0);
    const Eigen::Vector3d off = fixture.position(id).cast<double>() - expected;
    EXPECT_LT(off.head<2>().norm(), 0.005 * distance) << "rate " << rate << ", distance " << distance;
    EXPECT_NEAR(static_cast<double>(fixture.angular_velocity(id).z()), rate, 0.001);
  });
}

// A ball that rolls on a turntable moves on a circle of its own, at 2/7 of the table's rate.
TEST_P(Turntable, CarriesBallsAtTwoSeventhsOfItsRate) {
  on_random_tables(2, [](PhysicsFixture& fixture, const auto& draw) {
    const double rate = draw(0.3, 2.0), radius = draw(0.8, 2.0), k = 2.0 / 7.0 * rate;
    const Eigen::Vector2d from_middle(draw(-2, 2), draw(-2, 2)), velocity(draw(-0.6, 0.6), draw(-0.6, 0.6));
    scene::ObjectSpec ball =
        sphere(radius, {kTableMiddle + from_middle.x(), kTableMiddle + from_middle.y(), radius});
    ball.velocity = {velocity.x(), velocity.y(), 0};
    ball.angular_velocity = {(rate * from_middle.x() - velocity.y()) / radius,
                             (rate * from_middle.y() + velocity.x()) / radius, 0};
    const scene::ObjectId id = fixture.add(ball);
    turn_table(fixture, {kTableMiddle, kTableMiddle}, static_cast<float>(rate));
    fixture.run(kSeconds);
    const double s = std::sin(k * kSeconds) / k, c = (1 - std::cos(k * kSeconds)) / k;
    const Eigen::Vector2d way(s * velocity.x() - c * velocity.y(), s * velocity.y() + c * velocity.x());
    const Eigen::Vector2d moved = fixture.position(id).cast<double>().head<2>() -
                                  Eigen::Vector2d(kTableMiddle, kTableMiddle) - from_middle;
    EXPECT_LT((moved - way).norm(), 0.005 * velocity.norm() * kSeconds) << "rate " << rate;
  });
}

INSTANTIATE_TEST_SUITE_P(Steps, Turntable, testing::Values(60, 120, 240, 960));

TEST(Actuators, BoxOnBallsReachesTheirSpeed) {
  PhysicsFixture fixture;
  set_actuator(fixture, "ball", {{"radius", {0.4}}, {"max_acceleration", {1e6}}});
  const auto id = fixture.add(box({3, 3, 1}, {6, 15, 0.5}));
  fixture.run(0.2);
  set_all_targets(fixture, 1, 5);  // 2 u/s east
  // Friction accelerates the box at µ·g until it moves with the cell tops.
  fixture.run(0.2);
  EXPECT_NEAR(fixture.velocity(id).x(), 0.5 * 9.81 * 0.2, 0.1);
  fixture.run(0.5);
  EXPECT_NEAR(fixture.velocity(id).x(), 2.0, 0.01);
  EXPECT_NEAR(fixture.velocity(id).y(), 0.0, 0.01);
}

TEST(Actuators, SphereOnBallsRollsBackwards) {
  // A surface moving at v accelerates a resting sphere to (2/7)·v, where it rolls without slipping.
  PhysicsFixture fixture;
  set_actuator(fixture, "ball", {{"radius", {0.4}}, {"max_acceleration", {1e6}}});
  const auto id = fixture.add(sphere(2, {6, 15.5, 2}));
  fixture.run(0.2);
  set_all_targets(fixture, 1, 5);
  fixture.run(0.8);
  EXPECT_NEAR(fixture.velocity(id).x(), 2.0 * 2 / 7, 0.03);
  EXPECT_NEAR(fixture.angular_velocity(id).y(), (2.0 * 2 / 7 - 2.0) / 2, 0.03);
}

TEST(Actuators, ForceFieldAcceleratesByForceOverMass) {
  PhysicsFixture fixture;
  fixture.scene.materials[0].friction = 0;
  set_actuator(fixture, "force_field", {{"fall_off", {1}}, {"reach", {1}}});
  auto o = box({2.9, 2.9, 1}, {6, 15, 0.5});
  o.mass = 60.0;
  const auto id = fixture.add(o);
  set_all_targets(fixture, 0, 2);
  fixture.run(0.5);
  EXPECT_NEAR(fixture.velocity(id).x(), 9 * 2 / 60.0 * 0.5, 0.005);  // nine cells
  EXPECT_NEAR(fixture.position(id).z(), 0.5, 0.01);
}

TEST(Actuators, SheetHoversAtEquilibriumGap) {
  // cells·k·(flow/(1 + g/decay))² = m·g, with k = ½·density·drag·area
  PhysicsFixture fixture;
  set_actuator(fixture, "air_jet", {{"decay", {2}}, {"lag", {0}}});
  auto o = box({4.8, 4.8, 0.2}, {15, 15, 1.5});
  o.mass = 1.0;
  const auto id = fixture.add(o);
  set_all_targets(fixture, 0, 50);
  fixture.run(20.0);
  const double k = 0.5 * 0.001 * 1.2 * 0.64;
  const double gap = 2 * (50 / std::sqrt(9.81 / (25 * k)) - 1);
  EXPECT_NEAR(fixture.position(id).z() - 0.1, gap, 0.02);
  EXPECT_LT(fixture.velocity(id).norm(), 0.02);
  EXPECT_NEAR(fixture.position(id).x(), 15, 0.1);
}

TEST(Actuators, PinLiftsLightSphereAndStallsUnderHeavyOne) {
  for (const double mass : {1.0, 300.0}) {
    PhysicsFixture fixture;
    set_actuator(fixture, "pin",
                 {{"range", {0, 4}}, {"max_speed", {6}}, {"max_acceleration", {10}}, {"max_force", {40}}});
    auto o = sphere(1.5, {15, 16, 1.5});
    o.mass = mass;
    const auto id = fixture.add(o);
    fixture.run(0.5);
    fixture.cells().set_target(0, 15, 15, 2);  // the cell at (15, 16)
    fixture.run(1.5);
    if (mass < 10)
      EXPECT_NEAR(fixture.position(id).z(), 3.5, 0.1);
    else
      EXPECT_NEAR(fixture.position(id).z(), 1.5, 0.1);
  }
}

TEST(Actuators, MagnetAttractsAndRepelsByPole) {
  PhysicsFixture fixture;
  set_actuator(fixture, "magnet", {{"law", {1}}, {"strength", {400}}, {"lag", {0}}});
  auto attracted = cylinder(0.8, 0.6, {12, 16, 0.3});
  attracted.magnetic_pole = 1;
  auto repelled = attracted, plain = attracted;
  repelled.magnetic_pole = -1;
  repelled.position = {18, 16, 0.3};
  plain.magnetic_pole = 0;
  plain.position = {15, 19, 0.3};
  const auto a = fixture.add(attracted), r = fixture.add(repelled), p = fixture.add(plain);
  fixture.run(0.2);
  fixture.cells().set_target(0, 15, 15, -1);  // the cell at (15, 16)
  fixture.run(1.5);
  EXPECT_NEAR(fixture.position(a).x(), 15, 0.7);
  EXPECT_GT(fixture.position(r).x(), 18.5);
  EXPECT_NEAR(fixture.position(p).x(), 15, 0.01);
}
