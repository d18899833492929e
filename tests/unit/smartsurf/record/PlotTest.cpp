#include "smartsurf/record/plot/Plot.h"

#include <cairo.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "smartsurf/record/plot/ChartFile.h"
#include "smartsurf/record/plot/CurveChart.h"
#include "smartsurf/record/plot/TimeSpentPlot.h"
#include "smartsurf/record/plot/TrajectoryPlot.h"
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

class Image {
 public:
  explicit Image(const std::filesystem::path& path)
      : surface_(cairo_image_surface_create_from_png(path.c_str())) {
    EXPECT_EQ(cairo_surface_status(surface_), CAIRO_STATUS_SUCCESS);
  }
  ~Image() { cairo_surface_destroy(surface_); }
  int width() const { return cairo_image_surface_get_width(surface_); }
  int height() const { return cairo_image_surface_get_height(surface_); }
  // The pixel, 0xRRGGBB, at a position in points.
  std::uint32_t pixel_at(double x, double y) const {
    const int column = static_cast<int>(2.0 * x), row = static_cast<int>(2.0 * y);
    const unsigned char* line =
        cairo_image_surface_get_data(surface_) + row * cairo_image_surface_get_stride(surface_);
    return reinterpret_cast<const std::uint32_t*>(line)[column] & 0xFFFFFFu;
  }
  // True if blue clearly dominates red, and vice versa.
  bool is_blue(double x, double y) const { return (pixel_at(x, y) & 0xFF) > (pixel_at(x, y) >> 16) + 80; }
  bool is_orange(double x, double y) const { return (pixel_at(x, y) >> 16) > (pixel_at(x, y) & 0xFF) + 80; }

 private:
  cairo_surface_t* surface_;
};

// Names and units of recordings and devices; also those that are cut to their room.
TEST(Chart, DrawsTextsThatAreNotUtf8) {
  cairo_surface_t* const surface = cairo_image_surface_create(CAIRO_FORMAT_RGB24, 100, 40);
  cairo_t* const cr = cairo_create(surface);
  for (const std::string text : {"\xb5m", "\xc2", "a\x1b[31m\xff", "a long text \xe2\x82"}) {
    EXPECT_GT(common::text_width(cr, text, 10), 0) << text;
    common::draw_text(cr, 5, 20, text, 10, common::Align::kLeft, false, 30);
    EXPECT_EQ(cairo_status(cr), CAIRO_STATUS_SUCCESS) << text;
  }
  cairo_destroy(cr);
  cairo_surface_destroy(surface);
}

