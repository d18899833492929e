#include "smartsurf/world/Schedule.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

using namespace smartsurf;
using namespace smartsurf::world;

namespace {

// Spheres and boxes in turn, touching at random.
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
      if (i == j || !used.insert(std::minmax(i, j)).second) continue;  // five bodies touch very many
      add(pairs, std::min(i, j), std::max(i, j), 1 + k % 4);
    }
    for (int i = 0; i < n; i += 2) add(world, i, kField, 1 + i % 5);
  }
  static void add(ContactList& list, int a, int b, int count) {
    list.manifolds.push_back({a, b, static_cast<std::int32_t>(list.contacts.size()), count});
    list.contacts.resize(list.contacts.size() + static_cast<std::size_t>(count));
  }
};

}  // namespace

TEST(Schedule, NoBodyIsTwiceInAColourAndNoManifoldIsLeftOut) {
  const Tangle t(200, 600);
  Schedule schedule;
  schedule.build(t.bodies, t.pairs, t.world);
  std::multiset<int> scheduled;
  bool any_in_order = false;
  for (const auto& colour : schedule.colours()) {
    std::multiset<int> bodies;
    for (const OctetRun& run : {colour.round, colour.any})
      for (int o = run.first; o < run.first + run.count; ++o) {
        const Octet& octet = schedule.octet(o);
        EXPECT_LE(octet.count, colour.in_order ? 1 : kLanes);
        for (int lane = 0; lane < octet.count; ++lane) {
          scheduled.insert(schedule.manifold(o, lane));
          const Manifold& m = t.pairs.manifolds[static_cast<std::size_t>(schedule.manifold(o, lane))];
          EXPECT_EQ(m.a, octet.a[lane]);
          EXPECT_EQ(m.b, octet.b[lane]);
          EXPECT_LE(m.count, octet.points);
          if (!colour.in_order) bodies.insert({m.a, m.b});
        }
      }
    for (const int b : bodies) EXPECT_EQ(bodies.count(b), 1u);
    any_in_order |= colour.in_order;
  }
  EXPECT_TRUE(any_in_order) << "the test must reach the list of what finds no colour";
  EXPECT_EQ(scheduled.size(), t.pairs.manifolds.size());
  EXPECT_EQ(std::set<int>(scheduled.begin(), scheduled.end()).size(), scheduled.size());
}

TEST(Schedule, EveryBodyMeetsTheWorldOnce) {
  const Tangle t(200, 600);
  Schedule schedule;
  schedule.build(t.bodies, t.pairs, t.world);
  std::set<int> bodies;
  for (const OctetRun& run : {schedule.round_world(), schedule.any_world()})
    for (int o = run.first; o < run.first + run.count; ++o)
      for (int lane = 0; lane < schedule.octet(o).count; ++lane)
        EXPECT_TRUE(bodies.insert(schedule.octet(o).a[lane]).second);
  EXPECT_EQ(bodies.size(), t.world.manifolds.size());
}

TEST(Schedule, SharesAreWholeAndAsHeavyAsEachOther) {
  const Tangle t(200, 600);
  Schedule schedule;
  schedule.build(t.bodies, t.pairs, t.world);
  auto points = [&](int begin, int end) {
    int sum = 0;
    for (int o = begin; o < end; ++o) sum += schedule.octet(o).points;
    return sum;
  };
  for (const OctetRun& run : {schedule.any_world(), OctetRun{0, schedule.octets()}, OctetRun{3, 0}})
    for (const int members : {1, 2, 3, 7}) {
      int next = run.first;
      for (int member = 0; member < members; ++member) {
        const Range share = schedule.share(run, member, members);
        EXPECT_EQ(share.begin, next);
        next = share.end;
        const int fair = points(run.first, run.first + run.count) / members;
        EXPECT_NEAR(points(share.begin, share.end), fair, 6) << member << " of " << members;
      }
      EXPECT_EQ(next, run.first + run.count);
    }
}
