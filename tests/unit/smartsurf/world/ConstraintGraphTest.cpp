#include "common/threads/ThreadPool.h"
#include "smartsurf/world/solver/ConstraintGraph.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>
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
  // Slabs of a hundred manifolds; the last ones are empty.
  static SlabRanges ranges(const ContactList& list) {
    SlabRanges r;
    const int n = static_cast<int>(list.manifolds.size());
    for (int s = 1; s <= kSlabs; ++s) r.first.push_back(std::min(100 * s, n));
    EXPECT_EQ(r.manifold_count(), n);
    return r;
  }
  void build(ConstraintGraph& graph, const Member& member) const {
    const SlabRanges pair_ranges = ranges(pairs), world_ranges = ranges(world);
    const ConstraintGraph::Input in{bodies, pairs, world, pair_ranges, world_ranges};
    graph.build(in, member.share(kSlabs), member);
    member.single([&] { graph.pack_batches(in); });
  }
  void build(ConstraintGraph& graph) const {
    Barrier alone(1);
    build(graph, Member{0, 1, alone});
  }
  static constexpr int kSlabs = 15;
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
  EXPECT_TRUE(graph.has_overflow()) << "the test must exercise the overflow set";
  std::multiset<int> scheduled;
  Barrier barrier(1);
  for (int colour = 0; colour < graph.colour_count(); ++colour) {
    const bool is_overflow = graph.has_overflow() && colour + 1 == graph.colour_count();
    std::multiset<int> bodies;
    for (const BatchRange& run : graph.own_batches(Member{0, 1, barrier}, colour))
      for (int o = run.first; o < run.first + run.count; ++o) {
        const ContactBatch& batch = graph.reset_batch(o);
        EXPECT_LE(batch.lane_count, is_overflow ? 1 : kLanes);
        for (int lane = 0; lane < batch.lane_count; ++lane) {
          scheduled.insert(graph.manifold(o, lane));
          const Manifold& m = t.pairs.manifolds[static_cast<std::size_t>(graph.manifold(o, lane))];
          EXPECT_LE(m.count, batch.point_count);
          if (!is_overflow) bodies.insert({m.a, m.b});
        }
      }
    for (const int b : bodies) EXPECT_EQ(bodies.count(b), 1u);
  }
  EXPECT_EQ(scheduled.size(), t.pairs.manifolds.size());
  EXPECT_EQ(std::set<int>(scheduled.begin(), scheduled.end()).size(), scheduled.size());
}

TEST(ConstraintGraph, SchedulesEachStaticManifoldOnce) {
  const Tangle t(200, 600);
  ConstraintGraph graph;
  t.build(graph);
  std::set<int> bodies;
  graph.for_each_batch([&](ContactKind kind, int o) {
    if (is_pair(kind)) return;
    for (int lane = 0; lane < graph.reset_batch(o).lane_count; ++lane) {
      const Manifold& m = t.world.manifolds[static_cast<std::size_t>(graph.manifold(o, lane))];
      EXPECT_TRUE(bodies.insert(m.a).second);
      EXPECT_LE(m.count, graph.batch(o).point_count);
    }
  });
  EXPECT_EQ(bodies.size(), t.world.manifolds.size());
}

namespace {

// A graph that several members have built.
struct SharedGraph {
  ConstraintGraph graph;
  int members;
  SharedGraph(const Tangle& t, int count) : members(count) {
    common::ThreadPool pool(members, 0.0);
    Team team(&pool);
    team.run(true, [&](const Member& member) { t.build(graph, member); });
  }
  // Calls each(member, colour, kind, batch, lane) for all lanes.
  template <class Each>
  void for_each_lane(Each each) const {
    Barrier barrier(members);
    for (int m = 0; m < members; ++m)
      for (int colour = 0; colour <= graph.colour_count(); ++colour)
        for (const BatchRange& run : graph.own_batches(Member{m, members, barrier}, colour))
          for (int o = run.first; o < run.first + run.count; ++o)
            for (int lane = 0; lane < graph.lane_count(o); ++lane) each(m, colour, run.kind, o, lane);
  }
  // Each manifold and its colour, in the order of their ranks.
  std::vector<std::tuple<bool, int, int>> ranked() const {
    std::map<std::pair<int, int>, std::tuple<bool, int, int>> by_rank;
    for_each_lane([&](int, int colour, ContactKind kind, int batch, int lane) {
      const std::tuple manifold(is_pair(kind), graph.manifold(batch, lane), colour);
      EXPECT_TRUE(by_rank.insert({graph.rank(kind, batch, lane), manifold}).second);
    });
    std::vector<std::tuple<bool, int, int>> order;
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

// What a member writes in each substep stays in its cache.
TEST(ConstraintGraph, BatchesOfAMemberLieTogether) {
  const Tangle t(400, 1300);
  const SharedGraph s(t, 3);
  int last = -1, last_member = 0;
  s.for_each_lane([&](int m, int, ContactKind, int batch, int) {
    EXPECT_GE(m, last_member);
    EXPECT_GE(batch, last);
    EXPECT_LE(batch, last + 1);
    last = batch, last_member = m;
  });
  EXPECT_EQ(last + 1, s.graph.batch_count());
}

TEST(ConstraintGraph, MembersHaveTheBatchesOfTheirSlabs) {
  const Tangle t(400, 1300);
  for (const int members : {2, 3, 7}) {
    SharedGraph s(t, members);
    Barrier barrier(members);
    const int last = members - 1;
    s.for_each_lane([&](int m, int colour, ContactKind kind, int batch, int lane) {
      const int manifold = s.graph.manifold(batch, lane);
      const ContactList& list = is_pair(kind) ? t.pairs : t.world;
      EXPECT_LE(list.manifolds[static_cast<std::size_t>(manifold)].count,
                s.graph.reset_batch(batch).point_count);
      if (s.graph.has_overflow() && colour + 1 == s.graph.colour_count()) {
        EXPECT_EQ(m, last) << "the caller of Team::run has the overflow set";
        return;
      }
      const IndexRange own = Tangle::ranges(list).of(Member{m, members, barrier}.share(Tangle::kSlabs));
      EXPECT_TRUE(own.begin <= manifold && manifold < own.end) << members << " " << m << " " << manifold;
    });
  }
}
