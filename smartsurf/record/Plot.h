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

enum class PlotKind {
  kTrajectories,  // top view: the objects' ways over the surface, O where they start, X where they end
  kPurity         // purity over time, and when the surface was sorted
};

std::vector<std::string> plot_kinds();        // the names that --what takes
PlotKind plot_kind(const std::string& name);  // throws scene::InputError that lists the names
void plot(const Recording& recording, PlotKind kind, const std::filesystem::path& path);

}  // namespace smartsurf::record
