#include "smartsurf/record/plot/TrajectoryPlot.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "smartsurf/scene/SurfaceBounds.h"

namespace smartsurf::record {
namespace {

constexpr double kLongSide = 640.0, kMinWidth = 420.0, kMinHeight = 220.0;  // points
constexpr double kRightMargin = 24.0, kTop = 62.0, kLegendOffset = 48.0, kLegendRow = 22.0,
                 kLegendTextOffset = 44.0;
constexpr std::size_t kMaxLegendColumns = 4;    // including the entries for start and end
constexpr double kMaxLegendShare = 1.0 / 3.0;   // of the plot's height
constexpr float kMinContrast = 0.12F;           // between the colours of groups, in one component
constexpr float kMaxLuma = 0.6F;                // of lines on white
constexpr double kMarkRadius = 4.6;             // radius of an O, arm of an X
constexpr double kMargin = 0.03;                // margin around the surface, as a share of its longer side
constexpr double kMinStep_points = 0.5;         // shorter moves are not visible
constexpr std::size_t kBlockValues = 1u << 20;  // floats read at once

// Each pair of a colour and a pattern of dashes once; neighbours differ in both.
const std::vector<LineStyle>& line_styles() {
  static const std::vector<LineStyle> all = [] {
    constexpr std::size_t kCount = std::size(kLineDashes);
    std::vector<LineStyle> styles;
    for (std::size_t i = 0; i < kCount * kCount; ++i)
      styles.push_back({kLineColours[i % kCount], kLineDashes[(i + i / kCount) % kCount]});
    return styles;
  }();
  return all;
}

// Numbers within names count as such: "class 2" is before "class 10".
bool is_naturally_less(std::string_view a, std::string_view b) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  const auto take_digits = [&](std::string_view& text) {
    const auto end = std::ranges::find_if_not(text, is_digit) - text.begin();
    std::string_view digits = text.substr(0, static_cast<std::size_t>(end));
    text.remove_prefix(digits.size());
    digits.remove_prefix(std::min(digits.find_first_not_of('0'), digits.size()));
    return digits;
  };
  const std::string_view whole_a = a, whole_b = b;
  while (!a.empty() && !b.empty()) {
    if (is_digit(a.front()) && is_digit(b.front())) {
      const std::string_view m = take_digits(a), n = take_digits(b);
      if (m != n) return m.size() != n.size() ? m.size() < n.size() : m < n;
    } else if (a.front() != b.front()) {
      return a.front() < b.front();
    } else {
      a.remove_prefix(1), b.remove_prefix(1);
    }
  }
  return a.empty() != b.empty() ? a.empty() : whole_a < whole_b;
}

// The colour, as dark as a line on white has to be.
scene::Colour on_white(scene::Colour colour) {
  const float luma = 0.2126F * colour.r + 0.7152F * colour.g + 0.0722F * colour.b;
  const float factor = kMaxLuma / std::max(luma, kMaxLuma);
  return {factor * colour.r, factor * colour.g, factor * colour.b};
}

float contrast(const scene::Colour& a, const scene::Colour& b) {
  return std::max({std::abs(a.r - b.r), std::abs(a.g - b.g), std::abs(a.b - b.b)});
}

Chart make_chart(const scene::SurfaceSpec& s) {
  const scene::SurfaceBounds outline = scene::compute_surface_bounds(s);
  const double width = outline.width(), height = outline.height(), margin = kMargin * std::max(width, height);
  const double x = outline.west, y = outline.south;
  const double total_width = width + 2.0 * margin, total_height = height + 2.0 * margin;
  const double points = kLongSide / std::max(total_width, total_height);
  PlotArea area{0.0, kTop, std::max(total_width * points, kMinWidth),
                std::max(total_height * points, kMinHeight)};
  const double padding_x = (area.width / points - total_width) / 2.0,
               padding_y = (area.height / points - total_height) / 2.0;
  const Axis north{y - margin - padding_y, y + height + margin + padding_y, "y, north [u]"};
  area.left = y_axis_room(north, area.height);
  return {area, {x - margin - padding_x, x + width + margin + padding_x, "x, east [u]"}, north};
}

void draw_circle(cairo_t* cr, double x, double y) {
  cairo_new_sub_path(cr);
  cairo_arc(cr, x, y, kMarkRadius, 0.0, 2.0 * std::acos(-1.0));
}

void draw_cross(cairo_t* cr, double x, double y) {
  const double arm = 0.9 * kMarkRadius;
  cairo_move_to(cr, x - arm, y - arm);
  cairo_line_to(cr, x + arm, y + arm);
  cairo_move_to(cr, x - arm, y + arm);
  cairo_line_to(cr, x + arm, y - arm);
}

// Draws a mark with a white halo, so that it stands out from the lines.
template <class Shape>
void draw_mark(cairo_t* cr, const Rgba& ink, Shape shape) {
  shape();
  set_pen(cr, {1, 1, 1, 0.85}, 4.4);
  cairo_stroke(cr);
  shape();
  set_pen(cr, ink, 1.8);
  cairo_stroke(cr);
}

void set_line_style(cairo_t* cr, const LineStyle& style, double width, double alpha) {
  set_pen(cr, {style.color.r, style.color.g, style.color.b, alpha}, width);
  cairo_set_dash(cr, style.dashes.data(), static_cast<int>(style.dashes.size()), 0.0);
}

}  // namespace

