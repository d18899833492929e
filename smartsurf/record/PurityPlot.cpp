#include "smartsurf/record/PurityPlot.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::record {
namespace {

constexpr Area kArea{66.0, 62.0, 720.0, 340.0};
constexpr double kRight = 52.0, kBelow = 52.0;
constexpr Ink kCurve{0.00, 0.45, 0.70}, kLimit{0.84, 0.37, 0.00}, kHold{0.00, 0.62, 0.45};

Chart chart_of(const Purity& purity) {
  const double from = purity.time.front(), to = std::max(purity.time.back(), from + 1e-3);
  return {kArea, {from, to, "time [s]"}, {-0.04, 1.04, "purity"}};
}

Purity checked(const Recording& recording) {
  Purity result = purity(recording);
  if (result.time.empty())
    throw scene::InputError(recording.path().string() + ": has no frames: there is nothing to draw");
  return result;
}

std::string sorted_text(const Purity& purity) {
  if (!purity.sorted_at)
    return "never " + number_text(kSortedPurity) + " for " + number_text(kSortedHold_s) + " s";
  return "sorted at " + number_text(std::round(*purity.sorted_at * 10.0) / 10.0) + " s";
}

}  // namespace

PurityPlot::PurityPlot(const Recording& recording)
    : purity_(checked(recording)),
      subtitle_(subtitle(recording) + " · " + sorted_text(purity_)),
      chart_(chart_of(purity_)) {}

double PurityPlot::width() const { return kArea.right() + kRight; }
double PurityPlot::height() const { return kArea.bottom() + kBelow; }

void PurityPlot::draw_hold(cairo_t* paper) const {
  const double from = chart_.px(*purity_.sorted_at), to = chart_.px(*purity_.sorted_at + kSortedHold_s);
  cairo_rectangle(paper, from, kArea.top, to - from, kArea.height);
  use(paper, {kHold.r, kHold.g, kHold.b, 0.14});
  cairo_fill(paper);
  use(paper, kHold, 1.4);
  draw_line(paper, from, kArea.top, from, kArea.bottom());
  const std::string text = sorted_text(purity_) + ", held for " + number_text(kSortedHold_s) + " s";
  const bool fits = to + 8.0 + text_width(paper, text, 12.0) < kArea.right();
  draw_text(paper, fits ? to + 8.0 : from - 8.0, chart_.py(0.03), text, 12.0,
            fits ? Align::kLeft : Align::kRight);
}

// Purity is constant between two frames, so the curve goes in steps; frames without a value leave a gap.
void PurityPlot::draw_curve(cairo_t* paper) const {
  bool drawing = false;
  double last = NAN;
  const std::size_t frames = purity_.time.size();
  for (std::size_t i = 0; i < frames; ++i) {
    const double value = purity_.value[i], x = chart_.px(purity_.time[i]);
    if (drawing && (value != last || i + 1 == frames)) cairo_line_to(paper, x, chart_.py(last));
    if (!std::isnan(value) && value != last) {
      if (drawing)
        cairo_line_to(paper, x, chart_.py(value));
      else
        cairo_move_to(paper, x, chart_.py(value));
    }
    drawing = !std::isnan(value);
    last = value;
  }
  use(paper, kCurve, 2.0);
  cairo_stroke(paper);
}

void PurityPlot::draw(cairo_t* paper) const {
  chart_.clip(paper);
  if (purity_.sorted_at) draw_hold(paper);
  const double limit = chart_.py(kSortedPurity), dashes[] = {6.0, 3.5};
  cairo_set_dash(paper, dashes, 2, 0.0);
  use(paper, kLimit, 1.2);
  draw_line(paper, kArea.left, limit, kArea.right(), limit);
  cairo_set_dash(paper, nullptr, 0, 0.0);
  draw_curve(paper);
  cairo_restore(paper);
  chart_.draw_axes(paper);
  use(paper, kLimit);
  draw_text(paper, kArea.right() + 6.0, limit + 4.0, number_text(kSortedPurity), 12.0, Align::kLeft);
  use(paper, kBlack);
  draw_text(paper, kArea.left, 28.0, "Purity: share of the objects in their own half", 17.0, Align::kLeft,
            true, kArea.width);
  use(paper, kGrey);
  draw_text(paper, kArea.left, 48.0, subtitle_, 12.0, Align::kLeft, false, kArea.width);
}

}  // namespace smartsurf::record
