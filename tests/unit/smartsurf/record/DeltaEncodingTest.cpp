#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "smartsurf/record/Recording.h"
#include "tests/unit/smartsurf/record/SyntheticRun.h"

namespace smartsurf::record {
namespace {

// A run in which one height and one input change per tick.
struct ChangingRun : SyntheticRun {
  static std::vector<float> heights(std::uint64_t tick) {
    std::vector<float> values(24, 1.0f);
    for (std::uint64_t t = 0; t <= tick; ++t) values[(7 * t) % 24] = static_cast<float>(t) + 0.5f;
    return values;
  }
  static std::vector<float> inputs(std::uint64_t tick) {
    std::vector<float> values(48, 0.0f);
    for (std::uint64_t t = 1; t <= tick; ++t) values[(11 * t) % 48] = -static_cast<float>(t);
    return values;
  }

  void record(const std::filesystem::path& path, std::uint64_t ticks) {
    const auto recorder = open_recorder(path, meta, spec);
    for (std::uint64_t t = 0; t < ticks; ++t) {
      const std::vector<float> both = inputs(t);
      const std::span<const float> all(both);
      const scene::ChannelData channels[] = {{"height", 4, 6, 1, all.first(24)},
                                             {"spin", 4, 6, 1, all.last(24)}};
      recorder->record_inputs(channels);
      scene::Snapshot shot = snapshot_at(t, {0, 1});
      shot.height = heights(t);
      recorder->record_frame(shot, spec.objects);
    }
    recorder->close({"done", ticks, 0.0, 0});
  }
};

TEST(DeltaEncoding, ReadsHeightsInAnyOrder) {
  OutputFolder folder;
  ChangingRun run;
  run.record(folder / "run.h5", 700);
  const Recording recording = Recording::open(folder / "run.h5");
  ASSERT_EQ(recording.frames(), 700u);
  ASSERT_TRUE(recording.has_heights());
  for (const std::size_t frame : {0u, 1u, 255u, 256u, 257u, 699u, 3u, 600u, 256u, 0u, 512u, 511u})
    EXPECT_EQ(recording.read_snapshot(frame).height, ChangingRun::heights(frame)) << frame;
}

TEST(DeltaEncoding, KeepsInputsOfUnrecordedTicks) {
  OutputFolder folder;
  ChangingRun run;
  run.spec.record.tick_interval = 7;
  run.record(folder / "run.h5", 100);
  const Recording recording = Recording::open(folder / "run.h5");
  EXPECT_EQ(recording.frames(), 15u);
  ASSERT_EQ(recording.input_tick_count(), 100u);
  for (const std::size_t tick : {0u, 1u, 50u, 99u, 2u}) {
    const std::span<const float> inputs = recording.read_inputs(tick);
    EXPECT_EQ(std::vector<float>(inputs.begin(), inputs.end()), ChangingRun::inputs(tick)) << tick;
  }
  EXPECT_THROW(recording.read_inputs(100), scene::InputError);
}

TEST(DeltaEncoding, KeepsInputsWithoutClose) {
  OutputFolder folder;
  ChangingRun run;
  {
    const auto recorder = open_recorder(folder / "run.h5", run.meta, run.spec);
    for (std::uint64_t t = 0; t < 10; ++t) {
      const std::vector<float> values = ChangingRun::inputs(t);
      const scene::ChannelData channels[] = {{"height", 4, 12, 1, values}};
      recorder->record_inputs(channels);
      recorder->record_frame(run.snapshot_at(t, {0}), run.spec.objects);
    }
  }  // no close()
  const Recording recording = Recording::open(folder / "run.h5");
  EXPECT_FALSE(recording.result());
  EXPECT_EQ(recording.input_tick_count(), 10u);
}

TEST(DeltaEncoding, PreservesSignedZeroAndNaN) {
  OutputFolder folder;
  SyntheticRun run;
  const auto recorder = open_recorder(folder / "run.h5", run.meta, run.spec);
  for (std::uint64_t t = 0; t < 3; ++t) {
    scene::Snapshot shot = run.snapshot_at(t, {0});
    shot.height.assign(24, t == 1 ? -0.0f : 0.0f);
    shot.height[3] = std::nanf("");
    recorder->record_frame(shot, run.spec.objects);
  }
  recorder->close({"done", 3, 0.0, 0});
  const Recording recording = Recording::open(folder / "run.h5");
  EXPECT_FALSE(std::signbit(recording.read_snapshot(0).height[0]));
  EXPECT_TRUE(std::signbit(recording.read_snapshot(1).height[0]));
  EXPECT_TRUE(std::isnan(recording.read_snapshot(2).height[3]));
}

TEST(Recorder, RecordsFirstUserInteraction) {
  OutputFolder folder;
  SyntheticRun run;
  run.meta.driver = "controller";
  run.meta.overrides = {{"count", "3"}, {"speed", "1"}, {"count", "4"}};
  for (const bool touched : {false, true}) {
    const auto recorder = open_recorder(folder / "run.h5", run.meta, run.spec);
    recorder->record_frame(run.snapshot_at(0, {0}), run.spec.objects);
    if (touched) {
      recorder->mark_user_interaction(12);
      recorder->mark_user_interaction(40);
    }
    recorder->close({"done", 0, 0.0, 0});
    const Recording recording = Recording::open(folder / "run.h5");
    EXPECT_EQ(recording.first_interaction_tick(), touched ? std::optional<std::uint64_t>(12) : std::nullopt);
    EXPECT_EQ(recording.meta().driver, "controller");
    EXPECT_FALSE(recording.meta().unsafe);
    ASSERT_EQ(recording.meta().overrides.size(), 2u);
    EXPECT_EQ(recording.meta().overrides[0].value, "4") << "the last of a name wins";
  }
}

}  // namespace
}  // namespace smartsurf::record
