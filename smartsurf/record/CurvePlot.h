// Curves of numbers over time. Private to the room.
#pragma once

#include "smartsurf/record/Chart.h"
#include "smartsurf/record/Scalar.h"

namespace smartsurf::record {

class CurvePlot final : public Figure {
 public:
  CurvePlot(const Recording& recording, Scalar scalar);
  double width() const override;
  double height() const override;
  void draw(cairo_t* paper) const override;

  const Chart& chart() const { return chart_; }

 private:
  void draw_curve(cairo_t* paper, std::size_t i) const;
  void draw_legend(cairo_t* paper) const;

  std::vector<double> time_;
  Scalar scalar_;
  std::string subtitle_;
  Chart chart_;
};

}  // namespace smartsurf::record
