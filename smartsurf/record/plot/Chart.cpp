#include "smartsurf/record/plot/Chart.h"

#include <cmath>
#include <cstdio>
#include <filesystem>

#include "smartsurf/record/Recording.h"

namespace smartsurf::record {
namespace {

constexpr double kTickLength = 4.0, kTickLabelSize = 11.0, kTitleSize = 13.0;

void select_font(cairo_t* cr, double size, bool bold) {
  cairo_select_font_face(cr, "sans", CAIRO_FONT_SLANT_NORMAL,
                         bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(cr, size);
}

}  // namespace

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

void Chart::draw_axes(cairo_t* cr) const {
  set_pen(cr, kBlack);
  cairo_rectangle(cr, area_.left, area_.top, area_.width, area_.height);
  cairo_stroke(cr);
  for (const double value : tick_values(x_.min, x_.max)) {
    draw_line(cr, px(value), area_.bottom(), px(value), area_.bottom() + kTickLength);
    draw_text(cr, px(value), area_.bottom() + kTickLength + 12.0, format_number(value), kTickLabelSize,
              Align::kCentre);
  }
  for (const double value : tick_values(y_.min, y_.max)) {
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

std::string subtitle(const Recording& recording) {
  std::string text = std::filesystem::path(recording.spec().file).filename().string();
  text += (text.empty() ? "seed " : " · seed ") + std::to_string(recording.spec().world.seed);
  if (recording.frames() == 0) return text;
  const auto rounded = [](double t) { return format_number(std::round(t * 10.0) / 10.0); };
  return text + " · " + rounded(recording.times().front()) + " to " + rounded(recording.times().back()) +
         " s";
}

}  // namespace smartsurf::record