TEST(TrajectoryPlot, SmallObjectsSolidLargeObjectsDashed) {
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
    blue += image.is_blue(chart.px(x), chart.py(10.0));
    orange += image.is_orange(chart.px(x), chart.py(20.0));
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
  const double start = chart.px(26.0), end = chart.px(6.0), y = chart.py(10.0);
  EXPECT_TRUE(image.is_blue(start, y - 4.6));   // top of the O
  EXPECT_FALSE(image.is_blue(start + 2.0, y));  // inside the O, on the side without a line
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
  recorder->close({.outcome = "done"});
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

TEST(TrajectoryPlot, EqualSizesAreInNaturalOrder) {
  const OutputFolder out;
  for (const std::string prefix : {"class ", "", "Klasse 3."}) {
    const TrajectoryPlot figure = plot_movers(out, {{prefix + "10"}, {prefix + "2"}});
    const Image image(out / "figure.png");
    EXPECT_TRUE(image.is_orange(figure.chart().px(5.0) + 11.0, figure.chart().py(2.0))) << prefix;
    EXPECT_TRUE(image.is_blue(figure.chart().px(5.0) + 11.0, figure.chart().py(6.0))) << prefix;
  }
  const TrajectoryPlot figure = plot_movers(out, {{"10", {}, 1.0}, {"2", {}, 1.5}});
  EXPECT_TRUE(Image(out / "figure.png").is_blue(figure.chart().px(5.0) + 11.0, figure.chart().py(2.0)))
      << "sizes come first";
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

class ChartFile : public testing::Test {
 protected:
  void draw(const std::string& description) {
    std::ofstream(out / "chart.json") << description;
    write_chart(out / "chart.json", out / "figure.png");
  }
  std::string error_of(const std::string& description) {
    try {
      draw(description);
    } catch (const scene::InputError& error) {
      return std::string(error.what()).substr((out / "chart.json: ").string().size());
    }
    return "";
  }
  OutputFolder out;
};

TEST_F(ChartFile, BarsOnLogarithmicAxis) {
  const std::string text =
      R"({"x": {"categories": ["one", "two"]}, "y": {"scale": "log", "domain": [1, 1000]},
    "layers": [{"mark": "bar", "color": "#0000ff", "y": [10, null]}, {"mark": "bar", "color": "#ff7700", "y": [100, 1000]}]})";
  draw(text);
  const Image image(out / "figure.png");
  const ChartFigure figure = read_chart_file(out / "chart.json");
  const Chart& chart = figure.chart();
  EXPECT_NEAR(chart.py(10.0) - chart.py(100.0), chart.py(1.0) - chart.py(10.0), 1e-9);
  EXPECT_TRUE(image.is_blue(chart.px(-0.2), chart.py(5.0)));
  EXPECT_FALSE(image.is_blue(chart.px(-0.2), chart.py(15.0)));
  EXPECT_TRUE(image.is_orange(chart.px(0.2), chart.py(50.0)));
  EXPECT_FALSE(image.is_orange(chart.px(0.2), chart.py(150.0)));
  EXPECT_FALSE(image.is_blue(chart.px(0.8), chart.py(5.0))) << "null";
  EXPECT_TRUE(image.is_orange(chart.px(1.2), chart.py(500.0)));
}

TEST_F(ChartFile, BarsBeginAtZero) {
  const auto draw_bars = [this](const std::string& values) {
    draw(R"({"x": {"categories": ["a", "b", "c"]}, "layers": [{"mark": "bar", "color": "#0000ff", "y": )" +
         values + "}]}");
  };
  for (const auto& [values, first] :
       {std::pair{"[-10, -11, -13]", -10.0}, {"[50, 51, 52]", 50.0}, {"[-1, 0, 2]", -1.0}}) {
    draw_bars(values);
    const Image image(out / "figure.png");
    const ChartFigure figure = read_chart_file(out / "chart.json");
    const Chart& chart = figure.chart();
    ASSERT_GE(chart.py(0.0), chart.area().top - 1e-9) << values;
    ASSERT_LE(chart.py(0.0), chart.area().bottom() + 1e-9) << values;
    for (const double share : {0.05, 0.5, 0.95})
      EXPECT_TRUE(image.is_blue(chart.px(0.0), chart.py(share * first))) << values << ": " << share;
    for (const double share : {-0.05, 1.05})
      EXPECT_FALSE(image.is_blue(chart.px(0.0), chart.py(share * first))) << values << ": " << share;
  }
  const Image image(out / "figure.png");
  const ChartFigure figure = read_chart_file(out / "chart.json");
  const Chart& chart = figure.chart();
  EXPECT_TRUE(image.is_blue(chart.px(2.0), chart.py(1.9)));
  EXPECT_FALSE(image.is_blue(chart.px(2.0), chart.py(-0.1)));
}

TEST_F(ChartFile, PanelsOfImagesAndLines) {
  draw(R"({"title": "All", "columns": 2, "panels": [
    {"layers": [{"mark": "rect", "values": [[0, 1], [1, 1]], "colors": ["#0000ff", "#ff7700"], "labels": ["no", "yes"]}]},
    {"layers": [{"mark": "line", "point": true, "x": [0, 1, 2], "y": [1, null, 3]}, {"mark": "point", "x": [1], "y": [2]}]}]})");
  const Image image(out / "figure.png");
  const ChartFigure figure = read_chart_file(out / "chart.json");
  EXPECT_EQ(image.width(), 2 * 2 * 810);
  const double top = 34.0;  // below the title
  EXPECT_LT(figure.chart().py(0.0), figure.chart().py(1.0)) << "row 0 is on top";
  EXPECT_TRUE(image.is_blue(figure.chart().px(0.0), top + figure.chart().py(0.0)));
  EXPECT_TRUE(image.is_orange(figure.chart().px(1.0), top + figure.chart().py(0.0)));
  EXPECT_TRUE(image.is_orange(figure.chart().px(0.0), top + figure.chart().py(1.0)));
}

