#include "smartsurf/record/plot/CurvePlot.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace smartsurf::record {
namespace {

constexpr PlotArea kPlotArea{66.0, 62.0, 720.0, 340.0};
constexpr double kRightMargin = 24.0, kBottomMargin = 52.0, kLegendRow = 20.0, kLegendEntry = 180.0;
constexpr std::size_t kLegendColumns = 4;
constexpr double kMaxBins = 1440.0;  // two per point of width; more cannot be resolved

Rgba curve_colour(std::size_t i) { return kLineColours[i % std::size(kLineColours)]; }

Chart make_chart(const std::vector<double>& time, const TimeSeries& series) {
  double low = INFINITY, high = -INFINITY;
  for (const Curve& curve : series.curves)
    for (const double value : curve.values) {
      if (!std::isfinite(value)) continue;
      low = std::min(low, value);
      high = std::max(high, value);
    }
  if (!(low <= high)) low = 0.0, high = 1.0;
  // Start at zero if the values still fill more than half of the axis.
  if (low > 0.0 && low < 0.5 * high) low = 0.0;
  const double margin = high > low ? 0.04 * (high - low) : std::max(0.5, 0.1 * std::abs(high));
  const double to = std::max(time.back(), time.front() + 1e-3);
  return {kPlotArea,
          {time.front(), to, "time [s]"},
          {low - (low == 0.0 ? 0.0 : margin), high + margin, series.axis_title}};
}

const std::vector<double>& require_frame_times(const Recording& recording) {
  if (recording.frames() == 0) throw scene::InputError(recording.path().string() + ": has no frames to plot");
  return recording.times();
}

}  // namespace

CurvePlot::CurvePlot(const Recording& recording, TimeSeries series)
    : CurvePlot(require_frame_times(recording), std::move(series), subtitle(recording)) {}

CurvePlot::CurvePlot(std::vector<double> time, TimeSeries series, std::string subtitle)
    : time_(std::move(time)),
      series_(std::move(series)),
      subtitle_(std::move(subtitle)),
      chart_(make_chart(time_, series_)) {}

double CurvePlot::width() const { return kPlotArea.right() + kRightMargin; }
double CurvePlot::height() const {
  const std::size_t rows =
      series_.curves.size() > 1 ? (series_.curves.size() + kLegendColumns - 1) / kLegendColumns : 0;
  return kPlotArea.bottom() + kBottomMargin + static_cast<double>(rows) * kLegendRow;
}

// A long run is decimated: each bin draws its first, minimum, maximum and last value.
void CurvePlot::draw_curve(cairo_t* cr, std::size_t i) const {
  const std::vector<double>& value = series_.curves[i].values;
  const std::size_t frames = std::min(value.size(), time_.size());
  const std::size_t bin_size =
      std::max<std::size_t>(1, static_cast<std::size_t>(std::ceil(static_cast<double>(frames) / kMaxBins)));
  bool drawing = false;
  const auto draw_to = [&](std::size_t f) {
    if (!std::isfinite(value[f])) {
      drawing = false;
      return;
    }
    (drawing ? cairo_line_to : cairo_move_to)(cr, chart_.px(time_[f]), chart_.py(value[f]));
    drawing = true;
  };
  for (std::size_t first = 0; first < frames; first += bin_size) {
    const std::size_t end = std::min(first + bin_size, frames);
    const auto [least, most] = std::minmax_element(value.begin() + static_cast<std::ptrdiff_t>(first),
                                                   value.begin() + static_cast<std::ptrdiff_t>(end));
    std::size_t samples[] = {first, static_cast<std::size_t>(least - value.begin()),
                             static_cast<std::size_t>(most - value.begin()), end - 1};
    std::sort(std::begin(samples), std::end(samples));
    for (std::size_t m = 0; m < std::size(samples); ++m)
      if (m == 0 || samples[m] != samples[m - 1]) draw_to(samples[m]);
  }
  set_pen(cr, curve_colour(i), 1.8);
  cairo_set_line_join(cr, CAIRO_LINE_JOIN_ROUND);
  cairo_stroke(cr);
}

void CurvePlot::draw_legend(cairo_t* cr) const {
  for (std::size_t i = 0; i < series_.curves.size(); ++i) {
    const double x = kPlotArea.left + static_cast<double>(i % kLegendColumns) * kLegendEntry;
    const double y =
        kPlotArea.bottom() + kBottomMargin + 4.0 + static_cast<double>(i / kLegendColumns) * kLegendRow;
    set_pen(cr, curve_colour(i), 2.4);
    draw_line(cr, x, y - 4.0, x + 22.0, y - 4.0);
    set_pen(cr, kBlack);
    draw_text(cr, x + 28.0, y, series_.curves[i].name, 12.0, Align::kLeft, false, kLegendEntry - 36.0);
  }
}

void CurvePlot::draw(cairo_t* cr) const {
  chart_.clip(cr);
  for (std::size_t i = 0; i < series_.curves.size(); ++i) draw_curve(cr, i);
  cairo_restore(cr);
  chart_.draw_axes(cr);
  set_pen(cr, kBlack);
  const std::string title =
      series_.curves.size() == 1 && series_.curves[0].name.find(' ') != std::string::npos
          ? series_.title + ": " + series_.curves[0].name
          : series_.title;
  draw_text(cr, kPlotArea.left, 28.0, title, 17.0, Align::kLeft, true, kPlotArea.width);
  set_pen(cr, kGrey);
  draw_text(cr, kPlotArea.left, 48.0, subtitle_, 12.0, Align::kLeft, false, kPlotArea.width);
  if (series_.curves.size() > 1) draw_legend(cr);
}

}  // namespace smartsurf::record
