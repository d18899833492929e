#include "common/threads/ThreadPool.h"
#include "smartsurf/world/solver/ConstraintGraph.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <span>
#include <tuple>
#include <vector>

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

namespace {

// A graph that several members have built, and its batches by member.
struct SharedGraph {
  ConstraintGraph graph;
  std::vector<std::span<const BatchRange>> of_members;
  SharedGraph(const Tangle& t, int members) {
    common::ThreadPool pool(members, 0.0);
    Team team(&pool);
    team.run(true, [&](const Member& member) { t.build(graph, member); });
    Barrier barrier(members);
    for (int m = 0; m < members; ++m) of_members.push_back(graph.own_batches(Member{m, members, barrier}));
  }
  // Calls each(member, kind, batch, lane) for all lanes.
  template <class Each>
  void for_each_lane(Each each) const {
    for (std::size_t m = 0; m < of_members.size(); ++m)
      for (const BatchRange& run : of_members[m])
        for (int o = run.first; o < run.first + run.count; ++o)
          for (int lane = 0; lane < graph.lane_count(o); ++lane) each(static_cast<int>(m), run.kind, o, lane);
  }
  // Each manifold and its colour, in the order of their ranks.
  std::vector<std::tuple<bool, int, std::size_t>> ranked() const {
    const auto colour_of = [this](int batch) {
      const auto has = [&](const ConstraintGraph::Colour& c) {
        const auto in = [&](const BatchRange& run) {
          return batch >= run.first && batch < run.first + run.count;
        };
        return in(c.spheres) || in(c.general);
      };
      return static_cast<std::size_t>(std::ranges::find_if(graph.colours(), has) - graph.colours().begin());
    };
    std::map<std::pair<int, int>, std::tuple<bool, int, std::size_t>> by_rank;
    for_each_lane([&](int, ContactKind kind, int batch, int lane) {
      const std::tuple manifold(is_pair(kind), graph.manifold(batch, lane), colour_of(batch));
      EXPECT_TRUE(by_rank.insert({graph.rank(kind, batch, lane), manifold}).second);
    });
    std::vector<std::tuple<bool, int, std::size_t>> order;
    for (const auto& [rank, manifold] : by_rank) order.push_back(manifold);
    return order;
  }
};

}  // namespace

TEST(ConstraintGraph, SameColoursAndRanksForAnyThreadCount) {
  const Tangle t(400, 1300);
  const auto alone = SharedGraph(t, 1).ranked();
  EXPECT_EQ(alone.size(), t.pairs.manifolds.size() + t.world.manifolds.size());
  for (const int members : {2, 3, 7}) EXPECT_EQ(SharedGraph(t, members).ranked(), alone) << members;
}

TEST(ConstraintGraph, MembersHaveTheBatchesOfTheirSlabs) {
  const Tangle t(400, 1300);
  for (const int members : {2, 3, 7}) {
    SharedGraph s(t, members);
    Barrier barrier(members);
    const int last = members - 1;
    s.for_each_lane([&](int m, ContactKind kind, int batch, int lane) {
      const int manifold = s.graph.manifold(batch, lane);
      const ContactList& list = is_pair(kind) ? t.pairs : t.world;
      EXPECT_LE(list.manifolds[static_cast<std::size_t>(manifold)].count,
                s.graph.reset_batch(batch).point_count);
      const bool in_order =
          s.graph.colours().back().is_overflow && batch >= s.graph.colours().back().spheres.first;
      if (in_order && is_pair(kind)) {
        EXPECT_EQ(m, last) << "the caller of Team::run has the overflow set";
        return;
      }
      const SlabRanges ranges = Tangle::runs(list);
      const auto own = ranges.of(Member{m, members, barrier}.share(Tangle::kSlabs));
      EXPECT_TRUE(std::ranges::any_of(
          own, [&](const IndexRange& r) { return r.begin <= manifold && manifold < r.end; }))
          << members << " " << m << " " << manifold;
    });
  }
}
