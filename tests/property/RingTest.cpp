// Objects inside a ring of pins that rise and fall: none enters a pin, however the pins catch it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <ostream>
#include <random>
#include <vector>

#include "smartsurf/mesh/SolidBuilder.h"
#include "tests/property/ColumnDepth.h"
#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;
using Eigen::Vector3d;

namespace {

constexpr int kObjects = 18;

// How the ring moves: all its pins together, every other one, each at random; or it closes in on the objects
// step by step, still or with its innermost pins going up and down.
enum class Motion { kTogether, kCheckered, kRandom, kCloses, kClosesInWaves };

// A table whose size, tops, objects and motion are drawn from a seed.
class Ring {
 public:
  Ring(unsigned seed, double dt_s) : random_(seed) {
    scene::SceneSpec& s = fixture_.scene;
    s.world.dt_s = dt_s;
    constexpr int kSides[] = {8, 10, 12, 18};
    s.surface.border_height = 6.0;
    s.surface.pin.max_height = 6.0;
    s.surface.pin.max_speed = 4.0;
    constexpr double kTops[] = {0.8, 0.5, 1.0};
    s.surface.pin.top_x = s.surface.pin.top_y = kTops[draw_index(3)];
    side_ = kSides[draw_index(4)];
    s.surface.rows = s.surface.columns = side_;
    for (int i = 0; i < kObjects; ++i) add(i);
  }

  // The greatest depth of an object in a pin within the time, u.
  double deepest_within(double seconds) {
    const double period_s = uniform(0.3, 1.0);
    const auto high = static_cast<float>(uniform(1.0, 4.0));
    const double inner = uniform(1.2, 4.2), outer = inner + uniform(1.0, 2.5);
    const auto motion = static_cast<Motion>(draw_index(5));
    const int every = std::max(1, static_cast<int>(std::lround(1.0 / 60 / fixture_.scene.world.dt_s)));
    std::vector<float> targets(static_cast<std::size_t>(side_ * side_), 0.0F);
    fixture_.cells().set_targets(0, targets);
    fixture_.run(0.6);
    double deepest = 0.0;
    long step = 0;
    int k = 0;
    for (double t = 0.0; t < seconds; t += period_s, ++k) {
      for (int i = 0; i < side_ * side_; ++i) {
        const double middle = 0.5 * (side_ - 1);
        const double distance = std::hypot(i % side_ - middle, i / side_ - middle);
        if (motion < Motion::kCloses && (distance < inner || distance > outer)) continue;
        targets[static_cast<std::size_t>(i)] = rises(motion, i, k, distance, inner, outer) ? high : 0.0F;
      }
      fixture_.cells().set_targets(0, targets);
      fixture_.run(period_s, [&] {
        if (++step % every == 0) deepest = std::max(deepest, depth_now());
      });
    }
    return deepest;
  }

