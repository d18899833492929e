// RayCaster compared with the brute-force oracle of RayOracle.h.
#include <gtest/gtest.h>

#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "RayOracle.h"
#include "common/threads/ThreadPool.h"
#include "smartsurf/surface/raycast/RayCaster.h"

using namespace smartsurf;
using oracle::cast_ray;
using oracle::ExpectedHit;
using oracle::move_to;
using oracle::random_scene;
using oracle::scale_object;
using oracle::Scene;
using scene::ShapeKind;
using surface::CellRay;
using surface::RayCaster;

namespace {

std::vector<float> tags_of(const surface::RayBodies& bodies) {
  std::vector<float> tags;
  surface::snapshot_index_tags(bodies, tags);
  return tags;
}

struct Tally {
  int hits = 0, uncertain = 0, cells = 0;
};
// Compares all cells whose expected hit is certain.
void compare(const Scene& s, const CellRay& ray, Tally& tally, const std::string& what) {
  common::ThreadPool pool(1);
  surface::RayBodies bodies(0, static_cast<float>(s.field.rows - 1));
  bodies.update(s.snapshot, s.objects, pool);
  RayCaster caster(s.field, ray);
  caster.cast(bodies, tags_of(bodies), 1000, s.field.height, pool);
  for (int cell = 0; cell < s.field.cells(); ++cell) {
    const auto i = static_cast<std::size_t>(cell);
    const ExpectedHit e = cast_ray(s, ray, cell);
    ++tally.cells;
    tally.uncertain += !e.certain;
    tally.hits += e.tag != 0;
    if (!e.certain) continue;
    ASSERT_EQ(caster.tag()[i], e.tag)
        << what << ", cell " << cell << ", expected at " << e.distance << ", is " << caster.distance()[i];
    ASSERT_NEAR(caster.distance()[i], e.distance, 2e-3) << what << ", cell " << cell;
  }
}

CellRay ray_along(const Eigen::Vector3f& direction, float range, bool pins) {
  CellRay s;
  s.direction = direction.normalized();
  s.range = range;
  s.hits_pins = pins;
  return s;
}

const Eigen::Vector3f kDirections[] = {{0, 0, 1},         {0, 0, -1},       {1, 0, 0},    {0, -1, 0},
                                       {-1, 1, 0},        {0, 1, 1},        {-2, 0, 1},   {0.3F, 0.7F, 1},
                                       {0.5F, -1, -0.2F}, {0.1F, 0.2F, -1}, {3, -1, 0.1F}};

}  // namespace

TEST(RayCaster, MatchesOracle) {
  std::mt19937 random(5);
  Tally tally;
  for (int round = 0; round < 2; ++round)
    for (const auto& direction : kDirections)
      for (const bool pins : {false, true}) {
        const Scene s = random_scene(random, 10, 11, false);
        CellRay ray = ray_along(direction, 5.0F, pins);
        if (round == 1) ray.origin = {0.3F, -0.6F, 0.7F};
        std::ostringstream what;
        what << "round " << round << ", along " << direction.transpose() << (pins ? " with pins" : "");
        compare(s, ray, tally, what.str());
      }
  EXPECT_GT(tally.hits, tally.cells / 4);
  EXPECT_LT(tally.uncertain, tally.cells / 30);
}

TEST(RayCaster, MatchesOracleInFreeLayouts) {
  std::mt19937 random(6);
  Tally tally;
  for (const auto& direction : kDirections) {
    const Scene s = random_scene(random, 9, 10, true);
    CellRay ray = ray_along(direction, 4.0F, true);
    ray.origin = {0.2F, 0.1F, 0.5F};
    std::ostringstream what;
    what << "along " << direction.transpose();
    compare(s, ray, tally, what.str());
  }
  EXPECT_GT(tally.hits, tally.cells / 4);
}

TEST(RayCaster, MatchesOracleOnNarrowSurfacesAndFromFixedHeight) {
  std::mt19937 random(7);
  Tally tally;
  for (const int columns : {1, 3, 7, 8, 9}) {
    const Scene s = random_scene(random, 6, columns, false);
    compare(s, ray_along({0, 0, 1}, 6, true), tally, "up");
    compare(s, ray_along({1, 1, 1}, 6, true), tally, "oblique");
    CellRay overhead = ray_along({0, 0, -1}, 20, true);
    overhead.from_top = false;
    overhead.origin = {0.25F, 0.25F, 12};
    compare(s, overhead, tally, "from above");
  }
  EXPECT_GT(tally.hits, 100);
}

