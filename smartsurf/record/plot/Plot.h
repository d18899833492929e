// Plots a recording as SVG, PDF or PNG, chosen by the file's extension.
//
// Failure: scene::InputError for an unknown kind or extension, a path that cannot be written, or a recording
// that lacks the data. The file is replaced atomically.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "smartsurf/record/Recording.h"
#include "smartsurf/record/plot/TimeSeries.h"

namespace smartsurf::record {

// The values of --what: "trajectories", "time-spent[:LABEL]", and time series: "speed[:ID…]",
// "height:ROW,COLUMN…", …. write_plot() also accepts NAME:ROW,COLUMN… for any recorded channel, and the name
// of a metric. Rows and columns count from 0; row 0 is north.
std::vector<std::string> plot_kinds();
void write_plot(const Recording& recording, const std::string& what, const std::filesystem::path& path);

// Draws the chart that a JSON file describes (docs/recordings.md).
void write_chart(const std::filesystem::path& description, const std::filesystem::path& path);
// Draws curves over `time` (s, at least one value).
void write_curves(const std::vector<double>& time, TimeSeries series, const std::string& subtitle,
                  const std::filesystem::path& path);

}  // namespace smartsurf::record