TEST_F(ChartFile, ColumnsAreAsWideAsTheirWidestPanel) {
  draw(R"({"columns": 2, "panels": [
    {"width": 300, "height": 250, "layers": [{"mark": "line", "x": [0, 1], "y": [0, 1]}]},
    {"width": 700, "height": 250, "layers": [{"mark": "line", "x": [0, 1], "y": [0, 1]}]},
    {"width": 350, "height": 250, "layers": [{"mark": "line", "x": [0, 1], "y": [0, 1]}]}]})");
  const Image image(out / "figure.png");
  EXPECT_EQ(image.width(), 2 * (350 + 700));
  const auto is_dark = [&](double x) { return (image.pixel_at(x, 100.0) & 0xFFu) < 0x60u; };
  EXPECT_TRUE(is_dark(300.0 - 24.0)) << "the right edge of the first panel's axes";
  EXPECT_TRUE(is_dark(350.0 + 66.0)) << "the left edge of the second panel's";
  EXPECT_TRUE(is_dark(350.0 + 700.0 - 24.0));
}

TEST_F(ChartFile, CellsOfImagesAgreeWithTheAxes) {
  for (const std::string y : {"", R"("y": {"domain": [-0.5, 1.5]},)", R"("y": {"domain": [4, -2]},)"}) {
    SCOPED_TRACE(y);
    draw("{" + y + R"("layers": [{"mark": "point", "color": "#0000ff", "x": [0, 3], "y": [1, 0]},
      {"mark": "rect", "values": [[1, 0, 0], [0, 0, 0]], "colors": ["#dddddd", "#ff7700"]}]})");
    const Image image(out / "figure.png");
    const ChartFigure figure = read_chart_file(out / "chart.json");
    const Chart& chart = figure.chart();
    for (const double x : {-0.4, 0.4})
      for (const double row : {-0.4, 0.4}) EXPECT_TRUE(image.is_orange(chart.px(x), chart.py(row)));
    for (const auto& [x, row] : {std::pair{0.6, 0.0}, {0.0, 0.6}, {2.4, 1.4}})
      EXPECT_EQ(image.pixel_at(chart.px(x), chart.py(row)), 0xDDDDDDu) << x << ' ' << row;
    EXPECT_TRUE(image.is_blue(chart.px(3.0) - 1.0, chart.py(0.0))) << "a point beside the image";
  }
}

