#include "apron/debugger/Statistics.h"

#include <algorithm>
#include <cmath>

namespace apron::debugger {
namespace {

// Fills in extremes and counts only.
Statistics compute_extremes(const std::vector<float>& cells) noexcept {
  Statistics s;
  for (const float value : cells) {
    s.non_zero += value != 0.0F ? 1 : 0;
    if (!std::isfinite(value)) continue;
    s.min = s.finite == 0 ? value : std::min(s.min, value);
    s.max = s.finite == 0 ? value : std::max(s.max, value);
    ++s.finite;
  }
  s.non_finite = cells.size() - s.finite;
  return s;
}

}  // namespace

Statistics compute_statistics(const std::vector<float>& cells) noexcept {
  Statistics s = compute_extremes(cells);
  // The width is a double, because max - min may overflow a float.
  const double width = double{s.max} - double{s.min};
  double sum = 0.0;
  for (const float value : cells) {
    if (!std::isfinite(value)) continue;
    sum += value;
    const double bin = width > 0.0 ? (double{value} - double{s.min}) / width * kHistogramBins : 0.0;
    ++s.histogram[std::min(static_cast<std::size_t>(bin), kHistogramBins - 1)];
  }
  if (s.finite > 0) s.mean = sum / static_cast<double>(s.finite);
  return s;
}

ValueRange automatic_range(const Statistics& s) noexcept {
  const ValueRange range{std::min(0.0F, s.min), std::max(0.0F, s.max)};
  return range.low == range.high ? ValueRange{0.0F, 1.0F} : range;
}

ValueRange automatic_range(const std::vector<float>& cells) noexcept {
  return automatic_range(compute_extremes(cells));
}

}  // namespace apron::debugger
