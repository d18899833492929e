#include "smartsurf/record/plot/PurityPlot.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::record {
namespace {

constexpr PlotArea kPlotArea{66.0, 62.0, 720.0, 340.0};
constexpr double kRightMargin = 52.0, kBottomMargin = 52.0;
constexpr Rgba kCurveColour{0.00, 0.45, 0.70}, kThresholdColour{0.84, 0.37, 0.00},
    kHoldColour{0.00, 0.62, 0.45};

Chart make_chart(const PuritySeries& purity) {
  const double from = purity.times.front(), to = std::max(purity.times.back(), from + 1e-3);
  return {kPlotArea, {from, to, "time [s]"}, {-0.04, 1.04, "purity"}};
}

PuritySeries require_purity(const Recording& recording) {
  PuritySeries result = compute_purity(recording);
  if (result.times.empty()) throw scene::InputError(recording.path().string() + ": has no frames to plot");
  return result;
}

std::string sorted_text(const PuritySeries& purity) {
  if (!purity.sorted_at)
    return "never " + format_number(kSortedThreshold) + " for " + format_number(kSortedHold_s) + " s";
  return "sorted at " + format_number(std::round(*purity.sorted_at * 10.0) / 10.0) + " s";
}

}  // namespace

PurityPlot::PurityPlot(const Recording& recording)
    : purity_(require_purity(recording)),
      subtitle_(subtitle(recording) + " · " + sorted_text(purity_)),
      chart_(make_chart(purity_)) {}

double PurityPlot::width() const { return kPlotArea.right() + kRightMargin; }
double PurityPlot::height() const { return kPlotArea.bottom() + kBottomMargin; }

void PurityPlot::draw_hold_band(cairo_t* cr) const {
  const double from = chart_.px(*purity_.sorted_at), to = chart_.px(*purity_.sorted_at + kSortedHold_s);
  cairo_rectangle(cr, from, kPlotArea.top, to - from, kPlotArea.height);
  set_pen(cr, {kHoldColour.r, kHoldColour.g, kHoldColour.b, 0.14});
  cairo_fill(cr);
  set_pen(cr, kHoldColour, 1.4);
  draw_line(cr, from, kPlotArea.top, from, kPlotArea.bottom());
  const std::string text = sorted_text(purity_) + ", held for " + format_number(kSortedHold_s) + " s";
  const bool fits = to + 8.0 + text_width(cr, text, 12.0) < kPlotArea.right();
  draw_text(cr, fits ? to + 8.0 : from - 8.0, chart_.py(0.03), text, 12.0,
            fits ? Align::kLeft : Align::kRight);
}

// Purity is constant between two frames, so the curve is a step function; NaN leaves a gap.
void PurityPlot::draw_curve(cairo_t* cr) const {
  bool drawing = false;
  double last = NAN;
  const std::size_t frames = purity_.times.size();
  for (std::size_t i = 0; i < frames; ++i) {
    const double value = purity_.values[i], x = chart_.px(purity_.times[i]);
    if (drawing && (value != last || i + 1 == frames)) cairo_line_to(cr, x, chart_.py(last));
    if (!std::isnan(value) && value != last) {
      if (drawing)
        cairo_line_to(cr, x, chart_.py(value));
      else
        cairo_move_to(cr, x, chart_.py(value));
    }
    drawing = !std::isnan(value);
    last = value;
  }
  set_pen(cr, kCurveColour, 2.0);
  cairo_stroke(cr);
}

void PurityPlot::draw(cairo_t* cr) const {
  chart_.clip(cr);
  if (purity_.sorted_at) draw_hold_band(cr);
  const double threshold_y = chart_.py(kSortedThreshold), dashes[] = {6.0, 3.5};
  cairo_set_dash(cr, dashes, 2, 0.0);
  set_pen(cr, kThresholdColour, 1.2);
  draw_line(cr, kPlotArea.left, threshold_y, kPlotArea.right(), threshold_y);
  cairo_set_dash(cr, nullptr, 0, 0.0);
  draw_curve(cr);
  cairo_restore(cr);
  chart_.draw_axes(cr);
  set_pen(cr, kThresholdColour);
  draw_text(cr, kPlotArea.right() + 6.0, threshold_y + 4.0, format_number(kSortedThreshold), 12.0,
            Align::kLeft);
  set_pen(cr, kBlack);
  draw_text(cr, kPlotArea.left, 28.0, "Purity: share of the objects in their own half", 17.0, Align::kLeft,
            true, kPlotArea.width);
  set_pen(cr, kGrey);
  draw_text(cr, kPlotArea.left, 48.0, subtitle_, 12.0, Align::kLeft, false, kPlotArea.width);
}

}  // namespace smartsurf::record
