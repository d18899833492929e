// Computes a register's extremes, mean and histogram, and its automatic colour range.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "apron/debugger/ColorMap.h"

namespace apron::debugger {

inline constexpr std::size_t kHistogramBins = 64;

struct Statistics {
  float min = 0.0F, max = 0.0F;                          // of the finite cells; 0 if there are none
  double mean = 0.0;                                     // of the finite cells
  std::size_t finite = 0, non_finite = 0, non_zero = 0;  // cell counts; non_zero includes non-finite cells
  // Finite cells in equal bins of [min, max]; if min == max, all are in the first bin.
  std::array<std::uint32_t, kHistogramBins> histogram{};
};

Statistics compute_statistics(const std::vector<float>& cells) noexcept;

// The smallest range that contains all finite cells and 0; [0, 1] if they are all 0.
ValueRange automatic_range(const Statistics&) noexcept;
ValueRange automatic_range(const std::vector<float>& cells) noexcept;

}  // namespace apron::debugger
