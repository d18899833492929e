#include "smartsurf/run/display/PlotFile.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "common/files/AtomicFile.h"
#include "common/text/Unit.h"
#include "smartsurf/record/plot/Plot.h"

namespace smartsurf::run {
namespace {

// The axis has a unit only if all curves share it; otherwise each curve names its own.
record::TimeSeries time_series(const view::PlotExport& plot) {
  const std::string& unit = plot.series.front().unit;
  const bool same_unit = std::ranges::all_of(
      plot.series, [&](const view::PlotExport::Series& series) { return series.unit == unit; });
  record::TimeSeries result{plot.series.size() == 1 ? plot.series.front().name : "Signals",
                            same_unit && !unit.empty() ? "[" + common::typeset_unit(unit) + "]" : "value",
                            {}};
  for (const view::PlotExport::Series& series : plot.series)
    result.curves.push_back(
        {same_unit ? series.name : common::with_unit(series.name, series.unit), series.values});
  return result;
}

}  // namespace

std::string write_plot_file(const view::PlotExport& plot, const std::string& experiment) {
  if (plot.times.empty() || plot.series.empty()) return "there is nothing to plot yet";
  if (plot.file.ends_with(".csv")) {
    const std::error_code error = common::replace_file(plot.file, to_csv(plot));
    return error ? fmt::format("{}: cannot be written: {}", plot.file, error.message())
                 : "wrote " + plot.file;
  }
  try {
    record::write_curves(
        plot.times, time_series(plot),
        fmt::format("{} · {:.4g} to {:.4g} s", std::filesystem::path(experiment).filename().string(),
                    plot.times.front(), plot.times.back()),
        plot.file);
    return "wrote " + plot.file;
  } catch (const std::runtime_error& error) {
    return error.what();
  }
}

}  // namespace smartsurf::run
