// Jams: pins that push objects into a corner, or rise under a crowd, enter none of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "smartsurf/mesh/SolidBuilder.h"
#include "tests/property/FieldPenetration.h"
#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;

namespace {

constexpr int kJamSide = 18;  // cells along an edge of the table, border included
constexpr double kBorder = 6.0;

enum class JamShape { kSphere, kBox, kCylinder, kCapsule, kHull };
constexpr JamShape kShapes[] = {JamShape::kSphere, JamShape::kBox, JamShape::kCylinder, JamShape::kCapsule,
                                JamShape::kHull};
const char* name_of(JamShape s) {
  return std::array{"spheres", "boxes", "cylinders", "capsules", "hulls"}[static_cast<std::size_t>(s)];
}

// The number of seeded jams of each shape, and what the tests print of them: JAM_SEEDS, JAM_REPORT.
int seed_count(int otherwise) {
  const char* seeds = std::getenv("JAM_SEEDS");
  return seeds ? std::atoi(seeds) : otherwise;
}

class Jam {
 public:
  Jam(JamShape shape, unsigned seed, double dt_s) : random_(seed) {
    scene::SceneSpec& s = fixture_.scene;
    s.world.dt_s = dt_s;
    s.surface.rows = s.surface.columns = kJamSide;
    s.surface.border_height = kBorder;
    s.surface.pin.max_height = kBorder;
    s.surface.pin.max_speed = 4.0;
    s.surface.pin.max_acceleration = 400.0;
    for (int i = 0; i < 14; ++i) add(shape, i);
  }

  // A wall of pins sweeps the objects into the south-western corner; then the pins in the corner go up and
  // down.
  void shovel() {
    constexpr double kSettle_s = 1.0, kSweep_s = 4.0, kShake_s = 3.0, kShakePeriod_s = 0.5;
    run(kSettle_s);
    const int sweep_steps = 40;
    for (int k = 0; k <= sweep_steps; ++k) {
      set_wall(2.0 * kJamSide - (2.0 * kJamSide - 9.0) * k / sweep_steps);
      run(kSweep_s / sweep_steps);
    }
    for (double t = 0.0; t < kShake_s; t += kShakePeriod_s) {
      for (float& target : targets_)
        if (target < 4.0F) target = static_cast<float>(uniform(0.0, 2.5));
      fixture_.cells().set_targets(0, targets_);
      run(kShakePeriod_s);
    }
  }
  // Nothing is commanded any more: the jam must not go deeper.
  void rest(double seconds) { run(seconds); }

  double deepest = 0.0, last = 0.0;  // in cells, u: ever, and at the end
  double overlap_deepest = 0.0;      // of two objects, u

 private:
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random_); }

  void add(JamShape shape, int i) {
    const Eigen::Vector3d at(3.0 + 3.6 * (i % 4) + uniform(-0.3, 0.3),
                             3.0 + 3.6 * (i / 4) + uniform(-0.3, 0.3), 1.9);
    scene::ObjectSpec o;
    switch (shape) {
      case JamShape::kSphere:
        o = sphere(uniform(0.9, 1.4), at);
        break;
      case JamShape::kBox:
        o = box({uniform(1.5, 2.6), uniform(1.5, 2.6), uniform(1.2, 2.4)}, at);
        break;
      case JamShape::kCylinder:
        o = cylinder(uniform(0.8, 1.3), uniform(1.2, 2.4), at);
        break;
      case JamShape::kCapsule:
        o = capsule(uniform(0.6, 0.9), uniform(2.0, 2.8), at);
        break;
      case JamShape::kHull: {
        std::normal_distribution<double> normal;
        std::vector<Eigen::Vector3d> corners(12);
        for (auto& corner : corners) {
          for (double& along : corner) along = normal(random_);
          corner *= 1.4 / corner.norm();
        }
        o.shape = scene::ShapeKind::kSolid;
        o.solid = std::make_shared<scene::Solid>(mesh::build_hull_solid(corners));
        o.position = at;
        break;
      }
    }
    const double angle = uniform(0, 3.0);
    o.orientation = Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()));
    shapes_.push_back(world::make_shape(o));
    fixture_.add(o);
  }

  void set_wall(double limit) {
    targets_.assign(kJamSide * kJamSide, 0.0F);
    for (int row = 0; row < kJamSide; ++row)
      for (int column = 0; column < kJamSide; ++column)
        if (column + (kJamSide - 1 - row) > limit)
          targets_[static_cast<std::size_t>(row * kJamSide + column)] = 4.5F;
    fixture_.cells().set_targets(0, targets_);
  }

  void run(double seconds) {
    const int every = std::max(1, static_cast<int>(std::lround(1.0 / 20 / fixture_.scene.world.dt_s)));
    fixture_.run(seconds, [&] {
      if (++step_ % every != 0) return;
      const scene::Snapshot& s = fixture_.snapshot();
      last = 0.0;
      for (std::size_t i = 0; i < shapes_.size(); ++i) {
        const double depth = penetration_into_field(fixture_.cells().field(), shapes_[i], s, i);
        last = std::max(last, depth);
        for (std::size_t k = 0; k < i; ++k)
          overlap_deepest = std::max(overlap_deepest, overlap(shapes_[i], shapes_[k], s, i, k));
      }
      deepest = std::max(deepest, last);
    });
  }

  PhysicsFixture fixture_;
  std::mt19937 random_;
  std::vector<world::Shape> shapes_;
  std::vector<float> targets_;
  long step_ = 0;
};

// Upper bound of all jams, for a step of dt_s.
struct DepthBound {
  double dt_s;
  int seeds;
  double depth;  // u
};
constexpr DepthBound kCoarse{1.0 / 240, 20, 0.05};
constexpr DepthBound kFine{1.0 / 960, 5, 0.02};
constexpr double kAtRest = 0.026;  // u; at rest a jam is no deeper, or no deeper than before

void expect_shallow_jams(JamShape shape, const DepthBound& bound) {
  for (int seed = 1; seed <= seed_count(bound.seeds); ++seed) {
    Jam jam(shape, static_cast<unsigned>(seed), bound.dt_s);
    jam.shovel();
    const double before = jam.last;
    jam.rest(1.0);
    if (std::getenv("JAM_REPORT"))
      std::printf("%-9s seed %2d  1/%.0f s  in cells %.4f  end %.4f  overlap %.4f\n", name_of(shape), seed,
                  1 / bound.dt_s, jam.deepest, jam.last, jam.overlap_deepest);
    EXPECT_LE(jam.deepest, bound.depth) << name_of(shape) << ", seed " << seed;
    EXPECT_LE(jam.last, std::max(before, kAtRest))
        << name_of(shape) << ", seed " << seed << ": still sinking";
  }
}

}  // namespace

class JamTest : public testing::TestWithParam<JamShape> {};
TEST_P(JamTest, ShovelledObjectsEnterNoCell) { expect_shallow_jams(GetParam(), kCoarse); }
TEST_P(JamTest, ShovelledObjectsEnterNoCellFineStep) { expect_shallow_jams(GetParam(), kFine); }
INSTANTIATE_TEST_SUITE_P(Shapes, JamTest, testing::ValuesIn(kShapes),
                         [](const auto& shape) { return std::string(name_of(shape.param)); });
