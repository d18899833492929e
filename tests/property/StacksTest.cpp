// Stacks at rest: no load presses bodies into each other, and the cells bear the weight, at any mass ratio.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>
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

// Boxes on a fixed block far above the table, in a frame that is turned against the world's. Gravity acts
// along the frame's −z; without gravity a force presses each box by its weight instead.
struct TurnedBoxes {
  TurnedBoxes(const Eigen::Quaterniond& turn, bool has_gravity, double rate, double friction,
              int iterations = 10)
      : frame(turn) {
    fixture.scene.world.dt_s = 1.0 / rate, fixture.scene.world.iterations = iterations;
    fixture.scene.materials[0].friction = friction;
    fixture.scene.world.gravity = has_gravity ? kGravity * down() : Eigen::Vector3d::Zero().eval();
    pushes = !has_gravity;
    auto base = box({16, 6, 1}, place({0, 0, -0.5}));
    base.orientation = frame, base.fixed = true;
    fixture.add(base);
  }
  smartsurf::scene::ObjectId add(const Eigen::Vector3d& size, const Eigen::Vector3d& at, double mass,
                                 const Eigen::Vector3d& velocity = Eigen::Vector3d::Zero()) {
    return add(box(size, place(at)), mass, velocity);
  }
  smartsurf::scene::ObjectId add_disc(double radius, double height, const Eigen::Vector3d& at, double mass) {
    return add(cylinder(radius, height, place(at)), mass, Eigen::Vector3d::Zero());
  }
  Eigen::Vector3d position(smartsurf::scene::ObjectId id) {
    return frame.conjugate() * (fixture.position(id).cast<double>() - kMiddle);
  }
  Eigen::Vector3d down() const { return frame * -Eigen::Vector3d::UnitZ(); }

  PhysicsFixture fixture;
  Eigen::Quaterniond frame;
  bool pushes;

 private:
  smartsurf::scene::ObjectId add(smartsurf::scene::ObjectSpec o, double mass,
                                 const Eigen::Vector3d& velocity) {
    o.orientation = frame, o.mass = mass, o.velocity = frame * velocity;
    const auto id = fixture.add(o);
    if (pushes) fixture.world().apply_force(id, mass * kGravity * down(), {}, 100.0);
    return id;
  }
  inline static const Eigen::Vector3d kMiddle{15.5, 15.5, 40};
  Eigen::Vector3d place(const Eigen::Vector3d& at) const { return kMiddle + frame * at; }
};

// Tilted by 30° and 60°, upside down, and turned at random.
std::vector<Eigen::Quaterniond> frames() {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::vector<Eigen::Quaterniond> all;
  for (const double angle : {M_PI / 6, M_PI / 3, M_PI})
    all.emplace_back(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitX()));
  for (int i = 0; i < 2; ++i) {
    all.emplace_back(normal(random), normal(random), normal(random), normal(random));
    all.back().normalize();
  }
  return all;
}

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
    // Below a ratio of 14 the sweeps have the pair alone.
    EXPECT_LT(stack.sunk(), ratio < 14.0 ? 0.004 : 0.0025) << "ratio " << ratio;
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

// "Below" is where gravity points to, or a force where there is none.
TEST(Stacks, LoadsHardlySinkUnderGravityOfAnyDirection) {
  for (const bool has_gravity : {true, false})
    for (const auto& frame : frames())
      for (const double ratio : {2.0, 20.0, 1000.0}) {
        TurnedBoxes boxes(frame, has_gravity, 60, 0.5);
        const Eigen::Vector3d down = boxes.down();
        SCOPED_TRACE(testing::Message() << (has_gravity ? "gravity along " : "forces along ") << down.x()
                                        << ", " << down.y() << ", " << down.z());
        const auto under = boxes.add({2, 2, 1}, {0, 0, 0.5}, 1.0),
                   on = boxes.add({2, 2, 1}, {0, 0, 1.5}, ratio);
        boxes.fixture.run(2.0);
        EXPECT_NEAR(boxes.position(on).z(), 1.5, 0.0025) << "ratio " << ratio;
        EXPECT_LT(boxes.position(on).head<2>().norm(), 0.01) << "ratio " << ratio;
        for (const auto id : {under, on})
          EXPECT_LT(boxes.fixture.velocity(id).norm(), 0.002F) << "ratio " << ratio;
      }
}

