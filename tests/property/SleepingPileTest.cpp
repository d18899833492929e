// Piles that sleep cost nothing, and change nothing for what moves elsewhere.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "smartsurf/world/NativeEngine.h"
#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using smartsurf::scene::ObjectId;
using smartsurf::world::NativeEngine;

namespace {

constexpr int kBoxes = 12;

// Towers of twelve boxes that fall onto each other one by one, each tower on a square of 12 u.
struct Towers : PhysicsFixture {
  std::vector<ObjectId> tops;
  std::vector<double> heights;

  Towers(int side, unsigned seed, double first_x, int columns) {
    scene.world.dt_s = 1.0 / 120;
    scene.surface.rows = 12 * side;
    scene.surface.columns = columns;
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-0.1, 0.1), edge(1.5, 3.0);
    for (int k = 0; k < side * side; ++k) {
      const double a = edge(random);
      double top = 0.0;
      for (int i = 1; i <= kBoxes; ++i, top += a)
        tops.push_back(add(box({a, a, a}, {first_x + 6 + 12 * (k % side) + uniform(random),
                                           6 + 12 * (k / side) + uniform(random), top + 1.5 * i + 0.5 * a})));
      heights.push_back(top - 0.5 * a);
      tops.erase(tops.end() - kBoxes, tops.end() - 1);
    }
  }
  NativeEngine& engine() { return dynamic_cast<NativeEngine&>(world()); }
  int bodies() { return static_cast<int>(kBoxes * tops.size()); }
};

// Boxes, with even seeds bodies of all round shapes too, dropped into a pit at random.
struct Heap : PhysicsFixture {
  int count = 0;

  explicit Heap(unsigned seed) {
    std::mt19937 random(seed);
    const auto draw = [&random](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(random);
    };
    count = static_cast<int>(draw(50, 130));
    scene.world.dt_s = 1.0 / 60;
    scene.surface.rows = scene.surface.columns = 12;
    scene.surface.border_height = 8.0;
    scene.materials[0].rolling_friction = 0.01;
    for (int i = 0; i < count; ++i) {
      smartsurf::scene::ObjectSpec o = box({draw(0.8, 1.8), draw(0.8, 1.8), draw(0.8, 1.8)}, {});
      if (seed % 2 == 0 && i % 5 == 1) o = sphere(draw(0.5, 0.9), {});
      if (seed % 2 == 0 && i % 5 == 2) o = cylinder(draw(0.5, 0.9), draw(0.8, 1.8), {});
      if (seed % 2 == 0 && i % 5 == 3) o = capsule(draw(0.4, 0.6), draw(1.4, 2.2), {});
      o.position = {3 + 2.5 * (i % 3) + draw(-0.3, 0.3), 3 + 2.5 * (i / 3 % 3) + draw(-0.3, 0.3),
                    2 + 2.2 * (i / 9)};
      o.orientation = Eigen::Quaterniond(draw(-1, 1), draw(-1, 1), draw(-1, 1), draw(-1, 1)).normalized();
      add(o);
    }
  }
  NativeEngine& engine() { return dynamic_cast<NativeEngine&>(world()); }
};

}  // namespace

TEST(SleepingPile, TowersStandAndCostNothing) {
  Towers towers(5, 1, 0, 84);
  towers.run(14.0);
  ASSERT_EQ(towers.world().sleeping_count(), towers.bodies());
  for (std::size_t k = 0; k < towers.tops.size(); ++k)
    EXPECT_NEAR(towers.position(towers.tops[k]).z(), towers.heights[k], 0.1) << k;
  const std::uint64_t hash = towers.snapshot().state_hash;
  towers.run(0.5, [&] { ASSERT_EQ(towers.engine().step_work().rows, 0U); });
  EXPECT_EQ(towers.snapshot().state_hash, hash);
}

