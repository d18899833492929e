// Draws charts of lines, points, bars and small images, in the terms of Vega-Lite: a chart has an x and a y
// axis and layers, each with a mark; several charts form panels of one figure. Internal to this module.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "common/index/Index.h"
#include "smartsurf/record/plot/Chart.h"

namespace smartsurf::record {

struct ChartLayer {
  // kBar: the values y of the categories of the x axis, beside those of the other bar layers. kRect: an
  // image.
  enum class Mark { kLine, kPoint, kBar, kRect };
  Mark mark = Mark::kLine;
  std::string name = {};  // in the legend; "" = not there
  std::optional<Rgba> color = {};
  bool point = false;  // a line has a point at each value
  std::vector<double>
      x = {},
      y = {};  // not finite, or ≤ 0 on a logarithmic axis: the line has a gap, the bar is missing
  std::vector<std::vector<int>> values = {};  // kRect: rows of indices into `colors`; row r is at y = r
  std::vector<std::string> labels = {};       // kRect: of the colours, in the legend
  std::vector<Rgba> colors = {};
};

struct ChartAxis {
  std::string title = {};
  bool log = false;
  std::optional<std::array<double, 2>> domain = {};  // default: from the data
  std::vector<std::string> categories = {};          // x only: at 0, 1, …; the numbers are not shown
};

struct ChartSpec {
  std::string title = {}, subtitle = {};
  double width = 810.0, height = 454.0;  // points, all included
  ChartAxis x = {}, y = {};
  std::vector<ChartLayer> layers = {};
  std::optional<double> rule = {};  // x of a vertical line
  std::string rule_label = {};
};

class ChartFigure final : public Figure {
 public:
  // One chart, whose legend is added to its height.
  explicit ChartFigure(ChartSpec chart);
  // Panels, row by row; all rows are equally high.
  ChartFigure(std::string title, std::vector<ChartSpec> panels, int columns);
  double width() const override;
  double height() const override;
  void draw(cairo_t* cr) const override;

  // The axes of the first panel.
  const Chart& chart() const { return panels_.front().axes; }

 private:
  struct LegendEntry {
    std::string name;
    LineStyle style;
    ChartLayer::Mark mark;
  };
  struct Panel {
    explicit Panel(ChartSpec spec);
    double height() const;
    double legend_entry() const;  // width of an entry of the legend
    common::Index legend_columns() const;
    bool has_place(double x, double y) const;
    bool has_values() const;
    void draw(cairo_t* cr) const;
    void draw_points(cairo_t* cr, const ChartLayer& layer) const;
    void draw_line(cairo_t* cr, const ChartLayer& layer, const LineStyle& style) const;
    void draw_bars(cairo_t* cr) const;
    void draw_image(cairo_t* cr, const ChartLayer& layer) const;
    void draw_rule(cairo_t* cr) const;
    void draw_legend(cairo_t* cr) const;

    ChartSpec spec;
    std::vector<LegendEntry> legend;
    Chart axes;
  };

  std::vector<double> column_edges() const;

  std::string title_;
  std::vector<Panel> panels_;
  int columns_ = 1;
};

}  // namespace smartsurf::record
