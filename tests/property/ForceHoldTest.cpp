// Force-limited pins that are not overloaded hold and lift, at any gravity, speed, limit and shape.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "smartsurf/scene/KindRegistry.h"
#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;

namespace {

constexpr int kSize = 11;  // cells along an edge
constexpr double kMiddle = 5.0, kMass = 10.0;
constexpr float kTarget = 2.0F;

struct Motor {
  double max_speed, max_acceleration, max_force;  // max_force 0: unlimited
};

void use_pins(PhysicsFixture& fixture, const Motor& motor, double gravity) {
  fixture.scene.surface.rows = fixture.scene.surface.columns = kSize;
  fixture.scene.world.gravity = {0, 0, -gravity};
  scene::ActuatorSpec spec = scene::find_actuator_kind("pin")->default_spec();
  spec.values["range"] = {0, 4};
  spec.values["max_speed"] = {motor.max_speed};
  spec.values["max_acceleration"] = {motor.max_acceleration};
  if (motor.max_force > 0.0) spec.values["max_force"] = {motor.max_force};
  fixture.scene.surface.actuators = {spec};
  derive_pin_spec(fixture.scene.surface);
}

// The cells under a load on 1 or 3 × 3 cells.
void raise_cells(PhysicsFixture& fixture, int count) {
  const int reach = count == 1 ? 0 : 1;
  for (int row = kSize - 6 - reach; row <= kSize - 6 + reach; ++row)
    for (int column = 5 - reach; column <= 5 + reach; ++column)
      fixture.cells().set_target(0, row, column, kTarget);
}

struct Load {
  const char* name;
  scene::ObjectSpec object;
  double rest_height;  // of its centre above the tops, u
  int cells;           // that bear it
};

std::vector<Load> loads() {
  auto lying = capsule(0.8, 2.0, {kMiddle, kMiddle, 0});
  lying.orientation = Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitX());
  std::vector<Load> all = {{"sphere", sphere(1.5, {kMiddle, kMiddle, 0}), 1.5, 1},
                           {"box", box({2.8, 2.8, 1.6}, {kMiddle, kMiddle, 0}), 0.8, 9},
                           {"cylinder", cylinder(1.5, 2.0, {kMiddle, kMiddle, 0}), 1.0, 1},
                           {"capsule", lying, 0.8, 1},
                           {"hull", cube({kMiddle, kMiddle, 0}, 2.8F), 1.4, 9}};
  for (Load& load : all) load.object.mass = kMass;
  return all;
}

std::string describe(const Load& load, double gravity, const Motor& motor) {
  return std::string(load.name) + ", gravity " + std::to_string(gravity) + ", speed " +
         std::to_string(motor.max_speed) + ", force " + std::to_string(motor.max_force);
}

// Calls each(load, gravity, motor) for all combinations.
template <class Each>
void for_each_case(Each each) {
  for (const Load& load : loads())
    for (const double gravity : {1.0, 9.81, 981.0})
      for (const double max_speed : {0.5, 5.0, 50.0}) {
        const double share = kMass * gravity / load.cells;
        for (const double limit : {1.05 * share, 10 * share, 1e6, 1e8})
          each(load, gravity, Motor{max_speed, 0.5 * gravity, limit});
      }
}

}  // namespace

TEST(ForceHold, RaisedPinsHoldWhatTheyCanBear) {
  for_each_case([](const Load& load, double gravity, const Motor& motor) {
    PhysicsFixture fixture;
    use_pins(fixture, {1e3, 1e4, motor.max_force}, gravity);
    raise_all(fixture, kTarget);
    fixture.run(0.1);
    ASSERT_EQ(fixture.cells().field().height[0], kTarget);
    scene::ObjectSpec o = load.object;
    o.position.z() = kTarget + load.rest_height;
    const auto id = fixture.add(o);
    fixture.run(1.0);
    EXPECT_NEAR(fixture.position(id).z(), kTarget + load.rest_height, 0.005)
        << describe(load, gravity, motor);
    EXPECT_NEAR(fixture.velocity(id).norm(), 0.0, 0.02) << describe(load, gravity, motor);
  });
}

