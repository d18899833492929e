// Objects come to rest as statics has it: on cells of any heights, on each other, and under loads of any
// mass.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "smartsurf/mesh/SolidBuilder.h"
#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;

namespace {

// Draws from a seed; the parameter is the step, s.
class Rest : public testing::TestWithParam<double> {
 protected:
  double draw(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }
  std::mt19937 random{7};
};

class UnevenBed : public Rest {};

TEST_P(UnevenBed, BearsTheWeightAndHoldsStill) {
  for (int trial = 0; trial < 6; ++trial) {
    PhysicsFixture fixture;
    fixture.scene.world.dt_s = GetParam();
    fixture.cell_force_limit = trial % 2 == 0 ? 0.0 : 1e6;
    for (int r = 0; r < 32; ++r)
      for (int c = 0; c < 32; ++c)
        fixture.cells().set_target(0, r, c, static_cast<float>(1.0 + draw(-0.1, 0.1)));
    fixture.run(1.5);
    scene::ObjectSpec o = trial % 3 == 0 ? cylinder(draw(1, 3), draw(0.5, 2), {})
                                         : box({draw(2, 6), draw(2, 6), draw(0.5, 2)}, {});
    o.position = {draw(14, 16), draw(14, 16), 2.5};
    o.mass = 25;
    const auto id = fixture.add(o);
    fixture.run(10.0);
    const Eigen::Vector3f from = fixture.position(id);
    double least = 1e9, greatest = 0;
    fixture.run(2.0, [&] {
      least = std::min(least, fixture.total_load());
      greatest = std::max(greatest, fixture.total_load());
    });
    EXPECT_NEAR(least, 25 * kGravity, 0.01 * 25 * kGravity) << trial;
    EXPECT_NEAR(greatest, 25 * kGravity, 0.01 * 25 * kGravity) << trial;
    EXPECT_LT((fixture.position(id) - from).norm(), 1e-3F) << trial;
  }
}
INSTANTIATE_TEST_SUITE_P(Steps, UnevenBed, testing::Values(1.0 / 60, 1.0 / 240));

class HullsOnPins : public Rest {};

// Flat hulls of 6 to 20 points rock from edge to edge, and lose by it what they have. One may still move a
// little.
TEST_P(HullsOnPins, StopRocking) {
  int moving = 0;
  for (unsigned seed = 71; seed < 101; ++seed) {
    random.seed(seed);
    PhysicsFixture fixture;
    fixture.scene.world.dt_s = GetParam();
    for (int r = 0; r < 32; ++r)
      for (int c = 0; c < 32; ++c)
        fixture.cells().set_target(0, r, c, static_cast<float>(1.0 + draw(0.0, 0.6)));
    fixture.run(1.0);
    std::vector<scene::ObjectId> hulls;
    for (int i = 0; i < 25; ++i) {
      std::vector<Eigen::Vector3d> points(static_cast<std::size_t>(draw(6, 20)));
      for (Eigen::Vector3d& p : points) p = {draw(-1, 1), draw(-1, 1), draw(-0.3, 0.3)};
      scene::ObjectSpec o;
      o.shape = scene::ShapeKind::kSolid;
      o.solid = std::make_shared<scene::Solid>(mesh::build_hull_solid(points));
      o.position = {3.0 + 6 * (i % 5) + draw(0.0, 0.5), 3.0 + 6 * (i / 5) + draw(0.0, 0.5), 3.0};
      o.mass = 1;
      const Eigen::Vector3d axis{draw(-1, 1), draw(-1, 1), draw(-1, 1)};
      o.orientation = Eigen::AngleAxisd(draw(0, 6), axis.normalized());
      hulls.push_back(fixture.add(o));
    }
    fixture.run(25.0);
    for (const scene::ObjectId id : hulls)
      if (fixture.angular_velocity(id).norm() > 0.01F) ++moving;
  }
  EXPECT_LE(moving, 1) << "of 750";
}
INSTANTIATE_TEST_SUITE_P(Steps, HullsOnPins, testing::Values(1.0 / 60, 1.0 / 240));

class SleepingStack : public Rest {};

// Discs on each other jitter with few iterations, or with many. Asleep, the cells bear the weight, below its
// centre.
TEST_P(SleepingStack, LoadsAreInEquilibrium) {
  int asleep = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    random.seed(seed);
    PhysicsFixture fixture;
    fixture.scene.world.dt_s = GetParam();
    fixture.scene.world.iterations = seed % 2 == 0 ? 4 : 40;
    const int count = static_cast<int>(draw(3, 13));
    double top = 0;
    for (int i = 0; i < count; ++i) {
      const double height = draw(0.5, 1.5), x = draw(15.3, 15.7), y = draw(15.3, 15.7),
                   radius = draw(0.9, 1.5);
      auto o = cylinder(radius, height, {x, y, top + height / 2});
      o.mass = 1;
      fixture.add(o);
      top += height;
    }
    for (int s = 0; s < 15 && fixture.world().sleeping_count() < count; ++s) fixture.run(0.5);
    if (fixture.world().sleeping_count() < count) continue;
    ++asleep;
    Eigen::Vector3d load(0, 0, 0), centre(0, 0, 0);
    for (const world::ContactPoint& c : fixture.world().contacts())
      if (!c.other)
        load += static_cast<double>(c.impulse) / GetParam() * Eigen::Vector3d(c.point.x(), c.point.y(), 1);
    for (const auto& at : fixture.snapshot().position) centre += Eigen::Vector3d(at[0], at[1], 1) / count;
    const double weight = count * kGravity;
    EXPECT_NEAR(fixture.total_load(), weight, 0.001 * weight);
    EXPECT_LT((load / weight - centre).norm(), 0.002);
  }
  EXPECT_GE(asleep, 15);
}
INSTANTIATE_TEST_SUITE_P(Steps, SleepingStack, testing::Values(1.0 / 60, 1.0 / 240));

