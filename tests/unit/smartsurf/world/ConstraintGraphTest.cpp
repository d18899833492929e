#include "common/threads/ThreadPool.h"
#include "smartsurf/world/solver/ConstraintGraph.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <random>
#include <set>

using namespace smartsurf;
using namespace smartsurf::world;

namespace {

// Spheres and boxes with random contacts. Five bodies have so many that the colours run out.
struct Tangle {
  BodyStore bodies;
  ContactList pairs, world;
  explicit Tangle(int n, int contacts) {
    for (int i = 0; i < n; ++i) {
      scene::ObjectSpec o;
      if (i % 3 == 0) o.shape = scene::ShapeKind::kBox;
      bodies.add(static_cast<scene::ObjectId>(i), o, {});
    }
    std::mt19937 random(1);
    std::set<std::pair<int, int>> used;
    for (int k = 0; k < contacts; ++k) {
      const int i = static_cast<int>(random() % static_cast<unsigned>(n)), j = static_cast<int>(random() % 5);
      if (i == j || !used.insert(std::minmax(i, j)).second) continue;
      add(pairs, std::min(i, j), std::max(i, j), 1 + k % 4);
    }
    for (int i = 0; i < n; i += 2) add(world, i, Manifold::kStatic, 1 + i % 5);
  }
  // Slabs of a hundred manifolds; those in the second half of the list consist of two ranges each.
  static SlabRanges runs(const ContactList& list) {
    SlabRanges r;
    const int n = static_cast<int>(list.manifolds.size());
    for (int at = 0; at < n; at += 100) {
      r.first_range.push_back(static_cast<std::int32_t>(r.range.size()));
      const int end = std::min(at + 100, n), middle = at < n / 2 ? at : (at + end) / 2;
      if (at < middle) r.range.push_back({at, middle});
      r.range.push_back({middle, end});
    }
    r.first_range.resize(kSlabs + 1, static_cast<std::int32_t>(r.range.size()));
    return r;
  }
  void build(ConstraintGraph& graph, const Member& member) const {
    graph.build(bodies, pairs, runs(pairs), world, runs(world), member.share(kSlabs), member);
  }
  void build(ConstraintGraph& graph) const {
    Barrier alone(1);
    build(graph, Member{0, 1, alone});
  }
  static constexpr int kSlabs = 10;
  static void add(ContactList& list, int a, int b, int count) {
    list.manifolds.push_back({a, b, static_cast<std::int32_t>(list.contacts.size()), count});
    list.contacts.resize(list.contacts.size() + static_cast<std::size_t>(count));
  }
};

}  // namespace

TEST(ConstraintGraph, BodiesUniquePerColourAndAllManifoldsScheduled) {
  const Tangle t(200, 600);
  ConstraintGraph graph;
  t.build(graph);
  std::multiset<int> scheduled;
  bool any_in_order = false;
  for (const auto& colour : graph.colours()) {
    std::multiset<int> bodies;
    for (const BatchRange& run : {colour.spheres, colour.general})
      for (int o = run.first; o < run.first + run.count; ++o) {
        const ContactBatch& batch = graph.reset_batch(o);
        EXPECT_LE(batch.lane_count, colour.is_overflow ? 1 : kLanes);
        for (int lane = 0; lane < batch.lane_count; ++lane) {
          scheduled.insert(graph.manifold(o, lane));
          const Manifold& m = t.pairs.manifolds[static_cast<std::size_t>(graph.manifold(o, lane))];
          EXPECT_LE(m.count, batch.point_count);
          if (!colour.is_overflow) bodies.insert({m.a, m.b});
        }
      }
    for (const int b : bodies) EXPECT_EQ(bodies.count(b), 1u);
    any_in_order |= colour.is_overflow;
  }
  EXPECT_TRUE(any_in_order) << "the test must exercise the overflow set";
  EXPECT_EQ(scheduled.size(), t.pairs.manifolds.size());
  EXPECT_EQ(std::set<int>(scheduled.begin(), scheduled.end()).size(), scheduled.size());
}

TEST(ConstraintGraph, SchedulesEachStaticManifoldOnce) {
  const Tangle t(200, 600);
  ConstraintGraph graph;
  t.build(graph);
  std::set<int> bodies;
  for (const BatchRange& run : {graph.sphere_static(), graph.general_static()})
    for (int o = run.first; o < run.first + run.count; ++o)
      for (int lane = 0; lane < graph.reset_batch(o).lane_count; ++lane) {
        const Manifold& m = t.world.manifolds[static_cast<std::size_t>(graph.manifold(o, lane))];
        EXPECT_TRUE(bodies.insert(m.a).second);
        EXPECT_LE(m.count, graph.batch(o).point_count);
      }
  EXPECT_EQ(bodies.size(), t.world.manifolds.size());
}

TEST(ConstraintGraph, SameBatchesForAnyThreadCount) {
  const Tangle t(400, 1500);
  ConstraintGraph alone;
  t.build(alone);
  for (const int members : {1, 2, 3, 7}) {
    common::ThreadPool pool(members, 0.0);
    Team team(&pool);
    ConstraintGraph graph;
    team.run(true, [&](const Member& member) { t.build(graph, member); });
    ASSERT_EQ(graph.batch_count(), alone.batch_count()) << members;
    ASSERT_EQ(graph.point_count(), alone.point_count()) << members;
    for (int o = 0; o < graph.batch_count(); ++o) {
      const int lanes = alone.reset_batch(o).lane_count;
      ASSERT_EQ(graph.reset_batch(o).lane_count, lanes);
      for (int lane = 0; lane < lanes; ++lane)
        ASSERT_EQ(graph.manifold(o, lane), alone.manifold(o, lane)) << members;
    }
    std::multiset<int> shared;
    Barrier barrier(members);
    for (int m = 0; m < members; ++m)
      for (const BatchRange& run : graph.own_batches(Member{m, members, barrier}))
        for (int o = run.first; o < run.first + run.count; ++o) shared.insert(o);
    EXPECT_EQ(shared.size(), static_cast<std::size_t>(graph.batch_count())) << members;
    EXPECT_EQ(std::set<int>(shared.begin(), shared.end()).size(), shared.size()) << members;
  }
}

TEST(ConstraintGraph, MembersHaveEqualSharesOfEachColour) {
  const Tangle t(400, 1500);
  for (const int members : {2, 3, 7}) {
    common::ThreadPool pool(members, 0.0);
    Team team(&pool);
    ConstraintGraph graph;
    team.run(true, [&](const Member& member) { t.build(graph, member); });
    Barrier barrier(members);
    for (std::size_t c = 0; c <= graph.colours().size(); ++c) {
      std::map<std::pair<int, int>, std::vector<int>> counts;  // by kind and number of points; of each member
      for (int m = 0; m < members; ++m)
        for (const BatchRange& run : graph.own_batches(Member{m, members, barrier}, c))
          for (int o = run.first; o < run.first + run.count; ++o) {
            std::vector<int>& of = counts[{run.kind, graph.reset_batch(o).point_count}];
            of.resize(static_cast<std::size_t>(members));
            ++of[static_cast<std::size_t>(m)];
          }
      const bool is_overflow = c < graph.colours().size() && graph.colours()[c].is_overflow;
      for (const auto& [key, of] : counts) {
        const auto [least, most] = std::ranges::minmax(of);
        if (is_overflow)
          EXPECT_EQ(std::accumulate(of.begin(), of.end(), 0), of.back()) << "the caller of Team::run has all";
        else
          EXPECT_LE(most - least, 1) << members << " " << c;
      }
    }
  }
}
