#include "common/chart/Chart.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>

#include "common/index/Index.h"

namespace common {
namespace {

constexpr double kTickLength = 4.0, kTickLabelSize = 11.0, kTitleSize = 13.0;

void select_font(cairo_t* cr, double size, bool bold) {
  cairo_select_font_face(cr, "sans", CAIRO_FONT_SLANT_NORMAL,
                         bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(cr, size);
}

std::vector<double> ticks_of(const Axis& axis) {
  const auto [low, high] = std::minmax(axis.min, axis.max);
  if (!axis.log) return tick_values(low, high);
  std::vector<double> powers;
  for (double exponent = std::ceil(std::log10(low) - 1e-9); exponent <= std::log10(high) + 1e-9; ++exponent)
    powers.push_back(std::pow(10.0, exponent));
  return powers;
}

std::uint32_t pack_rgb24(const Rgba& ink) {
  const auto byte = [](double v) { return static_cast<std::uint32_t>(std::lround(255.0 * v)); };
  return byte(ink.r) << 16 | byte(ink.g) << 8 | byte(ink.b);
}

}  // namespace

double Axis::fraction(double value) const {
  if (!log) return (value - min) / (max - min);
  return std::log(std::max(value, 1e-300) / min) / std::log(max / min);
}

std::vector<double> tick_values(double from, double to) {
  const double raw_step = (to - from) / 7.0, magnitude = std::pow(10.0, std::floor(std::log10(raw_step)));
  double step = 10.0 * magnitude;
  for (const double multiple : {1.0, 2.0, 5.0})
    if (raw_step <= multiple * magnitude * 1.0001) {
      step = multiple * magnitude;
      break;
    }
  std::vector<double> numbers;
  for (double i = std::ceil(from / step - 1e-9); i * step <= to + 1e-9 * step; ++i)
    numbers.push_back(i * step);
  return numbers;
}

std::string format_number(double value) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "%g", std::abs(value) < 1e-12 ? 0.0 : value);
  return digits;
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
  cairo_text_extents(cr, text.c_str(), &extents);
  return extents.x_advance;
}

void draw_text(cairo_t* cr, double x, double y, const std::string& text, double size, Align align, bool bold,
               double max_width) {
  select_font(cr, size, bold);
  cairo_text_extents_t extents;
  cairo_text_extents(cr, text.c_str(), &extents);
  if (extents.x_advance > max_width) {
    cairo_set_font_size(cr, size * max_width / extents.x_advance);
    cairo_text_extents(cr, text.c_str(), &extents);
  }
  const double alignment_offset = align == Align::kLeft ? 0.0 : align == Align::kCentre ? 0.5 : 1.0;
  cairo_move_to(cr, x - alignment_offset * extents.x_advance, y);
  cairo_show_text(cr, text.c_str());
}

void draw_pixels(cairo_t* cr, const PlotArea& area, int columns, const std::vector<Rgba>& pixels) {
  const int rows = static_cast<int>(std::ssize(pixels) / columns);
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

void Chart::draw_grid(cairo_t* cr) const {
  set_pen(cr, kLightGreyPen);
  for (const double value : ticks_of(y_)) draw_line(cr, area_.left, py(value), area_.right(), py(value));
}

void Chart::draw_axes(cairo_t* cr) const {
  set_pen(cr, kBlack);
  cairo_rectangle(cr, area_.left, area_.top, area_.width, area_.height);
  cairo_stroke(cr);
  const double label_y = area_.bottom() + kTickLength + 12.0;
  const auto draw_label = [&](double x, double y, const std::string& text) {
    draw_text(cr, x, y, text, kTickLabelSize, Align::kCentre, false,
              area_.width / std::max(1.0, static_cast<double>(x_.categories.size())));
  };
  for (Index i = 0; i < std::ssize(x_.categories); ++i) {
    // A name of two words stands on two lines.
    const std::string& name = x_.categories[i];
    const std::size_t space = name.find(' ');
    draw_label(px(static_cast<double>(i)), label_y, name.substr(0, space));
    if (space != name.npos) draw_label(px(static_cast<double>(i)), label_y + 12.0, name.substr(space + 1));
  }
  if (x_.categories.empty())
    for (const double value : ticks_of(x_)) {
      draw_line(cr, px(value), area_.bottom(), px(value), area_.bottom() + kTickLength);
      draw_text(cr, px(value), label_y, format_number(value), kTickLabelSize, Align::kCentre);
    }
  for (const double value : ticks_of(y_)) {
    draw_line(cr, area_.left - kTickLength, py(value), area_.left, py(value));
    draw_text(cr, area_.left - kTickLength - 3.0, py(value) + 4.0, format_number(value), kTickLabelSize,
              Align::kRight);
  }
  draw_text(cr, area_.left + area_.width / 2.0, area_.bottom() + 36.0, x_.title, kTitleSize, Align::kCentre);
  cairo_save(cr);
  cairo_translate(cr, area_.left - 44.0, area_.top + area_.height / 2.0);
  cairo_rotate(cr, -std::acos(-1.0) / 2.0);
  draw_text(cr, 0.0, 0.0, y_.title, kTitleSize, Align::kCentre);
  cairo_restore(cr);
}

void Chart::clip(cairo_t* cr) const {
  cairo_save(cr);
  cairo_rectangle(cr, area_.left, area_.top, area_.width, area_.height);
  cairo_clip(cr);
}

}  // namespace common
