#include "smartsurf/world/broadphase/SpatialPartition.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>
#include <random>
#include <set>

using namespace smartsurf;
using namespace smartsurf::world;

namespace {

// Random spheres in a box: every seventh asleep, one fixed and large, one with a NaN position.
struct Heap {
  BodyStore bodies;
  UniformGrid grid;
  SpatialPartition slabs;
  Heap(int n, const Vec3& size) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> u(0, 1);
    for (int i = 0; i < n; ++i) {
      scene::ObjectSpec o;
      o.position = {size.x() * u(random), size.y() * u(random), size.z() * u(random)};
      o.fixed = i == 5;
      bodies.add(static_cast<scene::ObjectId>(i), o, {});
      bodies.asleep.back() = i % 7 == 0;
    }
    bodies.position[9].x() = std::numeric_limits<float>::quiet_NaN();
    std::vector<float> reach(bodies.bounding_radius);
    reach[5] = 1e30F;
    std::vector<std::int32_t> all(static_cast<std::size_t>(n));
    std::iota(all.begin(), all.end(), 0);
    Barrier alone(1);
    grid.build({bodies.position, reach, 10.0F, all}, all, Member{0, 1, alone});
    slabs.build(grid, n);
  }
  void list(int members) {
    Barrier alone(1);
    for (int m = 0; m < members; ++m) slabs.assign_rows(bodies, grid, {m, members, alone});
  }
};

const Vec3 kTables[] = {{20, 60, 6}, {60, 20, 6}, {300, 2, 2}};

}  // namespace

TEST(SpatialPartition, SlabsFollowEachOtherInGridOrder) {
  for (const Vec3& size : kTables) {
    const Heap h(1500, size);
    EXPECT_GE(h.slabs.slab_count(), 6);
    int next = 0;
    for (int s = 0; s + 1 < h.slabs.slab_count(); ++s) {
      EXPECT_EQ(h.slabs.sorted_bodies_of(s).begin, next);
      next = h.slabs.sorted_bodies_of(s).end;
    }
    EXPECT_EQ(next, h.grid.sorted_count());
  }
}

TEST(SpatialPartition, OrderedAlongLongerAxis) {
  for (const Vec3& size : kTables) {
    Heap h(1500, size);
    h.list(1);
    const int axis = size.y() > size.x() ? 1 : 0;
    float before = -1e30F;
    for (int s = 0; s + 1 < h.slabs.slab_count(); ++s) {
      float low = 1e30F, high = -1e30F;
      const IndexRange rows = h.slabs.rows_of(s);
      for (int row = rows.begin; row < rows.end; ++row) {
        low = std::min(low, h.bodies.position[h.slabs.body(row)][axis]);
        high = std::max(high, h.bodies.position[h.slabs.body(row)][axis]);
      }
      EXPECT_GE(low, before) << s;
      before = high;
    }
  }
}

TEST(SpatialPartition, AssignsEveryBodyARowActiveFirst) {
  for (const int members : {1, 2, 5}) {
    Heap h(1500, kTables[0]);
    h.list(members);
    std::set<std::size_t> bodies;
    EXPECT_EQ(h.slabs.row_count(), 1500);
    for (int s = 0; s < h.slabs.slab_count(); ++s) {
      const IndexRange rows = h.slabs.rows_of(s), moving = h.slabs.active_rows_of(s);
      for (int row = rows.begin; row < rows.end; ++row) {
        const std::size_t body = h.slabs.body(row);
        EXPECT_TRUE(bodies.insert(body).second);
        EXPECT_EQ(h.slabs.row(static_cast<std::int32_t>(body)), row);
        EXPECT_EQ(row < moving.end, h.bodies.is_active(body));
      }
    }
    EXPECT_EQ(bodies.size(), 1500u);
  }
}

TEST(SpatialPartition, SharesAreCompleteAndBalanced) {
  const Heap h(3000, kTables[0]);
  Barrier alone(1);
  for (const int members : {1, 2, 3, 8}) {
    int next = 0;
    for (int m = 0; m < members; ++m) {
      const IndexRange share = h.slabs.share({m, members, alone});
      EXPECT_EQ(share.begin, next);
      next = share.end;
      if (share.begin == share.end) continue;
      const int bodies = h.slabs.rows_of(share.end - 1).end - h.slabs.rows_of(share.begin).begin;
      EXPECT_NEAR(bodies, 3000 / members, 250);
    }
    EXPECT_EQ(next, h.slabs.slab_count());
  }
}

TEST(SpatialPartition, FewBodiesFormOneSlab) {
  const Heap h(100, kTables[0]);
  EXPECT_EQ(h.slabs.slab_count(), 2) << "large bodies form a slab of their own";
}
