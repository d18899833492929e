#include "smartsurf/record/plot/CurveChart.h"

#include <algorithm>
#include <array>
#include <utility>

#include "smartsurf/record/TimeText.h"

namespace smartsurf::record {

namespace {

// The least range in which ticks are whole numbers.
constexpr double kLeastCounts = 4.0;

std::array<double, 2> domain_of_counts(const std::vector<Curve>& curves) {
  double most = 0.0;
  for (const Curve& curve : curves)
    for (const double value : curve.values) most = std::max(most, value);
  return {0.0, std::max(1.04 * most, kLeastCounts)};
}

}  // namespace

ChartSpec make_curve_chart(const std::vector<double>& time, TimeSeries series, std::string subtitle) {
  ChartSpec chart{.title = std::move(series.title), .subtitle = std::move(subtitle)};
  chart.x.title = "time [s]";
  chart.y.title = std::move(series.axis_title);
  if (series.counts) chart.y.domain = domain_of_counts(series.curves);
  const bool has_one_curve = series.curves.size() == 1;
  if (has_one_curve && series.curves[0].name.find(' ') != std::string::npos)
    chart.title += ": " + series.curves[0].name;
  for (Curve& curve : series.curves)
    chart.layers.push_back(
        {.name = has_one_curve ? "" : std::move(curve.name), .x = time, .y = std::move(curve.values)});
  if (series.success_s) {
    chart.rule = series.success_s;
    chart.rule_label = "success at " + time_text(*series.success_s) + " s";
  }
  return chart;
}

ChartSpec make_curve_chart(const Recording& recording, TimeSeries series) {
  if (recording.frames() == 0) throw scene::InputError(recording.path().string() + ": has no frames to plot");
  return make_curve_chart(recording.times(), std::move(series), subtitle(recording));
}

}  // namespace smartsurf::record