// What moves beside sleepers costs as much as without them; what moves among them, a few of them besides.
TEST(SleepingPile, CostIsThatOfWhatMoves) {
  Towers towers(5, 1, 0, 84);
  towers.run(14.0);
  ASSERT_EQ(towers.world().sleeping_count(), towers.bodies());
  auto far = sphere(1.0, {72, 30, 1.0});
  far.velocity = {0.3, 0, 0};
  const ObjectId ball = towers.add(far);
  towers.run(1.0, [&] {
    const NativeEngine::StepWork work = towers.engine().step_work();
    ASSERT_EQ(work.active, 1U);
    ASSERT_EQ(work.in_grid, 1U);
    ASSERT_EQ(work.rows, 1U);
    ASSERT_EQ(work.pairs, 0U);
    ASSERT_LE(work.contacts, 5U);
    ASSERT_EQ(towers.world().sleeping_count(), towers.bodies());
  });
  // Onto the top of a tower, from so low that the tower goes on sleeping.
  smartsurf::scene::ObjectStateUpdate up;
  const Eigen::Vector3f top = towers.position(towers.tops[12]);
  up.position =
      top.cast<double>() + Eigen::Vector3d(0, 0, 1.0 + towers.heights[12] / (2.0 * kBoxes - 1.0) + 0.001);
  up.velocity = Eigen::Vector3d::Zero();
  towers.world().set_state(ball, up);
  towers.run(0.05, [&] {
    const NativeEngine::StepWork work = towers.engine().step_work();
    ASSERT_LE(work.active, 1U + kBoxes);
    ASSERT_LE(work.rows, 2U + kBoxes);
    ASSERT_LE(work.pairs, 30U);
    ASSERT_LE(work.contacts, 80U);
  });
}

// Boxes on every sixth cell of a table; a few cells begin to move at a time. Those within one cell of the
// middle of a box wake it, those three cells away do not.
TEST(SleepingPile, MovingCellsWakeWhatIsNear) {
  constexpr int kBoxesASide = 8, kSpacing = 6, kRows = kBoxesASide * kSpacing;
  PhysicsFixture fixture;
  fixture.scene.surface.rows = fixture.scene.surface.columns = kRows;
  for (int i = 0; i < kBoxesASide * kBoxesASide; ++i)
    fixture.add(
        box({1.6, 1.6, 1.6}, {3.0 + kSpacing * (i % kBoxesASide), 3.0 + kSpacing * (i / kBoxesASide), 0.8}));
  std::mt19937 random(11);
  std::uniform_int_distribution<int> any_box(0, kBoxesASide - 1), near(-1, 1), far(3, 9), count(0, 3);
  for (int trial = 0; trial < 40; ++trial) {
    fixture.run(2.0);
    ASSERT_EQ(fixture.world().sleeping_count(), kBoxesASide * kBoxesASide) << trial;
    std::vector<float> targets(kRows * kRows, 0.0F);
    const auto raise = [&](int x, int y) { targets[(kRows - 1 - y) * kRows + x] = 0.5F; };
    std::set<std::pair<int, int>> woken;
    for (int k = count(random); k > 0; --k) {
      const int x = any_box(random), y = any_box(random);
      raise(3 + kSpacing * x + near(random), 3 + kSpacing * y + near(random));
      woken.insert({x, y});
    }
    for (int k = count(random); k > 0; --k) {
      const int between = kSpacing * any_box(random), along = (kRows + 3 + far(random)) % kRows;
      k % 2 == 0 ? raise(between, along) : raise(along, between);
    }
    fixture.cells().set_targets(0, targets);
    fixture.run(fixture.scene.world.dt_s);
    ASSERT_EQ(fixture.world().sleeping_count(), kBoxesASide * kBoxesASide - std::ssize(woken)) << trial;
    fixture.cells().set_targets(0, std::vector<float>(targets.size(), 0.0F));
  }
}

