// Bodies whose centre of mass lies close within their support stand as statics has it: corbels up to the
// harmonic limit, beams with counterweights, towers with a heavy top, planks over narrow supports. Beyond the
// limit they fall.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using Eigen::Vector3d;

namespace {

// Boxes that lie on each other up to an edge in the plane x = 15.4: of raised cells, or of a fixed box.
class Pile {
 public:
  static constexpr double kEdge = 15.4, kHeight = 2.0;
  // `width`: of the support, u; on cells that of their tops, or of all cells up to the edge if more.
  Pile(PhysicsFixture& fixture, bool on_cells, double width) : fixture_(fixture) {
    auto& surface = fixture.scene.surface;
    if (!on_cells) {
      auto o = box({width, 8, kHeight}, {kEdge - 0.5 * width, 15.5, 0.5 * kHeight});
      o.fixed = true;
      fixture.add(o);
      return;
    }
    const bool is_narrow = width < 1.0;
    if (is_narrow) surface.pin.top_x = width;
    edge_ = is_narrow ? 15.0 + 0.5 * width : kEdge;
    for (int row = 0; row < surface.rows; ++row)
      for (int column = is_narrow ? 15 : 0; column <= 15; ++column)
        fixture.cells().set_target(0, row, column, static_cast<float>(kHeight));
    fixture.run(1.5);
  }
  double edge() const { return edge_; }
  double top() const { return top_; }
  // Adds a box on the last one, or on the support. `x`: of its middle.
  void add(const Vector3d& size, double x, double mass = 1.0) {
    auto o = box(size, {x, 15.5, top_ + 0.5 * size.z()});
    o.mass = mass;
    top_ += size.z();
    boxes_.push_back({fixture_.add(o), o.position});
  }
  bool comes_to_rest() {
    for (int i = 0; i < 12 && !sleeps(); ++i) fixture_.run(0.5);
    return sleeps();
  }
  bool sleeps() { return fixture_.world().sleeping_count() == static_cast<int>(boxes_.size()); }
  // The greatest of all boxes, °.
  double tilt() {
    double least = 1.0;
    for (const auto& [id, at] : boxes_)
      least = std::min(least, (fixture_.world().state(id).orientation * Vector3d::UnitZ()).z());
    return std::acos(std::max(least, -1.0)) * 180 / std::numbers::pi;
  }
  // The greatest of all boxes, u.
  double moved() {
    double most = 0.0;
    for (const auto& [id, at] : boxes_)
      most = std::max(most, (fixture_.position(id).cast<double>() - at).norm());
    return most;
  }
  bool falls() {
    for (int i = 0; i < 20 && moved() < 0.1; ++i) fixture_.run(0.5);
    return moved() >= 0.1;
  }

 private:
  struct Box {
    smartsurf::scene::ObjectId id;
    Vector3d at;
  };
  PhysicsFixture& fixture_;
  double edge_ = kEdge, top_ = kHeight;
  std::vector<Box> boxes_;
};

// Draws from a seed at 4 to 80 iterations; the parameter is the step, s.
class Corbels : public testing::TestWithParam<double> {
 protected:
  // Calls run(fixture, draw, on_cells) for random fixtures, on cells and on a fixed box in turn.
  template <class Run>
  void for_each_draw(unsigned seed, int draws, Run run) {
    int i = 0;
    for_random_fixtures(seed, draws, GetParam(), [&](PhysicsFixture& fixture, auto draw) {
      SCOPED_TRACE(testing::Message() << "draw " << i);
      if (i % 4 == 3) fixture.scene.world.iterations = 80;
      run(fixture, draw, i++ % 2 == 0);
    });
  }
};

// The k-th plank from the top overhangs the next one by this share of length / 2k.
template <class Draw>
void add_corbel(Pile& pile, Draw draw, double share) {
  const int count = 3 + static_cast<int>(draw(0, 10));
  const Vector3d size(draw(2, 5), draw(1, 2), draw(0.2, 0.6));
  double end = pile.edge();
  for (int k = count; k >= 1; --k) {
    end += share * size.x() / (2 * k);
    pile.add(size, end - 0.5 * size.x());
  }
}

}  // namespace

