#include "smartsurf/world/narrowphase/PairManifoldCache.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "smartsurf/world/narrowphase/ConvexPair.h"
#include "tests/unit/smartsurf/world/PlacedBody.h"

using namespace smartsurf;
using namespace smartsurf::world;
using scene::ShapeKind;

namespace {

constexpr float kPairMargin = 0.02F;
const scene::Material kMaterial;

scene::ObjectSpec object(ShapeKind kind, const Eigen::Vector3d& at) {
  scene::ObjectSpec o;
  o.shape = kind;
  o.radius = 1.0;
  o.height = 2.0;
  o.size = {2, 2, 2};
  o.position = at;
  return o;
}

struct PairCacheFixture {
  BodyStore bodies;
  PairManifoldCache cache;
  PairManifoldCache::ChunkCache chunk_cache;
  std::vector<Contact> contacts;

  PairCacheFixture(ShapeKind kind_a, ShapeKind kind_b, const Eigen::Vector3d& b_at) {
    bodies.add(0, object(kind_a, {0, 0, 0}), kMaterial);
    bodies.add(1, object(kind_b, b_at), kMaterial);
  }
  void step(float margin = kPairMargin) {
    cache.swap_in(0, chunk_cache);
    cache.build_index(bodies.size());
    contacts.clear();
    cache.collide(bodies, 0, 1, margin, chunk_cache, contacts);
  }
  // The contacts without the cache.
  std::vector<Contact> recompute() const {
    std::vector<Contact> out;
    collide_convex({*bodies.shape[0], bodies.position[0], bodies.axes[0]},
                   {*bodies.shape[1], bodies.position[1], bodies.axes[1]}, kPairMargin, nullptr, out);
    return out;
  }
  void rotate(std::size_t body, const Vec3& by) {
    bodies.orientation[body] = (rotation_from_vector(by) * bodies.orientation[body]).normalized();
    bodies.update_axes(body);
  }
};

}  // namespace

TEST(PairManifoldCache, SeparationFollowsSlowBodies) {
  for (const ShapeKind kind : {ShapeKind::kBox, ShapeKind::kCylinder, ShapeKind::kCapsule}) {
    PairCacheFixture p(ShapeKind::kBox, kind, {0.3, 0.2, 2.01});
    for (int i = 0; i < 60; ++i) {
      p.step();
      const auto expected = p.recompute();
      ASSERT_FALSE(p.contacts.empty()) << i;
      EXPECT_NEAR(min_separation(p.contacts), min_separation(expected), 1e-3F) << i;
      p.bodies.position[1] += Vec3(0.004F, -0.002F, i < 30 ? -1e-4F : 1e-4F);
      p.rotate(1, Vec3(2e-4F, -1e-4F, 1e-3F));
    }
  }
}

TEST(PairManifoldCache, PointsTrackSlidingBody) {
  PairCacheFixture p(ShapeKind::kBox, ShapeKind::kBox, {0.7, 0.6, 2.01});
  for (int i = 0; i < 60; ++i) {
    p.step();
    for (const Contact& c : p.contacts) {
      float nearest = 1.0F;
      for (const Contact& fresh : p.recompute())
        nearest = std::min(nearest, (fresh.anchor - c.anchor).norm());
      EXPECT_LT(nearest, 0.031F) << i;
    }
    p.bodies.position[1].x() += 0.005F;
  }
}

// A manifold cached with the large margin of a fast approach is recomputed once the body rotates.
TEST(PairManifoldCache, SeparationFollowsRollingAfterFastApproach) {
  PairCacheFixture p(ShapeKind::kBox, ShapeKind::kCapsule, {0.3, 0.2, 2.01});
  p.rotate(1, Vec3(1.2F, 0, 0));
  p.bodies.position[1].z() = 2.0F - 1.0F + 1.0F + 0.001F;
  p.step(0.5F);
  for (int i = 0; i < 20; ++i) {
    p.rotate(1, Vec3(0.01F, 0, 0));
    p.step();
    const float truth = min_separation(p.recompute());
    if (truth > kPairMargin || truth < -0.02F) continue;
    ASSERT_FALSE(p.contacts.empty()) << i;
    EXPECT_NEAR(min_separation(p.contacts), truth, 1e-3F) << i;
  }
}

TEST(PairManifoldCache, DetectsApproachingBodyInTime) {
  PairCacheFixture p(ShapeKind::kBox, ShapeKind::kBox, {0.3, 0.2, 2.6});
  for (int i = 0; i < 200; ++i) {
    p.step();
    const auto expected = p.recompute();
    if (min_separation(expected) < -0.02F) break;
    if (min_separation(expected) < kPairMargin - 1e-3F) {
      ASSERT_FALSE(p.contacts.empty()) << i;
      EXPECT_NEAR(min_separation(p.contacts), min_separation(expected), 1e-3F) << i;
    }
    p.bodies.position[1].z() -= 0.003F;
    p.rotate(1, Vec3(1e-3F, 5e-4F, 0));
  }
}

TEST(PairManifoldCache, FollowsCommonRigidMotion) {
  PairCacheFixture p(ShapeKind::kBox, ShapeKind::kBox, {0, 0, 2.01});
  p.step();
  const float separation = min_separation(p.contacts);
  const Vec3 turn(0, 0.5F, 0);
  for (const std::size_t body : {0U, 1U}) {
    p.rotate(body, turn);
    p.bodies.position[body] = rotation_from_vector(turn) * p.bodies.position[body] + Vec3(5, 3, 1);
  }
  p.step();
  ASSERT_EQ(p.contacts.size(), 4U);
  EXPECT_NEAR(min_separation(p.contacts), separation, 1e-5F);
  EXPECT_NEAR(p.contacts[0].normal.dot(rotation_from_vector(turn) * Vec3(0, 0, -1)), 1.0F, 1e-5F);
}

TEST(PairManifoldCache, RollingCylinderKeepsPointsBelow) {
  PairCacheFixture p(ShapeKind::kCylinder, ShapeKind::kBox, {0, 0, -2});
  const Quat lying(Eigen::AngleAxisf(1.5707963F, Vec3::UnitY()));
  p.bodies.orientation[0] = lying;
  p.bodies.update_axes(0);
  for (int i = 0; i < 20; ++i) {
    p.step();
    ASSERT_FALSE(p.contacts.empty());
    for (const Contact& c : p.contacts) EXPECT_NEAR(c.anchor.y(), 0.0F, 1e-3F) << i;
    p.rotate(0, Vec3(1e-3F, 0, 0));
  }
}
