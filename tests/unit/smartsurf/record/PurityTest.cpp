#include "smartsurf/record/Purity.h"

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

scene::ObjectSpec sphere(double radius, const std::string& label = "") {
  scene::ObjectSpec object;
  object.radius = radius;
  object.label = label;
  return object;
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

double purity_of(const std::vector<scene::ObjectSpec>& catalogue, const std::vector<float>& x,
                 float y = 5.0f) {
  PurityMeter meter(surface());
  meter.add(snapshot_at(0.0, x, y), catalogue);
  return meter.value();
}

using Classes = std::vector<SizeClass>;
constexpr SizeClass kSmall = SizeClass::kSmall, kLarge = SizeClass::kLarge, kNone = SizeClass::kNone;

TEST(ClassifyObjects, ByLabelOrBySize) {
  EXPECT_EQ(classify_objects({sphere(4, "a"), sphere(2, "b"), sphere(4, "a")}),
            (Classes{kLarge, kSmall, kLarge}));
  EXPECT_EQ(classify_objects({sphere(1, "b"), sphere(1, "a")}),
            (Classes{kLarge, kSmall}));  // equal means: alphabetical
  EXPECT_EQ(classify_objects({sphere(9, "a"), sphere(1, "a"), sphere(2, "b")}),
            (Classes{kLarge, kLarge, kSmall}));  // the mean size of a label decides
  EXPECT_EQ(classify_objects({sphere(4, "a"), sphere(2, "b"), sphere(9)}), (Classes{kLarge, kSmall, kNone}));
  EXPECT_EQ(classify_objects({sphere(4), sphere(2), sphere(3.1)}), (Classes{kLarge, kSmall, kLarge}));
  EXPECT_EQ(classify_objects({sphere(1, "a"), sphere(2, "b"), sphere(9, "c")}),
            (Classes{kSmall, kSmall, kLarge}));
  EXPECT_EQ(classify_objects({sphere(3, "a"), sphere(3, "a")}), (Classes{kNone, kNone}));
  scene::ObjectSpec wall = sphere(50, "wall");
  wall.fixed = true;
  EXPECT_EQ(classify_objects({sphere(4), sphere(2), wall}), (Classes{kLarge, kSmall, kNone}));
  EXPECT_TRUE(classify_objects({}).empty());
}

TEST(Purity, ShareOfObjectsInOwnHalf) {
  const std::vector<scene::ObjectSpec> four{sphere(1), sphere(1), sphere(2), sphere(2)};
  EXPECT_EQ(purity_of(four, {1, 4.4f, 4.6f, 9}), 1.0);
  EXPECT_EQ(purity_of(four, {9, 8, 1, 2}), 0.0);
  EXPECT_EQ(purity_of(four, {1, 8, 1, 9}), 0.5);
  EXPECT_EQ(purity_of(four, {4.5f, 1, 4.5f, 9}), 0.5);   // on the centre line
  EXPECT_EQ(purity_of(four, {-0.6f, 1, 8, 9.6f}), 0.5);  // off the surface, west and east
  EXPECT_EQ(purity_of(four, {1, 1, 8, 8}, 9.6f), 0.0);   // off the surface, north
  EXPECT_EQ(purity_of(four, {1, NAN, 1, NAN}), 0.5);     // removed objects do not count
  EXPECT_TRUE(std::isnan(purity_of(four, {NAN, NAN, NAN, NAN})));
  EXPECT_TRUE(std::isnan(purity_of({sphere(1), sphere(1)}, {1, 2})));
}

TEST(Purity, ObjectsOverEmptyCellsAreOffSurface) {
  scene::SurfaceSpec corner_gone = surface();
  for (int row = 0; row < 10; ++row)
    for (int column = 0; column < 10; ++column)
      corner_gone.actuator_of_cell.push_back(row >= 5 && column < 5 ? scene::kEmptyCell : std::int8_t{0});
  const std::vector<scene::ObjectSpec> two{sphere(1), sphere(2)};
  PurityMeter north(corner_gone), south(corner_gone);
  north.add(snapshot_at(0.0, {1, 8}, 8.0f), two);
  EXPECT_EQ(north.value(), 1.0);
  south.add(snapshot_at(0.0, {1, 8}, 1.0f), two);
  EXPECT_EQ(south.value(), 0.5) << "the small object lies over an empty cell";
}

TEST(PurityMeter, ReclassifiesWhenObjectsAreAdded) {
  PurityMeter meter(surface());
  std::vector<scene::ObjectSpec> catalogue{sphere(1)};
  meter.add(snapshot_at(0.0, {1}), catalogue);
  EXPECT_TRUE(std::isnan(meter.value()));
  catalogue.push_back(sphere(2));
  meter.add(snapshot_at(0.1, {1, 2}), catalogue);
  EXPECT_EQ(meter.value(), 0.5);
}

// Runs the meter at 10 Hz with one small object in the west and one large object, which is east within the
// intervals [high_from_to[i], high_from_to[i + 1]) and west otherwise. Times in seconds.
std::optional<double> sorted_at(const std::vector<double>& high_from_to, double end_s) {
  PurityMeter meter(surface());
  for (int tick = 0; tick <= std::lround(end_s * 10.0); ++tick) {
    bool high = false;
    for (std::size_t i = 0; i + 1 < high_from_to.size(); i += 2)
      high |= tick >= std::lround(high_from_to[i] * 10.0) && tick < std::lround(high_from_to[i + 1] * 10.0);
    meter.add(snapshot_at(tick * 0.1, {1.0f, high ? 8.0f : 2.0f}), {sphere(1), sphere(2)});
  }
  return meter.sorted_at();
}

TEST(PurityMeter, SortedAfterFiveSeconds) {
  EXPECT_DOUBLE_EQ(sorted_at({2.0, 99.0}, 20.0).value(), 2.0);
  EXPECT_DOUBLE_EQ(sorted_at({2.0, 99.0}, 7.0).value(), 2.0);             // exactly 5 s
  EXPECT_FALSE(sorted_at({2.0, 99.0}, 6.9));                              // less than 5 s
  EXPECT_FALSE(sorted_at({}, 20.0));                                      // never sorted
  EXPECT_FALSE(sorted_at({1.0, 5.9, 6.0, 10.9}, 20.0));                   // two intervals, both too short
  EXPECT_DOUBLE_EQ(sorted_at({1.0, 5.9, 6.0, 99.0}, 20.0).value(), 6.0);  // the hold restarts
  EXPECT_DOUBLE_EQ(sorted_at({1.0, 8.0}, 20.0).value(), 1.0);  // sorted_at keeps the first interval
}

TEST(PurityMeter, ThresholdIs95Percent) {
  std::vector<scene::ObjectSpec> catalogue;
  std::vector<float> x;
  for (int i = 0; i < 20; ++i) {
    catalogue.push_back(sphere(i < 10 ? 1 : 2));
    x.push_back(i < 10 ? 1.0f : 8.0f);
  }
  const auto sorted = [&] {
    PurityMeter meter(surface());
    for (int tick = 0; tick <= 60; ++tick) meter.add(snapshot_at(tick * 0.1, x), catalogue);
    return meter.sorted_at().has_value();
  };
  x[0] = 8.0f;
  EXPECT_TRUE(sorted());  // 19 of 20 = 0.95
  x[1] = 8.0f;
  EXPECT_FALSE(sorted());
}

TEST(Purity, RecordingMatchesMeter) {
  const OutputFolder out;
  SyntheticRun run;
  run.spec.surface = surface();
  run.spec.objects = {sphere(1, "s"), sphere(2, "l"), sphere(2, "l")};
  PurityMeter meter(surface());
  std::vector<double> expected;
  const auto recorder = Recorder::open(out / "run.h5", run.meta, run.spec);
  for (int tick = 0; tick < 200; ++tick) {
    scene::Snapshot shot = snapshot_at(tick * 0.1, {1.0f, tick < 30 ? 2.0f : 7.0f, tick < 100 ? NAN : 8.0f});
    shot.height.assign(static_cast<std::size_t>(surface().cell_count()), 0.0f);
    recorder->record_frame(shot, run.spec.objects);
    meter.add(shot, run.spec.objects);
    expected.push_back(meter.value());
  }
  recorder->close({});
  const Recording recording = Recording::open(out / "run.h5");
  const PuritySeries read = compute_purity(recording);
  EXPECT_EQ(read.values, expected);
  EXPECT_EQ(read.times, recording.times());
  EXPECT_EQ(read.sorted_at, meter.sorted_at());
  EXPECT_DOUBLE_EQ(read.sorted_at.value(), 3.0);
}

TEST(Purity, RequiresTwoClasses) {
  const OutputFolder out;
  SyntheticRun run;
  run.spec.objects = {sphere(1, "s"), sphere(1, "s")};
  Recorder::open(out / "run.h5", run.meta, run.spec)->close({});
  EXPECT_THROW(compute_purity(Recording::open(out / "run.h5")), scene::InputError);
}

}  // namespace
}  // namespace smartsurf::record
