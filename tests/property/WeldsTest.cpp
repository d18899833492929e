// Bodies that fixed joints hold together bear and press as one body does: in stacks of any mass ratio, on
// level and uneven cells, and on cells that drive or rise.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;

namespace {

void weld(PhysicsFixture& fixture, scene::ObjectId a, scene::ObjectId b, const Eigen::Vector3d& anchor) {
  fixture.world().add_joint({.kind = scene::JointKind::kFixed, .a = a, .b = b, .anchor = anchor});
}

class Welds : public testing::TestWithParam<double> {};

// A row of two or three boxes lies on cells of random heights, asleep.
TEST_P(Welds, UnevenCellsBearTheWeight) {
  int asleep = 0, off = 0;
  constexpr int kDraws = 24;
  for_random_fixtures(31, kDraws, GetParam(), [&](PhysicsFixture& fixture, auto draw) {
    for (int r = 0; r < 32; ++r)
      for (int c = 0; c < 32; ++c)
        fixture.cells().set_target(0, r, c, static_cast<float>(1.0 + draw(-0.1, 0.1)));
    fixture.run(1.0);
    const int count = draw(0, 1) < 0.5 ? 2 : 3;
    const double width = draw(2, 3), depth = draw(2, 4), x = draw(13, 14), y = draw(15, 16);
    std::vector<scene::ObjectId> boxes;
    double weight = 0;
    for (int i = 0; i < count; ++i) {
      auto o = box({width, depth, 1}, {x + i * width, y, 1.7});
      const double mass = draw(4, 16);
      o.mass = mass, weight += mass * kGravity;
      boxes.push_back(fixture.add(o));
      if (i > 0) weld(fixture, boxes[i], boxes[i - 1], {x + (i - 0.5) * width, y, 1.7});
    }
    fixture.run(6.0);
    if (fixture.world().sleeping_count() < count) return;
    ++asleep;
    if (std::abs(fixture.total_load() - weight) > 0.01 * weight) ++off;
  });
  EXPECT_GE(asleep, kDraws / 2);
  EXPECT_LE(off, 1);  // where edges of tops bear obliquely, friction carries a part
}

// A body of up to 1000 times the mass of that below it, with one or two light lids that are welded to either.
TEST_P(Welds, HeavyBodiesStandOnLightOnes) {
  for_random_fixtures(32, 12, GetParam(), [&](PhysicsFixture& fixture, auto draw) {
    const double ratio = std::pow(10.0, draw(1.3, 3)), height = draw(0.5, 1.5), low = draw(0.5, 1.5);
    const Eigen::Vector3d at(15.5 + draw(-0.2, 0.2), 15.5 + draw(-0.2, 0.2), 0);
    const auto add = [&](const Eigen::Vector3d& size, const Eigen::Vector3d& middle, double mass) {
      auto o = box(size, middle);
      o.mass = mass;
      return fixture.add(o);
    };
    const auto below = add({4, 4, low}, {15.5, 15.5, 0.5 * low}, 1.0);
    const Eigen::Vector3d middle = at + Eigen::Vector3d(0, 0, low + 0.5 * height);
    const auto heavy = add({3, 3, height}, middle, ratio);
    const double top = low + height, mass = draw(0.5, 2);
    const auto lid = add({1, 1, 0.2}, at + Eigen::Vector3d(0, 0, top + 0.1), mass);
    weld(fixture, lid, heavy, at + Eigen::Vector3d(0, 0, top));
    double weight = (1.0 + ratio + mass) * kGravity;
    if (draw(0, 1) < 0.5) {
      const auto flap = add({0.4, 3, low}, {17.75, 15.5, 0.5 * low}, 0.2);
      weld(fixture, flap, below, {17.5, 15.5, 0.5 * low});
      weight += 0.2 * kGravity;
    }
    fixture.run(4.0);
    SCOPED_TRACE(testing::Message() << "ratio " << ratio << ", " << fixture.scene.world.iterations
                                    << " iterations");
    EXPECT_NEAR(fixture.position(heavy).z(), middle.z(), 0.0042);
    EXPECT_GT(fixture.upright(heavy), std::cos(0.1 * M_PI / 180));
    EXPECT_NEAR(fixture.total_load(), weight, 0.01 * weight);
    EXPECT_NEAR(fixture.position(lid).z() - fixture.position(heavy).z(), 0.5 * height + 0.1, 1e-3);
  });
}

// Cells carry a box with another one of up to 1000 times its mass on it: they drive, or they rise.
TEST_P(Welds, MovingCellsCarryHeavyBodies) {
  for_random_fixtures(33, 8, GetParam(), [&](PhysicsFixture& fixture, auto draw) {
    const bool rises = draw(0, 1) < 0.5;
    const double ratio = std::pow(10.0, draw(1.3, 3)), speed = draw(0.1, 0.5);
    if (rises) fixture.scene.surface.pin.max_speed = speed;
    auto below = box({4, 4, 1}, {14.5, 15.5, 0.5}), above = box({3, 3, 1}, {14.5, 15.5, 1.5});
    below.mass = 1.0, above.mass = ratio;
    const auto lower = fixture.add(below), upper = fixture.add(above);
    fixture.run(1.0);
    if (rises) {
      raise_all(fixture, 2.0F);
    } else {
      auto& field = fixture.cells().field();
      field.surface_velocity_x.assign(field.height.size(), static_cast<float>(speed));
      field.surface_velocity_y.assign(field.height.size(), 0.0F);
    }
    fixture.run(0.5);
    const double weight = (1 + ratio) * kGravity;
    double load = 0.0;
    int steps = 0;
    SCOPED_TRACE(testing::Message() << (rises ? "rise " : "drive ") << speed << ", ratio " << ratio << ", "
                                    << fixture.scene.world.iterations << " iterations");
    fixture.run(1.0, [&] { load += fixture.total_load(), ++steps; });
    EXPECT_NEAR((fixture.position(upper) - fixture.position(lower)).z(), 1.0, 0.01);
    EXPECT_GT(fixture.upright(upper), std::cos(0.5 * M_PI / 180));
    EXPECT_NEAR(load / steps, weight, 0.01 * weight);
  });
}
INSTANTIATE_TEST_SUITE_P(Steps, Welds, testing::Values(1.0 / 60, 1.0 / 240, 1.0 / 960));

}  // namespace
