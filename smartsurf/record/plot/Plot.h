// Draws figures from a recording, as SVG or PNG by the file's ending.
//
// Failure: scene::InputError for an unknown kind or ending, a path that cannot be written, or a recording
// that lacks what the figure shows. The file appears whole or not at all.
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
