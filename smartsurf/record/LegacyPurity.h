// Purity, the metric of the case study, in recordings of versions that measured it for every experiment
// instead of storing the metrics that the script declares. Recording presents it as the metric "purity"
// (docs/recordings.md).
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::record {

// The names under which those versions published it and the time of success.
inline constexpr std::string_view kPurity = "purity", kSortedAt = "sorted_at_s";

struct PuritySeries {
  std::vector<double> values;         // one per frame, [0, 1]; NaN if no object counts
  std::optional<double> sorted_at_s;  // when the first interval of at least 5 s with purity >= 0.95 begins
};

// Tells if the objects form two classes (SizeClasses.h).
bool defines_purity(const scene::SceneSpec& spec);

// The share of the existing objects with a class that are in their own half of the table: within the outline
// of its cells, and small ones west of the line midway between its west and east ends, large ones east.
// Requires defines_purity(). times: of the frames, s. read_positions(first, count):
// Recording::read_positions().
PuritySeries compute_purity(
    const scene::SceneSpec& spec, std::span<const double> times,
    const std::function<std::vector<float>(std::size_t first, std::size_t count)>& read_positions);

}  // namespace smartsurf::record
