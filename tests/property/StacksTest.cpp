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
  StackOfBoxes(int count, double ratio) {
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

// Pairs keep a sixth of their softness at this step, which lets the heavy box sink by 0.0023 u a box.
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
  EXPECT_LT(stack.sunk(), 0.06);
  EXPECT_NEAR(stack.load(), stack.weight, 0.002 * stack.weight);
  EXPECT_LT(stack.fastest(), 0.002);
}
