// Plots curves over time. Internal to this module.
#pragma once

#include "smartsurf/record/plot/Chart.h"
#include "smartsurf/record/plot/TimeSeries.h"

namespace smartsurf::record {

class CurvePlot final : public Figure {
 public:
  CurvePlot(const Recording& recording, TimeSeries series);
  // time: s, at least one value.
  CurvePlot(std::vector<double> time, TimeSeries series, std::string subtitle);
  double width() const override;
  double height() const override;
  void draw(cairo_t* cr) const override;

  const Chart& chart() const { return chart_; }

 private:
  void draw_curve(cairo_t* cr, std::size_t i) const;
  void draw_legend(cairo_t* cr) const;

  std::vector<double> time_;
  TimeSeries series_;
  std::string subtitle_;
  Chart chart_;
};

}  // namespace smartsurf::record
