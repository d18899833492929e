#include "common/threads/ThreadPool.h"
#include "smartsurf/world/solver/SharedBatches.h"

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <set>

using namespace smartsurf;
using namespace smartsurf::world;

namespace {

constexpr int kSlabs = 12, kRowsOfSlab = 60, kRows = kSlabs * kRowsOfSlab;

// Spheres in a line; each may touch near neighbours and the field. A body's row is its index.
struct Chain {
  BodyStore bodies;
  ContactList pairs, world;
  SlabRanges pair_ranges, world_ranges;
  Chain() {
    std::mt19937 random(5);
    for (int i = 0; i < kRows; ++i) bodies.add(static_cast<scene::ObjectId>(i), {}, {});
    for (int i = 0; i < kRows; ++i) {
      for (const int by : {1, 2, 5, 9})
        if (i + by < kRows && random() % 3 != 0) add(pairs, i, i + by);
      if (random() % 2 == 0) add(world, i, Manifold::kStatic);
      if (i % kRowsOfSlab == kRowsOfSlab - 1) end_slab();
    }
  }
  void end_slab() {
    pair_ranges.first.push_back(static_cast<std::int32_t>(pairs.manifolds.size()));
    world_ranges.first.push_back(static_cast<std::int32_t>(world.manifolds.size()));
  }
  static void add(ContactList& list, int a, int b) {
    list.manifolds.push_back({a, b, static_cast<std::int32_t>(list.contacts.size()), 1});
    list.contacts.emplace_back();
  }
};

using Rows = std::set<int>;
// Rows of the bodies in those batches.
Rows rows_of(const ConstraintGraph& graph, std::span<const BatchRange> runs) {
  Rows rows;
  for (const BatchRange& run : runs)
    for (int o = run.first; o < run.first + run.count; ++o) {
      const ContactBatch& batch = graph.batch(o);
      rows.insert(batch.a, batch.a + kLanes);
      rows.insert(batch.b, batch.b + kLanes);
    }
  return rows;
}

int count_of(std::span<const BatchRange> runs) {
  int count = 0;
  for (const BatchRange& run : runs) count += run.count;
  return count;
}

struct Shared {
  Chain chain;
  ConstraintGraph graph;
  SharedBatches shared_batches;
  explicit Shared(int members) {
    common::ThreadPool pool(members, 0.0);
    Team team(&pool);
    team.run(true, [this](const Member& member) { work(member); });
  }
  void work(const Member& member) {
    const IndexRange slabs = member.share(kSlabs);
    const IndexRange own_rows{slabs.begin * kRowsOfSlab, slabs.end * kRowsOfSlab};
    const ConstraintGraph::Input in{chain.bodies, chain.pairs, chain.world, chain.pair_ranges,
                                    chain.world_ranges};
    graph.build(in, slabs, member);
    member.single([&] {
      graph.pack_batches(in);
      shared_batches.resize(kRows, member.member_count);
    });
    shared_batches.clear_marks(own_rows);
    member.arrive_and_wait();
    for (const BatchRange& run : graph.own_batches(member))
      for (int o = run.first; o < run.first + run.count; ++o)
        shared_batches.mark_foreign_rows(set_bodies(o, run.kind), own_rows);
    member.arrive_and_wait();
    shared_batches.split_batches(graph, member);
    member.wait();
  }
  // Sets the body rows of a batch; unused lanes repeat lane 0.
  const ContactBatch& set_bodies(int o, ContactKind kind) {
    ContactBatch& batch = graph.reset_batch(o);
    for (int lane = 0; lane < kLanes; ++lane) {
      const ContactList& list = kind == kSphereStatic ? chain.world : chain.pairs;
      const Manifold& m =
          list.manifolds[static_cast<std::size_t>(graph.manifold(o, lane < batch.lane_count ? lane : 0))];
      batch.a[lane] = m.a;
      batch.b[lane] = m.b >= 0 ? m.b : m.a;
    }
    return batch;
  }
};

}  // namespace

TEST(SharedBatches, OwnBatchesShareNoBodiesWithOtherMembers) {
  for (const int members : {2, 3}) {
    const Shared s(members);
    Barrier none(members);
    std::map<int, Rows> moved, own;  // indexed by member
    int all = 0, shared = 0;
    for (int m = 0; m < members; ++m) {
      const Member member{m, members, none};
      for (int c = 0; c <= s.graph.colour_count(); ++c) {
        moved[m].merge(rows_of(s.graph, s.graph.own_batches(member, c)));
        own[m].merge(rows_of(s.graph, s.shared_batches.own(member, c)));
        all += count_of(s.shared_batches.own(member, c)) + count_of(s.shared_batches.shared(member, c));
        shared += count_of(s.shared_batches.shared(member, c));
        EXPECT_EQ(count_of(s.shared_batches.own(member, c)) + count_of(s.shared_batches.shared(member, c)),
                  count_of(s.graph.own_batches(member, c)));
      }
    }
    EXPECT_EQ(all, s.graph.batch_count());
    EXPECT_GT(shared, 0);
    EXPECT_LT(shared, all / 4) << "most batches belong to one member only";
    for (int m = 0; m < members; ++m)
      for (int other = 0; other < members; ++other)
        for (const int row : own[m])
          EXPECT_TRUE(other == m || !moved[other].contains(row)) << m << " " << other << " " << row;
  }
}

TEST(SharedBatches, SingleMemberHasNoSharedBatches) {
  const Shared s(1);
  Barrier none(1);
  for (int c = 0; c <= s.graph.colour_count(); ++c)
    EXPECT_TRUE(s.shared_batches.shared(Member{0, 1, none}, c).empty());
}