class SleepingGroup : public Rest {};

// Bodies of all shapes fall one by one on a plank that lies on the level table, as it settles, falls asleep
// or sleeps.
TEST_P(SleepingGroup, CellsBearTheWeight) {
  const int groups = 16;
  int asleep = 0;
  for (unsigned seed = 1; seed <= groups; ++seed) {
    SCOPED_TRACE(seed);
    random.seed(seed);
    PhysicsFixture fixture;
    fixture.scene.world.dt_s = GetParam();
    fixture.scene.surface.pin.top_x = fixture.scene.surface.pin.top_y = 1.0;
    fixture.scene.materials[0].rolling_friction = 0.01;
    fixture.scene.materials[0].restitution = 0.2;
    double mass = 0;
    const auto add = [&](scene::ObjectSpec o) {
      const double added = draw(0.5, 4);
      o.mass = added, mass += added;
      fixture.add(o);
    };
    const double height = draw(0.3, 1);
    add(box({draw(2, 5), draw(2, 5), height}, {15.5, 15.5, height / 2}));
    const int count = 1 + static_cast<int>(draw(1, 6));
    for (int i = 1; i < count; ++i) {
      fixture.run(draw(0, 0.8));
      const Eigen::Vector3d at(15.5 + draw(-0.8, 0.8), 15.5 + draw(-0.8, 0.8), height + draw(0.01, 3));
      const Eigen::Vector3d size(draw(0.6, 2), draw(0.6, 2), draw(0.4, 1.2));
      const Eigen::Vector3d middle = at + Eigen::Vector3d(0, 0, size.z() / 2);
      switch (static_cast<int>(draw(0, 7))) {
        case 0:
          add(box(size, middle));
          break;
        case 1:
          add(cylinder(size.x() / 2, size.z(), middle));
          break;
        case 2: {
          auto lying = capsule(size.z() / 2, size.z() + size.x(), middle);
          lying.orientation = Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitX());
          add(lying);
          break;
        }
        case 3:
          add(cube(middle, static_cast<float>(size.z())));
          break;
        default:
          add(sphere(size.z() / 2, middle));
      }
    }
    for (int s = 0; s < 16 && fixture.world().sleeping_count() < count; ++s) fixture.run(0.5);
    if (fixture.world().sleeping_count() < count) continue;
    ++asleep;
    EXPECT_NEAR(fixture.total_load(), mass * kGravity, 0.001 * mass * kGravity);
  }
  EXPECT_GE(asleep, groups / 4);
}
INSTANTIATE_TEST_SUITE_P(Steps, SleepingGroup, testing::Values(1.0 / 60, 1.0 / 240, 1.0 / 960));

class Landing : public Rest {};

// The middle of a box that is dropped flat is over the box below it.
TEST_P(Landing, StaysFlat) {
  for (int trial = 0; trial < 8; ++trial) {
    PhysicsFixture fixture;
    fixture.scene.world.dt_s = GetParam();
    const double width = draw(1.5, 3), height = draw(0.5, 2);
    auto below = box({width, width, height}, {15.5, 15.5, height / 2});
    auto above =
        box({draw(1.5, 3), draw(1.5, 3), draw(0.5, 2)},
            {15.5 + draw(-0.35, 0.35) * width, 15.5 + draw(-0.35, 0.35) * width, height + draw(2, 12)});
    below.mass = draw(1, 10), above.mass = draw(1, 10);
    fixture.add(below);
    fixture.add(above);
    double least = 1;
    fixture.run(4.0, [&] { least = std::min(least, fixture.upright(1)); });
    EXPECT_GT(least, std::cos(0.3 * M_PI / 180)) << trial;
  }
}
INSTANTIATE_TEST_SUITE_P(Steps, Landing, testing::Values(1.0 / 60, 1.0 / 240));

class HeavyLoad : public Rest {};

// No deeper than the slop at each of the contacts below, and at rest.
TEST_P(HeavyLoad, StandsOnLightBodies) {
  for (int trial = 0; trial < 8; ++trial) {
    PhysicsFixture fixture;
    fixture.scene.world.dt_s = GetParam();
    const int count = 2 + trial % 5;
    double top = 0;
    scene::ObjectId last{};
    for (int i = 0; i < count; ++i) {
      const double height = draw(0.5, 1.5);
      auto o = box({draw(1.8, 3), draw(1.8, 3), height}, {15.5, 15.5, top + height / 2});
      o.mass = i + 1 == count ? std::pow(10.0, draw(1.3, 3)) : draw(1, 3);
      last = fixture.add(o);
      top += height;
      if (i + 1 == count) top -= height / 2;
    }
    fixture.run(4.0);
    EXPECT_NEAR(fixture.position(last).z(), top, 0.0021 * count) << trial;
    EXPECT_LT(fixture.velocity(last).norm(), 1e-3F) << trial;
  }
}
INSTANTIATE_TEST_SUITE_P(Steps, HeavyLoad, testing::Values(1.0 / 60, 1.0 / 120, 1.0 / 240, 1.0 / 960));

}  // namespace
