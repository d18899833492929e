// Purity over time (Purity.h), with the line of 0.95 and the time from which it was held. Private to the
// room.
#pragma once

#include "smartsurf/record/Chart.h"
#include "smartsurf/record/Purity.h"
#include "smartsurf/record/Recording.h"

namespace smartsurf::record {

class PurityPlot final : public Figure {
 public:
  explicit PurityPlot(const Recording& recording);
  double width() const override;
  double height() const override;
  void draw(cairo_t* paper) const override;

  const Chart& chart() const { return chart_; }

 private:
  void draw_hold(cairo_t* paper) const;
  void draw_curve(cairo_t* paper) const;

  Purity purity_;
  std::string subtitle_;
  Chart chart_;
};

}  // namespace smartsurf::record
