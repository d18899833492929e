// Plots the trajectory of every object from above, as in Fig. 9 of the paper, with O at the start and X at
// the end. Internal to this module.
//
// Each label has its own line style, in the natural order of the labels. The lines have the objects' colours
// where these tell the groups apart. `fixed` objects are not drawn.
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
  using Point = std::array<float, 2>;  // x, y, u

  struct Group {
    std::string name;
    LineStyle style;
    std::vector<std::size_t> objects;  // ids
  };

  struct Legend {
    std::size_t columns;
    std::size_t named;    // the first groups; if there are more, the next entry counts them
    std::size_t entries;  // with those for start and end
  };

  void find_groups();
  void set_styles();
  void collect_paths(const Recording& recording);
  bool is_off_surface(const Point& point) const;
  void draw_cells(cairo_t* cr) const;
  void draw_surface(cairo_t* cr) const;
  void draw_group(cairo_t* cr, const Group& group) const;
  void draw_marks(cairo_t* cr, const Group& group) const;
  void draw_legend(cairo_t* cr) const;
  static std::string legend_text(const Group& group);
  Legend legend() const;

  scene::SceneSpec spec_;
  std::string subtitle_;
  Chart chart_;
  std::vector<Group> groups_;
  std::vector<std::vector<Point>> paths_;  // one per object
};

}  // namespace smartsurf::record
