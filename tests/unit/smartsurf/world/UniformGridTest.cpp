#include "common/threads/ThreadPool.h"
#include "smartsurf/world/broadphase/UniformGrid.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <random>
#include <set>
#include <tuple>

using namespace smartsurf;
using namespace smartsurf::world;

namespace {

// Random spheres in a box; `reach` is the bounding radius.
struct Cloud {
  std::vector<Vec3> position;
  std::vector<float> reach;
  explicit Cloud(int n, float size, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> u(0, 1);
    for (int i = 0; i < n; ++i) {
      position.emplace_back(size * u(random), size * u(random), 0.3F * size * u(random));
      reach.push_back(0.3F + u(random));
    }
  }
  bool meet(int i, int j) const {
    const float both = reach[static_cast<std::size_t>(i)] + reach[static_cast<std::size_t>(j)];
    return (position[static_cast<std::size_t>(i)] - position[static_cast<std::size_t>(j)]).squaredNorm() <
           both * both;
  }
};

using Pairs = std::multiset<std::pair<int, int>>;

// Each of n members contributes every n-th body.
void build(UniformGrid& grid, const Cloud& cloud, int members = 1) {
  common::ThreadPool pool(members, 0.0);
  Team team(&pool);
  std::vector<std::int32_t> all(cloud.position.size());
  std::iota(all.begin(), all.end(), 0);
  team.run(true, [&](const Member& member) {
    std::vector<std::int32_t> own;
    for (int i = member.index; i < static_cast<int>(cloud.position.size()); i += member.member_count)
      own.push_back(i);
    grid.build({cloud.position, cloud.reach, 10.0F, all}, own, member);
  });
}

}  // namespace

TEST(Grid, FindsEveryPairOnce) {
  for (const float size : {0.5F, 6.0F, 40.0F, 200.0F}) {
    Cloud cloud(300, size, 7);
    for (const std::size_t i : {50U, 51U, 52U}) cloud.position[i + 1] = cloud.position[i] + Vec3(1, 0.3F, 0);
    cloud.position[3] = {1e4F, -1e4F, 5.0F};  // far from all others
    UniformGrid grid;
    build(grid, cloud);
    ASSERT_EQ(grid.sorted_count(), 300);
    Pairs found, expected;
    grid.for_each_pair(0, grid.sorted_count(), [&](int i, int j) { found.insert(std::minmax(i, j)); });
    for (int i = 0; i < 300; ++i)
      for (int j = i + 1; j < 300; ++j)
        if (cloud.meet(i, j)) expected.insert({i, j});
    EXPECT_EQ(found, expected) << size;
  }
}

TEST(Grid, SubrangesCoverAllPairs) {
  for (const bool sparse : {false, true}) {
    Cloud cloud(200, 10.0F, 3);
    if (sparse) cloud.position[60] = {3e5F, 0, 0};
    UniformGrid grid;
    build(grid, cloud);
    Pairs whole, parts;
    grid.for_each_pair(0, 200, [&](int i, int j) { whole.insert(std::minmax(i, j)); });
    EXPECT_GT(whole.size(), 100u);
    for (const auto& [begin, end] : {std::pair{0, 50}, {50, 51}, {51, 200}})
      grid.for_each_pair(begin, end, [&](int i, int j) { parts.insert(std::minmax(i, j)); });
    EXPECT_EQ(parts, whole);
  }
}

