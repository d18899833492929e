#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "smartsurf/record/OpenRecorder.h"
#include "tests/unit/smartsurf/record/SyntheticRun.h"

namespace smartsurf::record {
namespace {

TEST(CsvRecorder, WritesOneLinePerObjectAndFrame) {
  const OutputFolder out;
  SyntheticRun run;
  run.spec.objects[1].label = "says \"big\", loud";
  const auto recorder = open_recorder(out / "run.csv", run.meta, run.spec);
  recorder->record_frame(run.snapshot_at(0, {0, 1}), run.spec.objects);
  recorder->record_frame(run.snapshot_at(3, {2}), run.spec.objects);
  recorder->record_frame(run.snapshot_at(4, {}), run.spec.objects);
  recorder->close({});
  EXPECT_EQ(content(out / "run.csv"),
            "tick,time,id,label,x,y,z,qx,qy,qz,qw\n"
            "0,0,0,small,0,2,3,0,0.6,0,0.8\n"
            "0,0,1,\"says \"\"big\"\", loud\",1,2,3,0,0.6,0,0.8\n"
            "3,0.05,2,,2.3,2,3,0,0.6,0,0.8\n");
}

TEST(CsvRecorder, NumbersRoundTrip) {
  const OutputFolder out;
  const SyntheticRun run;
  scene::Snapshot shot = run.snapshot_at(1, {0});
  shot.position[0] = {1.0f / 3.0f, -1e-20f, 123456.789f};
  const auto recorder = open_recorder(out / "run.csv", run.meta, run.spec);
  recorder->record_frame(shot, run.spec.objects);
  recorder->close({});
  std::istringstream lines(content(out / "run.csv"));
  std::string field;
  std::getline(lines, field);
  for (int i = 0; i < 2; ++i) std::getline(lines, field, ',');
  EXPECT_EQ(std::stod(field), shot.time_s);
  for (int i = 0; i < 2; ++i) std::getline(lines, field, ',');
  for (const float expected : shot.position[0]) {
    std::getline(lines, field, ',');
    EXPECT_EQ(std::stof(field), expected);
  }
}

TEST(CsvRecorder, WritesLongRunsAtEveryNthTick) {
  const OutputFolder out;
  SyntheticRun run;
  run.spec.record.tick_interval = 2;
  const auto recorder = open_recorder(out / "run.csv", run.meta, run.spec);
  for (std::uint64_t t = 0; t < 10000; ++t)
    recorder->record_frame(run.snapshot_at(t, {0, 1, 2}), run.spec.objects);
  recorder->close({});
  std::istringstream lines(content(out / "run.csv"));
  std::string line;
  std::getline(lines, line);
  for (int i = 0; i < 15000; ++i) {
    ASSERT_TRUE(std::getline(lines, line));
    ASSERT_EQ(line.substr(0, line.find(',')), std::to_string(i / 3 * 2));
    ASSERT_EQ(std::count(line.begin(), line.end(), ','), 10);
  }
  EXPECT_FALSE(std::getline(lines, line));
}

}  // namespace
}  // namespace smartsurf::record
