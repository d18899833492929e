#include "smartsurf/record/LegacyPurity.h"

#include <gtest/gtest.h>

#include <cmath>

#include "smartsurf/record/Recording.h"
#include "tests/unit/smartsurf/record/SyntheticRun.h"

namespace smartsurf::record {
namespace {

// 10 × 10 cells of pitch 1: the outline spans −0.5 to 9.5, the centre line is x = 4.5.
scene::SurfaceSpec surface() {
  scene::SurfaceSpec s;
  s.rows = s.columns = 10;
  return s;
}

scene::Snapshot snapshot_at(double time_s, const std::vector<float>& x, float y = 5.0f) {
  scene::Snapshot shot;
  shot.tick = static_cast<std::uint64_t>(std::lround(time_s * 10.0));
  shot.time_s = time_s;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (std::isnan(x[i])) continue;
    shot.id.push_back(static_cast<scene::ObjectId>(i));
    shot.position.push_back({x[i], y, 1.0f});
    shot.orientation.push_back({0, 0, 0, 1});
    shot.velocity.push_back({0, 0, 0});
    shot.angular_velocity.push_back({0, 0, 0});
  }
  return shot;
}

// A recording, as an old version made it, with one frame for each row of x; NaN: the object does not exist.
Recording record_positions(const OutputFolder& out, const scene::SurfaceSpec& table,
                           const std::vector<scene::ObjectSpec>& objects,
                           const std::vector<std::vector<float>>& frames, float y = 5.0f) {
  SyntheticRun run;
  run.spec.surface = table;
  run.spec.objects = objects;
  run.meta.declares_success.reset();
  const auto recorder = open_recorder(out / "run.h5", run.meta, run.spec);
  for (std::size_t tick = 0; tick < frames.size(); ++tick) {
    scene::Snapshot shot = snapshot_at(0.1 * static_cast<double>(tick), frames[tick], y);
    shot.height.assign(table.cell_count(), 0.0f);
    recorder->record_frame(shot, objects);
  }
  recorder->close({});
  return Recording::open(out / "run.h5");
}

double purity_of(const std::vector<scene::ObjectSpec>& objects, const std::vector<float>& x, float y = 5.0f,
                 const scene::SurfaceSpec& table = surface()) {
  const OutputFolder out;
  return record_positions(out, table, objects, {x}, y).read_metric("purity").at(0);
}

TEST(LegacyPurity, ShareOfObjectsInOwnHalf) {
  const std::vector<scene::ObjectSpec> four{sphere(1), sphere(1), sphere(2), sphere(2)};
  EXPECT_EQ(purity_of(four, {1, 4.4f, 4.6f, 9}), 1.0);
  EXPECT_EQ(purity_of(four, {9, 8, 1, 2}), 0.0);
  EXPECT_EQ(purity_of(four, {1, 8, 1, 9}), 0.5);
  EXPECT_EQ(purity_of(four, {4.5f, 1, 4.5f, 9}), 0.5);   // on the centre line
  EXPECT_EQ(purity_of(four, {-0.6f, 1, 8, 9.6f}), 0.5);  // off the surface, west and east
  EXPECT_EQ(purity_of(four, {1, 1, 8, 8}, 9.6f), 0.0);   // off the surface, north
  EXPECT_EQ(purity_of(four, {1, NAN, 1, NAN}), 0.5);     // removed objects do not count
  EXPECT_TRUE(std::isnan(purity_of(four, {NAN, NAN, NAN, NAN})));
}

TEST(LegacyPurity, ObjectsOverEmptyCellsAreOffSurface) {
  scene::SurfaceSpec corner_gone = surface();
  for (int row = 0; row < 10; ++row)
    for (int column = 0; column < 10; ++column)
      corner_gone.actuator_of_cell.push_back(row >= 5 && column < 5 ? scene::kEmptyCell : std::int8_t{0});
  const std::vector<scene::ObjectSpec> two{sphere(1), sphere(2)};
  EXPECT_EQ(purity_of(two, {1, 8}, 8.0f, corner_gone), 1.0);
  EXPECT_EQ(purity_of(two, {1, 8}, 1.0f, corner_gone), 0.5) << "the small object lies over an empty cell";
}

// Records 10 Hz with one small object in the west and one large object, which is east within the intervals
// [high_from_to[i], high_from_to[i + 1]) and west otherwise. Times in seconds.
std::optional<double> sorted_at(const std::vector<double>& high_from_to, double end_s) {
  std::vector<std::vector<float>> frames;
  for (int tick = 0; tick <= std::lround(end_s * 10.0); ++tick) {
    bool high = false;
    for (std::size_t i = 0; i + 1 < high_from_to.size(); i += 2)
      high |= tick >= std::lround(high_from_to[i] * 10.0) && tick < std::lround(high_from_to[i + 1] * 10.0);
    frames.push_back({1.0f, high ? 8.0f : 2.0f});
  }
  const OutputFolder out;
  const Recording recording = record_positions(out, surface(), {sphere(1), sphere(2)}, frames);
  EXPECT_EQ(recording.success(), recording.success_s().has_value());
  return recording.success_s();
}

TEST(LegacyPurity, SortedAfterFiveSeconds) {
  EXPECT_DOUBLE_EQ(sorted_at({2.0, 99.0}, 20.0).value(), 2.0);
  EXPECT_DOUBLE_EQ(sorted_at({2.0, 99.0}, 7.0).value(), 2.0);             // exactly 5 s
  EXPECT_FALSE(sorted_at({2.0, 99.0}, 6.9));                              // less than 5 s
  EXPECT_FALSE(sorted_at({}, 20.0));                                      // never sorted
  EXPECT_FALSE(sorted_at({1.0, 5.9, 6.0, 10.9}, 20.0));                   // two intervals, both too short
  EXPECT_DOUBLE_EQ(sorted_at({1.0, 5.9, 6.0, 99.0}, 20.0).value(), 6.0);  // the hold restarts
  EXPECT_DOUBLE_EQ(sorted_at({1.0, 8.0}, 20.0).value(), 1.0);             // the first interval counts
}

TEST(LegacyPurity, ThresholdIs95Percent) {
  std::vector<scene::ObjectSpec> objects;
  std::vector<float> x;
  for (int i = 0; i < 20; ++i) {
    objects.push_back(sphere(i < 10 ? 1 : 2));
    x.push_back(i < 10 ? 1.0f : 8.0f);
  }
  const auto sorted = [&] {
    const OutputFolder out;
    return record_positions(out, surface(), objects, std::vector(61, x)).success();
  };
  x[0] = 8.0f;
  EXPECT_EQ(sorted(), true);  // 19 of 20 = 0.95
  x[1] = 8.0f;
  EXPECT_EQ(sorted(), false);
}

TEST(LegacyPurity, OnlyInOldRecordingsOfTwoClasses) {
  const OutputFolder out;
  const Recording old = record_positions(out, surface(), {sphere(1), sphere(2)}, {{1, 8}});
  EXPECT_EQ(old.metric_names(), std::vector<std::string>{"purity"});
  EXPECT_NE(describe_recording(old).find("purity: 1 at the start, 1 at the end"), std::string::npos);
  const Recording alike = record_positions(out, surface(), {sphere(1), sphere(1)}, {{1, 8}});
  EXPECT_TRUE(alike.metric_names().empty());
  EXPECT_FALSE(alike.success());
  SyntheticRun run;  // of today, with two labels
  const auto recorder = open_recorder(out / "new.h5", run.meta, run.spec);
  recorder->record_frame(run.snapshot_at(0, {0, 1, 2}), run.spec.objects);
  recorder->close({});
  const Recording present = Recording::open(out / "new.h5");
  EXPECT_TRUE(present.metric_names().empty());
  EXPECT_EQ(describe_recording(present).find("purity"), std::string::npos);
}

}  // namespace
}  // namespace smartsurf::record
