#include "common/chart/Chart.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>

#include "common/index/Index.h"
#include "common/text/Printable.h"

namespace common {
namespace {

constexpr double kTickLength = 4.0, kTickLabelSize = 11.0, kTitleSize = 13.0;

bool is_continuation(char byte) { return (static_cast<unsigned char>(byte) & 0xC0) == 0x80; }  // of UTF-8

void select_font(cairo_t* cr, double size, bool bold) {
  cairo_select_font_face(cr, "sans", CAIRO_FONT_SLANT_NORMAL,
                         bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(cr, size);
}

constexpr double kLabelGap = kTickLength + 3.0;
constexpr double kRightRoom = 20.0;                           // of tick labels beyond the area
constexpr double kTitleDistance = 44.0, kTitleRoom = 22.0;    // from the area to the title of y, and beyond
constexpr double kXTitleDistance = 36.0, kXTitleRoom = 16.0;  // from the area to the title of x, and beyond
constexpr double kLineHeight = 12.0;                          // of tick labels
constexpr double kMaxUpright = 0.4;                           // of the height: length of upright names
constexpr double kDigitWidth = 0.66 * kTickLabelSize;         // an estimate from above

struct Ticks {
  std::vector<double> values;
  std::vector<std::string> labels;
};

// length: of the axis; spacing: the least distance of decades; points.
Ticks ticks_of(const Axis& axis, double length, double spacing) {
  const auto [low, high] = std::minmax(axis.min, axis.max);
  Ticks ticks;
  if (!axis.log) {
    ticks.values = tick_values(low, high);
    ticks.labels = tick_labels(ticks.values);
    return ticks;
  }
  const int first = static_cast<int>(std::ceil(std::log10(low) - 1e-9)),
            last = static_cast<int>(std::floor(std::log10(high) + 1e-9));
  const int step = static_cast<int>(round_up(std::max(1.0, (last - first) * spacing / length)));
  for (int exponent = first; exponent <= last; exponent += step) {
    ticks.values.push_back(std::pow(10.0, exponent));
    ticks.labels.push_back(format_number(ticks.values.back()));
  }
  return ticks;
}

Ticks y_ticks(const Axis& axis, double height) { return ticks_of(axis, height, 18.0); }

Axis resolvable(Axis axis) {
  const auto [low, high] = std::minmax(axis.min, axis.max);
  AxisRange range = common::resolvable({low, high});
  if (axis.log) range.low = std::max(range.low, 1e-300);
  if (axis.min > axis.max) std::swap(range.low, range.high);
  axis.min = range.low;
  axis.max = range.high;
  return axis;
}

// A name of two words stands on two lines.
std::array<std::string, 2> lines_of(const std::string& name) {
  const std::size_t space = name.find(' ');
  return {name.substr(0, space), space == name.npos ? "" : name.substr(space + 1)};
}

// How the categories' names are drawn, all in one size.
struct NameLayout {
  double upright = 0.0;  // the most that they take upright; 0: they stand side by side
  double size = kTickLabelSize;
};
NameLayout lay_out_names(const std::vector<std::string>& categories, double width, double max_upright) {
  const std::unique_ptr<cairo_surface_t, void (*)(cairo_surface_t*)> surface(
      cairo_image_surface_create(CAIRO_FORMAT_A8, 1, 1), cairo_surface_destroy);
  const std::unique_ptr<cairo_t, void (*)(cairo_t*)> cr(cairo_create(surface.get()), cairo_destroy);
  double widest = 0.0, longest = 0.0;
  for (const std::string& name : categories) {
    longest = std::max(longest, text_width(cr.get(), name, kTickLabelSize));
    for (const std::string& line : lines_of(name))
      widest = std::max(widest, text_width(cr.get(), line, kTickLabelSize));
  }
  const double slot = width / std::max(1.0, static_cast<double>(categories.size()));
  const auto size_in = [](double room, double length) {
    return kTickLabelSize * std::clamp(room / std::max(length, 1.0), kMinTextScale, 1.0);
  };
  if (kMinTextScale * widest <= slot) return {0.0, size_in(slot, widest)};
  return {std::min(longest, max_upright), size_in(max_upright, longest)};
}

// Upright names take at most kMaxUpright of the height of an area and the room below it, gaps and title
// aside.
NameLayout names_below(const Axis& axis, const PlotArea& area) {
  return lay_out_names(axis.categories, area.width, kMaxUpright / (1.0 - kMaxUpright) * area.height);
}

double x_title_distance(const NameLayout& names) {
  return names.upright > 0.0 ? kLabelGap + names.upright + kLineHeight : kXTitleDistance;
}

std::uint32_t pack_rgb24(const Rgba& ink) {
  const auto byte = [](double v) { return static_cast<std::uint32_t>(std::lround(255.0 * v)); };
  return byte(ink.r) << 16 | byte(ink.g) << 8 | byte(ink.b);
}

}  // namespace

double y_axis_room(const Axis& axis, double height) {
  std::size_t longest = 0;
  for (const std::string& label : y_ticks(resolvable(axis), height).labels)
    longest = std::max(longest, label.size());
  return kTitleRoom + std::max(kTitleDistance, kDigitWidth * static_cast<double>(longest) + 2.0 * kLabelGap);
}

double x_axis_room(const Axis& axis, double width, double height) {
  const double most = kMaxUpright * (height - kLabelGap - kLineHeight - kXTitleRoom);
  return x_title_distance(lay_out_names(axis.categories, width, most)) + kXTitleRoom;
}

double Axis::fraction(double value) const {
  if (!log) return (value - min) / (max - min);
  return std::log(std::max(value, 1e-300) / min) / std::log(max / min);
}

void set_pen(cairo_t* cr, const Rgba& colour, double line_width) {
  cairo_set_source_rgba(cr, colour.r, colour.g, colour.b, colour.a);
  cairo_set_line_width(cr, line_width);
}

void draw_line(cairo_t* cr, double x1, double y1, double x2, double y2) {
  cairo_move_to(cr, x1, y1);
  cairo_line_to(cr, x2, y2);
  cairo_stroke(cr);
}

double text_width(cairo_t* cr, const std::string& text, double size) {
  select_font(cr, size, false);
  cairo_text_extents_t extents;
  cairo_text_extents(cr, printable(text).c_str(), &extents);
  return extents.x_advance;
}

void draw_text(cairo_t* cr, double x, double y, const std::string& any_text, double size, Align align,
               bool bold, double max_width, double min_scale) {
  select_font(cr, size, bold);
  const std::string whole_text = printable(any_text);  // Cairo draws nothing after a text that is not UTF-8
  std::string text = whole_text;
  cairo_text_extents_t extents;
  cairo_text_extents(cr, text.c_str(), &extents);
  if (extents.x_advance > max_width) {
    cairo_set_font_size(cr, size * std::max(max_width / extents.x_advance, min_scale));
    cairo_text_extents(cr, text.c_str(), &extents);
    for (std::size_t kept = text.size(); kept > 0 && extents.x_advance > 1.001 * max_width;) {
      do --kept;
      while (kept > 0 && is_continuation(whole_text[kept]));
      text = whole_text.substr(0, kept) + "…";
      cairo_text_extents(cr, text.c_str(), &extents);
    }
  }
  const double alignment_offset = align == Align::kLeft ? 0.0 : align == Align::kCentre ? 0.5 : 1.0;
  cairo_move_to(cr, x - alignment_offset * extents.x_advance, y);
  cairo_show_text(cr, text.c_str());
}

void draw_pixels(cairo_t* cr, const PlotArea& area, int columns, const std::vector<Rgba>& pixels) {
  constexpr double kInvisible = 1e-6;  // Cairo has no inverse of a scale of 0
  const int rows = static_cast<int>(std::ssize(pixels) / columns);
  if (std::abs(area.width / columns) < kInvisible || std::abs(area.height / rows) < kInvisible) return;
  std::vector<std::uint32_t> packed(pixels.size());
  std::ranges::transform(pixels, packed.begin(), pack_rgb24);
  const std::unique_ptr<cairo_surface_t, void (*)(cairo_surface_t*)> image(
      cairo_image_surface_create_for_data(reinterpret_cast<unsigned char*>(packed.data()), CAIRO_FORMAT_RGB24,
                                          columns, rows, 4 * columns),
      cairo_surface_destroy);
  cairo_save(cr);
  cairo_translate(cr, area.left, area.top);
  cairo_scale(cr, area.width / columns, area.height / rows);
  cairo_set_source_surface(cr, image.get(), 0.0, 0.0);
  cairo_pattern_set_filter(cairo_get_source(cr), CAIRO_FILTER_NEAREST);
  cairo_rectangle(cr, 0.0, 0.0, columns, rows);
  cairo_fill(cr);
  cairo_restore(cr);
}

Chart::Chart(PlotArea area, Axis x, Axis y)
    : area_(area), x_(resolvable(std::move(x))), y_(resolvable(std::move(y))) {}

void Chart::draw_grid(cairo_t* cr) const {
  set_pen(cr, kLightGreyPen);
  for (const double value : y_ticks(y_, area_.height).values)
    draw_line(cr, area_.left, py(value), area_.right(), py(value));
}

// Upright names that are closer than a line are thinned out.
void Chart::draw_categories(cairo_t* cr) const {
  const double slot = area_.width / std::max(1.0, static_cast<double>(x_.categories.size()));
  const auto [upright, size] = names_below(x_, area_);
  const Index step =
      upright > 0.0 ? std::max<Index>(1, static_cast<Index>(std::ceil(kLineHeight / slot))) : 1;
  for (Index i = 0; i < std::ssize(x_.categories); i += step) {
    const double x = px(static_cast<double>(i)), y = area_.bottom() + kTickLength + kLineHeight;
    if (upright == 0.0) {
      const auto [first, second] = lines_of(x_.categories[i]);
      draw_text(cr, x, y, first, size, Align::kCentre);
      draw_text(cr, x, y + kLineHeight, second, size, Align::kCentre);
      continue;
    }
    cairo_save(cr);
    cairo_translate(cr, x + 0.35 * kTickLabelSize, area_.bottom() + kLabelGap);
    cairo_rotate(cr, -0.5 * std::numbers::pi);
    constexpr double kRounding = 1.05;  // of the widths of glyphs, which depend on the size
    draw_text(cr, 0.0, 0.0, x_.categories[i], size, Align::kRight, false, kRounding * upright, 1.0);
    cairo_restore(cr);
  }
}

void Chart::draw_axes(cairo_t* cr) const {
  set_pen(cr, kBlack);
  cairo_rectangle(cr, area_.left, area_.top, area_.width, area_.height);
  cairo_stroke(cr);
  const double label_y = area_.bottom() + kTickLength + kLineHeight;
  draw_categories(cr);
  if (x_.categories.empty()) {
    const Ticks ticks = ticks_of(x_, area_.width, 40.0);
    double widest = 0.0;
    for (const std::string& label : ticks.labels)
      widest = std::max(widest, text_width(cr, label, kTickLabelSize));
    double labelled = -INFINITY;
    for (Index i = 0; i < std::ssize(ticks.values); ++i) {
      const double x = px(ticks.values[i]);
      draw_line(cr, x, area_.bottom(), x, area_.bottom() + kTickLength);
      if (std::abs(x - labelled) < widest + kLabelGap) continue;
      const double rightmost =
          area_.right() + kRightRoom - 0.5 * text_width(cr, ticks.labels[i], kTickLabelSize);
      draw_text(cr, std::min(x, rightmost), label_y, ticks.labels[i], kTickLabelSize, Align::kCentre);
      labelled = x;
    }
  }
  const Ticks ticks = y_ticks(y_, area_.height);
  double widest = 0.0;
  for (Index i = 0; i < std::ssize(ticks.values); ++i) {
    const double y = py(ticks.values[i]);
    draw_line(cr, area_.left - kTickLength, y, area_.left, y);
    draw_text(cr, area_.left - kLabelGap, y + 4.0, ticks.labels[i], kTickLabelSize, Align::kRight);
    widest = std::max(widest, text_width(cr, ticks.labels[i], kTickLabelSize));
  }
  draw_text(cr, area_.left + area_.width / 2.0, area_.bottom() + x_title_distance(names_below(x_, area_)),
            x_.title, kTitleSize, Align::kCentre);
  cairo_save(cr);
  cairo_translate(cr, area_.left - std::max(kTitleDistance, widest + 2.0 * kLabelGap),
                  area_.top + area_.height / 2.0);
  cairo_rotate(cr, -std::acos(-1.0) / 2.0);
  draw_text(cr, 0.0, 0.0, y_.title, kTitleSize, Align::kCentre);
  cairo_restore(cr);
}

void Chart::clip(cairo_t* cr, double margin) const {
  cairo_save(cr);
  cairo_rectangle(cr, area_.left - margin, area_.top - margin, area_.width + 2.0 * margin,
                  area_.height + 2.0 * margin);
  cairo_clip(cr);
}

}  // namespace common