// Light boxes and discs that are not quite above each other, under one of 1000: nothing squeezes them out.
TEST(Stacks, LightBodiesOfAnyShapeBearAHeavyOne) {
  std::mt19937 random(1);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const auto all_frames = frames();
  for (int draw = 0; draw < 20; ++draw) {
    SCOPED_TRACE(draw);
    constexpr double kRates[] = {60, 120, 240, 960};
    constexpr int kIterations[] = {4, 10, 20, 40, 80};
    TurnedBoxes stack(all_frames[static_cast<std::size_t>(draw) % all_frames.size()], true, kRates[draw % 4],
                      0.5, kIterations[draw % 5]);
    const int count = 3 + draw % 3;
    double top = 0.0;
    std::vector<std::pair<smartsurf::scene::ObjectId, Eigen::Vector3d>> bodies;
    for (int i = 0; i < count; ++i) {
      const double height = uniform(0.4, 1.2), mass = i == count - 1 ? 1000.0 : 1.0;
      const double y = uniform(-0.1, 0.1), x = uniform(-0.1, 0.1);
      const double depth = uniform(1.5, 2.5), width = uniform(1.5, 2.5);
      const Eigen::Vector3d at(x, y, top + 0.5 * height), size(width, depth, height);
      const bool is_box = uniform(0, 1) < 0.6;
      bodies.emplace_back(
          is_box ? stack.add(size, at, mass) : stack.add_disc(0.5 * size.x(), height, at, mass), at);
      top += height;
    }
    stack.fixture.run(2.0);
    for (const auto& [id, at] : bodies) EXPECT_LT((stack.position(id) - at).norm(), 0.02);
    EXPECT_LT(stack.fixture.velocity(bodies.back().first).norm(), 0.002);
  }
}

TEST(Stacks, SlowBoxKeepsItsFrictionUnderGravityOfAnyDirection) {
  for (const double rate : {60.0, 240.0})
    for (const auto& frame : frames())
      for (const double mass : {20.0, 1000.0}) {
        TurnedBoxes boxes(frame, true, rate, 0.2);
        boxes.add({12, 4, 1}, {0, 0, 0.5}, mass);
        const auto rider = boxes.add({0.9, 0.8, 0.8}, {-2, 0, 1.4}, 1.0, {0.9, 0, 0});
        boxes.fixture.run(1.0);
        const double right = 0.9 * 0.9 / (2 * 0.2 * kGravity);
        EXPECT_NEAR(boxes.position(rider).x() + 2, right, 0.06 * right + 0.45 / rate) << "mass " << mass;
      }
}

namespace {

// How far boxes of height 1 have sunk, u, and whether all sleep.
struct Rest {
  double sunk;
  bool sleeps;
};

// A pyramid in a plane, `width` boxes wide at its foot.
Rest pyramid_at_rest(int width, int iterations) {
  PhysicsFixture fixture;
  fixture.scene.world.dt_s = 1.0 / 60, fixture.scene.world.iterations = iterations;
  double sunk = 0.0;
  int count = 0;
  std::vector<std::pair<smartsurf::scene::ObjectId, double>> boxes;
  for (int level = 0; level < width; ++level)
    for (int i = 0; i < width - level; ++i, ++count)
      boxes.emplace_back(fixture.add(box({1.5, 2, 1}, {6 + 1.8 * i + 0.9 * level, 15.5, level + 0.5})),
                         level + 0.5);
  fixture.run(4.0);
  for (const auto& [id, height] : boxes) sunk = std::max(sunk, height - fixture.position(id).z());
  return {sunk, fixture.world().sleeping_count() == count};
}

// True if boxes of a seed, which fall onto each other in a pit, sleep after 12 s.
bool heap_sleeps(unsigned seed, int iterations) {
  PhysicsFixture fixture;
  fixture.scene.world.dt_s = 1.0 / 60, fixture.scene.world.iterations = iterations;
  fixture.scene.surface.rows = fixture.scene.surface.columns = 12;
  fixture.scene.surface.border_height = 6.0;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> draw(0.0, 1.0);
  constexpr int kCount = 40;
  for (int i = 0; i < kCount; ++i)
    fixture.add(box({0.8 + draw(random), 0.8 + draw(random), 0.6 + draw(random)},
                    {3 + 5 * draw(random), 3 + 5 * draw(random), 2 + 0.8 * i}));
  fixture.run(12.0);
  return fixture.world().sleeping_count() == kCount;
}

}  // namespace

// After 12 s the last box of a heap may still slide or tip: of 120 heaps, in four.
TEST(Stacks, FewHeapsOfBoxesStayAwake) {
  int awake = 0;
  for (const int iterations : {10, 20, 40})
    for (unsigned seed = 1; seed <= 8; ++seed) awake += heap_sleeps(seed, iterations) ? 0 : 1;
  EXPECT_LE(awake, 1);
}

