// Stacks at rest: no load presses bodies into each other, and the cells bear the weight, at any mass ratio.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;

namespace {

struct StackOfBoxes {
  PhysicsFixture fixture;
  std::vector<smartsurf::scene::ObjectId> boxes;
  double weight = 0.0;  // mass·u/s²

  // Boxes of height 1, the topmost of mass `ratio`.
  StackOfBoxes(int count, double ratio, double dt_s = 1.0 / 60, int iterations = 10) {
    fixture.scene.world.dt_s = dt_s, fixture.scene.world.iterations = iterations;
    for (int i = 0; i < count; ++i) {
      auto o = box({2, 2, 1}, {15.5, 15.5, i + 0.5});
      o.mass = i == count - 1 ? ratio : 1.0;
      weight += *o.mass * kGravity;
      boxes.push_back(fixture.add(o));
    }
  }
  double sunk() { return static_cast<double>(boxes.size()) - 0.5 - fixture.position(boxes.back()).z(); }
  double load() {
    const std::vector<float>& impulse = fixture.cells().field().impulse;
    return std::accumulate(impulse.begin(), impulse.end(), 0.0) / fixture.scene.world.dt_s;
  }
  double fastest() {
    double speed = 0.0;
    for (const auto id : boxes) speed = std::max(speed, static_cast<double>(fixture.velocity(id).norm()));
    return speed;
  }
};

}  // namespace

TEST(Stacks, HeavyBoxOnLightOnesComesToRest) {
  StackOfBoxes stack(5, 100.0);
  stack.fixture.run(4.0);
  EXPECT_LT(stack.sunk(), 0.0125);
  EXPECT_NEAR(stack.load(), stack.weight, 0.002 * stack.weight);
  EXPECT_LT(stack.fastest(), 0.002);
}

TEST(Stacks, TowerOfTenBearsItsWeight) {
  StackOfBoxes stack(10, 1.0);
  stack.fixture.run(3.0);
  EXPECT_LT(stack.sunk(), 0.02);
  EXPECT_NEAR(stack.load(), stack.weight, 0.004 * stack.weight);
  EXPECT_LT(stack.fastest(), 0.002);
}

TEST(Stacks, TowerOfThirtyStandsAndBearsItsWeight) {
  StackOfBoxes stack(30, 1.0);
  stack.fixture.run(4.0);
  EXPECT_LT(stack.sunk(), 0.01);
  EXPECT_NEAR(stack.load(), stack.weight, 0.002 * stack.weight);
  EXPECT_LT(stack.fastest(), 0.002);
}

// At any number of iterations: where sweeps are too few for a load, the direct solver has it.
TEST(Stacks, TowersOfTwelveHardlySink) {
  for (const double rate : {60.0, 120.0, 240.0})
    for (const int iterations : {4, 10, 25, 40, 80}) {
      StackOfBoxes stack(12, 1.0, 1.0 / rate, iterations);
      stack.fixture.run(3.0);
      EXPECT_LT(stack.sunk(), 0.01) << iterations << " iterations at 1/" << rate;
      EXPECT_LT(stack.fastest(), 0.002) << iterations << " iterations at 1/" << rate;
    }
}

// No load sinks much deeper than a heavier one.
TEST(Stacks, LoadsOfAnyRatioHardlySink) {
  for (const double ratio : {1.0, 2.0, 4.0, 8.0, 12.0, 15.0, 15.9, 16.1, 30.0, 100.0, 1000.0}) {
    StackOfBoxes stack(2, ratio);
    stack.fixture.run(2.0);
    EXPECT_LT(stack.sunk(), 0.0025) << "ratio " << ratio;
    EXPECT_NEAR(stack.load(), stack.weight, 0.002 * stack.weight) << "ratio " << ratio;
    EXPECT_LT(stack.fastest(), 0.002) << "ratio " << ratio;
  }
}

// Below the speed of a blow the direct solver has such a pair.
TEST(Stacks, SlowBoxKeepsItsFrictionOnHeavyOne) {
  for (const double rate : {60.0, 240.0})
    for (const double mass : {20.0, 200.0, 1e5}) {
      PhysicsFixture fixture;
      fixture.scene.world.dt_s = 1.0 / rate;
      fixture.scene.materials[0].friction = 0.2;
      auto under = box({12, 4, 1}, {10, 15, 0.5});
      under.mass = mass;
      fixture.add(under);
      auto rider = box({0.9, 0.8, 0.8}, {6, 15, 1.4});
      rider.mass = 1.0, rider.velocity = {0.9, 0, 0};
      const auto id = fixture.add(rider);
      fixture.run(1.0);
      const double right = 0.9 * 0.9 / (2 * 0.2 * kGravity);
      EXPECT_NEAR(fixture.position(id).x() - 6, right, 0.06 * right + 0.45 / rate) << "mass " << mass;
    }
}
