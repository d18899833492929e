// Charts of curves over time. Internal to this module.
#pragma once

#include "smartsurf/record/plot/ChartFigure.h"
#include "smartsurf/record/plot/TimeSeries.h"

namespace smartsurf::record {

// time: s, at least one value.
ChartSpec make_curve_chart(const std::vector<double>& time, TimeSeries series, std::string subtitle);
// Throws scene::InputError if the recording has no frames.
ChartSpec make_curve_chart(const Recording& recording, TimeSeries series);

}  // namespace smartsurf::record