TrajectoryPlot::TrajectoryPlot(const Recording& recording)
    : spec_(recording.spec()), subtitle_(subtitle(recording)), chart_(make_chart(recording.spec().surface)) {
  find_groups();
  collect_paths(recording);
  std::size_t off_surface_count = 0;
  for (const std::vector<Point>& path : paths_)
    off_surface_count += !path.empty() && is_off_surface(path.back());
  if (off_surface_count > 0)
    subtitle_ += " · " + std::to_string(off_surface_count) +
                 (off_surface_count == 1 ? " object" : " objects") + " off the surface";
}

double TrajectoryPlot::width() const { return chart_.area().right() + kRightMargin; }
double TrajectoryPlot::height() const {
  const auto [columns, named, entries] = legend();
  const auto rows = static_cast<double>((entries + columns - 1) / columns);
  return chart_.area().bottom() + kLegendOffset + rows * kLegendRow + 8.0;
}
std::string TrajectoryPlot::legend_text(const Group& group) {
  return group.name + " (" + std::to_string(group.objects.size()) + ")";
}
// As many columns as have room for the longest text; fewer, if that keeps the last entry from a row of its
// own.
TrajectoryPlot::Legend TrajectoryPlot::legend() const {
  std::size_t longest = 1;
  for (const Group& group : groups_) longest = std::max(longest, legend_text(group).size());
  const double entry = kLegendTextOffset + 7.2 * static_cast<double>(longest) + 6.0;
  const auto most =
      std::clamp<std::size_t>(static_cast<std::size_t>(chart_.area().width / entry), 1, kMaxLegendColumns);
  const auto rows = static_cast<std::size_t>(kMaxLegendShare * chart_.area().height / kLegendRow);
  const std::size_t all = groups_.size() + 2;
  if (all > most * rows) return {most, most * rows - 3, most * rows};
  std::size_t columns = most;
  while (columns > 1 && all > columns && all % columns == 1) --columns;
  if (columns == 1 || all > columns * rows) columns = most;
  return {columns, groups_.size(), all};
}

// Groups by label; objects without one are the last group.
void TrajectoryPlot::find_groups() {
  std::map<std::string, Group, decltype(&is_naturally_less)> labelled(&is_naturally_less);
  Group unlabelled;
  for (std::size_t i = 0; i < spec_.objects.size(); ++i) {
    const scene::ObjectSpec& object = spec_.objects[i];
    if (object.fixed) continue;
    Group& group = object.label.empty() ? unlabelled : labelled[object.label];
    group.name = object.label;
    group.objects.push_back(i);
  }
  for (auto& [label, group] : labelled) groups_.push_back(std::move(group));
  if (!unlabelled.objects.empty()) {
    unlabelled.name = groups_.empty() ? "objects" : "unlabelled";
    groups_.push_back(std::move(unlabelled));
  }
  set_styles();
}

