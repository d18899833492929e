// Plots a recording as SVG or PNG, chosen by the file's extension.
//
// Failure: scene::InputError for an unknown kind or extension, a path that cannot be written, or a recording
// that lacks the data. The file is replaced as a whole.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "smartsurf/record/Recording.h"

namespace smartsurf::record {

// What --what takes: "trajectories", "purity", "time-spent[:LABEL]", and numbers over time: "speed[:ID…]",
// "height:ROW,COLUMN…", …; besides, NAME:ROW,COLUMN… of any channel that was recorded. Rows and columns count
// from 0, row 0 north.
std::vector<std::string> plot_kinds();
void write_plot(const Recording& recording, const std::string& what, const std::filesystem::path& path);

}  // namespace smartsurf::record