// Vertical segments run along the sides of upright objects. The drum of 100 faces exceeds the capacity of
// VerticalFacets.
TEST(RayCaster, MatchesOracleForUprightAndManyFacedObjects) {
  std::mt19937 random(12);
  Tally tally;
  for (const int faces : {12, 56, 100})
    for (const auto& direction : {Eigen::Vector3f(0, 0, 1), Eigen::Vector3f(0, 0, -1)}) {
      Scene s = random_scene(random, 12, 13, false);
      for (auto& q : s.snapshot.orientation) q = {0, 0, 0, 1};
      for (auto& o : s.objects) {
        o.orientation.setIdentity();
        if (o.shape == ShapeKind::kSolid) o.solid = oracle::make_drum(faces);
      }
      CellRay ray = ray_along(direction, 12.0F, true);
      ray.from_top = direction.z() > 0;
      if (!ray.from_top) ray.origin.z() = 10.0F;
      compare(s, ray, tally, std::to_string(faces) + " faces");
    }
  EXPECT_GT(tally.hits, tally.cells / 4);
  EXPECT_LT(tally.uncertain, tally.cells / 20);
}

// Objects of very different sizes, also beside the surface, partly off it, below pin tops and inside pins;
// random pitches; segments in all directions, including nearly vertical and nearly horizontal ones.
TEST(RayCaster, MatchesOracleForRandomPlacesAndDirections) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> u(0, 1);
  std::normal_distribution<float> normal;
  Tally tally;
  for (int round = 0; round < 24; ++round) {
    const float pitch = round % 3 == 0 ? 1.0F : 0.9F + 1.6F * u(random);
    Scene s = random_scene(random, 6, 7, round % 2 == 1, pitch);
    for (std::size_t k = 0; k < s.objects.size(); ++k) {
      const float size = k % 4 == 0 ? 0.2F + 0.1F * u(random) : k % 4 == 1 ? 1.5F : 1.0F;
      scale_object(s.objects[k], double{size});
      move_to(s, k, {pitch * (9 * u(random) - 1.5F), pitch * (8 * u(random) - 1.5F), 6 * u(random) - 2.5F});
    }
    Eigen::Vector3f direction(normal(random), normal(random), normal(random));
    if (round % 6 == 2) direction.head<2>() *= 1e-3F;
    if (round % 6 == 5) direction.z() *= 1e-3F;
    CellRay ray = ray_along(direction, 1.0F + 7.0F * u(random), round % 4 < 2);
    ray.from_top = round % 8 != 7;
    ray.origin = {u(random) - 0.5F, u(random) - 0.5F, ray.from_top ? u(random) - 0.3F : 2.0F};
    std::ostringstream what;
    what << "round " << round << ", pitch " << pitch << ", along " << ray.direction.transpose();
    compare(s, ray, tally, what.str());
  }
  EXPECT_GT(tally.hits, tally.cells / 5);
  EXPECT_LT(tally.uncertain, tally.cells / 20);
}

// Seen from below, the lower of two plates hides the upper; seen from the side, a raised pin hides a plate.
TEST(RayCaster, NearerObjectsOccludeFartherOnes) {
  Scene s;
  s.field.rows = s.field.columns = 9;
  s.field.height.assign(81, 0.0F);
  for (int k = 0; k < 2; ++k) {
    scene::ObjectSpec plate;
    plate.shape = ShapeKind::kBox;
    plate.size = {k == 0 ? 6.0 : 3.0, k == 0 ? 6.0 : 3.0, 0.5};
    plate.position = {4, 4, k == 0 ? 5.0 : 2.0};
    s.objects.push_back(plate);
    s.snapshot.id.push_back(static_cast<scene::ObjectId>(k));
    s.snapshot.position.push_back({});
    s.snapshot.orientation.push_back({0, 0, 0, 1});
    move_to(s, static_cast<std::size_t>(k), plate.position.cast<float>());
  }
  common::ThreadPool pool(1);
  surface::RayBodies bodies(0, 8);
  bodies.update(s.snapshot, s.objects, pool);
  RayCaster up(s.field, ray_along({0, 0, 1}, 8, true));
  up.cast(bodies, tags_of(bodies), 1000, s.field.height, pool);
  EXPECT_EQ(up.tag()[4 * 9 + 4], 2.0F);
  EXPECT_FLOAT_EQ(up.distance()[4 * 9 + 4], 1.75F);
  EXPECT_EQ(up.tag()[2 * 9 + 4], 1.0F) << "beside the lower plate";
  EXPECT_FLOAT_EQ(up.distance()[2 * 9 + 4], 4.75F);
  EXPECT_EQ(up.tag()[0], 0.0F);

  CellRay west = ray_along({-1, 0, 0}, 8, true);
  west.origin.z() = 2.0F;
  RayCaster level(s.field, west);
  level.cast(bodies, tags_of(bodies), 1000, s.field.height, pool);
  EXPECT_EQ(level.tag()[4 * 9 + 8], 2.0F);
  EXPECT_FLOAT_EQ(level.distance()[4 * 9 + 8], 2.5F);
  s.field.height[4 * 9 + 6] = 2.5F;  // a pin between the cell and the plate
  level.cast(bodies, tags_of(bodies), 1000, s.field.height, pool);
  EXPECT_EQ(level.tag()[4 * 9 + 8], 1000.0F);
  EXPECT_FLOAT_EQ(level.distance()[4 * 9 + 8], 1.6F);
  EXPECT_EQ(level.tag()[3 * 9 + 8], 2.0F) << "the neighbouring row is not occluded";
}