// The objects' own colours, if those of a group are equal, those of groups differ, and one at least is not
// the default of its look.
void TrajectoryPlot::set_styles() {
  for (std::size_t i = 0; i < groups_.size(); ++i) groups_[i].style = line_styles()[i % line_styles().size()];
  std::vector<scene::Colour> own;
  bool is_chosen = false;
  for (const Group& group : groups_) {
    const scene::ObjectSpec& first = spec_.objects[group.objects.front()];
    const auto look =
        static_cast<std::size_t>(spec_.materials[static_cast<std::size_t>(first.material)].look);
    is_chosen |= contrast(first.colour, scene::kLookColours[look]) > 0.0F;
    for (const std::size_t i : group.objects)
      if (contrast(spec_.objects[i].colour, first.colour) > 0.0F) return;
    own.push_back(on_white(first.colour));
    for (std::size_t i = 0; i + 1 < own.size(); ++i)
      if (contrast(own[i], own.back()) < kMinContrast) return;
  }
  for (std::size_t i = 0; is_chosen && i < groups_.size(); ++i)
    groups_[i].style.color = {own[i].r, own[i].g, own[i].b};
}

void TrajectoryPlot::collect_paths(const Recording& recording) {
  const std::size_t objects = spec_.objects.size();
  paths_.resize(objects);
  if (objects == 0) return;
  const double min_step = kMinStep_points / (chart_.px(1.0) - chart_.px(0.0));
  std::vector<Point> last(objects, {NAN, NAN});
  const std::size_t block = std::max<std::size_t>(1, kBlockValues / (3 * objects));
  for (std::size_t first = 0; first < recording.frames(); first += block) {
    const std::size_t count = std::min(block, recording.frames() - first);
    const std::vector<float> positions = recording.read_positions(first, count);
    for (std::size_t f = 0; f < count; ++f)
      for (std::size_t i = 0; i < objects; ++i) {
        const float* p = positions.data() + 3 * (objects * f + i);
        if (std::isnan(p[0])) continue;
        last[i] = {p[0], p[1]};
        if (paths_[i].empty() ||
            std::hypot(p[0] - paths_[i].back()[0], p[1] - paths_[i].back()[1]) >= min_step)
          paths_[i].push_back(last[i]);
      }
  }
  for (std::size_t i = 0; i < objects; ++i)
    if (!paths_[i].empty()) paths_[i].push_back(last[i]);
}

bool TrajectoryPlot::is_off_surface(const Point& point) const {
  return !scene::compute_surface_bounds(spec_.surface).contains(point[0], point[1]);
}

// Draws the cell tops of a free layout.
void TrajectoryPlot::draw_cells(cairo_t* cr) const {
  const scene::SurfaceSpec& s = spec_.surface;
  for (std::size_t i = 0; i < s.cell_poses.size(); ++i) {
    if (s.is_empty(static_cast<int>(i) / s.columns, static_cast<int>(i) % s.columns)) continue;
    const scene::CellPose& place = s.cell_poses[i];
    const double cosine = std::cos(place.angle), sine = std::sin(place.angle);
    cairo_new_sub_path(cr);
    for (const auto& [a, b] : {std::pair{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}}) {
      const double x = a * s.pin.top_x, y = b * s.pin.top_y;
      cairo_line_to(cr, chart_.px(place.x + cosine * x - sine * y),
                    chart_.py(place.y + sine * x + cosine * y));
    }
    cairo_close_path(cr);
  }
  set_pen(cr, kLightGreyPen);
  cairo_fill(cr);
}

