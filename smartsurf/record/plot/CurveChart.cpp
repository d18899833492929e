#include "smartsurf/record/plot/CurveChart.h"

#include <utility>

#include "smartsurf/record/TimeText.h"

namespace smartsurf::record {

ChartSpec make_curve_chart(const std::vector<double>& time, TimeSeries series, std::string subtitle) {
  ChartSpec chart{.title = std::move(series.title), .subtitle = std::move(subtitle)};
  chart.x.title = "time [s]";
  chart.y.title = std::move(series.axis_title);
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
