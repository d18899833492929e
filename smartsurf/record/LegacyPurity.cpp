#include "smartsurf/record/LegacyPurity.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/index/Index.h"
#include "smartsurf/record/SizeClasses.h"
#include "smartsurf/scene/SurfaceBounds.h"
#include "smartsurf/scene/TableFootprint.h"

namespace smartsurf::record {
namespace {

constexpr double kSortedThreshold = 0.95, kSortedHold_s = 5.0;
constexpr double kRounding_s = 1e-9;             // tolerance for frame times that round to just under 5 s
constexpr common::Index kBlockValues = 1 << 20;  // floats read at once

}  // namespace

bool defines_purity(const scene::SceneSpec& spec) {
  const std::vector<SizeClass> classes = classify_objects(spec.objects);
  const auto has = [&](SizeClass c) { return std::ranges::find(classes, c) != classes.end(); };
  return has(SizeClass::kSmall) && has(SizeClass::kLarge);
}

PuritySeries compute_purity(
    const scene::SceneSpec& spec, std::span<const double> times,
    const std::function<std::vector<float>(std::size_t first, std::size_t count)>& read_positions) {
  const std::vector<SizeClass> classes = classify_objects(spec.objects);
  const scene::TableFootprint footprint(spec.surface);
  const scene::SurfaceBounds bounds = scene::compute_surface_bounds(spec.surface);
  const double centre_x = (bounds.west + bounds.east) / 2.0;
  // position: x, y and z of each object, NaN where it does not exist.
  const auto purity_of = [&](const float* position) {
    int in_own_half = 0, total = 0;
    for (const SizeClass size_class : classes) {
      const double x = position[0], y = position[1];
      position += 3;
      if (size_class == SizeClass::kNone || std::isnan(x)) continue;
      ++total;
      if (footprint.contains(x, y) && (size_class == SizeClass::kSmall ? x < centre_x : x > centre_x))
        ++in_own_half;
    }
    return total > 0 ? static_cast<double>(in_own_half) / total : std::numeric_limits<double>::quiet_NaN();
  };
  PuritySeries result;
  std::optional<double> above_threshold_since;
  const common::Index floats = 3 * std::ssize(classes),
                      block = std::max<common::Index>(1, kBlockValues / floats);
  std::vector<float> positions;
  for (common::Index frame = 0; frame < std::ssize(times); ++frame) {
    if (frame % block == 0) positions = read_positions(frame, std::min(block, std::ssize(times) - frame));
    const double time_s = times[frame];
    result.values.push_back(purity_of(positions.data() + floats * (frame % block)));
    if (!(result.values.back() >= kSortedThreshold))
      above_threshold_since.reset();
    else if (!above_threshold_since)
      above_threshold_since = time_s;
    if (above_threshold_since && !result.sorted_at_s &&
        time_s - *above_threshold_since >= kSortedHold_s - kRounding_s)
      result.sorted_at_s = above_threshold_since;
  }
  return result;
}

}  // namespace smartsurf::record
