// Effects of actuators on objects against closed forms.
#include <gtest/gtest.h>

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

}  // namespace

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
