#include "smartsurf/record/OpenRecorder.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numeric>
#include <random>
#include <set>

#include "smartsurf/record/PendingFile.h"
#include "smartsurf/record/Recording.h"
#include "smartsurf/scene/KindRegistry.h"
#include "tests/unit/common/SanitizedCases.h"
#include "tests/unit/smartsurf/record/SyntheticRun.h"

namespace smartsurf::record {
namespace {

using scene::InputError;

std::string error_of(const std::filesystem::path& path, const SyntheticRun& run) {
  try {
    open_recorder(path, run.meta, run.spec);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

void record_ticks(Recorder& recorder, const SyntheticRun& run, std::uint64_t ticks) {
  for (std::uint64_t t = 0; t < ticks; ++t)
    recorder.record_frame(run.snapshot_at(t, {0, 1, 2}), run.spec.objects);
}

TEST(Recorder, WritesEveryFrame) {
  const OutputFolder out;
  const SyntheticRun run;
  const auto recorder = open_recorder(out / "run.h5", run.meta, run.spec);
  record_ticks(*recorder, run, 150);  // two full buffers and a partial one
  recorder->close({.outcome = "done", .ticks = 150, .simulated_s = 2.5, .state_hash = 77});

  const Recording recording = Recording::open(out / "run.h5");
  ASSERT_EQ(recording.frames(), 150u);
  for (const std::uint64_t t : {0u, 63u, 64u, 149u}) {
    const scene::Snapshot expected = run.snapshot_at(t, {0, 1, 2}), read = recording.read_snapshot(t);
    EXPECT_EQ(read.tick, expected.tick);
    EXPECT_EQ(read.time_s, expected.time_s);
    EXPECT_EQ(read.state_hash, expected.state_hash);
    EXPECT_EQ(read.contact_count, expected.contact_count);
    EXPECT_EQ(read.id, expected.id);
    EXPECT_EQ(read.position, expected.position);
    EXPECT_EQ(read.orientation, expected.orientation);
    EXPECT_EQ(read.velocity, expected.velocity);
    EXPECT_EQ(read.angular_velocity, expected.angular_velocity);
    EXPECT_EQ(read.height, expected.height);
  }
}

TEST(Recorder, WritesMetadata) {
  const OutputFolder out;
  SyntheticRun run;
  run.meta.program_text = std::string(300000, 'p');  // above the limit of fixed-length HDF5 attributes
  run.spec.world.unit = scene::find_physical_unit("mm");
  open_recorder(out / "run.hdf5", run.meta, run.spec)
      ->close({.outcome = "stopped", .ticks = 9, .simulated_s = 0.15, .state_hash = 0xABCDEF0123456789u});

  const Recording recording = Recording::open(out / "run.hdf5");
  EXPECT_EQ(recording.meta().command_line, run.meta.command_line);
  EXPECT_EQ(recording.meta().mode, "time-step");
  EXPECT_EQ(recording.meta().program_file, "sort.aps");
  EXPECT_EQ(recording.meta().program_text, run.meta.program_text);
  EXPECT_EQ(recording.meta().versions.size(), 3u);  // bullet, plus smartsurf and hdf5
  EXPECT_EQ(recording.spec().file, run.spec.file);
  EXPECT_EQ(recording.spec().source, run.spec.source);
  EXPECT_EQ(recording.spec().world.seed, run.spec.world.seed);
  EXPECT_EQ(recording.spec().world.dt_s, run.spec.world.dt_s);
  EXPECT_EQ(recording.spec().world.gravity, run.spec.world.gravity);
  EXPECT_EQ(recording.spec().world.unit->metres, 0.001);
  EXPECT_EQ(recording.spec().surface.rows, 4);
  EXPECT_EQ(recording.spec().surface.columns, 6);
  EXPECT_EQ(recording.spec().surface.pin.top_x, 1.5);
  EXPECT_EQ(recording.spec().surface.border_height, 5.0);
  ASSERT_EQ(recording.spec().options.size(), 2u);
  EXPECT_EQ(recording.spec().options[0].value, "3");
  ASSERT_TRUE(recording.result());
  EXPECT_EQ(recording.result()->outcome, "stopped");
  EXPECT_EQ(recording.result()->ticks, 9u);
  EXPECT_EQ(recording.result()->state_hash, 0xABCDEF0123456789u);
}

TEST(Recorder, WritesCatalogueWithInitialState) {
  const OutputFolder out;
  const SyntheticRun run;
  open_recorder(out / "run.h5", run.meta, run.spec)->close({});
  const std::vector<scene::ObjectSpec> read = Recording::open(out / "run.h5").spec().objects;
  ASSERT_EQ(read.size(), 3u);
  EXPECT_EQ(read[0].label, "small");
  EXPECT_EQ(read[0].radius, 2.0);
  EXPECT_DOUBLE_EQ(*read[0].mass, 2.0 * run.spec.objects[0].volume());  // density of steel × volume
  EXPECT_EQ(read[1].shape, scene::ShapeKind::kCylinder);
  EXPECT_EQ(read[1].radius, 4.0);
  EXPECT_EQ(read[1].height, 3.0);
  EXPECT_EQ(read[2].shape, scene::ShapeKind::kBox);
  EXPECT_EQ(read[2].size, Eigen::Vector3d(1.0, 2.0, 3.0));
  EXPECT_EQ(read[2].label, "");
  EXPECT_EQ(read[2].position, Eigen::Vector3d(3.0, 2.0, 8.0));
  EXPECT_EQ(read[2].velocity, Eigen::Vector3d(0.0, 0.25, 0.0));
  EXPECT_EQ(read[2].colour.g, 0.25f);
}

TEST(Recorder, MissingObjectsAreNaN) {
  const OutputFolder out;
  SyntheticRun run;
  const auto recorder = open_recorder(out / "run.h5", run.meta, run.spec);
  for (std::uint64_t t = 0; t < 200; ++t) {
    if (t == 70) run.add(scene::ShapeKind::kSphere, "late", 1.0);
    // Object 0 is removed and object 3 added at tick 70.
    std::vector<scene::ObjectId> live =
        t < 70 ? std::vector<scene::ObjectId>{0, 1, 2} : std::vector<scene::ObjectId>{1, 2, 3};
    if (t >= 140) live = {3};
    recorder->record_frame(run.snapshot_at(t, live), run.spec.objects);
  }
  recorder->close({});

  const Recording recording = Recording::open(out / "run.h5");
  ASSERT_EQ(recording.spec().objects.size(), 4u);
  EXPECT_EQ(recording.spec().objects[3].label, "late");
  const std::vector<float> p = recording.read_positions(0, 200);
  const auto x = [&](std::size_t frame, std::size_t id) { return p[3 * (4 * frame + id)]; };
  for (std::size_t t = 0; t < 200; ++t) {
    EXPECT_EQ(std::isnan(x(t, 0)), t >= 70) << t;
    EXPECT_EQ(std::isnan(x(t, 2)), t >= 140) << t;
    EXPECT_EQ(std::isnan(x(t, 3)), t < 70) << t;
  }
  const std::vector<float> w = recording.read_angular_velocities(0, 200);
  for (std::size_t i = 0; i < p.size(); ++i) EXPECT_EQ(std::isnan(w[i]), std::isnan(p[i]));
  EXPECT_EQ(x(69, 0), SyntheticRun::x(69, 0));
  EXPECT_EQ(x(70, 3), SyntheticRun::x(70, 3));
  EXPECT_EQ(x(199, 3), SyntheticRun::x(199, 3));
  EXPECT_EQ(recording.read_snapshot(199).id, std::vector<scene::ObjectId>{3});
}

TEST(Recorder, AcceptsObjectsAddedLater) {
  const OutputFolder out;
  SyntheticRun run;
  run.spec.objects.clear();
  const auto recorder = open_recorder(out / "run.h5", run.meta, run.spec);
  for (std::uint64_t t = 0; t < 70; ++t) recorder->record_frame(run.snapshot_at(t, {}), run.spec.objects);
  for (int i = 0; i < 40; ++i) run.add(scene::ShapeKind::kSphere, "rain", 1.0);
  recorder->record_frame(run.snapshot_at(70, {0, 39}), run.spec.objects);
  recorder->close({});
  const Recording recording = Recording::open(out / "run.h5");
  ASSERT_EQ(recording.frames(), 71u);
  EXPECT_EQ(recording.read_snapshot(69).object_count(), 0u);
  EXPECT_EQ(recording.read_snapshot(70).position, run.snapshot_at(70, {0, 39}).position);
  EXPECT_EQ(recording.read_snapshot(70).angular_velocity, run.snapshot_at(70, {0, 39}).angular_velocity);
}

TEST(Recorder, RecordsEveryNthTick) {
  const OutputFolder out;
  SyntheticRun run;
  run.spec.record.tick_interval = 3;
  const auto recorder = open_recorder(out / "run.h5", run.meta, run.spec);
  for (std::uint64_t t = 1; t <= 8; ++t) recorder->record_frame(run.snapshot_at(t, {0}), run.spec.objects);
  recorder->close({});
  EXPECT_EQ(Recording::open(out / "run.h5").ticks(), (std::vector<std::uint64_t>{1, 4, 7}));
}

// Two channels whose values encode tick and index; the second has three components, stored as planes.
struct Channels {
  explicit Channels(std::uint64_t tick) : proximity(24), colour(72) {
    for (std::size_t i = 0; i < 24; ++i) proximity[i] = static_cast<float>(100 * tick + i);
    for (std::size_t i = 0; i < 72; ++i) colour[i] = static_cast<float>(tick) - static_cast<float>(i);
  }
  std::vector<float> proximity, colour;
  std::array<scene::ChannelData, 2> sensors() const {
    return {scene::ChannelData{"proximity", 4, 6, 1, proximity},
            scene::ChannelData{"colour", 4, 6, 3, colour}};
  }
};

TEST(Recorder, WritesRequestedChannels) {
  const OutputFolder out;
  SyntheticRun run;
  run.spec.record.sensors = scene::SensorRecording::kAlways;
  run.spec.record.actuators = true;
  const auto recorder = open_recorder(out / "run.h5", run.meta, run.spec);
  for (std::uint64_t t = 0; t < 100; ++t) {
    const Channels values(t);
    const scene::ChannelData actuators[] = {{"height", 4, 6, 1, values.proximity}};
    recorder->record_frame(run.snapshot_at(t, {0}), run.spec.objects, values.sensors(), actuators);
  }
  recorder->close({});
  const Recording recording = Recording::open(out / "run.h5");
  for (const std::size_t t : {0u, 63u, 64u, 99u}) {
    EXPECT_EQ(recording.read_channel(ChannelGroup::kSensors, "proximity", t), Channels(t).proximity);
    const std::vector<float> colour = recording.read_channel(ChannelGroup::kSensors, "colour", t);
    for (std::size_t cell = 0; cell < 24; ++cell)
      for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(colour[3 * cell + k], Channels(t).colour[24 * k + cell]);
    EXPECT_EQ(recording.read_channel(ChannelGroup::kActuators, "height", t), Channels(t).proximity);
    EXPECT_EQ(recording.read_snapshot(t).height, run.snapshot_at(t, {}).height);
  }
  EXPECT_THROW(recording.read_channel(ChannelGroup::kSensors, "pressure", 0), InputError);
  EXPECT_THROW(recording.read_channel(ChannelGroup::kSensors, "proximity", 100), InputError);
}

// Sensors that nobody asks for stay in the file where they take at most a tenth of it. Tables, numbers of
// objects and shares of cells whose readings change are drawn.
TEST(Recorder, KeepsSensorsWhereTheyCostLittle) {
  const OutputFolder out;
  int kept = 0, dropped = 0;
  for (unsigned seed = 1; seed <= cases(12U, 4U); ++seed) {
    std::mt19937 draw(seed);
    const auto uniform = [&](int low, int high) {
      return std::uniform_int_distribution<int>(low, high)(draw);
    };
    SyntheticRun run;
    run.spec.surface.rows = uniform(4, 32);
    run.spec.surface.columns = uniform(4, 32);
    for (int more = uniform(0, 60); more > 0; --more) run.add(scene::ShapeKind::kSphere, "", 1.0);
    const int rows = run.spec.surface.rows, columns = run.spec.surface.columns;
    const int changing = uniform(0, rows * columns / (seed % 3 == 0 ? 1 : 12)), frames = uniform(20, 400);
    std::vector<scene::ObjectId> live(run.spec.objects.size());
    std::iota(live.begin(), live.end(), scene::ObjectId{0});
    const unsigned noise = draw();
    const auto write = [&](const char* name, scene::SensorRecording sensors) {
      run.spec.record.sensors = sensors;
      const auto recorder = open_recorder(out / name, run.meta, run.spec);
      std::mt19937 readings(noise);
      std::vector<float> values(rows * columns);
      for (int t = 0; t < frames; ++t) {
        for (int i = 0; i < changing; ++i)
          values[readings() % values.size()] = static_cast<float>(readings()) * 1e-6F;
        const scene::ChannelData channels[] = {{"proximity", rows, columns, 1, values}};
        recorder->record_frame(run.snapshot_at(t, live), run.spec.objects, channels);
      }
      recorder->close({});
      return static_cast<double>(std::filesystem::file_size(out / name));
    };
    const double without = write("never.h5", scene::SensorRecording::kNever),
                 with = write("always.h5", scene::SensorRecording::kAlways),
                 chosen = write("cheap.h5", scene::SensorRecording::kWhereCheap),
                 share = 1.0 - without / with;
    EXPECT_EQ(write("again.h5", scene::SensorRecording::kWhereCheap), chosen);
    EXPECT_EQ(content(out / "again.h5"), content(out / "cheap.h5"));
    const bool has = !Recording::open(out / "cheap.h5").channel_names(ChannelGroup::kSensors).empty();
    SCOPED_TRACE(testing::Message() << "seed " << seed << ", share " << share << ", frames " << frames);
    if (share < 0.07) {
      EXPECT_TRUE(has);
    }
    if (share > 0.14) {
      EXPECT_FALSE(has);
    }
    EXPECT_LT(chosen, 1.14 * without);
    if (has) {
      EXPECT_EQ(content(out / "always.h5"), content(out / "cheap.h5"));
    }
    ++(has ? kept : dropped);
  }
  EXPECT_GT(kept, 2);
  EXPECT_GT(dropped, 2);
}

TEST(Recorder, KeepsUnitsAndRangesOfChannels) {
  const OutputFolder out;
  SyntheticRun run;
  run.spec.record.sensors = scene::SensorRecording::kAlways;
  run.spec.record.actuators = true;
  scene::SensorSpec proximity = scene::find_sensor_kind("proximity")->default_spec();
  proximity.values["range"] = {7.5};
  proximity.values["origin"] = {0.25, 0.0, 0.5};
  proximity.values["direction"] = {0.0, -2.0, 0.0};
  run.spec.surface.sensors = {proximity};
  const auto recorder = open_recorder(out / "run.h5", run.meta, run.spec);
  const Channels values(0);
  const scene::ChannelData actuators[] = {{"height", 4, 6, 1, values.proximity}};
  recorder->record_frame(run.snapshot_at(0, {0}), run.spec.objects, values.sensors(), actuators);
  recorder->close({});
  const Recording recording = Recording::open(out / "run.h5");
  EXPECT_EQ(recording.channel_info(ChannelGroup::kSensors, "proximity").unit, "u");
  EXPECT_EQ(recording.channel_info(ChannelGroup::kSensors, "proximity").maximum, 7.5);
  EXPECT_EQ(recording.channel_info(ChannelGroup::kSensors, "proximity").origin, (std::array{0.25, 0.0, 0.5}));
  EXPECT_EQ(recording.channel_info(ChannelGroup::kSensors, "proximity").direction,
            (std::array{0.0, -1.0, 0.0}));
  EXPECT_FALSE(recording.channel_info(ChannelGroup::kActuators, "height").direction);
  EXPECT_EQ(recording.channel_info(ChannelGroup::kSensors, "colour").unit, "")
      << "not a channel of the surface's sensors";
  EXPECT_EQ(recording.channel_info(ChannelGroup::kActuators, "height").unit, "u");
  EXPECT_EQ(recording.channel_info(ChannelGroup::kActuators, "height").maximum,
            run.spec.surface.pin.max_height);
}

TEST(Recorder, KeepsMetricsFromTheirFirstValueOn) {
  const OutputFolder out;
  const SyntheticRun run;
  const auto recorder = open_recorder(out / "run.h5", run.meta, run.spec);
  std::vector<NamedNumber> metrics;
  for (std::uint64_t t = 0; t < 150; ++t) {
    if (t == 10) metrics.emplace_back("lift", 0.0);
    if (t == 100) metrics.emplace_back("score", -1.0);
    if (t >= 10) metrics[0].second = 0.5 * static_cast<double>(t);
    recorder->record_frame(run.snapshot_at(t, {0}), run.spec.objects, {}, {}, metrics);
  }
  recorder->close({});
  const Recording recording = Recording::open(out / "run.h5");
  EXPECT_EQ(recording.metric_names(), (std::vector<std::string>{"lift", "score"}));
  const std::vector<double> lift = recording.read_metric("lift"), score = recording.read_metric("score");
  ASSERT_EQ(lift.size(), 150u);
  ASSERT_EQ(score.size(), 150u);
  EXPECT_TRUE(std::isnan(lift[9]));
  EXPECT_EQ(lift[10], 5.0);
  EXPECT_EQ(lift[64], 32.0);
  EXPECT_EQ(lift[149], 74.5);
  EXPECT_TRUE(std::isnan(score[99]));
  EXPECT_EQ(score[100], -1.0);
  EXPECT_THROW(recording.read_metric("none"), InputError);
}

TEST(Recorder, KeepsMetricsOfAnyName) {
  // Few characters, so that names differ by what one of them is escaped with.
  const std::vector<std::string> parts = {"/", "%", "2F", "25", "2E", ".", "a", std::string(1, '\0')};
  std::mt19937 random(4);
  std::set<std::string> names = {".", "/", "..", "a", "a/b", "/a", "a/", "a//b", "./a", "speed u/s", "50 %"};
  while (names.size() < 60) {
    std::string name;
    for (int i = std::uniform_int_distribution(1, 4)(random); i > 0; --i)
      name += parts[random() % parts.size()];
    names.insert(name);
  }
  std::vector<NamedNumber> metrics;
  for (const std::string& name : names) metrics.emplace_back(name, static_cast<double>(metrics.size()));
  const OutputFolder out;
  const SyntheticRun run;
  const auto recorder = open_recorder(out / "run.h5", run.meta, run.spec);
  recorder->record_frame(run.snapshot_at(0, {0}), run.spec.objects, {}, {}, metrics);
  std::vector<NamedNumber> at_end = metrics;
  for (auto& [name, value] : at_end) value = -value;
  recorder->close({.outcome = "done", .metrics = at_end});
  const Recording recording = Recording::open(out / "run.h5");
  const std::vector<std::string> found = recording.metric_names();
  EXPECT_EQ(std::set<std::string>(found.begin(), found.end()), names);
  for (const auto& [name, value] : metrics)
    EXPECT_EQ(recording.read_metric(name), std::vector<double>{value});
  std::vector<NamedNumber> ended = recording.result()->metrics;
  std::ranges::sort(ended);
  std::ranges::sort(at_end);
  EXPECT_EQ(ended, at_end);
}

// As many as a script may have, whose names are the longest in the file.
TEST(Recorder, KeepsManyMetricsAtTheEnd) {
  std::vector<NamedNumber> metrics;
  for (int i = 0; i < 1000; ++i)
    metrics.emplace_back(std::string(60, '/') + std::to_string(1000 + i), 0.1 * i);
  const OutputFolder out;
  const SyntheticRun run;
  open_recorder(out / "run.h5", run.meta, run.spec)->close({.outcome = "done", .metrics = metrics});
  EXPECT_EQ(Recording::open(out / "run.h5").result()->metrics, metrics);
}

TEST(Recorder, OmitsUnrequestedData) {
  const OutputFolder out;
  SyntheticRun run;
  run.spec.record.objects = false;
  run.spec.record.sensors = scene::SensorRecording::kNever;
  const auto recorder = open_recorder(out / "run.h5", run.meta, run.spec);
  const Channels values(0);
  recorder->record_frame(run.snapshot_at(0, {0}), run.spec.objects, values.sensors());
  recorder->close({});
  const Recording recording = Recording::open(out / "run.h5");
  EXPECT_EQ(recording.frames(), 1u);
  EXPECT_FALSE(recording.has_objects());
  EXPECT_THROW(recording.read_positions(0, 1), InputError);
  EXPECT_THROW(recording.read_channel(ChannelGroup::kSensors, "proximity", 0), InputError);
}

TEST(Recorder, IsReproducibleByteForByte) {
  const OutputFolder out;
  const SyntheticRun run;
  std::array<std::string, 2> bytes;
  for (std::size_t i = 0; i < 2; ++i) {
    const auto path = out / ("run" + std::to_string(i) + ".h5");
    const auto recorder = open_recorder(path, run.meta, run.spec);
    record_ticks(*recorder, run, 100);
    recorder->close({.outcome = "done"});
    std::ifstream file(path, std::ios::binary);
    bytes[i].assign(std::istreambuf_iterator<char>(file), {});
    if (i == 0) ::sleep(1);  // so that any timestamps would differ
  }
  EXPECT_GT(bytes[0].size(), 1000u);
  EXPECT_TRUE(bytes[0] == bytes[1]);
}

TEST(Recorder, DestructorWritesBufferedFrames) {
  const OutputFolder out;
  const SyntheticRun run;
  record_ticks(*open_recorder(out / "run.h5", run.meta, run.spec), run, 5);
  const Recording recording = Recording::open(out / "run.h5");
  EXPECT_EQ(recording.frames(), 5u);
  EXPECT_FALSE(recording.result());
}

TEST(Recorder, ReadableWithH5py) {
  const std::string python = DEBIAN_PYTHON;
  if (python.empty() || std::system((python + " -c 'import h5py' 2>/dev/null").c_str()) != 0)
    GTEST_SKIP() << "needs Debian's python3-h5py";
  const OutputFolder out;
  SyntheticRun run;
  run.spec.record.sensors = scene::SensorRecording::kAlways;
  const auto recorder = open_recorder(out / "run.h5", run.meta, run.spec);
  for (std::uint64_t t = 0; t < 10; ++t) {
    const Channels values(t);
    recorder->record_frame(run.snapshot_at(t, {0, 1, 2}), run.spec.objects, values.sensors());
  }
  recorder->close({});
  const std::string command = python + " " + READ_RECORDING_PY + " " + (out / "run.h5").string();
  std::FILE* pipe = ::popen(command.c_str(), "r");
  std::string printed;
  for (int c; (c = std::fgetc(pipe)) != EOF;) printed += static_cast<char>(c);
  EXPECT_EQ(::pclose(pipe), 0);
  std::string proximity;
  for (int row = 0; row < 4; ++row) {
    proximity += row == 0 ? "[[" : ", [";
    for (int i = 0; i < 6; ++i) proximity += (i ? ", " : "") + std::to_string(500 + 6 * row + i) + ".0";
    proximity += "]";
  }
  EXPECT_EQ(printed,
            "smartsurf run scripts/experiment.lua --seed 7\n"
            "18446744073709551601 -- α\n"
            "{'count': '3', 'speed': '0.5'}\n"
            "(10,) uint64 uint64 9223372036854775811\n"
            "(10, 3, 3) float32 1.2999999523162842\n"
            "[0.0, 0.6000000238418579, 0.0, 0.800000011920929]\n"
            "(10, 3, 3) float32 [2.0, 1.0, -1.0]\n"
            "['small', 'large', ''] ['sphere', 'cylinder', 'box']\n"
            "[2.0, 4.0, nan] 67.020643\n"
            "(10, 4, 6) gzip True\n" +
                proximity + "]\n4 5.0 [1.5, 0.8]\n");
}

TEST(RecorderErrors, DescribeInvalidPaths) {
  const OutputFolder out;
  const SyntheticRun run;
  EXPECT_NE(
      error_of(out / "run.mat", run).find("run.mat: unknown kind of recording '.mat': the name must end in"),
      std::string::npos);
  EXPECT_NE(error_of(out / "run", run).find("must end in .h5"), std::string::npos);
  EXPECT_NE(error_of(out / "none/run.h5", run).find("there is no directory"), std::string::npos);
  std::filesystem::create_directory(out / "folder.h5");
  EXPECT_NE(error_of(out / "folder.h5", run).find("is a directory"), std::string::npos);
  EXPECT_NE(error_of("/proc/run.h5", run).find("cannot be written"), std::string::npos);
  SyntheticRun slash;
  slash.spec.record.sensors = scene::SensorRecording::kAlways;
  const std::vector<float> values(24);
  const scene::ChannelData bad[] = {{"a/b", 4, 6, 1, values}};
  EXPECT_THROW(open_recorder(out / "slash.h5", run.meta, slash.spec)
                   ->record_frame(run.snapshot_at(0, {}), run.spec.objects, bad),
               InputError);
}

TEST(RecorderErrors, NameWhetherTheFileIsReadOrWritten) {
  const OutputFolder out;
  const SyntheticRun run;
  const auto lock = [&](int kind) {
    const int file = ::open((out / "run.h5").c_str(), O_RDWR | O_CREAT, 0600);
    EXPECT_EQ(::flock(file, kind | LOCK_NB), 0);
    const std::string error = error_of(out / "run.h5", run);
    ::close(file);
    return error;
  };
  EXPECT_NE(lock(LOCK_SH).find("run.h5: is open for reading: close it or give another name"),
            std::string::npos);
  EXPECT_NE(lock(LOCK_EX).find("run.h5: another process is writing it: give another name"),
            std::string::npos);
}

TEST(RecorderErrors, RefuseFileLockedByAnotherRun) {
  const OutputFolder out;
  const SyntheticRun run;
  for (const std::string name : {"run.h5", "run.csv"}) {
    const auto first = open_recorder(out / name, run.meta, run.spec);
    record_ticks(*first, run, 70);
    EXPECT_NE(error_of(out / name, run).find("another process is writing it"), std::string::npos);
    first->close({});
  }
  EXPECT_EQ(Recording::open(out / "run.h5").frames(), 70u);
  EXPECT_EQ(error_of(out / "run.h5", run), "");
}

// Returns 0 if the failure is reported once and later calls do nothing. Runs in a child process, because a
// lowered RLIMIT_FSIZE cannot be raised again.
int record_to_full_disk(const std::filesystem::path& path, const SyntheticRun& run) {
  const pid_t child = ::fork();
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    auto recorder = open_recorder(path, run.meta, run.spec);
    record_ticks(*recorder, run, 64);
    const rlimit limit{200000, 200000};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    int status = 1;
    try {
      record_ticks(*recorder, run, 100000);
    } catch (const InputError&) {
      status = 2;
    } catch (const std::runtime_error& error) {
      const std::string text = error.what();
      status = text.find("cannot be written") != text.npos && text.find('\n') == text.npos ? 0 : 3;
    }
    record_ticks(*recorder, run, 1000);
    recorder->close({});
    recorder.reset();
    std::exit(status);  // runs the HDF5 library's exit handlers too
  }
  int status = -1;
  ::waitpid(child, &status, 0);
  return status;
}

// A disk that is full from the first byte, or soon after. The child's exit runs the library's exit handlers
// too.
TEST(RecorderErrors, SmallDiskIsAnErrorNotACrash) {
  const OutputFolder out;
  const SyntheticRun run;
  for (const rlim_t bytes : {0, 50, 96, 500, 1000, 4096, 20000, 80000, 300000}) {
    const pid_t child = ::fork();
    if (child == 0) {
      std::signal(SIGXFSZ, SIG_IGN);
      const rlimit limit{bytes, bytes};
      ::setrlimit(RLIMIT_FSIZE, &limit);
      try {
        auto recorder = open_recorder(out / "run.h5", run.meta, run.spec);
        record_ticks(*recorder, run, 100000);
      } catch (const std::exception& error) {
        std::exit(std::string(error.what()).find("cannot be written: File too large") == std::string::npos);
      }
      std::exit(2);
    }
    int status = -1;
    ::waitpid(child, &status, 0);
    EXPECT_EQ(status, 0) << bytes << " bytes";
  }
}

TEST(PendingFile, OlderRecordingSurvivesUntilFirstFlush) {
  const OutputFolder out;
  const SyntheticRun run;
  for (const std::string name : {"run.h5", "run.csv"}) {
    std::ofstream(out / name) << "older";
    {
      const auto recorder = open_recorder(out / name, run.meta, run.spec);
      EXPECT_EQ(content(out / name), "older");
      EXPECT_NE(error_of(out / name, run).find("another process is writing it"), std::string::npos);
      EXPECT_TRUE(std::filesystem::exists(out / (name + ".part")));
      recorder->close({"stopped by the user"});
    }
    EXPECT_EQ(content(out / name), "older") << "a run without frames";
    EXPECT_FALSE(std::filesystem::exists(out / (name + ".part")));
    std::ofstream(out / (name + ".part")) << "left by a killed run";
    const auto recorder = open_recorder(out / name, run.meta, run.spec);
    record_ticks(*recorder, run, 1);
    recorder->close({"done"});
    EXPECT_GT(content(out / name).size(), 50U);
    EXPECT_FALSE(std::filesystem::exists(out / (name + ".part")));
  }
}

TEST(PendingFile, RunWithoutFramesIsRecordedUnderNewName) {
  const OutputFolder out;
  const SyntheticRun run;
  open_recorder(out / "run.h5", run.meta, run.spec)->close({"stopped by the user"});
  EXPECT_EQ(Recording::open(out / "run.h5").result()->outcome, "stopped by the user");
}

// Also between a write and the note of its length.
TEST(PendingFile, LossIsSeenWheneverItHappens) {
  for (const bool replaces : {false, true}) {
    const OutputFolder out;
    PendingFile pending(out / "run.csv");
    pending.own();
    std::ofstream(pending.path()) << "frame 1\n";
    pending.note_length(8);
    pending.commit();
    pending.require_unchanged();
    std::ofstream(out / "run.csv") << "frame 1\nframe 2\n";
    if (replaces) {
      std::ofstream(out / "other") << "longer than what the run has written\n";
      std::filesystem::rename(out / "other", out / "run.csv");
    } else {
      std::filesystem::resize_file(out / "run.csv", 10);
    }
    pending.note_length(16);
    EXPECT_THROW(pending.require_unchanged(), std::runtime_error) << replaces;
  }
}

// In a folder that others may write to, somebody may have guessed the name.
TEST(PendingFile, NothingUnderItsTemporaryNameIsFollowed) {
  const OutputFolder out;
  const SyntheticRun run;
  for (const std::string name : {"run.h5", "run.csv"}) {
    const std::filesystem::path part = out / (name + ".part");
    std::ofstream(out / "victim") << "precious";
    std::filesystem::create_symlink(out / "victim", part);
    open_recorder(out / name, run.meta, run.spec)->close({});
    EXPECT_EQ(content(out / "victim"), "precious");
    ASSERT_EQ(::mkfifo(part.c_str(), 0666), 0);
    open_recorder(out / name, run.meta, run.spec)->close({});
    EXPECT_FALSE(std::filesystem::exists(part));
    std::filesystem::create_directories(part / "full");
    EXPECT_NE(error_of(out / name, run).find("cannot be written"), std::string::npos);
  }
}

TEST(PendingFile, TargetOfLinkIsReplaced) {
  const OutputFolder out;
  const SyntheticRun run;
  std::ofstream(out / "target.h5") << "older";
  std::filesystem::create_symlink("target.h5", out / "run.h5");
  const auto recorder = open_recorder(out / "run.h5", run.meta, run.spec);
  record_ticks(*recorder, run, 1);
  recorder->close({"done"});
  EXPECT_TRUE(std::filesystem::is_symlink(out / "run.h5"));
  EXPECT_EQ(Recording::open(out / "target.h5").frames(), 1U);
}

TEST(RecorderErrors, ReportFullDiskOnce) {
  const OutputFolder out;
  const SyntheticRun run;
  EXPECT_EQ(record_to_full_disk(out / "run.csv", run), 0);
  EXPECT_EQ(record_to_full_disk(out / "run.h5", run), 0);
  EXPECT_GE(Recording::open(out / "run.h5").frames(), 64u);
}

}  // namespace
}  // namespace smartsurf::record
