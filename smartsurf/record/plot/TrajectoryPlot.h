// The trajectory of every object from above, as in the paper's Fig. 9: solid for small and dashed for large
// objects, O at the start and X at the end. Internal to this module.
//
// Two size classes (Purity.h) have two line styles; more than two labels have one each, in the order of their
// mean sizes. `fixed` objects are not drawn.
#pragma once

#include <array>

#include "smartsurf/record/Recording.h"
#include "smartsurf/record/plot/Chart.h"

namespace smartsurf::record {

class TrajectoryPlot final : public Figure {
 public:
  explicit TrajectoryPlot(const Recording& recording);
  double width() const override;
  double height() const override;
  void draw(cairo_t* cr) const override;

  const Chart& chart() const { return chart_; }

 private:
  using Point = std::array<float, 2>;  // x, y, u; a NaN ends one piece of a line and begins the next

  struct Group {
    std::string name;
    double mean_size = 0.0;  // mean, u
    int style = 0;           // index of its ink and dashes
    std::vector<std::size_t> objects;
  };

  void find_groups();
  void collect_paths(const Recording& recording);
  bool is_off_surface(const Point& point) const;
  void draw_cells(cairo_t* cr) const;
  void draw_surface(cairo_t* cr) const;
  void draw_group(cairo_t* cr, const Group& group) const;
  void draw_marks(cairo_t* cr, const Group& group) const;
  void draw_legend(cairo_t* cr) const;
  double legend_rows() const;

  scene::SceneSpec spec_;
  std::string subtitle_;
  Chart chart_;
  bool has_size_classes_ = false;
  std::vector<Group> groups_;
  std::vector<std::vector<Point>> paths_;  // one an object
};

}  // namespace smartsurf::record