// Whoever lists which bodies: the grid's order is that of the contacts.
TEST(Grid, SameOrderForAnyNumberOfMembers) {
  for (const float size : {6.0F, 40.0F, 200.0F})
    for (const unsigned seed : {1U, 2U, 3U}) {
      Cloud cloud(400, size, seed);
      cloud.reach[7] = 20.0F;  // large
      const auto order_of = [](const UniformGrid& grid) {
        std::vector<std::array<int, 3>> order;
        for (const UniformGrid::Row& row : grid.rows()) order.push_back({row.slice, row.layer, row.begin});
        for (int k = 0; k < grid.sorted_count(); ++k) order.push_back({grid.body(k), grid.column(k), 0});
        for (const std::int32_t body : grid.large_bodies()) order.push_back({body, 0, 0});
        return order;
      };
      UniformGrid alone, shared;
      build(alone, cloud);
      ASSERT_EQ(alone.sorted_count(), 399);
      for (const int members : {2, 3, 5}) {
        build(shared, cloud, members);
        EXPECT_EQ(order_of(shared), order_of(alone)) << size << ", " << members << " members";
        Pairs found, expected;
        shared.for_each_pair(0, 399, [&](int i, int j) { found.insert({i, j}); });
        alone.for_each_pair(0, 399, [&](int i, int j) { expected.insert({i, j}); });
        EXPECT_EQ(found, expected);
        std::swap(cloud.reach[7], cloud.reach[8]);  // the next grid has another large body
        build(alone, cloud);
      }
    }
}

// Fewer bodies than are worth cells: the same pairs and the same order as of more.
TEST(Grid, FewBodiesAreInTheOrderOfTheirCells) {
  for (int n = 0; n <= 40; ++n)
    for (const float size : {0.2F, 3.0F, 12.0F, 90.0F}) {
      Cloud cloud(n, size, static_cast<unsigned>(n));
      if (n % 3 == 2) cloud.reach[1] = 50.0F;
      if (n % 5 == 4) cloud.position[3] = cloud.position[0];
      UniformGrid grid;
      build(grid, cloud);
      std::vector<int> small;
      float widest = 1e-3F;
      Vec3 low = Vec3::Constant(1e30F);
      for (int i = 0; i < n; ++i) {
        const auto k = static_cast<std::size_t>(i);
        if (cloud.reach[k] > 10.0F) continue;
        small.push_back(i);
        widest = std::max(widest, cloud.reach[k]);
        low = low.cwiseMin(cloud.position[k]);
      }
      std::ranges::stable_sort(small, {}, [&](int i) {
        const Vec3 cell = (cloud.position[static_cast<std::size_t>(i)] - low) * (1.0F / (2.0F * widest));
        const float across = std::floor(cell[grid.slice_axis()]),
                    along = std::floor(cell[1 - grid.slice_axis()]);
        return std::tuple(across, std::floor(cell.z()), along);
      });
      ASSERT_EQ(grid.sorted_count(), std::ssize(small));
      std::vector<std::pair<int, int>> expected, found;
      for (std::size_t a = 0; a < small.size(); ++a) {
        EXPECT_EQ(grid.body(static_cast<int>(a)), small[a]) << n << " " << size;
        for (std::size_t b = a + 1; b < small.size(); ++b)
          if (cloud.meet(small[a], small[b])) expected.emplace_back(small[a], small[b]);
      }
      grid.for_each_pair(0, grid.sorted_count(), [&](int i, int j) { found.emplace_back(i, j); });
      EXPECT_EQ(found, expected) << n << " " << size;
      const Vec3 from(0.2F * size, 0.1F * size, 0), to(0.6F * size, 0.5F * size, 0.2F * size);
      std::vector<int> in_box, expected_in_box;
      grid.for_each_in_box(from, to, [&](int i) { in_box.push_back(i); });
      for (const int i : small) {
        const auto& p = cloud.position[static_cast<std::size_t>(i)].array();
        const float r = cloud.reach[static_cast<std::size_t>(i)];
        if ((p + r > from.array()).all() && (p - r < to.array()).all()) expected_in_box.push_back(i);
      }
      EXPECT_EQ(in_box, expected_in_box) << n << " " << size;
    }
}

