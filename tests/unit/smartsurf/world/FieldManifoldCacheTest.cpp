#include "smartsurf/world/field/FieldManifoldCache.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "smartsurf/world/field/ConvexOnField.h"
#include "tests/unit/smartsurf/world/PlacedBody.h"

using namespace smartsurf;
using namespace smartsurf::world;
using scene::ShapeKind;

namespace {

constexpr float kCacheMargin = 0.03F;
constexpr int kCacheSide = 9;

// A body above the middle of a field of 9 × 9 cells.
struct FieldCacheFixture {
  surface::Field field;
  BodyStore bodies;
  FieldManifoldCache cache;
  FieldManifoldCache::ChunkCache chunk_cache;
  std::vector<Contact> contacts;

  explicit FieldCacheFixture(ShapeKind kind, double height) : cache(field) {
    field.rows = field.columns = kCacheSide;
    for (auto* v : {&field.height, &field.speed}) v->assign(kCacheSide * kCacheSide, 0.0F);
    field.max_height = 2.0F;
    scene::ObjectSpec o;
    o.shape = kind;
    o.radius = 1.2;
    o.height = 2.0;
    o.size = {2.6, 3.0, 2.0};
    o.position = {4.1, 3.9, height};
    bodies.add(0, o, scene::Material{});
  }
  // Sets each cell to slope(x), where x is its column.
  template <class Slope>
  void set_heights(Slope slope) {
    for (int i = 0; i < field.cells(); ++i)
      field.height[static_cast<std::size_t>(i)] = slope(static_cast<float>(i % kCacheSide));
  }
  void raise(float by) {
    for (float& h : field.height) h += by;
  }
  float& cell(int row, int column) {
    return field.height[static_cast<std::size_t>(field.index(row, column))];
  }
  void step() {
    cache.swap_in(0, chunk_cache);
    cache.build_index(bodies.size());
    contacts.clear();
    cache.collide(bodies, 0, kCacheMargin, {}, chunk_cache, contacts);
  }
  // The contacts without the cache.
  std::vector<Contact> recompute() const {
    std::vector<Contact> out;
    collide_shape_with_field(field, *bodies.shape[0], bodies.position[0], bodies.axes[0], kCacheMargin, out);
    return out;
  }
  // Lowers the body until its minimum separation is at most `separation`.
  void lower_to(float separation) {
    while (min_separation(recompute()) > separation) bodies.position[0].z() -= 0.002F;
  }
  void rotate(const Vec3& by) {
    bodies.orientation[0] = (rotation_from_vector(by) * bodies.orientation[0]).normalized();
    bodies.update_axes(0);
  }
};

float wave(float x) { return 0.3F * std::sin(0.8F * x); }

}  // namespace

TEST(FieldManifoldCache, SeparationFollowsSlidingAndRotatingBody) {
  for (const ShapeKind kind :
       {ShapeKind::kBox, ShapeKind::kCylinder, ShapeKind::kCapsule, ShapeKind::kCone}) {
    FieldCacheFixture b(kind, 2.0);
    b.set_heights(wave);
    b.lower_to(0.005F);
    for (int i = 0; i < 60; ++i) {
      b.step();
      const auto expected = b.recompute();
      const float truth = min_separation(expected);
      if (std::abs(truth) < 0.015F) {
        ASSERT_FALSE(b.contacts.empty()) << i;
        EXPECT_NEAR(min_separation(b.contacts), truth, 2e-3F) << static_cast<int>(kind) << ' ' << i;
      }
      b.bodies.position[0] += Vec3(0.003F, -0.002F, 0);
      b.rotate(Vec3(2e-4F, -3e-4F, 2e-3F));
      if (truth < -0.005F) b.bodies.position[0].z() += 0.01F;
    }
  }
}

TEST(FieldManifoldCache, PointsTrackSlidingBody) {
  FieldCacheFixture b(ShapeKind::kBox, 1.305);
  b.cell(4, 4) = 0.3F;
  for (int i = 0; i < 60; ++i) {
    b.step();
    ASSERT_FALSE(b.contacts.empty());
    for (const Contact& c : b.contacts) {
      float nearest = 1.0F;
      for (const Contact& fresh : b.recompute())
        nearest = std::min(nearest, (fresh.anchor - c.anchor).norm());
      EXPECT_LT(nearest, 0.051F) << i;
    }
    b.bodies.position[0].y() += 0.006F;
  }
}

TEST(FieldManifoldCache, PointsFollowMovingCells) {
  FieldCacheFixture b(ShapeKind::kBox, 1.31);
  b.set_heights(wave);
  b.lower_to(0.01F);
  b.step();
  ASSERT_FALSE(b.contacts.empty());
  const float separation = min_separation(b.contacts);
  b.raise(0.008F);
  b.step();
  EXPECT_NEAR(min_separation(b.contacts), separation - 0.008F, 1e-4F);
  // Raising the cells and the body together leaves the separation unchanged.
  b.raise(0.5F);
  b.bodies.position[0].z() += 0.508F;
  b.step();
  EXPECT_NEAR(min_separation(b.contacts), separation, 1e-4F);
}

// Only four of many equally deep points are kept. A cell under a dropped point may then rise above them.
TEST(FieldManifoldCache, ReselectsPointsWhenCellsMove) {
  FieldCacheFixture b(ShapeKind::kBox, 1.0);
  for (int i = 0; i < kCacheSide * kCacheSide; ++i)
    b.field.height[static_cast<std::size_t>(i)] = -0.002F * static_cast<float>(i % 3 + i / kCacheSide % 2);
  for (int row = 3; row <= 5; ++row)
    for (int column = 3; column <= 5; ++column) {
      b.step();
      b.cell(row, column) += 0.012F;
      b.step();
      EXPECT_NEAR(min_separation(b.contacts), min_separation(b.recompute()), 1e-4F) << row << ' ' << column;
      b.cell(row, column) -= 0.012F;
    }
}

TEST(FieldManifoldCache, DetectsPinRisingFromLevelField) {
  FieldCacheFixture b(ShapeKind::kBox, 1.001);
  b.step();
  ASSERT_EQ(b.contacts.size(), 4U);
  for (int i = 0; i < 4; ++i) {
    b.cell(4, 4) += 0.0025F;
    b.step();
  }
  EXPECT_NEAR(min_separation(b.contacts), 0.001F - 0.01F, 1e-5F);
}

TEST(FieldManifoldCache, DetectsApproachingBodyInTime) {
  FieldCacheFixture b(ShapeKind::kBox, 2.0);
  b.set_heights(wave);
  b.rotate(Vec3(0.2F, 0.3F, 0));
  int near = 0;
  for (int i = 0; i < 400; ++i) {
    b.step();
    const float truth = min_separation(b.recompute());
    if (truth < -0.02F) break;
    if (truth < kCacheMargin - 2e-3F) {
      ASSERT_FALSE(b.contacts.empty()) << i;
      EXPECT_NEAR(min_separation(b.contacts), truth, 2e-3F) << i;
      ++near;
    }
    b.bodies.position[0].z() -= 0.003F;
    b.rotate(Vec3(1e-4F, 0, 1e-3F));
  }
  EXPECT_GT(near, 5);
}