TEST(RayCaster, UpdatesMovedObjectsAndReportsChangedSpans) {
  std::mt19937 random(8);
  common::ThreadPool pool(1);
  Scene s = random_scene(random, 40, 50, false);
  surface::RayBodies bodies(0, 39);
  for (const Eigen::Vector3f& direction : {Eigen::Vector3f(0, 0, 1), Eigen::Vector3f(1, 1, 1)}) {
    const CellRay ray = ray_along(direction, 8, true);
    RayCaster kept(s.field, ray);
    // A copy of the distances that is updated in the reported spans only.
    std::vector<float> before(kept.distance().begin(), kept.distance().end());
    for (int step = 0; step < 5; ++step) {
      // Step 3 moves all objects out of range; step 4 makes one position NaN.
      for (auto& p : s.snapshot.position) p[0] += step == 3 ? 1e9F : 3.0F;
      if (step == 4) s.snapshot.position[0][1] = std::numeric_limits<float>::quiet_NaN();
      bodies.update(s.snapshot, s.objects, pool);
      RayCaster fresh(s.field, ray);
      kept.cast(bodies, tags_of(bodies), 1000, s.field.height, pool);
      fresh.cast(bodies, tags_of(bodies), 1000, s.field.height, pool);
      ASSERT_TRUE(std::ranges::equal(kept.distance(), fresh.distance())) << step;
      ASSERT_TRUE(std::ranges::equal(kept.tag(), fresh.tag())) << step;
      kept.for_each_changed_span(0, 40, [&](int first, int last) {
        std::copy(kept.distance().begin() + first, kept.distance().begin() + last, before.begin() + first);
      });
      ASSERT_TRUE(std::ranges::equal(kept.distance(), before)) << step;
    }
    for (auto& p : s.snapshot.position) p[0] = 20;
  }
}

TEST(RayCaster, BitIdenticalForAnyThreadCount) {
  std::mt19937 random(9);
  for (const bool free : {false, true}) {
    const Scene s = random_scene(random, 37, 41, free);
    for (const auto& direction : kDirections) {
      std::vector<float> first;
      for (const int threads : {1, 2, 3}) {
        common::ThreadPool pool(threads, 0.0);  // always runs in parallel
        surface::RayBodies bodies;
        bodies.update(s.snapshot, s.objects, pool);
        RayCaster caster(s.field, ray_along(direction, 6, true));
        caster.cast(bodies, tags_of(bodies), 1000, s.field.height, pool);
        if (threads == 1) first.assign(caster.distance().begin(), caster.distance().end());
        ASSERT_TRUE(std::ranges::equal(first, caster.distance())) << direction.transpose();
      }
    }
  }
}

TEST(RayCaster, BitIdenticalForAnyThreadCountInCrowd) {
  std::mt19937 random(11);
  Scene s = random_scene(random, 60, 40, false);
  std::uniform_real_distribution<float> u(-3.0F, 63.0F);
  for (std::size_t k = s.objects.size(); k < 300; ++k) {
    scene::ObjectSpec o;
    o.radius = 0.5 + 0.01 * static_cast<double>(k % 100);
    s.snapshot.id.push_back(static_cast<scene::ObjectId>(k));
    s.snapshot.position.push_back({u(random), u(random), 3.0F});
    s.snapshot.orientation.push_back({0, 0, 0, 1});
    s.objects.push_back(o);
  }
  s.snapshot.position[40][1] = std::numeric_limits<float>::quiet_NaN();
  for (const auto& direction : kDirections) {
    std::vector<float> first;
    for (const int threads : {1, 2, 7}) {
      common::ThreadPool pool(threads, 0.0);
      surface::RayBodies bodies(0, 59);
      bodies.update(s.snapshot, s.objects, pool);
      RayCaster caster(s.field, ray_along(direction, 6, false));
      caster.cast(bodies, tags_of(bodies), 1000, s.field.height, pool);
      if (threads == 1) first.assign(caster.tag().begin(), caster.tag().end());
      ASSERT_TRUE(std::ranges::equal(first, caster.tag())) << direction.transpose() << " " << threads;
    }
  }
}

TEST(RayCaster, BitIdenticalOnEveryTarget) {
  std::mt19937 random(10);
  common::ThreadPool pool(1);
  for (const bool free : {false, true}) {
    const Scene s = random_scene(random, 21, 23, free);
    surface::RayBodies bodies;
    bodies.update(s.snapshot, s.objects, pool);
    for (const auto& direction : kDirections) {
      std::vector<float> first;
      for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
        hwy::SetSupportedTargetsForTest(target);
        hwy::GetChosenTarget().Update(hwy::SupportedTargets());
        RayCaster caster(s.field, ray_along(direction, 6, true));
        caster.cast(bodies, tags_of(bodies), 1000, s.field.height, pool);
        if (first.empty()) first.assign(caster.distance().begin(), caster.distance().end());
        EXPECT_TRUE(std::ranges::equal(first, caster.distance())) << hwy::TargetName(target);
      }
      hwy::SetSupportedTargetsForTest(0);
      hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    }
  }
}
