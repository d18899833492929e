// Plots the surface from above, each cell coloured by the time that objects spent over it. Internal to this
// module.
#pragma once

#include "smartsurf/record/Recording.h"
#include "smartsurf/record/plot/Chart.h"

namespace smartsurf::record {

class TimeSpentPlot final : public Figure {
 public:
  // label: counts only objects with this label; "" counts all. Fixed objects never count. Throws
  // scene::InputError if no object has the label.
  TimeSpentPlot(const Recording& recording, const std::string& label);
  double width() const override;
  double height() const override;
  void draw(cairo_t* cr) const override;

  // Time with an object's centre over the cell, summed over the objects, s; rows × columns, row-major, row 0
  // is north.
  const std::vector<double>& seconds() const { return seconds_; }
  const Chart& chart() const { return chart_; }

 private:
  void accumulate(const Recording& recording, const std::vector<bool>& included);
  void draw_cells(cairo_t* cr) const;
  void draw_colour_bar(cairo_t* cr) const;

  scene::SurfaceSpec surface_;
  std::string title_, subtitle_;
  Chart chart_;
  std::vector<double> seconds_;
  double max_seconds_ = 0.0;
};

}  // namespace smartsurf::record