// At any number of iterations a contact yields by no more than the overlap that it is allowed, and half of
// that.
TEST(Stacks, SinkingIsBoundedAtAnyIterations) {
  constexpr double kYields = 1.5 * 5e-4, kOnCells = 0.001;
  for (const int iterations : {10, 20, 40, 80}) {
    SCOPED_TRACE(iterations);
    const Rest pyramid = pyramid_at_rest(8, iterations);
    EXPECT_LT(pyramid.sunk, 8 * kYields + kOnCells);
    EXPECT_TRUE(pyramid.sleeps);
    StackOfBoxes stack(12, 1.0, 1.0 / 60, iterations);
    stack.fixture.run(3.0);
    EXPECT_LT(stack.sunk(), 12 * kYields + kOnCells);
    EXPECT_EQ(stack.fastest(), 0.0);
  }
}

// A capsule or cylinder lies along both edges of the gap between two boxes, fixed or free to move and turned
// to any heading, and is still.
TEST(Stacks, RollersRestInTheGapBetweenTwoBoxes) {
  std::mt19937 random(11);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (const double rate : {60.0, 240.0, 960.0})
    for (int i = 0; i < 8; ++i) {
      SCOPED_TRACE(testing::Message() << "roller " << i << " at 1/" << rate);
      PhysicsFixture fixture;
      fixture.scene.world.dt_s = 1.0 / rate;
      const double radius = uniform(0.3, 0.6), gap = radius * uniform(0.4, 1.4), length = uniform(2, 4),
                   masses = uniform(1, 20);
      const Eigen::AngleAxisd heading(uniform(0, 2 * std::numbers::pi), Eigen::Vector3d::UnitZ());
      const Eigen::Vector3d middle(15.5, 15.5, 0);
      for (const double side : {-1.0, 1.0}) {
        auto o = box({2, 5, 1}, middle + heading * Eigen::Vector3d(side * (1 + 0.5 * gap), 0, 0.5));
        o.orientation = heading;
        o.mass = masses, o.fixed = i % 4 == 0;
        fixture.add(o);
      }
      const double height = 1 + std::sqrt(radius * radius - 0.25 * gap * gap);
      const Eigen::Vector3d at =
          middle + heading * Eigen::Vector3d(0, uniform(-0.5, 0.5), height + uniform(0, 0.1));
      auto roller = i / 2 % 2 == 0 ? capsule(radius, length, at) : cylinder(radius, length, at);
      roller.orientation = heading * Eigen::AngleAxisd(0.5 * std::numbers::pi, Eigen::Vector3d::UnitX());
      const auto id = fixture.add(roller);
      fixture.run(3.0);
      double fastest = 0.0;
      fixture.run(1.0,
                  [&] { fastest = std::max(fastest, static_cast<double>(fixture.velocity(id).norm())); });
      EXPECT_LT(fastest, 1e-3);
      EXPECT_NEAR(fixture.position(id).z(), height, 0.01);
    }
}

// A box is taken out of a stack of unlike ones: those above it land on those below, and the stack stands. One
// of a heavy box, a light one and the table passes the blow to and fro.
TEST(Stacks, StandWhenABoxIsTakenOut) {
  std::mt19937 random(20);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (const double rate : {60.0, 120.0, 240.0})
    for (int i = 0; i < 60; ++i) {
      SCOPED_TRACE(testing::Message() << "stack " << i << " at 1/" << rate);
      PhysicsFixture fixture;
      fixture.scene.world.dt_s = 1.0 / rate;
      fixture.scene.materials[0].restitution = 0.2;
      const auto count = static_cast<int>(uniform(3, 6)), taken = static_cast<int>(uniform(0, count - 1));
      std::vector<smartsurf::scene::ObjectId> boxes;
      double height = 0.0;
      for (int k = 0; k < count; ++k) {
        const Eigen::Vector3d size(uniform(1.2, 3), uniform(1.2, 3), uniform(0.4, 1.5));
        auto o =
            box(size, {15.5 + uniform(-0.15, 0.15), 15.5 + uniform(-0.15, 0.15), height + 0.5 * size.z()});
        o.mass = std::pow(10.0, uniform(-1, 1));
        o.orientation = Eigen::AngleAxisd(uniform(0, std::numbers::pi), Eigen::Vector3d::UnitZ());
        height += size.z();
        boxes.push_back(fixture.add(o));
      }
      fixture.run(1.0);
      ASSERT_TRUE(fixture.world().remove(boxes[static_cast<std::size_t>(taken)]));
      boxes.erase(boxes.begin() + taken);
      fixture.run(2.0);
      for (const auto id : boxes)
        EXPECT_GT((fixture.world().state(id).orientation * Eigen::Vector3d::UnitZ()).z(), 0.99);
    }
}
