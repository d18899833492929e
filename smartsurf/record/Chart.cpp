#include "smartsurf/record/Chart.h"

#include <cmath>
#include <cstdio>
#include <filesystem>

#include "smartsurf/record/Recording.h"

namespace smartsurf::record {
namespace {

constexpr double kTickLength = 4.0, kNumberSize = 11.0, kTitleSize = 13.0;

void choose_font(cairo_t* paper, double size, bool bold) {
  cairo_select_font_face(paper, "sans", CAIRO_FONT_SLANT_NORMAL,
                         bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(paper, size);
}

}  // namespace

std::vector<double> round_numbers(double from, double to) {
  const double rough = (to - from) / 7.0, power = std::pow(10.0, std::floor(std::log10(rough)));
  double step = 10.0 * power;
  for (const double nice : {1.0, 2.0, 5.0})
    if (rough <= nice * power * 1.0001) {
      step = nice * power;
      break;
    }
  std::vector<double> numbers;
  for (double i = std::ceil(from / step - 1e-9); i * step <= to + 1e-9 * step; ++i)
    numbers.push_back(i * step);
  return numbers;
}

std::string number_text(double value) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "%g", std::abs(value) < 1e-12 ? 0.0 : value);
  return digits;
}

void use(cairo_t* paper, const Ink& ink, double line_width) {
  cairo_set_source_rgba(paper, ink.r, ink.g, ink.b, ink.a);
  cairo_set_line_width(paper, line_width);
}

void draw_line(cairo_t* paper, double x1, double y1, double x2, double y2) {
  cairo_move_to(paper, x1, y1);
  cairo_line_to(paper, x2, y2);
  cairo_stroke(paper);
}

double text_width(cairo_t* paper, const std::string& text, double size) {
  choose_font(paper, size, false);
  cairo_text_extents_t extents;
  cairo_text_extents(paper, text.c_str(), &extents);
  return extents.x_advance;
}

void draw_text(cairo_t* paper, double x, double y, const std::string& text, double size, Align align,
               bool bold, double widest) {
  choose_font(paper, size, bold);
  cairo_text_extents_t extents;
  cairo_text_extents(paper, text.c_str(), &extents);
  if (extents.x_advance > widest) {
    cairo_set_font_size(paper, size * widest / extents.x_advance);
    cairo_text_extents(paper, text.c_str(), &extents);
  }
  const double share = align == Align::kLeft ? 0.0 : align == Align::kCentre ? 0.5 : 1.0;
  cairo_move_to(paper, x - share * extents.x_advance, y);
  cairo_show_text(paper, text.c_str());
}

void Chart::draw_axes(cairo_t* paper) const {
  use(paper, kBlack);
  cairo_rectangle(paper, area_.left, area_.top, area_.width, area_.height);
  cairo_stroke(paper);
  for (const double value : round_numbers(x_.from, x_.to)) {
    draw_line(paper, px(value), area_.bottom(), px(value), area_.bottom() + kTickLength);
    draw_text(paper, px(value), area_.bottom() + kTickLength + 12.0, number_text(value), kNumberSize,
              Align::kCentre);
  }
  for (const double value : round_numbers(y_.from, y_.to)) {
    draw_line(paper, area_.left - kTickLength, py(value), area_.left, py(value));
    draw_text(paper, area_.left - kTickLength - 3.0, py(value) + 4.0, number_text(value), kNumberSize,
              Align::kRight);
  }
  draw_text(paper, area_.left + area_.width / 2.0, area_.bottom() + 36.0, x_.title, kTitleSize,
            Align::kCentre);
  cairo_save(paper);
  cairo_translate(paper, area_.left - 44.0, area_.top + area_.height / 2.0);
  cairo_rotate(paper, -std::acos(-1.0) / 2.0);
  draw_text(paper, 0.0, 0.0, y_.title, kTitleSize, Align::kCentre);
  cairo_restore(paper);
}

void Chart::clip(cairo_t* paper) const {
  cairo_save(paper);
  cairo_rectangle(paper, area_.left, area_.top, area_.width, area_.height);
  cairo_clip(paper);
}

std::string subtitle(const Recording& recording) {
  std::string text = std::filesystem::path(recording.spec().file).filename().string();
  text += (text.empty() ? "seed " : " · seed ") + std::to_string(recording.spec().world.seed);
  if (recording.frames() == 0) return text;
  const auto rounded = [](double t) { return number_text(std::round(t * 10.0) / 10.0); };
  return text + " · " + rounded(recording.time().front()) + " to " + rounded(recording.time().back()) + " s";
}

}  // namespace smartsurf::record
