#include "smartsurf/run/TableWatch.h"

#include <gtest/gtest.h>

namespace smartsurf::run {
namespace {

// Cells from -0.5 to 7.5 u along x and to 3.5 u along y.
scene::SurfaceSpec table() {
  scene::SurfaceSpec surface;
  surface.rows = 4;
  surface.columns = 8;
  return surface;
}

scene::Snapshot at(const std::vector<std::array<float, 3>>& positions) {
  scene::Snapshot snapshot;
  snapshot.position = positions;
  for (std::size_t i = 0; i < positions.size(); ++i) snapshot.id.push_back(static_cast<scene::ObjectId>(i));
  return snapshot;
}

std::vector<scene::ObjectId> left(const TableWatch& watch) {
  return {watch.left().begin(), watch.left().end()};
}

using Ids = std::vector<scene::ObjectId>;

TEST(TableWatch, CountsEachObjectWhenItLeavesOverAnyEdgeOrFallsBelow) {
  const std::vector<scene::ObjectSpec> catalogue(5);
  TableWatch watch(table());
  watch.watch(at({{1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}}), catalogue);
  EXPECT_EQ(watch.off(), 0U);
  watch.watch(at({{-0.6F, 1, 1}, {7.6F, 1, 1}, {1, 3.6F, 1}, {1, 1, -0.1F}, {7.4F, 3.4F, 0.1F}}), catalogue);
  EXPECT_EQ(left(watch), (Ids{0, 1, 2, 3}));
  EXPECT_EQ(watch.off(), 4U);
  watch.watch(at({{-0.7F, 1, 1}, {7.7F, 1, 1}, {1, 3.7F, 1}, {1, 1, 1}, {1, 1, 1}}), catalogue);
  EXPECT_EQ(left(watch), Ids{}) << "each leaves once";
  EXPECT_EQ(watch.off(), 3U);
  watch.watch(at({{1, 1, 1}, {9, 9, 1}, {9, 9, 1}, {9, 9, 1}, {1, 1, 1}}), catalogue);
  EXPECT_EQ(left(watch), (Ids{3})) << "it had come back";
  EXPECT_EQ(watch.left_so_far(), 5U);
}

TEST(TableWatch, WhatNeverWasOverTheTableOrIsFixedDoesNotLeave) {
  std::vector<scene::ObjectSpec> catalogue(2);
  catalogue[1].fixed = true;
  TableWatch watch(table());
  watch.watch(at({{20, 1, 1}, {1, 1, 1}}), catalogue);
  watch.watch(at({{30, 1, 1}, {30, 1, 1}}), catalogue);
  EXPECT_EQ(left(watch), Ids{});
  EXPECT_EQ(watch.off(), 2U);
}

TEST(TableWatch, KnowsObjectsThatComeLaterAndForgetsThoseThatAreGone) {
  std::vector<scene::ObjectSpec> catalogue(1);
  TableWatch watch(table());
  watch.watch(at({{1, 1, 1}}), catalogue);
  catalogue.resize(3);
  scene::Snapshot later = at({{2, 2, 1}});
  later.id = {2};
  watch.watch(later, catalogue);
  later.position[0] = {2, 9, 1};
  watch.watch(later, catalogue);
  EXPECT_EQ(left(watch), Ids{2});
}

}  // namespace
}  // namespace smartsurf::run
