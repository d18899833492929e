#include "smartsurf/record/plot/Plot.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <random>

#include "smartsurf/record/plot/CurveChart.h"
#include "smartsurf/record/plot/TimeSpentPlot.h"
#include "smartsurf/record/plot/TrajectoryPlot.h"
#include "tests/unit/smartsurf/record/PlotImage.h"
#include "tests/unit/smartsurf/record/SyntheticRun.h"

// Fontconfig, which Cairo uses to find fonts, never frees its tables; the HDF5 library leaks memory on a
// damaged file.
extern "C" [[gnu::visibility("default")]] const char* __lsan_default_suppressions() {
  return "leak:libfontconfig\nleak:libhdf5";
}

namespace smartsurf::record {
namespace {

constexpr double kSuccess_s = 3.3;

// A run of 10 s on 32 × 32 cells with a border: a small sphere moves straight west along y = 10, a large one
// straight east along y = 20, both for the first 4 s. The metric "lift" rises by 2 per second.
Recording record_two_trajectories(const std::filesystem::path& path) {
  SyntheticRun run;
  run.spec.surface = {};
  run.spec.surface.rows = run.spec.surface.columns = 32;
  run.spec.surface.border_height = 6.0;
  run.spec.objects.clear();
  run.add(scene::ShapeKind::kSphere, "small", 1.0);
  run.add(scene::ShapeKind::kSphere, "large", 2.0);
  const auto recorder = open_recorder(path, run.meta, run.spec);
  for (std::uint64_t t = 0; t <= 600; ++t) {
    scene::Snapshot shot = run.snapshot_at(t, {0, 1});
    const float way = 20.0f * static_cast<float>(std::min<std::uint64_t>(t, 240)) / 240.0f;
    shot.position = {{{26.0f - way, 10.0f, 3.0f}, {5.0f + way, 20.0f, 3.0f}}};
    const NamedNumber lift{"lift", 2.0 * shot.time_s};
    recorder->record_frame(shot, run.spec.objects, {}, {}, {&lift, 1});
  }
  recorder->close({.outcome = "done", .success = true, .success_s = kSuccess_s});
  return Recording::open(path);
}

TEST(TrajectoryPlot, FirstLabelSolidSecondDashed) {
  const OutputFolder out;
  const Recording recording = record_two_trajectories(out / "run.h5");
  write_plot(recording, "trajectories", out / "figure.png");
  const Image image(out / "figure.png");
  const TrajectoryPlot figure(recording);
  const Chart& chart = figure.chart();
  EXPECT_EQ(image.width(), static_cast<int>(std::ceil(2.0 * figure.width())));
  EXPECT_EQ(image.height(), static_cast<int>(std::ceil(2.0 * figure.height())));
  int blue = 0, orange = 0, samples = 0;
  for (double x = 10.0; x < 22.0; x += 0.05, ++samples) {
    blue += image.is_blue(chart.px(x), chart.py(20.0));  // "large"
    orange += image.is_orange(chart.px(x), chart.py(10.0));
  }
  EXPECT_EQ(blue, samples);          // solid between the marks
  EXPECT_GT(orange, samples * 0.5);  // 6 on, 3.5 off
  EXPECT_LT(orange, samples * 0.8);
  EXPECT_EQ(image.pixel_at(chart.px(12.0), chart.py(15.3)), 0xFFFFFFu);  // no trajectory
}

TEST(TrajectoryPlot, DrawsStartEndAndBorder) {
  const OutputFolder out;
  const Recording recording = record_two_trajectories(out / "run.h5");
  write_plot(recording, "trajectories", out / "figure.png");
  const Image image(out / "figure.png");
  const TrajectoryPlot figure(recording);
  const Chart& chart = figure.chart();
  const double start = chart.px(5.0), end = chart.px(25.0), y = chart.py(20.0);
  EXPECT_TRUE(image.is_blue(start, y - 4.6));   // top of the O
  EXPECT_FALSE(image.is_blue(start - 2.0, y));  // inside the O, on the side without a line
  EXPECT_TRUE(image.is_blue(end - 3.0, y - 3.0));
  EXPECT_TRUE(image.is_blue(end + 3.0, y - 3.0));
  EXPECT_FALSE(image.is_blue(end, y - 4.6));
  const std::uint32_t grey = image.pixel_at(chart.px(0.0), chart.py(12.3));  // the border, at the west edge
  EXPECT_EQ(grey, 0xE1E1E1u);
  EXPECT_EQ(image.pixel_at(chart.px(31.0), chart.py(12.3)), grey);
  EXPECT_EQ(image.pixel_at(chart.px(12.3), chart.py(0.0)), grey);
  EXPECT_EQ(image.pixel_at(chart.px(1.0), chart.py(12.3)), 0xFFFFFFu);
}

TEST(CurveChart, MarksSuccess) {
  const OutputFolder out;
  const Recording recording = record_two_trajectories(out / "run.h5");
  write_plot(recording, "lift", out / "figure.png");
  const Image image(out / "figure.png");
  const ChartFigure figure(make_curve_chart(recording, time_series(recording, "metric", {"lift"})));
  const Chart& chart = figure.chart();
  EXPECT_TRUE(image.is_blue(chart.px(2.0), chart.py(4.0)));
  int green = 0, samples = 0;
  for (double y = 10.0; y < 14.0; y += 0.02, ++samples)
    green += image.pixel_at(chart.px(kSuccess_s), chart.py(y)) != 0xFFFFFFu;
  EXPECT_GT(green, samples / 2);  // dashed
  EXPECT_LT(green, samples);
  EXPECT_EQ(image.pixel_at(chart.px(kSuccess_s - 0.3), chart.py(12.0)), 0xFFFFFFu);
}

TEST(TimeSpentPlot, SumsSecondsPerCell) {
  const OutputFolder out;
  const Recording recording = record_two_trajectories(out / "run.h5");
  const TimeSpentPlot small(recording, "small"), all(recording, "");
  const auto at = [](const TimeSpentPlot& figure, int x, int y) {
    return figure.seconds()[static_cast<std::size_t>((31 - y) * 32 + x)];
  };
  // 20 u in 4 s are 0.2 s per cell; the objects rest for the last 6 s.
  EXPECT_NEAR(at(small, 16, 10), 0.2, 0.02);
  EXPECT_NEAR(at(small, 6, 10), 6.0 + 0.1, 0.05);
  EXPECT_EQ(at(small, 16, 20), 0.0);
  EXPECT_NEAR(at(all, 16, 20), 0.2, 0.02);
  double sum = 0.0;
  for (const double seconds : all.seconds()) sum += seconds;
  EXPECT_NEAR(sum, 20.0, 1e-9);
}

TEST(TimeSpentPlot, NorthOnTopMaximumYellow) {
  const OutputFolder out;
  const Recording recording = record_two_trajectories(out / "run.h5");
  write_plot(recording, "time-spent:small", out / "figure.png");
  const Image image(out / "figure.png");
  const TimeSpentPlot figure(recording, "small");
  const auto red = [&](double x, double y) {
    return image.pixel_at(figure.chart().px(x), figure.chart().py(y)) >> 16;
  };
  EXPECT_GT(red(6.0, 10.0), 0xF0u);
  EXPECT_LT(red(6.0, 21.0), 0x50u) << "upside down";
}

TEST(CurveChart, DrawsCurveAtItsValues) {
  const OutputFolder out;
  const Recording recording = record_two_trajectories(out / "run.h5");
  write_plot(recording, "x:0", out / "figure.png");
  const Image image(out / "figure.png");
  const ChartFigure figure(make_curve_chart(recording, time_series(recording, "x", {"0"})));
  const Chart& chart = figure.chart();
  for (const double t : {0.5, 1.0, 2.0, 3.5})
    EXPECT_TRUE(image.is_blue(chart.px(t), chart.py(26.0 - 5.0 * t))) << t;
  EXPECT_TRUE(image.is_blue(chart.px(8.0), chart.py(6.0)));
  EXPECT_EQ(image.pixel_at(chart.px(8.0), chart.py(16.3)), 0xFFFFFFu);
}

TEST(TimeSeries, ReadsEveryFrame) {
  const OutputFolder out;
  const Recording recording = record_two_trajectories(out / "run.h5");
  const auto only = [&](const std::string& kind, std::vector<std::string> arguments = {}) {
    const TimeSeries result = time_series(recording, kind, arguments);
    EXPECT_EQ(result.curves.size(), std::max<std::size_t>(arguments.size(), 1));
    EXPECT_EQ(result.curves.back().values.size(), recording.frames());
    return result.curves.back().values;
  };
  EXPECT_DOUBLE_EQ(only("objects")[7], 2.0);
  EXPECT_DOUBLE_EQ(only("contacts")[7], 2.0);
  EXPECT_NEAR(only("speed", {"0", "1"})[600], std::sqrt(5.0 + 600.0 * 600.0), 1e-3);
  EXPECT_NEAR(only("spin", {"0", "1"})[600], std::sqrt(300.0 * 300.0 + 1.0 + 1.0), 1e-3);
  EXPECT_DOUBLE_EQ(only("height", {"2,3"})[9], 9.0);
  EXPECT_NEAR(only("x")[0], 15.5, 1e-6) << "mean of both";
}

TEST(Plot, WritesSvg) {
  const OutputFolder out;
  const Recording recording = record_two_trajectories(out / "run.h5");
  for (const std::string kind :
       {"trajectories", "lift", "metric:lift", "time-spent", "time-spent:small", "speed", "speed:0:1",
        "spin:1", "x:1", "z", "objects", "contacts", "height:0,0", "height:3,4:5,6"}) {
    SCOPED_TRACE(kind);
    write_plot(recording, kind, out / "figure.svg");
    std::ifstream file(out / "figure.svg");
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    EXPECT_EQ(text.substr(0, 5), "<?xml");
    EXPECT_NE(text.find("</svg>"), std::string::npos);
    EXPECT_EQ(text.find("stroke-dasharray") != std::string::npos,
              kind == "trajectories" || kind == "lift" || kind == "metric:lift");
  }
}

TEST(Plot, RejectsInvalidRequests) {
  const OutputFolder out;
  const Recording recording = record_two_trajectories(out / "run.h5");
  const auto error_of = [&](const std::string& kind, const std::filesystem::path& path) -> std::string {
    try {
      write_plot(recording, kind, path);
    } catch (const scene::InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(error_of("trajectory", out / "a.png"),
            "--what trajectory: unknown kind of plot; known: trajectories, time-spent, speed, spin, x, "
            "y, z, objects, contacts, metric, height, apron, channel, lift; did you mean 'trajectories'?");
  EXPECT_EQ(error_of("height", out / "a.png"), "--what height: needs a cell: height:ROW,COLUMN");
  EXPECT_EQ(error_of("height:3", out / "a.png"), "--what height:3: must be height:ROW,COLUMN");
  EXPECT_EQ(error_of("height:3,32", out / "a.png"),
            "--what height:3,32: the surface has rows 0 to 31 and columns 0 to 31");
  EXPECT_EQ(error_of("speed:2", out / "a.png"), "--what speed:2: the objects are 0 to 1");
  EXPECT_EQ(error_of("contacts:1", out / "a.png"), "--what contacts:1: takes nothing after 'contacts'");
  EXPECT_EQ(error_of("metric:left", out / "a.png"),
            "--what metric:left: no such metric; known: lift; did you mean 'lift'?");
  EXPECT_EQ(error_of("apron", out / "a.png"),
            "--what apron: needs a register and cells: apron:NAME:ROW,COLUMN");
  EXPECT_NE(error_of("apron:SIZE:1,1", out / "a.png")
                .find("holds no registers, which run --record-registers SIZE keeps"),
            std::string::npos);
  EXPECT_EQ(error_of("lift:1", out / "a.png"), "--what lift:1: takes nothing after 'lift'");
  EXPECT_NE(error_of("purity", out / "a.png").find("--what purity: unknown kind of plot"), std::string::npos);
  EXPECT_EQ(error_of("time-spent:smal", out / "a.png"),
            "--what time-spent:smal: no object has this label; did you mean 'small'?");
  EXPECT_NE(error_of("lift", out / "a.gif").find("a.gif: unknown kind of picture '.gif'"), std::string::npos);
  EXPECT_NE(error_of("lift", out / "none/a.png").find("No such file or directory"), std::string::npos);
  std::filesystem::create_directory(out / "folder.png");
  EXPECT_NE(error_of("lift", out / "folder.png").find("Is a directory"), std::string::npos);
  std::size_t files = 0;  // no temporary files remain
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(out / "")) ++files;
  EXPECT_EQ(files, 2u);

  SyntheticRun run;
  open_recorder(out / "empty.h5", run.meta, run.spec)->close({});
  const Recording empty = Recording::open(out / "empty.h5");
  for (const std::string kind : {"trajectories", "lift", "time-spent", "speed", "contacts"})
    EXPECT_THROW(write_plot(empty, kind, out / "a.png"), scene::InputError);
}

// Channels, labels and metrics whose names a kind of plot or a colon could hide.
Recording record_names(const std::filesystem::path& path) {
  SyntheticRun run;
  run.spec.objects[0].label = "a:b";
  run.spec.record.actuators = true;
  const auto recorder = open_recorder(path, run.meta, run.spec);
  std::vector<float> force(3 * 24), one(24);
  for (std::uint64_t t = 0; t < 10; ++t) {
    for (std::size_t i = 0; i < force.size(); ++i) force[i] = static_cast<float>(100 * (i / 24) + t);
    one.assign(24, static_cast<float>(t));
    const scene::ChannelData sensors[] = {{"tip_force", 4, 6, 3, force}, {"x", 4, 6, 1, one}},
                             actuators[] = {{"speed", 4, 6, 1, one}};
    const NamedNumber metrics[] = {{"err", 1.0}, {"err:x", 2.0}};
    recorder->record_frame(run.snapshot_at(t, {0, 1, 2}), run.spec.objects, sensors, actuators, metrics);
  }
  recorder->close({.outcome = "done", .metrics = {{"err", 3.0}, {"late", 4.0}}});
  return Recording::open(path);
}

TEST(TimeSeries, ComponentsOfAChannel) {
  const OutputFolder out;
  const Recording recording = record_names(out / "run.h5");
  const TimeSeries all = time_series(recording, "tip_force", {"1,1", "2,3"});
  ASSERT_EQ(all.curves.size(), 6u);
  EXPECT_EQ(all.curves[2].name, "row 1, column 1, [2]");
  EXPECT_EQ(all.curves[2].values[7], 207.0);
  const TimeSeries one = time_series(recording, "tip_force[1]", {"1,1"});
  ASSERT_EQ(one.curves.size(), 1u);
  EXPECT_EQ(one.title, "Channel tip_force[1]");
  EXPECT_EQ(one.curves[0].values, (std::vector<double>{100, 101, 102, 103, 104, 105, 106, 107, 108, 109}));
  const auto error_of = [&](const std::string& kind, const std::vector<std::string>& arguments) {
    try {
      time_series(recording, kind, arguments);
    } catch (const scene::InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(error_of("tip_force[3]", {"1,1"}), "--what tip_force[3]: must be tip_force[0] to tip_force[2]");
  EXPECT_EQ(error_of("channel", {"x[0]", "1,1"}), "--what x[0]: must be x, which has one component");
  EXPECT_EQ(
      error_of("x", {"1,1"}),
      "--what x:1,1: must be x:ID, the number of an object; the recorded channel is channel:x:ROW,COLUMN");
  EXPECT_EQ(error_of("channel", {"tip", "1,1"}),
            "--what channel:tip: no such channel; known: tip_force, x, speed");
}

TEST(TimeSeries, SaysHowToRecordAChannel) {
  const OutputFolder out;
  const Recording recording = record_two_trajectories(out / "run.h5");
  const std::string file = (out / "run.h5").string();
  const auto error_of = [](const Recording& of, const std::string& kind,
                           const std::vector<std::string>& arguments) {
    try {
      time_series(of, kind, arguments);
    } catch (const scene::InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const std::string sensors =
      file + " holds no sensors: record { sensors = true } keeps those that the experiment declares";
  EXPECT_EQ(error_of(recording, "pressure", {"5,5"}), "--what pressure: " + sensors);
  EXPECT_EQ(error_of(recording, "tip_force[2]", {"5,5", "6,6"}), "--what tip_force[2]: " + sensors);
  EXPECT_EQ(error_of(recording, "channel", {"pressure", "5,5"}), "--what channel:pressure: " + sensors);
  EXPECT_EQ(error_of(recording, "hight", {"5,5"}), "--what hight: " + sensors + "; did you mean 'height'?");
  const std::string commands = file + " holds no commands, which record { actuators = true } keeps";
  EXPECT_EQ(error_of(recording, "command", {" height", "5,5"}), "--what command: " + commands);
  EXPECT_EQ(error_of(recording, "channel", {"height", "5,5"}), "--what channel:height: " + commands);
  EXPECT_NE(error_of(recording, "command", {" speed", "5,5"}).find("unknown kind of plot"),
            std::string::npos);
  EXPECT_NE(error_of(recording, "pressure", {}).find("unknown kind of plot"), std::string::npos);
  EXPECT_NE(error_of(record_names(out / "names.h5"), "pressure", {"1,1"}).find("unknown kind of plot"),
            std::string::npos)
      << "the run recorded all its sensors";
}

TEST(CurveChart, CountsHaveWholeTicksFromZero) {
  std::mt19937 random(5);
  for (int i = 0; i < 200; ++i) {
    const double base = std::pow(10.0, random() % 4), spread = random() % 7;
    TimeSeries series{
        .title = "Number", .axis_title = "objects", .curves = {{"objects", {}}}, .counts = true};
    std::vector<double> time;
    double most = 0.0;
    for (int k = 0; k < 5; ++k) {
      time.push_back(k);
      series.curves[0].values.push_back(std::floor(base) + std::floor(spread * (random() % 100) / 100.0));
      most = std::max(most, series.curves[0].values.back());
    }
    const ChartFigure figure(make_curve_chart(time, std::move(series), ""));
    const PlotArea& area = figure.chart().area();
    EXPECT_NEAR(figure.chart().py(0.0), area.bottom(), 1e-9);
    EXPECT_GE(figure.chart().py(most), area.top);
    const double top = area.height / (figure.chart().py(0.0) - figure.chart().py(1.0));  // of the axis
    for (const double tick : tick_values(0.0, top)) EXPECT_NEAR(tick, std::round(tick), 1e-9) << most;
  }
}

TEST(Plot, NamesLikeKindsAndWithColons) {
  const OutputFolder out;
  const Recording recording = record_names(out / "run.h5");
  for (const std::string what :
       {"channel:x:1,1", "channel:speed:1,1:2,2", "command: speed:1,1", "channel:command: speed:1,1",
        "channel:tip_force[2]:0,0", "time-spent:a:b", "metric:err:x", "err:x", "metric:err:x:err"}) {
    SCOPED_TRACE(what);
    EXPECT_NO_THROW(write_plot(recording, what, out / "figure.svg"));
  }
  EXPECT_EQ(time_series(recording, "metric", {"err", "x"}).curves[0].values[0], 2.0);
  EXPECT_EQ(time_series(recording, "metric", {"err", "x", "err"}).curves.size(), 2u);
  EXPECT_EQ(time_series(recording, "err", {"x"}).curves[0].name, "err:x");
  for (const std::string what : {"late", "metric:late", "metric:err:late"}) {
    try {
      write_plot(recording, what, out / "figure.svg");
      ADD_FAILURE() << what;
    } catch (const scene::InputError& error) {
      EXPECT_STREQ(error.what(),
                   "--what metric:late: has a value at the end of the run only, which smartsurf info prints");
    }
  }
}

TEST(CurveChart, ConstantsUpToRoundingAreDrawn) {
  const OutputFolder out;
  for (const auto& [low, high] : {std::pair{0.3, 0.1 + 0.2}, {1e17, 1e17 + 160.0}}) {
    SCOPED_TRACE(low);
    write_curves({0.0, 1.0, 2.0}, {"Metric", "value", {{"metric", {low, high, low}}}}, "",
                 out / "figure.png");
    const ChartFigure figure(
        make_curve_chart({0.0, 1.0, 2.0}, {"Metric", "value", {{"metric", {low, high, low}}}}, ""));
    const double y = figure.chart().py(low);
    EXPECT_TRUE(Image(out / "figure.png").is_blue(figure.chart().px(0.01), y)) << y;
  }
}

TEST(CurveChart, SuccessTimeIsNeverZero) {
  const auto label = [](double success_s) {
    return make_curve_chart({0.0, 1.0}, {"Metric", "value", {{"metric", {0.0, 1.0}}}, success_s}, "")
        .rule_label;
  };
  EXPECT_EQ(label(0.016667), "success at 0.01667 s");
  EXPECT_EQ(label(45.233), "success at 45.23 s");
  EXPECT_EQ(label(1234.56), "success at 1234.6 s");
  EXPECT_EQ(label(30.0), "success at 30 s");
}

TEST(CurveChart, CurvesOfEqualColourHaveOtherDashes) {
  const OutputFolder out;
  TimeSeries series{"Eight", "value", {}};
  for (int i = 0; i < 8; ++i) series.curves.push_back({std::to_string(i), {1.0 * i, 1.0 * i}});
  write_curves({0.0, 1.0}, series, "", out / "figure.png");
  const Image image(out / "figure.png");
  const ChartFigure figure(make_curve_chart({0.0, 1.0}, series, ""));
  const auto blue_share = [&](double y) {
    int blue = 0;
    for (int i = 0; i < 1000; ++i) blue += image.is_blue(figure.chart().px(0.001 * i), figure.chart().py(y));
    return 0.001 * blue;
  };
  EXPECT_GT(blue_share(0.02), 0.95);
  EXPECT_GT(blue_share(7.0), 0.5);
  EXPECT_LT(blue_share(7.0), 0.8);
}

TEST(TrajectoryPlot, LongLabelsHaveFewerColumns) {
  const OutputFolder out;
  SyntheticRun run;
  const auto record = [&](const std::string& label) {
    run.spec.objects[0].label = label;
    const auto recorder = open_recorder(out / "run.h5", run.meta, run.spec);
    recorder->record_frame(run.snapshot_at(0, {0, 1, 2}), run.spec.objects);
    recorder->close({.outcome = "done"});
    const TrajectoryPlot figure(Recording::open(out / "run.h5"));
    return figure.height() - figure.chart().area().bottom();
  };
  EXPECT_NEAR(record(std::string(60, 'm')) - record("small"), 3 * 22.0, 1e-9) << "five rows in place of two";
}

// Spheres of equal sizes, in rows of their own from the south, that move east by 20 u.
struct Mover {
  std::string label;
  scene::Colour colour = {};
  double radius = 1.0;
};
Recording record_movers(const OutputFolder& out, const std::vector<Mover>& movers) {
  SyntheticRun run;
  run.spec.surface = {};
  run.spec.surface.rows = run.spec.surface.columns = 32;
  run.spec.objects.clear();
  std::vector<scene::ObjectId> ids;
  for (const Mover& mover : movers) {
    ids.push_back(static_cast<scene::ObjectId>(ids.size()));
    run.add(scene::ShapeKind::kSphere, mover.label, mover.radius);
    run.spec.objects.back().colour = mover.colour;
  }
  const auto recorder = open_recorder(out / "run.h5", run.meta, run.spec);
  for (std::uint64_t t = 0; t < 2; ++t) {
    scene::Snapshot shot = run.snapshot_at(t, ids);
    for (std::size_t i = 0; i < ids.size(); ++i)
      shot.position[i] = {5.0F + 20.0F * static_cast<float>(t), 2.0F + 4.0F * static_cast<float>(i), 3.0F};
    recorder->record_frame(shot, run.spec.objects);
  }
  recorder->close({.outcome = "done"});
  return Recording::open(out / "run.h5");
}
TrajectoryPlot plot_movers(const OutputFolder& out, const std::vector<Mover>& movers) {
  const Recording recording = record_movers(out, movers);
  write_plot(recording, "trajectories", out / "figure.png");
  return TrajectoryPlot(recording);
}

TEST(TrajectoryPlot, LinesHaveTheColoursOfTheObjects) {
  const OutputFolder out;
  const scene::Colour orange{1.0F, 0.5F, 0.0F}, blue{0.1F, 0.2F, 1.0F}, white{1.0F, 1.0F, 1.0F};
  const auto colours = [&](const std::vector<Mover>& movers) {
    const TrajectoryPlot figure = plot_movers(out, movers);
    const Image image(out / "figure.png");
    std::string seen;
    for (std::size_t i = 0; i < movers.size(); ++i) {
      const double x = figure.chart().px(5.0) + 11.0,
                   y = figure.chart().py(2.0 + 4.0 * static_cast<double>(i));
      seen += image.is_blue(x, y)                 ? 'b'
              : image.is_orange(x, y)             ? 'o'
              : image.pixel_at(x, y) == 0xFFFFFFu ? ' '
                                                  : '?';
    }
    return seen;
  };
  EXPECT_EQ(colours({{"a", orange}, {"b", blue}}), "ob");
  EXPECT_EQ(colours({{"a", blue}, {"b", orange}}), "bo");
  EXPECT_EQ(colours({{"a", orange}}), "o");
  EXPECT_EQ(colours({{"a", orange}, {"b", white}}), "o?") << "white lines are drawn grey";
  EXPECT_EQ(colours({{"a"}, {"b", blue}}), "ob") << "the default is amber";
  // Those of the figure.
  EXPECT_EQ(colours({{"a"}, {"b"}}), "bo");
  EXPECT_EQ(colours({{"a"}}), "b");
  EXPECT_EQ(colours({{"a", orange}, {"b", orange}}), "bo");
  EXPECT_EQ(colours({{"a", orange}, {"b", blue}, {"a", white}}), "bob");
}

TEST(TrajectoryPlot, LabelsAreInNaturalOrder) {
  const OutputFolder out;
  for (const std::string prefix : {"class ", "", "Klasse 3."}) {
    const TrajectoryPlot figure = plot_movers(out, {{prefix + "10"}, {prefix + "2"}});
    const Image image(out / "figure.png");
    EXPECT_TRUE(image.is_orange(figure.chart().px(5.0) + 11.0, figure.chart().py(2.0))) << prefix;
    EXPECT_TRUE(image.is_blue(figure.chart().px(5.0) + 11.0, figure.chart().py(6.0))) << prefix;
  }
  const TrajectoryPlot figure = plot_movers(out, {{"", {}, 1.0}, {"a", {}, 2.0}});
  EXPECT_TRUE(Image(out / "figure.png").is_blue(figure.chart().px(5.0) + 11.0, figure.chart().py(6.0)))
      << "objects without a label are last";
}

TEST(TrajectoryPlot, TwoLabelsDivideNoTable) {
  const OutputFolder out;
  const TrajectoryPlot figure = plot_movers(out, {{"a", {}, 1.0}, {"b", {}, 2.0}});
  const Image image(out / "figure.png");
  const Chart& chart = figure.chart();
  for (double y = 12.0; y < 30.0; y += 0.05)
    for (double away = -1.0; away <= 1.0; away += 0.5)
      ASSERT_EQ(image.pixel_at(chart.px(15.5) + away, chart.py(y)), 0xFFFFFFu) << y;
}

TEST(TrajectoryPlot, LegendsFit) {
  const OutputFolder out;
  const auto rows = [&](std::size_t labels, std::size_t length = 3) {
    std::vector<Mover> movers;
    for (std::size_t i = 0; i < labels; ++i)
      movers.push_back({std::string(length - 3, 'm') + std::to_string(100 + i)});
    const TrajectoryPlot figure(record_movers(out, movers));
    return std::lround((figure.height() - figure.chart().area().bottom() - 48.0 - 8.0) / 22.0);
  };
  EXPECT_EQ(rows(2), 1);
  EXPECT_EQ(rows(3), 2);
  EXPECT_EQ(rows(30), 8);
  EXPECT_EQ(rows(34), 9) << "a third of the plot";
  EXPECT_EQ(rows(35), 9);
  EXPECT_EQ(rows(200), 9);
  EXPECT_EQ(rows(50, 60), 9) << "of one column";

  const TrajectoryPlot figure = plot_movers(out, {{"a"}, {"b"}, {"c"}});
  const PlotArea& area = figure.chart().area();
  EXPECT_LT(
      Image(out / "figure.png").pixel_at(area.left + area.width / 3.0 + 12.0, area.bottom() + 48.0 + 33.0),
      0x404040u)
      << "the end is beside the start, not in a row of its own";
}

}  // namespace
}  // namespace smartsurf::record
