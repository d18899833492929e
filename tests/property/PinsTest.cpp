#include <gtest/gtest.h>

#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;

namespace {
void raise_pins(PhysicsFixture& fixture, float height) {
  std::vector<float> targets(fixture.cells().field().height.size(), height);
  fixture.cells().set_targets(0, targets);
}
}  // namespace

TEST(Pins, SphereRidesUpAndDown) {
  PhysicsFixture fixture;
  fixture.scene.surface.pin.max_speed = 2;
  fixture.scene.surface.pin.max_acceleration = 4;  // below g, so the sphere never leaves the pins
  const auto id = fixture.add(sphere(1.5, {15.3, 15.2, 1.5}));
  fixture.run(0.5);
  double max_penetration = 0;
  auto track_penetration = [&] {
    const double top = fixture.cells().field().height[0];
    max_penetration = std::max(max_penetration, top + 1.5 - static_cast<double>(fixture.position(id).z()));
  };
  raise_pins(fixture, 4);
  fixture.run(4.0, track_penetration);
  EXPECT_NEAR(fixture.position(id).z(), 5.5, 0.01);
  raise_pins(fixture, 1);
  fixture.run(4.0, track_penetration);
  EXPECT_NEAR(fixture.position(id).z(), 2.5, 0.01);
  EXPECT_LT(max_penetration, 0.03) << "the sphere sinks into moving pins";
  EXPECT_NEAR(fixture.position(id).x(), 15.3, 0.05);
}

TEST(Pins, ThrowSphereAtTheirSpeed) {
  // Pins that stop abruptly release the sphere at their speed v; it rises by another v²/(2·g).
  PhysicsFixture fixture;
  fixture.scene.surface.pin.max_speed = 10;
  fixture.scene.surface.pin.max_acceleration = 1e4;
  const auto id = fixture.add(sphere(1.0, {15.3, 15.2, 1.0}));
  fixture.run(0.5);
  raise_pins(fixture, 6);
  double apex = 0;
  fixture.run(2.0, [&] { apex = std::max(apex, static_cast<double>(fixture.position(id).z())); });
  EXPECT_NEAR(apex, 7 + 100 / (2 * 9.81), 0.15);
}

TEST(Pins, ObeySpeedAndAccelerationLimits) {
  using namespace smartsurf;
  scene::SurfaceSpec spec;
  spec.rows = spec.columns = 3;
  spec.pin.max_speed = 20;
  spec.pin.max_acceleration = 400;
  surface::ActuatorArray cells(spec);
  const surface::Field& field = cells.field();
  cells.set_target(0, 1, 1, 4.0F);
  const double dt = 1.0 / 240;
  float last_speed = 0;
  int steps = 0;
  while (field.height[4] != 4.0F && steps < 1000) {
    cells.plan(dt);
    const float v = field.speed[4];
    EXPECT_LE(v, 20.0F);
    EXPECT_GE(v, 0.0F) << "overshoot";
    EXPECT_LE(std::abs(v - last_speed), 400.0F * dt * 1.0001) << "step " << steps;
    last_speed = v;
    cells.commit(dt);
    ++steps;
  }
  // Trapezoid: 4 u at 20 u/s and 400 u/s² take 4/20 + 20/400 s.
  EXPECT_NEAR(steps * dt, 0.25, 0.015);
  cells.plan(dt);
  EXPECT_NEAR(field.speed[4], 0.0F, 1e-4F);
  cells.commit(dt);
  cells.plan(dt);
  EXPECT_EQ(field.speed[4], 0.0F);
  EXPECT_EQ(field.height[4], 4.0F);
  EXPECT_EQ(field.height[0], 0.0F);
}

TEST(Pins, ReversalsObeyLimits) {
  using namespace smartsurf;
  scene::SurfaceSpec spec;
  spec.rows = spec.columns = 1;
  surface::ActuatorArray cells(spec);
  const surface::Field& field = cells.field();
  const double dt = 1.0 / 240;
  float last = 0;
  for (int i = 0; i < 5000; ++i) {
    if (i % 17 == 0) cells.set_target(0, 0, 0, static_cast<float>((i * 7919) % 61) / 10.0F);
    cells.plan(dt);
    EXPECT_LE(std::abs(field.speed[0] - last), 400.0F * dt * 1.001);
    EXPECT_LE(std::abs(field.speed[0]), 20.0F);
    last = field.speed[0];
    cells.commit(dt);
    EXPECT_GE(field.height[0], -1e-4F);
    EXPECT_LE(field.height[0], 6.0001F);
  }
}

TEST(Pins, SphereRestsInPocket) {
  PhysicsFixture fixture;
  auto& cells = fixture.cells();
  for (int r = 0; r < 32; ++r)
    for (int c = 0; c < 32; ++c) {
      const double dx = c - 15, dy = (31 - r) - 15;
      cells.set_target(0, r, c, dx * dx + dy * dy <= 4.1 ? 0.0F : 4.0F);
    }
  fixture.run(1.0);
  const auto id = fixture.add(sphere(2.0, {15.2, 14.9, 7}));
  fixture.run(4.0);
  EXPECT_NEAR(fixture.position(id).x(), 15, 0.5);
  EXPECT_NEAR(fixture.position(id).y(), 15, 0.5);
  EXPECT_GT(fixture.position(id).z(), 1.9);
  EXPECT_LT(fixture.velocity(id).norm(), 0.02);
}

TEST(Pins, RaisedRowStopsRollingSphere) {
  PhysicsFixture fixture;
  for (int r = 0; r < 32; ++r) fixture.cells().set_target(0, r, 20, 4.0F);
  fixture.run(1.0);
  auto object = sphere(1.5, {8, 15.3, 1.5});
  object.velocity = {8, 0, 0};
  object.angular_velocity = {0, 8 / 1.5, 0};
  const auto id = fixture.add(object);
  float farthest = 0;
  fixture.run(3.0, [&] { farthest = std::max(farthest, fixture.position(id).x()); });
  EXPECT_NEAR(farthest, 20 - 0.4 - 1.5, 0.03);
}

TEST(Pins, BoxRestsOnRaisedPatch) {
  PhysicsFixture fixture;
  for (int r = 14; r <= 16; ++r)
    for (int c = 14; c <= 16; ++c) fixture.cells().set_target(0, r, c, 2.0F);
  fixture.run(1.0);
  const auto id = fixture.add(box({5, 5, 1}, {15, 16, 2.6}));
  fixture.run(3.0);
  EXPECT_NEAR(fixture.position(id).z(), 2.5, 0.02);
  EXPECT_LT(fixture.velocity(id).norm(), 0.01);
  EXPECT_LT(fixture.angular_velocity(id).norm(), 0.01);
}

TEST(Pins, CylinderStandsAndLies) {
  PhysicsFixture fixture;
  const auto standing = fixture.add(cylinder(1.5, 3, {8, 15.3, 1.6}));
  auto lying_spec = cylinder(1.0, 4, {20, 15.3, 1.1});
  lying_spec.orientation = Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitY());
  const auto lying = fixture.add(lying_spec);
  fixture.run(4.0);
  EXPECT_NEAR(fixture.position(standing).z(), 1.5, 0.02);
  EXPECT_NEAR(fixture.position(lying).z(), 1.0, 0.02);
  EXPECT_LT(fixture.velocity(standing).norm(), 0.02);
  EXPECT_LT(fixture.velocity(lying).norm(), 0.02);
}
