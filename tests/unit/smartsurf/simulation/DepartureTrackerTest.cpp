#include "smartsurf/simulation/DepartureTracker.h"

#include <gtest/gtest.h>

namespace smartsurf::simulation {
namespace {

// A surface that spans −0.5 to 7.5 u in x and −0.5 to 3.5 u in y.
scene::SurfaceSpec table() {
  scene::SurfaceSpec surface;
  surface.rows = 4;
  surface.columns = 8;
  return surface;
}

scene::Snapshot snapshot_at(const std::vector<std::array<float, 3>>& positions) {
  scene::Snapshot snapshot;
  snapshot.position = positions;
  for (std::size_t i = 0; i < positions.size(); ++i) snapshot.id.push_back(static_cast<scene::ObjectId>(i));
  return snapshot;
}

std::vector<scene::ObjectId> departed_ids(const DepartureTracker& tracker) {
  return {tracker.departed().begin(), tracker.departed().end()};
}

using Ids = std::vector<scene::ObjectId>;

TEST(DepartureTracker, DetectsDepartureOverEdgesAndBelow) {
  const std::vector<scene::ObjectSpec> catalogue(5);
  DepartureTracker watch(table());
  watch.update(snapshot_at({{1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}}), catalogue);
  EXPECT_EQ(watch.off_table_count(), 0U);
  watch.update(snapshot_at({{-0.6F, 1, 1}, {7.6F, 1, 1}, {1, 3.6F, 1}, {1, 1, -0.1F}, {7.4F, 3.4F, 0.1F}}),
               catalogue);
  EXPECT_EQ(departed_ids(watch), (Ids{0, 1, 2, 3}));
  EXPECT_EQ(watch.off_table_count(), 4U);
  watch.update(snapshot_at({{-0.7F, 1, 1}, {7.7F, 1, 1}, {1, 3.7F, 1}, {1, 1, 1}, {1, 1, 1}}), catalogue);
  EXPECT_EQ(departed_ids(watch), Ids{}) << "each departure counts once";
  EXPECT_EQ(watch.off_table_count(), 3U);
  watch.update(snapshot_at({{1, 1, 1}, {9, 9, 1}, {9, 9, 1}, {9, 9, 1}, {1, 1, 1}}), catalogue);
  EXPECT_EQ(departed_ids(watch), (Ids{3})) << "it had come back";
  EXPECT_EQ(watch.total_departures(), 5U);
}

TEST(DepartureTracker, IgnoresFixedObjectsAndObjectsNeverOnTable) {
  std::vector<scene::ObjectSpec> catalogue(2);
  catalogue[1].fixed = true;
  DepartureTracker watch(table());
  watch.update(snapshot_at({{20, 1, 1}, {1, 1, 1}}), catalogue);
  watch.update(snapshot_at({{30, 1, 1}, {30, 1, 1}}), catalogue);
  EXPECT_EQ(departed_ids(watch), Ids{});
  EXPECT_EQ(watch.off_table_count(), 2U);
}

TEST(DepartureTracker, HandlesAddedAndRemovedObjects) {
  std::vector<scene::ObjectSpec> catalogue(1);
  DepartureTracker watch(table());
  watch.update(snapshot_at({{1, 1, 1}}), catalogue);
  catalogue.resize(3);
  scene::Snapshot later = snapshot_at({{2, 2, 1}});
  later.id = {2};
  watch.update(later, catalogue);
  later.position[0] = {2, 9, 1};
  watch.update(later, catalogue);
  EXPECT_EQ(departed_ids(watch), Ids{2});
}

}  // namespace
}  // namespace smartsurf::simulation