// The cost of a pair search is the number of bodies in neighbouring cells.
TEST(Grid, FarBodiesShareNoCells) {
  for (const float size : {300.0F, 3e4F, 3e6F}) {
    Cloud cloud(3000, size, 13);
    cloud.position[7] = {-1e9F, 1e9F, 1e12F};
    UniformGrid grid;
    build(grid, cloud);
    std::map<std::tuple<int, int, int>, int> bodies_in_cell;
    const auto rows = grid.rows();
    EXPECT_EQ(rows.front().begin, 0);
    EXPECT_EQ(rows.back().begin, 3000);
    for (std::size_t r = 0; r + 1 < rows.size(); ++r)
      for (int k = rows[r].begin; k < rows[r + 1].begin; ++k)
        ++bodies_in_cell[{grid.column(k), rows[r].slice, rows[r].layer}];
    for (const auto& [cell, bodies] : bodies_in_cell) EXPECT_LE(bodies, 3) << size;
  }
}

TEST(Grid, SeparatesLargeBodiesAndAnswersBoxQueries) {
  for (const bool sparse : {false, true}) {
    Cloud cloud(200, 12.0F, 5);
    cloud.reach[17] = 50.0F;
    if (sparse) cloud.position[60] = {3e5F, 4.0F, -2e5F};
    UniformGrid grid;
    build(grid, cloud);
    ASSERT_EQ(grid.large_bodies().size(), 1u);
    EXPECT_EQ(grid.large_bodies()[0], 17);
    for (const float reach : {0.0F, 1e6F}) {
      const Vec3 low(2, 3, -reach), high(7 + reach, 5, 2);
      std::set<int> found, expected;
      grid.for_each_in_box(low, high, [&](int i) { EXPECT_TRUE(found.insert(i).second); });
      for (int i = 0; i < 200; ++i) {
        const Vec3& p = cloud.position[static_cast<std::size_t>(i)];
        const float r = cloud.reach[static_cast<std::size_t>(i)];
        const bool meets = ((p.array() + r) > low.array()).all() && ((p.array() - r) < high.array()).all();
        if (i != 17 && meets) expected.insert(i);
      }
      EXPECT_EQ(found, expected) << sparse << reach;
    }
  }
}

TEST(Grid, NanBoxQueryFindsNothing) {
  Cloud cloud(20, 6.0F, 7);
  UniformGrid grid;
  build(grid, cloud);
  const Vec3 nowhere = Vec3::Constant(std::numeric_limits<float>::quiet_NaN());
  int found = 0;
  grid.for_each_in_box(nowhere, nowhere, [&](std::int32_t) { ++found; });
  EXPECT_EQ(found, 0);
}

class GridOrder : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(DenseAndSparse, GridOrder, testing::Bool());

TEST_P(GridOrder, SameForAnyMemberCount) {
  Cloud cloud(400, 12.0F, 9);
  cloud.reach[17] = cloud.reach[301] = 50.0F;
  if (GetParam()) cloud.position[60] = {3e5F, 4.0F, -2e5F};
  UniformGrid alone;
  build(alone, cloud);
  for (const int members : {2, 3, 7}) {
    UniformGrid grid;
    build(grid, cloud, members);
    ASSERT_EQ(grid.sorted_count(), 398);
    EXPECT_EQ(std::vector(grid.large_bodies().begin(), grid.large_bodies().end()), (std::vector{17, 301}));
    Pairs found, expected;
    for (int k = 0; k < grid.sorted_count(); ++k)
      EXPECT_EQ(grid.body(k), alone.body(k)) << members << " " << k;
    alone.for_each_pair(0, 398, [&](int i, int j) { expected.insert({i, j}); });
    grid.for_each_pair(0, 398, [&](int i, int j) { found.insert({i, j}); });
    EXPECT_EQ(found, expected) << members;
  }
}

TEST(Grid, SamePairsOnEveryTarget) {
  const Cloud cloud(300, 9.0F, 11);
  UniformGrid grid;
  build(grid, cloud);
  std::vector<std::pair<int, int>> first;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    std::vector<std::pair<int, int>> found;
    grid.for_each_pair(0, grid.sorted_count(), [&](int i, int j) { found.emplace_back(i, j); });
    if (first.empty()) first = found;
    EXPECT_EQ(found, first) << hwy::TargetName(target);
  }
  EXPECT_GT(first.size(), 300u);
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}
