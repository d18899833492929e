// Writes the signals that a window plots.
#pragma once

#include <string>

#include "smartsurf/view/model/PlotData.h"

namespace smartsurf::run {

// Writes plot.file: a table if it ends in .csv, else a figure. experiment: named in the figure. Returns one
// line for the user: which file was written, or why not.
std::string write_plot_file(const view::PlotExport& plot, const std::string& experiment);

}  // namespace smartsurf::run