// A direct-current motor under the load W, from rest: m·dv/dt = F·(1 − v/v₀) − W. Height after t.
double motor_height(const Motor& motor, double gravity, double force, double t) {
  const double time_constant = kMass * motor.max_speed / force;
  const double final_speed = motor.max_speed * (1 - kMass * gravity / force);
  return final_speed * (t - time_constant * (1 - std::exp(-t / time_constant)));
}

TEST(ForceHold, PinsLiftWhatTheyCanBear) {
  for_each_case([](const Load& load, double gravity, const Motor& motor) {
    PhysicsFixture fixture;
    use_pins(fixture, motor, gravity);
    scene::ObjectSpec o = load.object;
    o.position.z() = load.rest_height;
    const auto id = fixture.add(o);
    raise_cells(fixture, load.cells);
    const double force = motor.max_force * load.cells, weight = kMass * gravity;
    const double rise_s = 2.3 * std::sqrt(2 / motor.max_acceleration) + 2.4 / motor.max_speed;
    if (force < 2 * weight) {
      // Before the pins brake for their target.
      double t = 0.0;
      while (motor_height(motor, gravity, force, t) < 0.5 * kTarget && t < 3.0) t += fixture.scene.world.dt_s;
      fixture.run(t);
      const double expected = motor_height(motor, gravity, force, t);
      EXPECT_NEAR(fixture.position(id).z() - load.rest_height, expected, 0.05 * expected)
          << describe(load, gravity, motor);
    } else {
      fixture.run(rise_s);
      EXPECT_NEAR(fixture.position(id).z(), kTarget + load.rest_height, 0.01)
          << describe(load, gravity, motor);
    }
  });
}

TEST(ForceHold, PinsOfAnyForceCarryAsPinsWithoutLimit) {
  // At cruise the pins have no force for a load that they do not bear yet.
  for (const double gravity : {9.81, 981.0}) {
    std::array<float, 3> heights;
    const double limits[] = {0.0, 1000.0 * gravity / 9.81, 1e6 * gravity / 9.81};
    for (std::size_t i = 0; i < heights.size(); ++i) {
      PhysicsFixture fixture;
      use_pins(fixture, {0.5, 5.0, limits[i]}, gravity);
      auto ball = sphere(3.0, {kMiddle + 0.5, kMiddle + 0.5, 4.0});
      ball.mass = kMass;
      const auto id = fixture.add(ball);
      raise_all(fixture, kTarget);
      fixture.run(6.0);
      heights[i] = fixture.position(id).z();
    }
    EXPECT_NEAR(heights[1], heights[0], 0.002) << gravity;
    EXPECT_NEAR(heights[2], heights[0], 0.002) << gravity;
  }
}

TEST(ForceHold, BoxOnOnePinDoesNotDrift) {
  PhysicsFixture fixture;
  use_pins(fixture, {6, 10, 40}, 9.81);
  auto o = box({0.8, 0.8, 1.0}, {kMiddle, kMiddle, 0.5});
  o.mass = 0.9 * 40 / 9.81;
  const auto id = fixture.add(o);
  fixture.run(0.5);
  raise_all(fixture, kTarget);
  fixture.run(30.0);
  EXPECT_NEAR((fixture.position(id) - Eigen::Vector3f(kMiddle, kMiddle, kTarget + 0.5F)).norm(), 0.0, 0.005);
}

TEST(ForceHold, SunkenObjectIsPushedOut) {
  for (const Load& load : loads())
    for (const double force : {1.5, 1e4}) {
      PhysicsFixture fixture;
      use_pins(fixture, {6, 10, force * kMass * 9.81 / load.cells}, 9.81);
      raise_all(fixture, kTarget);
      fixture.run(2.0);
      scene::ObjectSpec o = load.object;
      o.position.z() = kTarget + load.rest_height - 0.1;
      const auto id = fixture.add(o);
      fixture.run(1.5);
      EXPECT_NEAR(fixture.position(id).z(), kTarget + load.rest_height, 0.005)
          << load.name << ", force " << force;
    }
}
