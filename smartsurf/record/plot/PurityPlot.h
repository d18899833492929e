// Plots purity over time (Purity.h), with the threshold and the interval that proves the surface sorted.
// Internal to this module.
#pragma once

#include "smartsurf/record/Purity.h"
#include "smartsurf/record/Recording.h"
#include "smartsurf/record/plot/Chart.h"

namespace smartsurf::record {

class PurityPlot final : public Figure {
 public:
  explicit PurityPlot(const Recording& recording);
  double width() const override;
  double height() const override;
  void draw(cairo_t* cr) const override;

  const Chart& chart() const { return chart_; }

 private:
  void draw_hold_band(cairo_t* cr) const;
  void draw_curve(cairo_t* cr) const;

  PuritySeries purity_;
  std::string subtitle_;
  Chart chart_;
};

}  // namespace smartsurf::record