void TrajectoryPlot::draw_surface(cairo_t* cr) const {
  const scene::SurfaceSpec& s = spec_.surface;
  const scene::SurfaceBounds outline = scene::compute_surface_bounds(s);
  const double west = outline.west, south = outline.south, wide = outline.width(), high = outline.height();
  const auto rectangle = [&](double inset) {
    const double x = chart_.px(west + inset), y = chart_.py(south + high - inset);
    cairo_rectangle(cr, x, y, chart_.px(west + wide - inset) - x, chart_.py(south + inset) - y);
  };
  rectangle(0.0);
  set_pen(cr, s.border_height && s.cell_poses.empty() ? kLightGreyPen : kWhite);
  cairo_fill(cr);
  if (!s.cell_poses.empty()) draw_cells(cr);
  if (s.border_height && s.cell_poses.empty() && s.rows > 2 && s.columns > 2) {
    rectangle(s.pitch);
    set_pen(cr, kWhite);
    cairo_fill(cr);
  }
  rectangle(0.0);
  set_pen(cr, kGreyPen, 1.2);
  cairo_stroke(cr);
}

void TrajectoryPlot::draw_group(cairo_t* cr, const Group& group) const {
  set_line_style(cr, group.style, 1.2, 0.75);
  for (const std::size_t i : group.objects) {
    for (const Point& point : paths_[i]) cairo_line_to(cr, chart_.px(point[0]), chart_.py(point[1]));
    cairo_stroke(cr);
  }
  cairo_set_dash(cr, nullptr, 0, 0.0);
}

void TrajectoryPlot::draw_marks(cairo_t* cr, const Group& group) const {
  const Rgba ink = group.style.color;
  for (const std::size_t i : group.objects) {
    if (paths_[i].empty()) continue;
    const Point from = paths_[i].front(), to = paths_[i].back();
    draw_mark(cr, ink, [&] { draw_circle(cr, chart_.px(from[0]), chart_.py(from[1])); });
    draw_mark(cr, ink, [&] { draw_cross(cr, chart_.px(to[0]), chart_.py(to[1])); });
  }
}

void TrajectoryPlot::draw_legend(cairo_t* cr) const {
  const PlotArea& area = chart_.area();
  const auto [columns, named, entries] = legend();
  const double column = area.width / static_cast<double>(columns);
  for (std::size_t i = 0; i < entries; ++i) {
    const double x = area.left + column * static_cast<double>(i % columns);
    const double y = area.bottom() + kLegendOffset + kLegendRow * (static_cast<double>(i / columns) + 0.5);
    const double text_x = x + (i + 2 < entries ? kLegendTextOffset : 24.0), middle = x + 12.0;
    std::string text = i + 2 == entries ? "start" : "end";
    if (i < named) {
      text = legend_text(groups_[i]);
      set_line_style(cr, groups_[i].style, 1.8, 1.0);
      draw_line(cr, x, y, x + 36.0, y);
      cairo_set_dash(cr, nullptr, 0, 0.0);
    } else if (i + 2 < entries) {
      text = "… and " + std::to_string(groups_.size() - named) + " more";
    } else if (i + 2 == entries) {
      draw_mark(cr, kBlack, [&] { draw_circle(cr, middle, y); });
    } else {
      draw_mark(cr, kBlack, [&] { draw_cross(cr, middle, y); });
    }
    set_pen(cr, kBlack);
    draw_text(cr, text_x, y + 4.5, text, 12.0, Align::kLeft, false, x + column - text_x - 6.0);
  }
}

void TrajectoryPlot::draw(cairo_t* cr) const {
  const PlotArea& area = chart_.area();
  cairo_set_line_join(cr, CAIRO_LINE_JOIN_ROUND);
  chart_.clip(cr);
  draw_surface(cr);
  // Small objects last, so that the lines of the large ones do not hide theirs.
  for (auto group = groups_.rbegin(); group != groups_.rend(); ++group) draw_group(cr, *group);
  for (auto group = groups_.rbegin(); group != groups_.rend(); ++group) draw_marks(cr, *group);
  cairo_restore(cr);
  chart_.draw_axes(cr);
  set_pen(cr, kBlack);
  draw_text(cr, area.left, 28.0, "Trajectories", 17.0, Align::kLeft, true);
  set_pen(cr, kGreyPen);
  draw_text(cr, area.left, 48.0, subtitle_, 12.0, Align::kLeft, false, area.width);
  draw_legend(cr);
}

}  // namespace smartsurf::record