TEST_P(Corbels, StandUpToTheHarmonicLimit) {
  for_each_draw(1, 24, [](PhysicsFixture& fixture, auto draw, bool on_cells) {
    Pile pile(fixture, on_cells, 10);
    add_corbel(pile, draw, std::array{0.8, 0.9, 0.95, 0.99}[static_cast<std::size_t>(draw(0, 4))]);
    EXPECT_TRUE(pile.comes_to_rest());
    EXPECT_LT(pile.tilt(), 0.1);
    EXPECT_LT(pile.moved(), 0.02);
  });
}

TEST_P(Corbels, FallBeyondIt) {
  for_each_draw(2, 12, [](PhysicsFixture& fixture, auto draw, bool on_cells) {
    Pile pile(fixture, on_cells, 10);
    add_corbel(pile, draw, draw(0, 1) < 0.5 ? 1.02 : 1.05);
    EXPECT_TRUE(pile.falls());
  });
}

// A plank, and boxes on it above its support: its middle is within the support by a share of half the width.
TEST_P(Corbels, PlanksBalanceOnNarrowSupports) {
  for_each_draw(3, 36, [](PhysicsFixture& fixture, auto draw, bool on_cells) {
    const double width = draw(0.06, 0.3);
    Pile pile(fixture, on_cells, width);
    const double inside = std::array{0.1, 0.05, 0.02, -0.05, -0.1}[static_cast<std::size_t>(draw(0, 5))];
    const double x = pile.edge() - 0.5 * width * inside;
    pile.add({draw(2, 5), draw(1, 2), draw(0.2, 0.6)}, x);
    for (int i = static_cast<int>(draw(0, 3)); i > 0; --i)
      pile.add({draw(0.6, 2), draw(1, 2), draw(0.2, 0.6)}, x);
    if (inside < 0.0) {
      EXPECT_TRUE(pile.falls());
      return;
    }
    EXPECT_TRUE(pile.comes_to_rest());
    EXPECT_LT(pile.tilt(), 0.1) << "inside by " << inside;
  });
}

// A beam whose middle is beyond the edge, with a weight behind it.
TEST_P(Corbels, CounterweightsHoldBeams) {
  for_each_draw(4, 24, [](PhysicsFixture& fixture, auto draw, bool on_cells) {
    Pile pile(fixture, on_cells, 10);
    const double length = draw(3, 5), beyond = draw(0.1, 0.3) * length,
                 behind = draw(0.3, 0.8) * (0.5 * length - beyond),
                 share = std::array{0.8, 0.9, 0.95, 0.98, 1.05}[static_cast<std::size_t>(draw(0, 5))];
    pile.add({length, draw(1, 2), draw(0.2, 0.6)}, pile.edge() + beyond);
    const double half = 0.9 * (0.5 * length - beyond - behind);
    pile.add({2 * std::min(half, behind), 1, 0.5}, pile.edge() - behind, beyond / behind / share);
    if (share > 1.0) {
      EXPECT_TRUE(pile.falls());
      return;
    }
    EXPECT_TRUE(pile.comes_to_rest());
    EXPECT_LT(pile.tilt(), 0.1) << "at " << share;
    EXPECT_LT(pile.moved(), 0.02) << "at " << share;
  });
}

// The top, of up to 50 masses, has its middle over the box below.
TEST_P(Corbels, TowersBearHeavyTops) {
  for_each_draw(5, 24, [](PhysicsFixture& fixture, auto draw, bool on_cells) {
    Pile pile(fixture, on_cells, 10);
    const int count = 2 + static_cast<int>(draw(0, 6));
    const double width = draw(1, 2),
                 share = std::array{0.8, 0.9, 0.95, 1.05}[static_cast<std::size_t>(draw(0, 4))];
    for (int i = 0; i < count; ++i) pile.add({width, width, draw(0.5, 1)}, pile.edge() - 0.5 * width);
    pile.add({width, width, draw(0.5, 1)}, pile.edge() - 0.5 * width + 0.5 * share * width,
             std::pow(50.0, draw(0, 1)));
    if (share > 1.0) {
      EXPECT_TRUE(pile.falls());
      return;
    }
    EXPECT_TRUE(pile.comes_to_rest());
    EXPECT_LT(pile.tilt(), 0.1) << "at " << share;
  });
}
INSTANTIATE_TEST_SUITE_P(Steps, Corbels, testing::Values(1.0 / 60, 1.0 / 240, 1.0 / 960));
