// SIMD inner loops of the stencil operations over one row, compiled once per instruction set.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace apron::vm {

// Non-owning view of a filter: width x height coefficients, row-major.
struct FilterView {
  std::uint32_t width = 0, height = 0;
  const float* coefficients = nullptr;
};

inline constexpr std::uint32_t kStencilBlockCells = 64;

// The rows that a stencil reads for one output row, north to south. Output column x reads the cells
// row[j][step[j] * x + i], i = 0 … filter width - 1. A row of step 0 is constant: it holds
// kStencilBlockCells + filter width cells of one value.
struct StencilRows {
  const float* const* row = nullptr;
  const std::ptrdiff_t* step = nullptr;  // 0 or 1
};

// The destination: `columns` cells, of any alignment. mask is null, or only its non-zero cells are
// written.
struct StencilOutput {
  float* y = nullptr;
  const float* mask = nullptr;
  std::uint32_t columns = 0;
};

// Output rows that a kernel of filters computes at once.
inline constexpr std::uint32_t kFilterRows = 4;

struct StencilKernels {
  // Correlates with the filter; with `accumulate`, the sums begin with y instead of 0.
  void (*correlate)(const FilterView& filter, const StencilRows& rows, const StencilOutput& to,
                    bool accumulate) noexcept = nullptr;
  // kFilterRows output rows, one below the other and of as many columns, of a filter without zeros: `rows`
  // are the filter's height + kFilterRows - 1 rows that they read.
  void (*correlate_rows)(const FilterView& filter, const StencilRows& rows,
                         const std::array<StencilOutput, kFilterRows>& to) noexcept = nullptr;
  // near.sum to near.all with 4 [0] and 8 [1] neighbours, on three rows of three cells.
  std::array<std::array<void (*)(const StencilRows& rows, const StencilOutput& to) noexcept, 2>, 5> near{};
};

}  // namespace apron::vm
