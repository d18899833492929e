// Charts that a file describes, and what all charts share: texts and ticks.
#include "smartsurf/record/plot/ChartFile.h"

#include <cairo.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <random>

#include "smartsurf/record/plot/Plot.h"
#include "tests/unit/smartsurf/record/PlotImage.h"
#include "tests/unit/smartsurf/record/SyntheticRun.h"

namespace smartsurf::record {
namespace {

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

class ChartFile : public testing::Test {
 protected:
  void draw(const std::string& description, const std::string& figure = "figure.png") {
    std::ofstream(out / "chart.json") << description;
    write_chart(out / "chart.json", out / figure);
  }
  std::string error_of(const std::string& description, const std::string& figure = "figure.png") {
    try {
      draw(description, figure);
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
  EXPECT_NEAR(below(40), below(400), 10.0) << "thinned out";
}

// Upright names may take two fifths of the height, also in a narrow chart, and all have one size.
TEST_F(ChartFile, NamesOfANarrowChartCanBeRead) {
  const auto room = [this](const std::string& name, const std::string& size) {
    draw(R"({"title": "a", "width": 300, "height": )" + size + R"(, "x": {"categories": ["one", ")" + name +
         R"(", "two"]}, "layers": [{"mark": "bar", "y": [1, 2, 3]}]})");
    const PlotArea area = read_chart_file(out / "chart.json").chart().area();
    EXPECT_GE(area.height, 60.0);
    return std::stod(size) - area.bottom();
  };
  const double longest = room("relocation-of-many", "5000");
  EXPECT_EQ(room("relocation-of-many", "1000"), longest);
  EXPECT_NEAR(room("relocation-of-many", "240"), std::min(longest, 35.0 + 0.4 * (240.0 - 42.0 - 35.0)), 1e-9);
  EXPECT_NEAR(room("relocation-of-many and-of-more", "240"), 35.0 + 0.4 * (240.0 - 42.0 - 35.0), 1e-9);
  // The columns of ink below "one" are as wide as its letters are high, whose size is that of the longest
  // name.
  const auto width_of_one = [&](const std::string& name) {
    room(name, "240");
    const Image image(out / "figure.png");
    const ChartFigure figure = read_chart_file(out / "chart.json");
    const PlotArea& area = figure.chart().area();
    int columns = 0;
    for (double x = figure.chart().px(0.0) - 12.0; x < figure.chart().px(0.0) + 12.0; x += 0.5) {
      bool ink = false;
      for (double y = area.bottom() + 6.0; y < area.bottom() + 50.0; y += 0.5)
        ink |= (image.pixel_at(x, y) & 0xFF) < 0x80;
      columns += ink;
    }
    return columns;
  };
  EXPECT_LT(width_of_one("relocation-of-many-and-of-more"), width_of_one("relocation-of"));
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

// Panels of any number and size: the largest figures are drawn in each format, larger ones refused.
TEST_F(ChartFile, SizeIsLimited) {
  std::mt19937 source(9);
  const auto up_to = [&](int n) { return static_cast<int>(source() % n) + 1; };
  const auto panels = [&](int count, int columns, int width, int height) {
    const std::string panel = R"({"width": )" + std::to_string(width) + R"(, "height": )" +
                              std::to_string(height) + R"(, "layers": [{"mark": "bar"}]})";
    std::string text = R"({"columns": )" + std::to_string(columns) + R"(, "panels": [)" + panel;
    for (int i = 1; i < count; ++i) text += "," + panel;
    return text + "]}";
  };
  const std::string limits =
      " points: must be at most 14400 wide and high, and have an area of at most 50 million square points";
  int refused = 0, drawn = 0;
  for (int i = 0; i < 60; ++i) {
    const int count = up_to(120), columns = up_to(120), width = 149 + up_to(1000), height = 149 + up_to(500);
    const int across = std::min(columns, count) * width, down = (count + columns - 1) / columns * height;
    const bool is_too_large = across > 14400 || down > 14400 || static_cast<double>(across) * down > 5e7;
    if (!is_too_large && ++drawn > 4) continue;
    EXPECT_EQ(
        error_of(panels(count, columns, width, height), i % 2 == 0 ? "figure.svg" : "figure.pdf"),
        is_too_large ? "a figure of " + std::to_string(across) + " x " + std::to_string(down) + limits : "");
    refused += is_too_large;
  }
  EXPECT_GT(refused, 20);
  EXPECT_GT(drawn, 4);
  for (const char* const figure : {"figure.svg", "figure.pdf", "figure.png"}) {
    EXPECT_EQ(error_of(panels(96, 1, 150, 150), figure), "");
    EXPECT_EQ(error_of(panels(97, 1, 150, 150), figure), "a figure of 150 x 14550" + limits);
    EXPECT_EQ(error_of(panels(20'000, 1, 810, 454), figure), "a figure of 810 x 9080000" + limits);
  }
}

// Also where the cells of a rect are larger or smaller than can be seen.
TEST_F(ChartFile, AnyNumbersAreDrawnOrRefused) {
  std::mt19937 source(4);
  const auto number = [&] {
    constexpr const char* kNumbers[] = {"0",      "1",       "-1",   "2.5", "0.001", "1e-9", "5e-324",
                                        "-1e308", "1.7e308", "1e17", "2e9", "1e7",   "-4e4"};
    return std::string(kNumbers[source() % std::size(kNumbers)]);
  };
  const auto pair = [&] { return "[" + number() + ", " + number() + "]"; };
  const auto domain = [&] { return source() % 2 == 0 ? "{}" : R"({"domain": )" + pair() + "}"; };
  int drawn = 0;
  for (int i = 0; i < 150; ++i) {
    const std::string text =
        R"({"width": 200, "height": 150, "x": )" + domain() + R"(, "y": )" + domain() +
        R"(, "layers": [{"mark": "rect", "values": [[0, 0, 0]], "colors": ["#112233"]}, {"mark": ")" +
        (source() % 2 == 0 ? "line" : "point") + R"(", "point": true, "x": )" + pair() + R"(, "y": )" +
        pair() + "}]}";
    const std::string error = error_of(text, i % 3 == 0   ? "figure.svg"
                                             : i % 3 == 1 ? "figure.pdf"
                                                          : "figure.png");
    EXPECT_TRUE(error.empty() || error.find(".domain: must be ") == 1) << text << error;
    drawn += error.empty();
  }
  EXPECT_GT(drawn, 60);
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