TEST_F(ChartFile, SinglePointsAndPointsBetweenGapsAreDots) {
  for (const std::string values :
       {R"("x": [3], "y": [2])", R"("x": [1, 2, 3, 4, 5], "y": [1, null, 2, null, 3])"}) {
    draw(R"({"layers": [{"mark": "line", "color": "#0000ff", )" + values + "}]}");
    const Image image(out / "figure.png");
    const ChartFigure figure = read_chart_file(out / "chart.json");
    EXPECT_TRUE(image.is_blue(figure.chart().px(3.0), figure.chart().py(2.0))) << values;
  }
}

TEST_F(ChartFile, DecimationKeepsExtremesBesideGaps) {
  std::string x = "0", y = "0";
  for (int i = 1; i < 14400; ++i) {
    x += "," + std::to_string(i);
    y += i % 10 == 5 ? ",null" : i == 7202 ? ",100" : ",0";
  }
  draw(R"({"layers": [{"mark": "line", "color": "#0000ff", "x": [)" + x + R"(], "y": [)" + y + "]}]}");
  const Image image(out / "figure.png");
  const ChartFigure figure = read_chart_file(out / "chart.json");
  EXPECT_TRUE(image.is_blue(figure.chart().px(7202.0), figure.chart().py(97.0)));
}

// A logarithmic axis has no place for zero, so that the line has a gap there and no spike to the frame.
TEST_F(ChartFile, LogarithmicLinesHaveGapsAtZero) {
  for (const std::string value : {"0", "-3", "null"}) {
    draw(R"({"y": {"scale": "log"}, "layers": [{"mark": "line", "color": "#0000ff", "x": [0, 1, 2, 3, 4],
      "y": [100, 50, )" +
         value + ", 50, 100]}]}");
    const Image image(out / "figure.png");
    const ChartFigure figure = read_chart_file(out / "chart.json");
    const Chart& chart = figure.chart();
    EXPECT_TRUE(image.is_blue(chart.px(0.02), chart.py(99.0)));
    for (double x = 0.98; x < 3.02; x += 0.001)
      for (const double y : {11.0, 15.0, 30.0})
        ASSERT_FALSE(image.is_blue(chart.px(x), chart.py(y))) << value << " at " << x << ", " << y;
  }
}

TEST_F(ChartFile, ZerosAndPointsOnTheFrameAreSeen) {
  draw(R"({"layers": [{"mark": "line", "color": "#0000ff", "x": [0, 1], "y": [0, 0]}]})");
  const ChartFigure constant = read_chart_file(out / "chart.json");
  const Chart& middle = constant.chart();
  EXPECT_TRUE(Image(out / "figure.png").is_blue(middle.px(0.5), middle.py(0.0)));
  EXPECT_LT(middle.py(0.0), middle.area().bottom() - 20.0);

  draw(R"({"x": {"domain": [0, 1]}, "y": {"domain": [0, 1]}, "layers": [
      {"mark": "point", "color": "#0000ff", "x": [0, 0.5, 1, 1.01], "y": [0.5, 0, 1, 0.3]},
      {"mark": "line", "color": "#0000ff", "x": [0, 1], "y": [0, 0]},
      {"mark": "line", "color": "#0000ff", "x": [1], "y": [0.7]}]})");
  const Image image(out / "figure.png");
  const ChartFigure figure = read_chart_file(out / "chart.json");
  const Chart& chart = figure.chart();
  for (const double away : {-2.0, 0.0, 2.0}) {
    EXPECT_TRUE(image.is_blue(chart.px(0.0) + away, chart.py(0.5))) << away;
    EXPECT_TRUE(image.is_blue(chart.px(0.5), chart.py(0.0) + away)) << away;
    EXPECT_TRUE(image.is_blue(chart.px(1.0), chart.py(1.0) + away)) << away;
  }
  EXPECT_TRUE(image.is_blue(chart.px(0.2), chart.py(0.0))) << "a line along the frame";
  EXPECT_TRUE(image.is_blue(chart.px(1.0) + 1.5, chart.py(0.7))) << "a dot";
  EXPECT_FALSE(image.is_blue(chart.px(1.01), chart.py(0.3))) << "outside";
}

TEST_F(ChartFile, NothingToDrawIsSaid) {
  const auto marks = [&](const std::string& layer, const std::string& axis = "{}") {
    draw(R"({"x": {"categories": ["a"]}, "y": )" + axis + R"(, "layers": [)" + layer + "]}");
    const Image image(out / "figure.png");
    const ChartFigure figure = read_chart_file(out / "chart.json");
    const PlotArea& area = figure.chart().area();
    int dark = 0;
    for (double x = 0.35; x < 0.65; x += 0.0005)
      for (double y = -14.0; y < 4.0; y += 0.5)
        dark += (image.pixel_at(area.left + x * area.width, area.top + 0.5 * area.height + y) & 0xFF) < 160;
    return dark;
  };
  EXPECT_GT(marks(R"({"mark": "line", "x": [0, 1], "y": [null, null]})"), 100);
  EXPECT_GT(marks(R"({"mark": "bar", "y": [null]})"), 100);
  EXPECT_EQ(marks(R"({"mark": "point", "x": [0.4], "y": [3]})", R"({"domain": [0, 4]})"), 0);
}

// Names that do not fit side by side stand upright, below the area that leaves them room.
TEST_F(ChartFile, ManyCategoriesStandUpright) {
  const auto below = [this](int categories) {
    std::string names, values;
    for (int i = 0; i < categories; ++i) {
      names += (i == 0 ? "\"" : ", \"") + ("category number " + std::to_string(i)) + '"';
      values += i == 0 ? "1" : ", 1";
    }
    draw(R"({"x": {"categories": [)" + names + R"(]}, "layers": [{"mark": "bar", "y": [)" + values + "]}]}");
    const ChartFigure figure = read_chart_file(out / "chart.json");
    return figure.height() - figure.chart().area().bottom();
  };
  EXPECT_EQ(below(6), 52.0);
  EXPECT_GT(below(40), 120.0);
  EXPECT_EQ(below(40), below(400)) << "thinned out";
}

TEST_F(ChartFile, SmallRangesFillTheAxis) {
  draw(R"({"layers": [{"mark": "line", "x": [0, 1e-6], "y": [0, 1]}]})");
  const ChartFigure figure = read_chart_file(out / "chart.json");
  EXPECT_NEAR(figure.chart().px(1e-6), figure.chart().area().right(), 1e-6);
}

TEST_F(ChartFile, LabelsHaveRoomBesideTheTitle) {
  const auto left = [this](const std::string& values) {
    draw(R"({"y": {"title": "value"}, "layers": [{"mark": "line", "x": [0, 1], "y": )" + values + "}]}");
    return read_chart_file(out / "chart.json").chart().area().left;
  };
  EXPECT_EQ(left("[0, 1]"), 66.0);
  EXPECT_GT(left("[100000000, 100000000.5]"), 66.0 + 40.0);
}

TEST_F(ChartFile, MistakesAreNamed) {
  EXPECT_EQ(error_of(R"({"layers": [{"mark": "line", "x": [1, null], "y": [1, 2]}]})"),
            "layers[0].x[1] = null: must be a number");
  EXPECT_EQ(error_of(R"({"layers": [{"mark": "line", "x": [1, 2], "y": [1, "a"]}]})"),
            "layers[0].y[1] = \"a\": must be a number or null");
  EXPECT_EQ(error_of(R"({"x": {"categories": ["a"]}, "layers": [{"mark": "bar", "y": [1, 2]}]})"),
            "layers[0].y has 2 bars: x.categories are only 1");
  EXPECT_EQ(error_of(R"({"layers": [{"mark": "bar", "y": [1, 2]}]})"),
            "layers[0].y has 2 bars: x.categories must name them");
  EXPECT_EQ(error_of("3"), "a chart: must be an object");
  EXPECT_TRUE(error_of("{").starts_with("is not JSON: "));
  EXPECT_EQ(error_of("{}"), "layers: must be a list of layers");
  EXPECT_EQ(error_of(R"({"layer": []})"), "layer: no such field; did you mean 'layers'?");
  EXPECT_EQ(error_of(R"({"layers": [{"mark": "lin"}]})"),
            "layers[0].mark = 'lin': must be line, point, bar or rect");
  EXPECT_EQ(error_of(R"({"layers": [{"mark": "line", "x": [1], "y": [1, 2]}]})"),
            "layers[0].y: must be as long as x");
  EXPECT_EQ(error_of(R"({"layers": [{"mark": "line", "color": "red"}]})"),
            "layers[0].color = 'red': must be a colour like #1f4e79");
  EXPECT_EQ(error_of(R"({"y": {"scale": "log", "domain": [0, 1]}, "layers": [{"mark": "bar"}]})"),
            "y.domain: must be two different numbers above 0");
  EXPECT_EQ(
      error_of(R"({"panels": [{"layers": [{"mark": "rect", "values": [[1]], "colors": ["#000000"]}]}]})"),
      "panels[0].layers[0].values holds 1: there is no such colour");
  EXPECT_EQ(
      error_of(
          R"({"x": {"scale": "log"}, "layers": [{"mark": "rect", "values": [[0]], "colors": ["#000000"]}]})"),
      "x.scale = 'log': must be linear, because the cells of a rect begin at -0.5");
  EXPECT_EQ(error_of(R"({"width": 1e9, "layers": [{"mark": "bar"}]})"),
            "width and height: must be from 150 to 5000");
  EXPECT_EQ(error_of(R"({"y": {"scale": "log"}, "layers": [{"mark": "line", "x": [1, 2], "y": [-1, 0]}]})"),
            "y.scale = 'log': must be linear, because no value is above 0");
  EXPECT_EQ(
      error_of(
          R"({"panels": [{"x": {"scale": "log"}, "layers": [{"mark": "point", "x": [-1], "y": [1]}]}]})"),
      "panels[0].x.scale = 'log': must be linear, because no value is above 0");
  EXPECT_EQ(error_of(R"({"y": {"scale": "log"}, "layers": [{"mark": "point", "x": [1, 2], "y": [-1, 1]}]})"),
            "");
}

TEST(Chart, RoundTickValues) {
  EXPECT_EQ(tick_values(0.0, 64.0), (std::vector<double>{0, 10, 20, 30, 40, 50, 60}));
  EXPECT_EQ(tick_values(-2.4, 6.9), (std::vector<double>{-2, 0, 2, 4, 6}));
  const std::vector<double> tenths = tick_values(0.0, 1.04);
  ASSERT_EQ(tenths.size(), 6u);
  EXPECT_EQ(format_number(tenths[3]), "0.6");
}

TEST(Chart, MarginSuitsConstants) {
  const auto range = [](double low, double high) {
    const common::AxisRange axis = common::with_margin({low, high}, 0.05);
    return std::pair(axis.low, axis.high);
  };
  EXPECT_EQ(range(0.0, 10.0), std::pair(-0.5, 10.5));
  EXPECT_EQ(range(0.0, 0.0), std::pair(-0.5, 0.5));
  EXPECT_EQ(range(-40.0, -40.0), std::pair(-44.0, -36.0));
  EXPECT_EQ(range(INFINITY, -INFINITY), std::pair(0.0, 1.0));
  EXPECT_LE(range(-1e308, 1e308).second, 1e300);
}

TEST(Chart, TicksAreFewAndTheirLabelsDiffer) {
  for (const auto& [low, high] : {std::pair{0.3, 0.1 + 0.2},
                                  {1e17, 1e17 + 160.0},
                                  {1e8, 1e8 + 0.5},
                                  {-1e-13, 1e-13},
                                  {0.0, 5e-324},
                                  {-1.7e308, 1.7e308},
                                  {NAN, NAN},
                                  {-1e300, 1e300}}) {
    SCOPED_TRACE(low);
    const std::vector<double> ticks = tick_values(low, high);
    EXPECT_GE(ticks.size(), 2u);
    EXPECT_LE(ticks.size(), 9u);
    std::vector<std::string> labels = tick_labels(ticks);
    for (std::size_t i = 0; i < ticks.size(); ++i) EXPECT_EQ(labels[i] == "0", ticks[i] == 0.0) << labels[i];
    std::ranges::sort(labels);
    EXPECT_TRUE(std::ranges::adjacent_find(labels) == labels.end());
  }
  EXPECT_EQ(tick_labels(tick_values(1e8, 1e8 + 0.5))[1], "100000000.1");
  EXPECT_EQ(tick_labels(tick_values(0.0, 1e-12))[1], "2e-13");
  EXPECT_LT(tick_values(0.0, 1.0, 1.0).size(), 4u);
}

TEST_F(ChartFile, DecadesThinToWhatFits) {
  const auto grid_lines = [this](const std::string& least) {
    draw(R"({"y": {"scale": "log", "domain": [)" + least +
         R"(, 1]}, "layers": [{"mark": "line", "x": [], "y": []}]})");
    const Image image(out / "figure.png");
    const ChartFigure figure = read_chart_file(out / "chart.json");
    const PlotArea& area = figure.chart().area();
    int marks = 0;  // outside the frame, at its left
    bool was_dark = false;
    for (double y = area.top - 3.0; y < area.bottom() + 3.0; y += 0.5) {
      const bool dark = (image.pixel_at(area.left - 2.0, y) & 0xFF) < 0x80;
      marks += dark && !was_dark;
      was_dark = dark;
    }
    return marks;
  };
  EXPECT_EQ(grid_lines("1e-3"), 4);
  EXPECT_LE(grid_lines("1e-200"), 22);
  EXPECT_GE(grid_lines("1e-200"), 3);
}

}  // namespace
}  // namespace smartsurf::record
