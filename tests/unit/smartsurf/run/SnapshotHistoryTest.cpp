#include "smartsurf/run/display/SnapshotHistory.h"

#include <gtest/gtest.h>

namespace smartsurf::run {
namespace {

scene::Snapshot state(std::uint64_t tick) {
  scene::Snapshot s;
  s.tick = tick;
  s.height.assign(1000, static_cast<float>(tick));
  return s;
}

TEST(SnapshotHistory, KeepsLatestSnapshotsWithinLimit) {
  SnapshotHistory past(50'000);  // about eleven snapshots
  for (std::uint64_t tick = 0; tick < 5; ++tick) past.add(state(tick));
  ASSERT_EQ(past.size(), 5u);
  EXPECT_EQ(past.at(0).tick, 0u);
  for (std::uint64_t tick = 5; tick < 100; ++tick) past.add(state(tick));
  ASSERT_GT(past.size(), 5u);
  ASSERT_LT(past.size(), 13u);
  for (std::size_t i = 0; i < past.size(); ++i) {
    EXPECT_EQ(past.at(i).tick, 100u - past.size() + i);
    EXPECT_EQ(past.at(i).height[0], static_cast<float>(past.at(i).tick));
  }
  past.clear();
  EXPECT_EQ(past.size(), 0u);
  past.add(state(7));
  EXPECT_EQ(past.at(0).tick, 7u);
}

}  // namespace
}  // namespace smartsurf::run