// A bit of the state is all that the sleepers would have to change.
TEST(SleepingPile, SleepersElsewhereChangeNoBit) {
  const auto add_moving = [](PhysicsFixture& fixture) {
    std::vector<ObjectId> ids;
    std::mt19937 random(5);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (int i = 0; i < 60; ++i) {
      const Eigen::Vector3d at(4 + 16 * uniform(random), 4 + 24 * uniform(random), 2 + 0.4 * i);
      if (i % 3 == 0) ids.push_back(fixture.add(sphere(0.8 + 0.4 * uniform(random), at)));
      if (i % 3 == 1) ids.push_back(fixture.add(box({2, 1.5, 1.2}, at)));
      if (i % 3 == 2) ids.push_back(fixture.add(cylinder(0.8, 2, at)));
    }
    return ids;
  };
  Towers alone(0, 1, 0, 96), beside(3, 1, 48, 96);
  alone.scene.surface.rows = 36;
  beside.run(14.0);
  const int sleeping = beside.world().sleeping_count();
  ASSERT_EQ(sleeping, beside.bodies());
  const std::vector<ObjectId> ids = add_moving(alone), same = add_moving(beside);
  for (int k = 0; k < 12; ++k) {
    alone.run(0.5), beside.run(0.5);
    ASSERT_GE(beside.world().sleeping_count(), sleeping);
    for (std::size_t i = 0; i < ids.size(); ++i) {
      ASSERT_EQ(alone.position(ids[i]), beside.position(same[i])) << k << " " << i;
      ASSERT_EQ(alone.velocity(ids[i]), beside.velocity(same[i])) << k << " " << i;
    }
  }
}

// A heap falls asleep body by body. However many do so in a step, its loads at rest take a limited number of
// passes over it, in a step and in all.
TEST(SleepingPile, LoadsOfAHeapCostNoMoreThanItsBodies) {
  constexpr unsigned kHeaps = 16;
  unsigned asleep = 0;
  for (unsigned seed = 901; seed < 901 + kHeaps; ++seed) {
    SCOPED_TRACE(seed);
    Heap heap(seed);
    std::size_t work = 0, most = 0;
    heap.run(16.0, [&] {
      const std::size_t before = std::exchange(work, heap.engine().rest_load_work());
      most = std::max(most, work - before);
    });
    asleep += heap.world().sleeping_count() > heap.count / 2 ? 1 : 0;
    EXPECT_LT(most, 100U * static_cast<std::size_t>(heap.count));
    EXPECT_LT(work, 150U * static_cast<std::size_t>(heap.count));
  }
  EXPECT_GE(asleep, kHeaps - 3);  // those awake cost nothing
}

// An engine that takes over the state finds the same loads.
TEST(SleepingPile, SavedHeapsHaveTheSameLoads) {
  const auto loads_of = [](unsigned seed, bool takes_over) {
    Heap heap(seed);
    std::vector<float> loads;
    for (int k = 0; k < 30; ++k) {
      heap.run(0.5);
      for (const smartsurf::world::ContactPoint& c : heap.world().contacts()) loads.push_back(c.impulse);
      if (takes_over) heap.take_over();
    }
    return loads;
  };
  for (unsigned seed = 1; seed <= 4; ++seed) EXPECT_EQ(loads_of(seed, true), loads_of(seed, false)) << seed;
}

// Piles fall asleep, are hit, wake and fall asleep again, in one engine and in another that takes over its
// state every now and then, with one thread and three.
TEST(SleepingPile, SavedStatesAndThreadsGiveTheSameBits) {
  const auto hash_after = [](int threads, bool takes_over) {
    Towers towers(7, 2, 0, 84);
    towers.threads = threads;
    std::vector<smartsurf::scene::ObjectSpec> catalogue;
    std::mt19937 random(9);
    std::uniform_real_distribution<double> uniform(0, 1);
    std::uint64_t sum = 0;
    towers.run(9.0);
    for (int k = 0; k < 8; ++k) {
      auto ball = sphere(0.5 + uniform(random), {80 * uniform(random), 80 * uniform(random), 30});
      ball.velocity = {6 * uniform(random) - 3, 6 * uniform(random) - 3, -8};
      towers.add(ball);
      towers.run(0.7);
      sum = 31 * sum + towers.snapshot().state_hash;
      if (takes_over) towers.take_over();
    }
    return sum;
  };
  const std::uint64_t hash = hash_after(1, false);
  for (const int threads : {1, 3}) EXPECT_EQ(hash_after(threads, true), hash) << threads;
}
