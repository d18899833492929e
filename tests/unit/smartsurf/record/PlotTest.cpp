#include "smartsurf/record/Plot.h"

#include <cairo.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "smartsurf/record/PurityPlot.h"
#include "smartsurf/record/TrajectoryPlot.h"
#include "tests/unit/smartsurf/record/SyntheticRun.h"

// Fontconfig, which finds Cairo's fonts, keeps its tables to the end of the process.
extern "C" const char* __lsan_default_suppressions() { return "leak:libfontconfig"; }

namespace smartsurf::record {
namespace {

// A small sphere that goes straight west along y = 10 and a large one that goes straight east along y = 20,
// in 10 s, on 32 × 32 cells with a border.
Recording two_ways(const std::filesystem::path& path) {
  SyntheticRun run;
  run.spec.surface = {};
  run.spec.surface.rows = run.spec.surface.columns = 32;
  run.spec.surface.border_height = 6.0;
  run.spec.objects.clear();
  run.add(scene::ShapeKind::kSphere, "small", 1.0);
  run.add(scene::ShapeKind::kSphere, "large", 2.0);
  const auto recorder = Recorder::open(path, run.meta, run.spec);
  for (std::uint64_t t = 0; t <= 600; ++t) {
    scene::Snapshot shot = run.at(t, {0, 1});
    const float way = 20.0f * static_cast<float>(std::min<std::uint64_t>(t, 240)) / 240.0f;
    shot.position = {{{26.0f - way, 10.0f, 3.0f}, {5.0f + way, 20.0f, 3.0f}}};
    recorder->frame(shot, run.spec.objects);
  }
  recorder->close({});
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
  // 0xRRGGBB at a place in points of the figure.
  std::uint32_t at(double x, double y) const {
    const int column = static_cast<int>(2.0 * x), row = static_cast<int>(2.0 * y);
    const unsigned char* line =
        cairo_image_surface_get_data(surface_) + row * cairo_image_surface_get_stride(surface_);
    return reinterpret_cast<const std::uint32_t*>(line)[column] & 0xFFFFFFu;
  }
  // Whether the pixel is clearly more of the one channel than of the other.
  bool blue(double x, double y) const { return (at(x, y) & 0xFF) > (at(x, y) >> 16) + 80; }
  bool orange(double x, double y) const { return (at(x, y) >> 16) > (at(x, y) & 0xFF) + 80; }

 private:
  cairo_surface_t* surface_;
};

TEST(TrajectoryPlot, DrawsSolidSmallAndDashedLargeWays) {
  const OutputFolder out;
  const Recording recording = two_ways(out / "run.h5");
  plot(recording, PlotKind::kTrajectories, out / "figure.png");
  const Image image(out / "figure.png");
  const TrajectoryPlot figure(recording);
  const Chart& chart = figure.chart();
  EXPECT_EQ(image.width(), static_cast<int>(std::ceil(2.0 * figure.width())));
  EXPECT_EQ(image.height(), static_cast<int>(std::ceil(2.0 * figure.height())));
  int blue = 0, orange = 0, samples = 0;
  for (double x = 10.0; x < 22.0; x += 0.05, ++samples) {
    blue += image.blue(chart.px(x), chart.py(10.0));
    orange += image.orange(chart.px(x), chart.py(20.0));
  }
  EXPECT_EQ(blue, samples);          // all of the way between the marks
  EXPECT_GT(orange, samples * 0.5);  // 6 on, 3.5 off
  EXPECT_LT(orange, samples * 0.8);
  EXPECT_EQ(image.at(chart.px(12.0), chart.py(15.3)), 0xFFFFFFu);  // nothing went there
}

TEST(TrajectoryPlot, MarksStartAndEndAndTheBorder) {
  const OutputFolder out;
  const Recording recording = two_ways(out / "run.h5");
  plot(recording, PlotKind::kTrajectories, out / "figure.png");
  const Image image(out / "figure.png");
  const TrajectoryPlot figure(recording);
  const Chart& chart = figure.chart();
  const double start = chart.px(26.0), end = chart.px(6.0), y = chart.py(10.0);
  EXPECT_TRUE(image.blue(start, y - 4.6));   // the O's top…
  EXPECT_FALSE(image.blue(start + 2.0, y));  // …and the inside of its side that has no line
  EXPECT_TRUE(image.blue(end - 3.0, y - 3.0));
  EXPECT_TRUE(image.blue(end + 3.0, y - 3.0));
  EXPECT_FALSE(image.blue(end, y - 4.6));
  const std::uint32_t grey = image.at(chart.px(0.0), chart.py(12.3));  // the westmost column of cells
  EXPECT_EQ(grey, 0xE1E1E1u);
  EXPECT_EQ(image.at(chart.px(31.0), chart.py(12.3)), grey);
  EXPECT_EQ(image.at(chart.px(12.3), chart.py(0.0)), grey);
  EXPECT_EQ(image.at(chart.px(1.0), chart.py(12.3)), 0xFFFFFFu);
}

TEST(PurityPlot, DrawsTheCurveAndWhereItIsHeld) {
  const OutputFolder out;
  const Recording recording = two_ways(out / "run.h5");
  // Both cross x = 15.5 on their 4 s way: 10.5/20 of it, after 2.1 s.
  const double sorted = purity(recording).sorted_at.value();
  EXPECT_NEAR(sorted, 2.1, 1.5 / 60.0);
  plot(recording, PlotKind::kPurity, out / "figure.png");
  const Image image(out / "figure.png");
  const PurityPlot figure(recording);
  const Chart& chart = figure.chart();
  EXPECT_TRUE(image.blue(chart.px(8.6), chart.py(1.0)));
  EXPECT_TRUE(image.blue(chart.px(1.0), chart.py(0.0)));
  EXPECT_FALSE(image.blue(chart.px(8.6), chart.py(0.5)));
  EXPECT_EQ(image.at(chart.px(8.6), chart.py(0.5)), 0xFFFFFFu);
  EXPECT_NE(image.at(chart.px(sorted + 4.9), chart.py(0.5)), 0xFFFFFFu);  // the band of the hold
  EXPECT_EQ(image.at(chart.px(sorted + 5.1), chart.py(0.5)), 0xFFFFFFu);
  int orange = 0;
  for (double x = 8.0; x < 9.5; x += 0.01) orange += image.orange(chart.px(x), chart.py(0.95));
  EXPECT_GT(orange, 75);  // half of the 150 samples: the dashed line of 0.95
}

TEST(Plot, WritesSvg) {
  const OutputFolder out;
  const Recording recording = two_ways(out / "run.h5");
  for (const std::string& kind : plot_kinds()) {
    plot(recording, plot_kind(kind), out / (kind + ".svg"));
    std::ifstream file(out / (kind + ".svg"));
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    EXPECT_EQ(text.substr(0, 5), "<?xml");
    EXPECT_NE(text.find("</svg>"), std::string::npos);
    EXPECT_NE(text.find("stroke-dasharray"), std::string::npos);
  }
}

TEST(Plot, RefusesWhatItCannotDraw) {
  const OutputFolder out;
  const Recording recording = two_ways(out / "run.h5");
  const auto error_of = [&](const std::string& kind, const std::filesystem::path& path) -> std::string {
    try {
      plot(recording, plot_kind(kind), path);
    } catch (const scene::InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(error_of("trajectory", out / "a.png"),
            "unknown plot 'trajectory': known are trajectories, purity; did you mean 'trajectories'?");
  EXPECT_EQ(error_of("xyz", out / "a.png"), "unknown plot 'xyz': known are trajectories, purity");
  EXPECT_NE(error_of("purity", out / "a.pdf").find("a.pdf: unknown kind of picture '.pdf'"),
            std::string::npos);
  EXPECT_NE(error_of("purity", out / "none/a.png").find("No such file or directory"), std::string::npos);
  std::filesystem::create_directory(out / "folder.png");
  EXPECT_NE(error_of("purity", out / "folder.png").find("Is a directory"), std::string::npos);
  std::size_t files = 0;  // and leaves nothing behind
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(out / "")) ++files;
  EXPECT_EQ(files, 2u);

  SyntheticRun run;
  Recorder::open(out / "empty.h5", run.meta, run.spec)->close({});
  const Recording empty = Recording::open(out / "empty.h5");
  for (const std::string& kind : plot_kinds())
    EXPECT_THROW(plot(empty, plot_kind(kind), out / "a.png"), scene::InputError);
}

TEST(Chart, HasRoundNumbers) {
  EXPECT_EQ(round_numbers(0.0, 64.0), (std::vector<double>{0, 10, 20, 30, 40, 50, 60}));
  EXPECT_EQ(round_numbers(-2.4, 6.9), (std::vector<double>{-2, 0, 2, 4, 6}));
  const std::vector<double> tenths = round_numbers(0.0, 1.04);
  ASSERT_EQ(tenths.size(), 6u);
  EXPECT_EQ(number_text(tenths[3]), "0.6");
}

}  // namespace
}  // namespace smartsurf::record
