// Writes a comparison of two engines: as text, and as figures and a table in a folder.
#pragma once

#include <filesystem>
#include <string>

#include "common/files/Inputs.h"
#include "smartsurf/run/compare/Compare.h"

namespace smartsurf::run {

// Several lines, each ending with '\n': one per object, up to kMaxReportedObjects, those that part first; and
// one per metric.
inline constexpr std::size_t kMaxReportedObjects = 40;
std::string describe(const Comparison&, const EngineTrace& first, const EngineTrace& second);

// The files that write_report() writes: distances.svg, loads.svg, heights.svg and objects.csv.
std::vector<common::NamedOutput> report_files(const std::filesystem::path& folder);
// Throws scene::InputError if one cannot be written.
void write_report(const Comparison&, const EngineTrace& first, const EngineTrace& second,
                  const std::string& experiment, const std::filesystem::path& folder);

}  // namespace smartsurf::run
