#include "smartsurf/record/plot/ChartFigure.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "common/index/Index.h"

namespace smartsurf::record {
namespace {

using common::Index;
using Mark = ChartLayer::Mark;

constexpr double kLeft = 66.0, kRight = 24.0, kTitleHeight = 34.0;
constexpr double kLegendRow = 20.0, kLineWidth = 1.8, kDotRadius = 2.2;
constexpr Index kMaxBins = 1440;     // two per point of width; more cannot be resolved
constexpr double kGroupWidth = 0.8;  // of the bars of a category
constexpr Rgba kRuleColour{0.00, 0.62, 0.45};

Rgba color_of(const ChartSpec& spec, Index layer) {
  return spec.layers[layer].color.value_or(kLineColours[layer % std::ssize(kLineColours)]);
}

// Layers without a colour of their own repeat the colours with other dashes.
LineStyle style_of(const ChartSpec& spec, Index layer) {
  const Index round = spec.layers[layer].color ? 0 : layer / std::ssize(kLineColours);
  return {color_of(spec, layer), kLineDashes[round % std::ssize(kLineDashes)]};
}

bool is_bar(const ChartLayer& layer) { return layer.mark == Mark::kBar; }

bool is_image(const ChartLayer& layer) { return layer.mark == Mark::kRect; }

// All cells of the images, whose rows count from the top, and the values of the other layers.
Axis image_axis(const ChartSpec& spec, const ChartAxis& axis, bool is_y) {
  double low = -0.5, high = static_cast<double>(axis.categories.size()) - 0.5;
  for (const ChartLayer& layer : spec.layers) {
    if (is_image(layer))
      high =
          std::max(high, static_cast<double>(is_y ? layer.values.size() : layer.values.front().size()) - 0.5);
    for (const double value : is_y ? layer.y : layer.x)
      if (std::isfinite(value)) low = std::min(low, value), high = std::max(high, value);
  }
  return {is_y ? high : low, is_y ? low : high, axis.title, false, axis.categories};
}

// The range of the layers' values, with a margin. Bars begin at zero.
Axis make_axis(const ChartSpec& spec, const ChartAxis& axis, std::vector<double> ChartLayer::*values) {
  if (axis.domain) return {(*axis.domain)[0], (*axis.domain)[1], axis.title, axis.log, axis.categories};
  const bool is_y = values == &ChartLayer::y;
  if (std::ranges::any_of(spec.layers, is_image)) return image_axis(spec, axis, is_y);
  if (!axis.categories.empty())
    return {-0.5, static_cast<double>(axis.categories.size()) - 0.5, axis.title, false, axis.categories};
  double low = INFINITY, high = -INFINITY;
  for (const ChartLayer& layer : spec.layers)
    for (const double value : layer.*values) {
      if (!std::isfinite(value) || (axis.log && value <= 0.0)) continue;
      low = std::min(low, value);
      high = std::max(high, value);
    }
  if (!(low <= high)) low = axis.log ? 0.1 : 0.0, high = 1.0;
  if (axis.log) {
    // Whole decades, of which the lowest value leaves some for its bar.
    const double first = std::floor(std::log10(low) - 1e-9), last = std::ceil(std::log10(high) - 1e-9);
    return {std::pow(10.0, first), std::pow(10.0, std::max(last, first + 1.0)), axis.title, true};
  }
  if (!is_y) {
    const double margin = axis_margin(low, high, 0.0);
    return {low - margin, high + margin, axis.title};
  }
  const bool has_bars = std::ranges::any_of(spec.layers, is_bar);
  if (has_bars) low = std::min(low, 0.0), high = std::max(high, 0.0);
  // Start at zero if the values still fill more than half of the axis.
  if (low > 0.0 && low < 0.5 * high) low = 0.0;
  const double margin = axis_margin(low, high, 0.04);
  const bool hangs = has_bars && high == 0.0 && low < 0.0, stands = low == 0.0 && (has_bars || high > 0.0);
  return {low - (stands ? 0.0 : margin), high + (hangs ? 0.0 : margin), axis.title};
}

Chart make_axes(const ChartSpec& spec) {
  const double top = spec.title.empty() ? 14.0 : spec.subtitle.empty() ? 42.0 : 62.0;
  Axis x = make_axis(spec, spec.x, &ChartLayer::x), y = make_axis(spec, spec.y, &ChartLayer::y);
  const double left = std::min(y_axis_room(y, spec.height - top), spec.width / 2.0),
               width = spec.width - left - kRight, height = spec.height - top;
  return {{left, top, width, height - x_axis_room(x, width, height)}, std::move(x), std::move(y)};
}

void draw_point(cairo_t* cr, double x, double y, double radius) {
  cairo_new_sub_path(cr);
  cairo_arc(cr, x, y, radius, 0.0, 2.0 * std::acos(-1.0));
  cairo_fill(cr);
}

// Whole, also on the frame; a point outside is left out.
void draw_point_in(cairo_t* cr, const PlotArea& area, double x, double y, double radius) {
  constexpr double kRounding = 1e-6;
  if (x < area.left - kRounding || x > area.right() + kRounding || y < area.top - kRounding ||
      y > area.bottom() + kRounding)
    return;
  cairo_save(cr);
  cairo_reset_clip(cr);
  draw_point(cr, x, y, radius);
  cairo_restore(cr);
}

}  // namespace

ChartFigure::Panel::Panel(ChartSpec chart) : spec(std::move(chart)), axes(make_axes(spec)) {
  for (Index i = 0; i < std::ssize(spec.layers); ++i) {
    const ChartLayer& layer = spec.layers[i];
    if (!layer.name.empty()) legend.push_back({layer.name, style_of(spec, i), layer.mark});
    for (Index k = 0; k < std::ssize(layer.labels); ++k)
      legend.push_back({layer.labels[k], {layer.colors[k], {}}, layer.mark});
  }
}

Index ChartFigure::Panel::legend_columns() const {
  return std::max<Index>(1, static_cast<Index>((spec.width - axes.area().left) / legend_entry()));
}

double ChartFigure::Panel::height() const {
  const Index columns = legend_columns();
  return spec.height + kLegendRow * static_cast<double>((std::ssize(legend) + columns - 1) / columns);
}

// Logarithmic axes have places for positive numbers alone.
bool ChartFigure::Panel::has_place(double x, double y) const {
  const auto is_on = [](const ChartAxis& axis, double value) {
    return std::isfinite(value) && !(axis.log && value <= 0.0);
  };
  return is_on(spec.x, x) && is_on(spec.y, y);
}

bool ChartFigure::Panel::has_values() const {
  return std::ranges::any_of(spec.layers, [&](const ChartLayer& layer) {
    if (is_image(layer)) return true;
    const Index count =
        is_bar(layer) ? std::ssize(layer.y) : std::min(std::ssize(layer.x), std::ssize(layer.y));
    for (Index i = 0; i < count; ++i)
      if (is_bar(layer) ? std::isfinite(layer.y[i]) : has_place(layer.x[i], layer.y[i])) return true;
    return false;
  });
}

void ChartFigure::Panel::draw_points(cairo_t* cr, const ChartLayer& layer) const {
  for (Index k = 0; k < std::min(std::ssize(layer.x), std::ssize(layer.y)); ++k)
    if (has_place(layer.x[k], layer.y[k]))
      draw_point_in(cr, axes.area(), axes.px(layer.x[k]), axes.py(layer.y[k]), 3.0);
}

// A long line is decimated: each bin draws its first, minimum, maximum and last value. A value between gaps
// is a dot.
void ChartFigure::Panel::draw_line(cairo_t* cr, const ChartLayer& layer, const LineStyle& style) const {
  const std::vector<double>& value = layer.y;
  const Index count = std::min(std::ssize(value), std::ssize(layer.x));
  const Index bin_size = std::max<Index>(1, (count + kMaxBins - 1) / kMaxBins);
  std::vector<Index> piece;  // shown between two gaps
  const auto finish_piece = [&] {
    const bool is_dot = piece.size() == 1 && !layer.point;
    for (const Index i : piece) {
      const double x = axes.px(layer.x[i]), y = axes.py(value[i]);
      if (is_dot)
        draw_point_in(cr, axes.area(), x, y, kDotRadius);
      else
        cairo_line_to(cr, x, y);
    }
    cairo_stroke(cr);
    piece.clear();
  };
  set_pen(cr, style.color, kLineWidth);
  cairo_set_dash(cr, style.dashes.data(), static_cast<int>(style.dashes.size()), 0.0);
  cairo_set_line_join(cr, CAIRO_LINE_JOIN_ROUND);
  const auto is_shown = [&](Index i) { return has_place(layer.x[i], value[i]); };
  for (Index first = 0; first < count; first += bin_size) {
    const Index end = std::min(first + bin_size, count);
    for (Index from = first; from < end;) {
      if (!is_shown(from)) {
        finish_piece();
        ++from;
        continue;
      }
      Index to = from;
      while (to < end && is_shown(to)) ++to;
      const auto [least, most] = std::minmax_element(value.begin() + from, value.begin() + to);
      Index samples[] = {from, least - value.begin(), most - value.begin(), to - 1};
      std::ranges::sort(samples);
      piece.insert(piece.end(), samples, std::unique(samples, std::end(samples)));
      from = to;
    }
  }
  finish_piece();
  cairo_set_dash(cr, nullptr, 0, 0.0);
}

void ChartFigure::Panel::draw_bars(cairo_t* cr) const {
  const auto layers = std::ranges::count_if(spec.layers, is_bar);
  if (layers == 0) return;
  const PlotArea& area = axes.area();
  const auto y_inside = [&](double value) { return std::clamp(axes.py(value), area.top, area.bottom()); };
  const double base = spec.y.log ? area.bottom() : y_inside(0.0);
  const double bar = kGroupWidth / static_cast<double>(layers);
  double offset = -0.5 * kGroupWidth;
  for (Index i = 0; i < std::ssize(spec.layers); ++i) {
    if (!is_bar(spec.layers[i])) continue;
    const std::vector<double>& values = spec.layers[i].y;
    set_pen(cr, color_of(spec, i));
    for (Index k = 0; k < std::ssize(values); ++k) {
      if (!std::isfinite(values[k])) continue;
      const double left = axes.px(static_cast<double>(k) + offset);
      const double right = axes.px(static_cast<double>(k) + offset + bar);
      cairo_rectangle(cr, left + 0.5, base, right - left - 1.0, y_inside(values[k]) - base);
    }
    cairo_fill(cr);
    offset += bar;
  }
  if (base <= area.top || base >= area.bottom()) return;
  set_pen(cr, kBlack);
  record::draw_line(cr, area.left, base, area.right(), base);
}

// The cell in row r, column c is the unit square around x = c, y = r.
void ChartFigure::Panel::draw_image(cairo_t* cr, const ChartLayer& layer) const {
  std::vector<Rgba> pixels;
  for (const std::vector<int>& row : layer.values)
    for (const int value : row) pixels.push_back(layer.colors[value]);
  const Index columns = std::ssize(layer.values.front());
  const double left = axes.px(-0.5), top = axes.py(-0.5);
  draw_pixels(cr,
              {left, top, axes.px(static_cast<double>(columns) - 0.5) - left,
               axes.py(static_cast<double>(layer.values.size()) - 0.5) - top},
              static_cast<int>(columns), pixels);
}

void ChartFigure::Panel::draw_rule(cairo_t* cr) const {
  const double x = axes.px(*spec.rule), bottom = axes.area().bottom(), dashes[] = {6.0, 3.5};
  set_pen(cr, kRuleColour, 1.4);
  cairo_set_dash(cr, dashes, 2, 0.0);
  record::draw_line(cr, x, axes.area().top, x, bottom);
  cairo_set_dash(cr, nullptr, 0, 0.0);
  const bool fits_right = x < axes.area().right() - 120.0;
  draw_text(cr, fits_right ? x + 6.0 : x - 6.0, bottom - 10.0, spec.rule_label, 12.0,
            fits_right ? Align::kLeft : Align::kRight);
}

double ChartFigure::Panel::legend_entry() const {
  std::size_t longest = 0;
  for (const LegendEntry& entry : legend) longest = std::max(longest, entry.name.size());
  return std::min(axes.area().width, 42.0 + 7.2 * static_cast<double>(longest));
}

void ChartFigure::Panel::draw_legend(cairo_t* cr) const {
  const double entry_width = legend_entry();
  const Index columns = legend_columns();
  for (Index i = 0; i < std::ssize(legend); ++i) {
    const double x = axes.area().left + static_cast<double>(i % columns) * entry_width;
    const double y = spec.height + 4.0 + static_cast<double>(i / columns) * kLegendRow;
    const LineStyle& style = legend[i].style;
    set_pen(cr, style.color, 2.4);
    if (legend[i].mark == Mark::kLine) {
      cairo_set_dash(cr, style.dashes.data(), static_cast<int>(style.dashes.size()), 0.0);
      record::draw_line(cr, x, y - 4.0, x + 22.0, y - 4.0);
      cairo_set_dash(cr, nullptr, 0, 0.0);
    } else if (legend[i].mark == Mark::kPoint) {
      draw_point(cr, x + 11.0, y - 4.0, 3.5);
    } else {
      cairo_rectangle(cr, x + 4.0, y - 10.0, 14.0, 11.0);
      cairo_fill(cr);
    }
    set_pen(cr, kBlack);
    draw_text(cr, x + 28.0, y, legend[i].name, 12.0, Align::kLeft, false, entry_width - 28.0);
  }
}

// Lines and points are drawn over the frame, which would cut and hide them where they lie on it.
void ChartFigure::Panel::draw(cairo_t* cr) const {
  axes.clip(cr);
  axes.draw_grid(cr);
  draw_bars(cr);
  for (const ChartLayer& layer : spec.layers)
    if (is_image(layer)) draw_image(cr, layer);
  cairo_restore(cr);
  axes.draw_axes(cr);
  axes.clip(cr, 0.5 * kLineWidth);
  for (Index i = 0; i < std::ssize(spec.layers); ++i) {
    const ChartLayer& layer = spec.layers[i];
    if (layer.mark == Mark::kLine) draw_line(cr, layer, style_of(spec, i));
    if (layer.mark != Mark::kPoint && !layer.point) continue;
    set_pen(cr, color_of(spec, i));
    draw_points(cr, layer);
  }
  if (spec.rule) draw_rule(cr);
  cairo_restore(cr);
  if (!has_values()) {
    const PlotArea& area = axes.area();
    set_pen(cr, kGreyPen);
    draw_text(cr, area.left + 0.5 * area.width, area.top + 0.5 * area.height, "no values", 13.0,
              Align::kCentre);
  }
  const double left = axes.area().left, width = axes.area().width;
  set_pen(cr, kBlack);
  draw_text(cr, left, 28.0, spec.title, 17.0, Align::kLeft, true, width);
  set_pen(cr, kGreyPen);
  draw_text(cr, left, 48.0, spec.subtitle, 12.0, Align::kLeft, false, width);
  draw_legend(cr);
}

ChartFigure::ChartFigure(ChartSpec chart) { panels_.emplace_back(std::move(chart)); }

ChartFigure::ChartFigure(std::string title, std::vector<ChartSpec> panels, int columns)
    : title_(std::move(title)), columns_(columns) {
  for (ChartSpec& panel : panels) panels_.emplace_back(std::move(panel));
}

// Where the columns of panels begin, and the end of the last; a column is as wide as its widest panel.
std::vector<double> ChartFigure::column_edges() const {
  std::vector<double> edges{0.0};
  for (Index column = 0; column < std::min<Index>(columns_, std::ssize(panels_)); ++column) {
    double widest = 0.0;
    for (Index i = column; i < std::ssize(panels_); i += columns_)
      widest = std::max(widest, panels_[i].spec.width);
    edges.push_back(edges.back() + widest);
  }
  return edges;
}

double ChartFigure::width() const { return column_edges().back(); }

double ChartFigure::height() const {
  double row_height = 0.0;
  for (const Panel& panel : panels_) row_height = std::max(row_height, panel.height());
  return (title_.empty() ? 0.0 : kTitleHeight) +
         row_height * static_cast<double>((std::ssize(panels_) + columns_ - 1) / columns_);
}

void ChartFigure::draw(cairo_t* cr) const {
  const double top = title_.empty() ? 0.0 : kTitleHeight;
  const double row_height =
      (height() - top) / static_cast<double>((std::ssize(panels_) + columns_ - 1) / columns_);
  const std::vector<double> edges = column_edges();
  set_pen(cr, kBlack);
  draw_text(cr, kLeft, 26.0, title_, 15.0, Align::kLeft, true, edges.back() - 2.0 * kLeft);
  for (Index i = 0; i < std::ssize(panels_); ++i) {
    cairo_save(cr);
    cairo_translate(cr, edges[i % columns_], top + static_cast<double>(i / columns_) * row_height);
    panels_[i].draw(cr);
    cairo_restore(cr);
  }
}

}  // namespace smartsurf::record
