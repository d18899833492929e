// Statistics of a register: extremes, mean, histogram.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "apron/debugger/ColorMap.h"

namespace apron::debugger {

inline constexpr std::size_t kHistogramBins = 64;

struct Statistics {
  float min = 0.0F, max = 0.0F;  // of the finite cells; 0 without any
  double mean = 0.0;
  std::size_t finite = 0, non_finite = 0, non_zero = 0;  // cells; `others` are infinite or not a number
  // Equal parts of [min, max]; without a difference all cells lie in the first.
  std::array<std::uint32_t, kHistogramBins> histogram{};
};

Statistics compute_statistics(const std::vector<float>& cells) noexcept;

// The range in which a palette shows all of them: from 0 or the least to 0 or the largest; 0 to 1 if all are
// 0.
ValueRange automatic_range(const Statistics&) noexcept;
ValueRange automatic_range(const std::vector<float>& cells) noexcept;

}  // namespace apron::debugger
