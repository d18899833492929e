// Reads the description of a chart that `smartsurf plot FILE.json` draws (docs/recordings.md). Internal to
// this module.
#pragma once

#include <filesystem>

#include "smartsurf/record/plot/ChartFigure.h"

namespace smartsurf::record {

// Throws scene::InputError, one line that begins with the file's name.
ChartFigure read_chart_file(const std::filesystem::path& path);

}  // namespace smartsurf::record
