// Pins of limited force, against closed forms: a weight W on n pins rises if n·max_force > W, and stalls
// otherwise.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "tests/property/PhysicsBench.h"

using namespace physics_bench;
using namespace smartsurf;

namespace {

constexpr double kGravity = 9.81, kForce = 40;
constexpr float kUp = 2.0F;  // how far the pins are told to rise

void use_pins(PhysicsBench& bench) {
  scene::ActuatorSpec spec = scene::find_actuator_kind("pin")->default_spec();
  for (const auto& [name, value] : scene::ParameterValues{
           {"range", {0, 4}}, {"max_speed", {6}}, {"max_acceleration", {10}}, {"max_force", {kForce}}})
    spec.values[name] = value;
  bench.scene.surface.actuators = {spec};
  derive_pin_spec(bench.scene.surface);
}

void raise_all(PhysicsBench& bench, float height) {
  bench.cells().set_targets(0, std::vector<float>(bench.cells().field().height.size(), height));
}

scene::ObjectSpec heavy(scene::ObjectSpec o, double weight) {
  o.mass = weight / kGravity;
  return o;
}

// A box that covers `columns` × `rows` cells whole, from the cell at (10, 10) on.
scene::ObjectSpec box_over(int columns, int rows) {
  return box({columns - 0.2, rows - 0.2, 1.0}, {10 + 0.5 * (columns - 1), 10 + 0.5 * (rows - 1), 0.5});
}

double lift(int columns, int rows, double share_of_force) {
  PhysicsBench bench;
  use_pins(bench);
  const auto id = bench.add(heavy(box_over(columns, rows), share_of_force * kForce * columns * rows));
  bench.run(0.5);
  raise_all(bench, kUp);
  bench.run(4.0);
  return bench.position(id).z() - 0.5;
}

}  // namespace

TEST(ForceLimit, AWeightRisesWhereItsPinsCanBearItTogetherAndStallsWhereTheyCannot) {
  for (const auto& [columns, rows] : {std::pair{1, 1}, {2, 2}, {3, 3}, {1, 4}, {5, 5}}) {
    EXPECT_NEAR(lift(columns, rows, 0.7), kUp, 0.02) << columns << " by " << rows;
    EXPECT_NEAR(lift(columns, rows, 0.9), kUp, 0.02) << columns << " by " << rows;
    EXPECT_NEAR(lift(columns, rows, 1.1), 0.0, 0.02) << columns << " by " << rows;
    EXPECT_NEAR(lift(columns, rows, 2.0), 0.0, 0.02) << columns << " by " << rows;
  }
}

TEST(ForceLimit, NoPinOffItsStopGivesMoreThanItsForceInAnyStep) {
  PhysicsBench bench;
  use_pins(bench);
  bench.add(heavy(box_over(4, 4), 12 * kForce));
  auto ball = heavy(sphere(1.5, {11.5, 11.5, 8}), 3 * kForce);
  bench.add(ball);
  // The force is limited along the pin; a contact that leans a little bears a little more.
  const float most = static_cast<float>(kForce / 240) * 1.02F;
  double greatest = 0;
  int gave_way = 0;
  auto look = [&] {
    const surface::Field& f = bench.cells().field();
    for (std::size_t i = 0; i < f.impulse.size(); ++i)
      if (f.height[i] > 0.01F) {
        ASSERT_LE(f.impulse[i], most);
        greatest = std::max(greatest, static_cast<double>(f.impulse[i]));
        gave_way += f.speed[i] < -0.1F;
      }
  };
  raise_all(bench, kUp);
  bench.run(3.0, look);
  EXPECT_GT(greatest, 0.9F * most);
  EXPECT_GT(gave_way, 0) << "the ball's blow pushes pins back";
}

// How high the lower of two boxes gets in 3 s that stand with one edge each on one pin between them.
float height_of_two(double share, double offset) {
  PhysicsBench bench;
  use_pins(bench);
  const double weight = 1.5 * share * kForce;
  const auto west = bench.add(heavy(box({1.45, 0.8, 1}, {10.325 + offset, 10, 0.5}), weight));
  const auto east = bench.add(heavy(box({1.45, 0.8, 1}, {11.825 + offset, 10, 0.5}), weight));
  bench.run(0.5);
  raise_all(bench, kUp);
  bench.run(3.0);
  return std::min(bench.position(west).z(), bench.position(east).z());
}

TEST(ForceLimit, TwoBodiesOnOnePinShareItsForce) {
  // Each alone could be lifted by its outer pin and half of the middle one. The two rock against each other,
  // and how far they get in a given time is a matter of chance: the middle one of several tries is looked at.
  for (const double share : {0.8, 1.2}) {
    std::array<float, 11> heights;
    for (std::size_t i = 0; i < heights.size(); ++i)
      heights[i] = height_of_two(share, 1e-3 * static_cast<double>(i));
    const auto middle = heights.begin() + heights.size() / 2;
    std::nth_element(heights.begin(), middle, heights.end());
    if (share < 1)
      EXPECT_GT(*middle, 1.0F);
    else
      EXPECT_LT(*middle, 1.0F);
  }
}

TEST(ForceLimit, AnUnevenLoadStallsTheOverloadedPinsOnly) {
  PhysicsBench bench;
  use_pins(bench);
  const auto plank = bench.add(heavy(box_over(12, 1), 0.5 * kForce));
  // On the eastern end, more than the pins under it can bear.
  const auto load = bench.add(heavy(box({1.8, 0.8, 1}, {20.5, 10, 1.5}), 12 * kForce));
  bench.run(0.5);
  raise_all(bench, 1);
  bench.run(3.0);
  const auto& f = bench.cells().field();
  const int row = 31 - 10;
  EXPECT_GT(f.height[static_cast<std::size_t>(f.index(row, 10))], 0.9F) << "the light end rises";
  EXPECT_LT(f.height[static_cast<std::size_t>(f.index(row, 21))], 0.1F) << "the heavy one does not";
  EXPECT_LT(bench.position(load).z(), 1.7F);
  EXPECT_GT(bench.position(plank).z(), 0.7F);
}

TEST(ForceLimit, PinsThatAreUpSinkUnderMoreThanTheyCanHold) {
  // What is too heavy falls with the share of its weight that the pins do not hold: s = ½·(1 − 1/share)·g·t².
  for (const double share : {0.9, 1.25}) {
    PhysicsBench bench;
    use_pins(bench);
    raise_all(bench, 4);
    bench.run(3.0);
    auto o = heavy(box_over(3, 3), share * 9 * kForce);
    o.position.z() = 4.5;
    const auto id = bench.add(o);
    bench.run(0.5);
    const double sunk = share < 1 ? 0.0 : 0.5 * (1 - 1 / share) * kGravity * 0.5 * 0.5;
    EXPECT_NEAR(4.5 - bench.position(id).z(), sunk, 0.02);
  }
}