 private:
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random_); }
  int draw_index(int n) { return static_cast<int>(random_() % static_cast<unsigned>(n)); }

  bool rises(Motion motion, int cell, int k, double distance, double inner, double outer) {
    const bool up = k % 2 == 0;
    const double closing = outer + 2.0 - (outer + 2.0 - inner) * (k % 8) / 7;
    switch (motion) {
      case Motion::kTogether:
        break;
      case Motion::kCheckered:
        return up != ((cell + cell / side_) % 2 != 0);
      case Motion::kRandom:
        return uniform(0, 1) < 0.5;
      case Motion::kCloses:
        return distance > closing;
      case Motion::kClosesInWaves:
        return distance > closing && (distance > closing + 1.5 || up);
    }
    return up;
  }

  void add(int i) {
    const double middle = 0.5 * (side_ - 1), angle = 2.4 * i,
                 radius = std::min(3.2, 0.5 * side_ - 2.6) * std::sqrt((i % 6 + 0.5) / 6);
    const Vector3d at(middle + radius * std::cos(angle), middle + radius * std::sin(angle),
                      1.6 + 2.4 * (i / 6));
    scene::ObjectSpec o;
    switch (i % 8) {
      case 0:
        o = sphere(uniform(0.5, 1.2), at);
        break;
      case 1:
        o = box({uniform(0.8, 2.4), uniform(0.8, 2.4), uniform(0.6, 2.0)}, at);
        break;
      case 2:
        o = cylinder(uniform(0.5, 1.2), uniform(0.6, 2.2), at);
        break;
      case 3:
        o = capsule(uniform(0.4, 0.8), uniform(1.7, 2.6), at);
        break;
      case 4: {
        std::normal_distribution<double> normal;
        std::vector<Vector3d> corners(12);
        for (Vector3d& c : corners) {
          for (double& along : c) along = normal(random_);
          c *= 1.2 / c.norm();
        }
        o.shape = scene::ShapeKind::kSolid;
        o.solid = std::make_shared<scene::Solid>(mesh::build_hull_solid(corners));
        break;
      }
      case 5:
        o = cone(uniform(0.5, 1.1), uniform(0.8, 2.0), at);
        break;
      case 6: {  // a bar with an arm to the side at one end and one upwards at the other
        const double l = uniform(0.8, 1.4), h = uniform(0.3, 0.5);
        o = compound({{{2 * l, h, h}, {0, 0, 0}},
                      {{h, l, h}, {l - h / 2, (l + h) / 2, 0}},
                      {{h, h, l}, {h / 2 - l, 0, (l + h) / 2}}});
        o.mass = 2.0, o.inertia = 0.6 * Eigen::Matrix3d::Identity();
        break;
      }
      default:
        o = box({uniform(1.5, 2.4), uniform(0.4, 0.8), uniform(0.4, 0.8)}, at);
    }
    o.position = at;
    o.orientation = Eigen::Quaterniond(Eigen::AngleAxisd(uniform(0, 3), Vector3d::UnitZ()));
    specs_.push_back(o);
    fixture_.add(o);
  }

  double depth_now() {
    const scene::Snapshot& s = fixture_.snapshot();
    double deepest = 0.0;
    for (std::size_t i = 0; i < specs_.size(); ++i)
      deepest = std::max(deepest, depth_in_columns(fixture_.cells().field(), specs_[i], s, i));
    return deepest;
  }

  PhysicsFixture fixture_;
  std::mt19937 random_;
  std::vector<scene::ObjectSpec> specs_;
  int side_ = 0;
};

struct Bound {
  double dt_s;
  int seeds;
  double depth;  // of all scenes but `exceptions`, u
  // Others that need a direct solver that leaves wedged islands alone (40, 100), and columns that are not
  // joined over a gap that one part of a compound fits into (122, 191).
  std::vector<int> more_seeds;
  int exceptions = 0;         // docs/truth.md has their share
  double greatest_depth = 0;  // of the exceptions, u
};
void PrintTo(const Bound& bound, std::ostream* out) { *out << bound.dt_s; }

class RingTest : public testing::TestWithParam<Bound> {};

// RING_SEEDS: how many scenes; RING_FIRST: the first of them; RING_REPORT: prints them.
TEST_P(RingTest, ObjectsEnterNoPin) {
  const Bound& bound = GetParam();
  std::vector<int> drawn;
  const char *count = std::getenv("RING_SEEDS"), *first = std::getenv("RING_FIRST");
  for (int i = 0; i < (count ? std::atoi(count) : bound.seeds); ++i)
    drawn.push_back((first ? std::atoi(first) : 1) + i);
  if (!count) drawn.insert(drawn.end(), bound.more_seeds.begin(), bound.more_seeds.end());
  int deeper = 0;
  for (const int seed : drawn) {
    Ring ring(static_cast<unsigned>(seed), bound.dt_s);
    const double deepest = ring.deepest_within(6.0);
    if (std::getenv("RING_REPORT"))
      std::printf("1/%.0f s  seed %2d  in cells %.4f\n", 1 / bound.dt_s, seed, deepest);
    EXPECT_LE(deepest, std::max(bound.depth, bound.greatest_depth)) << "seed " << seed;
    if (deepest > bound.depth) ++deeper;
  }
  if (!count) {
    EXPECT_LE(deeper, bound.exceptions);
  }
}
INSTANTIATE_TEST_SUITE_P(Steps, RingTest,
                         testing::Values(Bound{1.0 / 60, 4, 0.15, {}}, Bound{1.0 / 120, 4, 0.08, {}},
                                         Bound{1.0 / 240, 6, 0.055, {100, 122, 191}, 1, 0.185},
                                         Bound{1.0 / 960, 2, 0.03, {40}}));

}  // namespace
