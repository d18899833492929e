#include "smartsurf/record/TrajectoryPlot.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "smartsurf/record/Purity.h"
#include "smartsurf/scene/Outline.h"

namespace smartsurf::record {
namespace {

constexpr double kLongSide = 640.0, kLeastWidth = 420.0, kLeastHeight = 220.0;  // points
constexpr double kLeft = 66.0, kRight = 24.0, kTop = 62.0, kBelowAxis = 48.0, kLegendRow = 22.0;
constexpr std::size_t kLegendColumns = 4;  // start and end included
constexpr double kMark = 4.6;              // radius of an O, arm of an X
constexpr double kMargin = 0.03;           // of the longer side, around the surface
constexpr double kLeastStep_points = 0.5;  // shorter moves add nothing but ink
constexpr std::size_t kBlockNumbers = 1u << 20;

struct Style {
  Ink ink;
  std::vector<double> dashes;
};
// Colours that the colour-blind can tell apart (Okabe and Ito).
const std::vector<Style>& styles() {
  static const std::vector<Style> all{{{0.00, 0.45, 0.70}, {}},
                                      {{0.84, 0.37, 0.00}, {6.0, 3.5}},
                                      {{0.00, 0.62, 0.45}, {1.5, 2.5}},
                                      {{0.80, 0.47, 0.65}, {8.0, 3.0, 1.5, 3.0}},
                                      {{0.34, 0.71, 0.91}, {12.0, 4.0}}};
  return all;
}

Chart chart_of(const scene::SurfaceSpec& s) {
  const scene::Outline outline = scene::outline_of(s);
  const double wide = outline.width(), high = outline.height(), margin = kMargin * std::max(wide, high);
  const double x = outline.west, y = outline.south;
  const double all_wide = wide + 2.0 * margin, all_high = high + 2.0 * margin;
  const double points = kLongSide / std::max(all_wide, all_high);
  const Area area{kLeft, kTop, std::max(all_wide * points, kLeastWidth),
                  std::max(all_high * points, kLeastHeight)};
  const double more_x = (area.width / points - all_wide) / 2.0,
               more_y = (area.height / points - all_high) / 2.0;
  return {area,
          {x - margin - more_x, x + wide + margin + more_x, "x, east [u]"},
          {y - margin - more_y, y + high + margin + more_y, "y, north [u]"}};
}

void draw_o(cairo_t* paper, double x, double y) {
  cairo_new_sub_path(paper);
  cairo_arc(paper, x, y, kMark, 0.0, 2.0 * std::acos(-1.0));
}

void draw_x(cairo_t* paper, double x, double y) {
  const double arm = 0.9 * kMark;
  cairo_move_to(paper, x - arm, y - arm);
  cairo_line_to(paper, x + arm, y + arm);
  cairo_move_to(paper, x - arm, y + arm);
  cairo_line_to(paper, x + arm, y - arm);
}

// On a white rim, so that a mark can be seen among lines.
template <class Shape>
void draw_mark(cairo_t* paper, const Ink& ink, Shape shape) {
  shape();
  use(paper, {1, 1, 1, 0.85}, 4.4);
  cairo_stroke(paper);
  shape();
  use(paper, ink, 1.8);
  cairo_stroke(paper);
}

void set_style(cairo_t* paper, const Style& style, double width, double alpha) {
  use(paper, {style.ink.r, style.ink.g, style.ink.b, alpha}, width);
  cairo_set_dash(paper, style.dashes.data(), static_cast<int>(style.dashes.size()), 0.0);
}

}  // namespace

TrajectoryPlot::TrajectoryPlot(const Recording& recording)
    : spec_(recording.spec()), subtitle_(subtitle(recording)), chart_(chart_of(recording.spec().surface)) {
  find_groups();
  follow_objects(recording);
  std::size_t off = 0;
  for (const std::vector<Point>& way : ways_) off += !way.empty() && off_surface(way.back());
  if (off > 0)
    subtitle_ += " · " + std::to_string(off) + (off == 1 ? " object" : " objects") + " off the surface";
}

double TrajectoryPlot::width() const { return chart_.area().right() + kRight; }
double TrajectoryPlot::height() const {
  return chart_.area().bottom() + kBelowAxis + legend_rows() * kLegendRow + 8.0;
}
double TrajectoryPlot::legend_rows() const {
  return std::ceil(static_cast<double>(groups_.size() + 2) / kLegendColumns);
}

// By label when there are labels, else by size. With exactly two labels these are the two size classes.
void TrajectoryPlot::find_groups() {
  const std::vector<SizeClass> classes = size_classes(spec_.objects);
  std::set<std::string> labels;
  for (const scene::ObjectSpec& object : spec_.objects)
    if (!object.fixed && !object.label.empty()) labels.insert(object.label);
  two_classes_ =
      (labels.empty() || labels.size() == 2) &&
      std::any_of(classes.begin(), classes.end(), [](SizeClass c) { return c != SizeClass::kNone; });

  std::map<std::string, Group> groups;
  for (std::size_t i = 0; i < classes.size(); ++i) {
    if (spec_.objects[i].fixed) continue;
    std::string name = spec_.objects[i].label;
    if (name.empty())
      name = !labels.empty()                   ? "unlabelled"
             : !two_classes_                   ? "objects"
             : classes[i] == SizeClass::kSmall ? "small"
                                               : "large";
    Group& group = groups[name];
    group.name = name;
    group.size += size_of(spec_.objects[i]);
    group.objects.push_back(i);
  }
  for (auto& [name, group] : groups) {
    group.size /= static_cast<double>(group.objects.size());
    groups_.push_back(std::move(group));
  }
  std::stable_sort(groups_.begin(), groups_.end(), [](const Group& a, const Group& b) {
    const bool a_last = a.name == "unlabelled", b_last = b.name == "unlabelled";
    return a_last != b_last ? b_last : a.size < b.size;
  });
  for (std::size_t i = 0; i < groups_.size(); ++i) groups_[i].style = static_cast<int>(i % styles().size());
}

void TrajectoryPlot::follow_objects(const Recording& recording) {
  const std::size_t objects = spec_.objects.size();
  ways_.resize(objects);
  if (objects == 0) return;
  const double least = kLeastStep_points / (chart_.px(1.0) - chart_.px(0.0));
  std::vector<Point> last(objects, {NAN, NAN});
  const std::size_t block = std::max<std::size_t>(1, kBlockNumbers / (3 * objects));
  for (std::size_t first = 0; first < recording.frames(); first += block) {
    const std::size_t count = std::min(block, recording.frames() - first);
    const std::vector<float> positions = recording.positions(first, count);
    for (std::size_t f = 0; f < count; ++f)
      for (std::size_t i = 0; i < objects; ++i) {
        const float* p = positions.data() + 3 * (objects * f + i);
        if (std::isnan(p[0])) continue;
        last[i] = {p[0], p[1]};
        if (ways_[i].empty() || std::hypot(p[0] - ways_[i].back()[0], p[1] - ways_[i].back()[1]) >= least)
          ways_[i].push_back(last[i]);
      }
  }
  for (std::size_t i = 0; i < objects; ++i)
    if (!ways_[i].empty()) ways_[i].push_back(last[i]);
}

bool TrajectoryPlot::off_surface(const Point& point) const {
  return !scene::outline_of(spec_.surface).contains(point[0], point[1]);
}

// The tops of the cells of a layout that is no rectangular grid.
void TrajectoryPlot::draw_cells(cairo_t* paper) const {
  const scene::SurfaceSpec& s = spec_.surface;
  for (std::size_t i = 0; i < s.places.size(); ++i) {
    if (s.is_empty(static_cast<int>(i) / s.columns, static_cast<int>(i) % s.columns)) continue;
    const scene::CellPlace& place = s.places[i];
    const double cosine = std::cos(place.angle), sine = std::sin(place.angle);
    cairo_new_sub_path(paper);
    for (const auto& [a, b] : {std::pair{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}}) {
      const double x = a * s.pin.top_x, y = b * s.pin.top_y;
      cairo_line_to(paper, chart_.px(place.x + cosine * x - sine * y),
                    chart_.py(place.y + sine * x + cosine * y));
    }
    cairo_close_path(paper);
  }
  use(paper, kPale);
  cairo_fill(paper);
}

void TrajectoryPlot::draw_surface(cairo_t* paper) const {
  const scene::SurfaceSpec& s = spec_.surface;
  const scene::Outline outline = scene::outline_of(s);
  const double west = outline.west, south = outline.south, wide = outline.width(), high = outline.height();
  const auto rectangle = [&](double inset) {
    const double x = chart_.px(west + inset), y = chart_.py(south + high - inset);
    cairo_rectangle(paper, x, y, chart_.px(west + wide - inset) - x, chart_.py(south + inset) - y);
  };
  rectangle(0.0);
  use(paper, s.border_height && s.places.empty() ? kPale : kWhite);
  cairo_fill(paper);
  if (!s.places.empty()) draw_cells(paper);
  if (s.border_height && s.places.empty() && s.rows > 2 && s.columns > 2) {
    rectangle(s.pitch);
    use(paper, kWhite);
    cairo_fill(paper);
  }
  rectangle(0.0);
  use(paper, kGrey, 1.2);
  cairo_stroke(paper);
  if (!two_classes_) return;
  const double centre = chart_.px((outline.west + outline.east) / 2.0);
  const double dots[] = {1.5, 3.0};
  cairo_set_dash(paper, dots, 2, 0.0);
  use(paper, kGrey, 1.0);
  draw_line(paper, centre, chart_.py(south + high), centre, chart_.py(south));
  cairo_set_dash(paper, nullptr, 0, 0.0);
}

void TrajectoryPlot::draw_group(cairo_t* paper, const Group& group) const {
  set_style(paper, styles()[static_cast<std::size_t>(group.style)], 1.2, 0.75);
  for (const std::size_t i : group.objects) {
    for (const Point& point : ways_[i]) cairo_line_to(paper, chart_.px(point[0]), chart_.py(point[1]));
    cairo_stroke(paper);
  }
  cairo_set_dash(paper, nullptr, 0, 0.0);
}

void TrajectoryPlot::draw_marks(cairo_t* paper, const Group& group) const {
  const Ink ink = styles()[static_cast<std::size_t>(group.style)].ink;
  for (const std::size_t i : group.objects) {
    if (ways_[i].empty()) continue;
    const Point from = ways_[i].front(), to = ways_[i].back();
    draw_mark(paper, ink, [&] { draw_o(paper, chart_.px(from[0]), chart_.py(from[1])); });
    draw_mark(paper, ink, [&] { draw_x(paper, chart_.px(to[0]), chart_.py(to[1])); });
  }
}

void TrajectoryPlot::draw_legend(cairo_t* paper) const {
  const Area& area = chart_.area();
  const double column = area.width / static_cast<double>(kLegendColumns);
  for (std::size_t i = 0; i < groups_.size() + 2; ++i) {
    const double x = area.left + column * static_cast<double>(i % kLegendColumns);
    const double y =
        area.bottom() + kBelowAxis + kLegendRow * (static_cast<double>(i / kLegendColumns) + 0.5);
    const double text_x = x + (i < groups_.size() ? 44.0 : 24.0), middle = x + 12.0;
    std::string text = i == groups_.size() ? "start" : "end";
    if (i < groups_.size()) {
      text = groups_[i].name + " (" + std::to_string(groups_[i].objects.size()) + ")";
      set_style(paper, styles()[static_cast<std::size_t>(groups_[i].style)], 1.8, 1.0);
      draw_line(paper, x, y, x + 36.0, y);
      cairo_set_dash(paper, nullptr, 0, 0.0);
    } else if (i == groups_.size()) {
      draw_mark(paper, kBlack, [&] { draw_o(paper, middle, y); });
    } else {
      draw_mark(paper, kBlack, [&] { draw_x(paper, middle, y); });
    }
    use(paper, kBlack);
    draw_text(paper, text_x, y + 4.5, text, 12.0, Align::kLeft, false, x + column - text_x - 6.0);
  }
}

void TrajectoryPlot::draw(cairo_t* paper) const {
  const Area& area = chart_.area();
  cairo_set_line_join(paper, CAIRO_LINE_JOIN_ROUND);
  chart_.clip(paper);
  draw_surface(paper);
  // Small over large: the larger objects' lines would hide them.
  for (auto group = groups_.rbegin(); group != groups_.rend(); ++group) draw_group(paper, *group);
  for (auto group = groups_.rbegin(); group != groups_.rend(); ++group) draw_marks(paper, *group);
  cairo_restore(paper);
  chart_.draw_axes(paper);
  use(paper, kBlack);
  draw_text(paper, area.left, 28.0, "Trajectories", 17.0, Align::kLeft, true);
  use(paper, kGrey);
  draw_text(paper, area.left, 48.0, subtitle_, 12.0, Align::kLeft, false, area.width);
  draw_legend(paper);
}

}  // namespace smartsurf::record
