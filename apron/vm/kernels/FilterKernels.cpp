// Filters, neighbourhoods and matrix products.
// Compiled once per instruction set: foreach_target.h re-includes this file for each.
#include <array>
#include <cstddef>
#include <cstdint>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "apron/vm/kernels/FilterKernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "apron/vm/kernels/CellVectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace apron::vm {
namespace HWY_NAMESPACE {
namespace {

// Loads the cells from `from` on that exist; `count` of them do.
HWY_INLINE V load_cells(const float* from, std::size_t count) {
  const D d;
  if (count >= hn::Lanes(d)) return hn::LoadU(d, from);
  HWY_ALIGN float cells[kLanes] = {};
  for (std::size_t i = 0; i < count; ++i) cells[i] = from[i];
  return hn::Load(d, cells);
}

HWY_INLINE void store_cells(const StencilOutput& to, std::size_t x, V value) {
  const D d;
  const std::size_t count = to.columns - x;
  if (count >= hn::Lanes(d)) {
    if (to.mask != nullptr)
      value = hn::IfThenElse(is_true(hn::LoadU(d, to.mask + x)), value, hn::LoadU(d, to.y + x));
    return hn::StoreU(value, d, to.y + x);
  }
  HWY_ALIGN float cells[kLanes];
  hn::Store(value, d, cells);
  for (std::size_t i = 0; i < count; ++i)
    if (to.mask == nullptr || to.mask[x + i] != 0.0F) to.y[x + i] = cells[i];
}

// Several vectors of sums at once hide the latency of the additions; a single one may end with the last
// column.
template <std::size_t kVectors>
HWY_INLINE void correlate_vectors(const FilterView& filter, const StencilRows& rows, const StencilOutput& to,
                                  bool accumulate, std::size_t x) {
  const D d;
  const std::size_t lanes = hn::Lanes(d), columns = to.columns - x;
  const auto load = [lanes, columns](const float* from, std::size_t v) HWY_ATTR {
    return kVectors > 1 ? hn::LoadU(D(), from + v * lanes) : load_cells(from, columns);
  };
  V sums[kVectors];
#pragma GCC unroll 4
  for (std::size_t v = 0; v < kVectors; ++v) sums[v] = accumulate ? load(to.y + x, v) : zero();
  const float* element = filter.coefficients;
  for (std::uint32_t j = 0; j < filter.height; ++j) {
    const float* from = rows.row[j] + rows.step[j] * static_cast<std::ptrdiff_t>(x);
    for (const float* const end = element + filter.width; element != end; ++element, ++from) {
      if (*element == 0.0F) continue;
      const V e = hn::Set(d, *element);
#pragma GCC unroll 4
      for (std::size_t v = 0; v < kVectors; ++v) sums[v] = hn::Add(sums[v], hn::Mul(e, load(from, v)));
    }
  }
#pragma GCC unroll 4
  for (std::size_t v = 0; v < kVectors; ++v) store_cells(to, x + v * lanes, sums[v]);
}

void correlate(const FilterView& filter, const StencilRows& rows, const StencilOutput& to,
               bool accumulate) noexcept {
  const std::size_t lanes = hn::Lanes(D());
  std::size_t x = 0;
  for (; x + 4 * lanes <= to.columns; x += 4 * lanes) correlate_vectors<4>(filter, rows, to, accumulate, x);
  for (; x < to.columns; x += lanes) correlate_vectors<1>(filter, rows, to, accumulate, x);
}

// kVectors vectors of each of the rows at once: a vector of cells is loaded once for all of them, and a
// coefficient once for all vectors. The order of a cell's products is that of correlate().
template <std::size_t kVectors>
HWY_INLINE void correlate_block(const FilterView& filter, const StencilRows& rows,
                                const std::array<StencilOutput, kFilterRows>& to, std::size_t x) {
  static_assert(kFilterRows == 4);
  const D d;
  const std::size_t lanes = hn::Lanes(d);
  V sums[kFilterRows][kVectors];
#pragma GCC unroll 4
  for (std::size_t o = 0; o < kFilterRows; ++o)
#pragma GCC unroll 4
    for (std::size_t v = 0; v < kVectors; ++v) sums[o][v] = zero();
  const auto last = static_cast<std::ptrdiff_t>(filter.height) - 1;
  for (std::ptrdiff_t j = 0; j < last + static_cast<std::ptrdiff_t>(kFilterRows); ++j) {
    const float* from = rows.row[j] + rows.step[j] * static_cast<std::ptrdiff_t>(x);
    const float* const elements = filter.coefficients + j * filter.width;
    if (j >= static_cast<std::ptrdiff_t>(kFilterRows) - 1 && j <= last) {
      for (std::ptrdiff_t i = 0; i < filter.width; ++i, ++from) {
        V cells[kVectors];
#pragma GCC unroll 4
        for (std::size_t v = 0; v < kVectors; ++v) cells[v] = hn::LoadU(d, from + v * lanes);
#pragma GCC unroll 4
        for (std::size_t o = 0; o < kFilterRows; ++o) {
          const V e = hn::Set(d, elements[i - static_cast<std::ptrdiff_t>(o * filter.width)]);
#pragma GCC unroll 4
          for (std::size_t v = 0; v < kVectors; ++v) sums[o][v] = hn::Add(sums[o][v], hn::Mul(e, cells[v]));
        }
      }
    } else {  // the first rows that the upper outputs read, and the last of the lower ones
#pragma GCC unroll 4
      for (std::size_t o = 0; o < kFilterRows; ++o) {
        const std::ptrdiff_t row = j - static_cast<std::ptrdiff_t>(o);
        if (row < 0 || row > last) continue;
        for (std::ptrdiff_t i = 0; i < filter.width; ++i) {
          const V e = hn::Set(d, filter.coefficients[row * filter.width + i]);
#pragma GCC unroll 4
          for (std::size_t v = 0; v < kVectors; ++v)
            sums[o][v] = hn::Add(sums[o][v], hn::Mul(e, hn::LoadU(d, from + i + v * lanes)));
        }
      }
    }
  }
#pragma GCC unroll 4
  for (std::size_t o = 0; o < kFilterRows; ++o)
#pragma GCC unroll 4
    for (std::size_t v = 0; v < kVectors; ++v) store_cells(to[o], x + v * lanes, sums[o][v]);
}

// 16 or 8 sums, so many registers are there.
constexpr std::size_t kFilterVectors = kLanes * sizeof(float) == 64 && HWY_MAX_BYTES == 64 ? 4 : 2;

// False if there are fewer columns than a block has. The last block ends with the last column: its first
// columns may be computed twice.
template <std::size_t kVectors>
bool correlate_blocks(const FilterView& filter, const StencilRows& rows,
                      const std::array<StencilOutput, kFilterRows>& to) noexcept {
  const std::size_t width = kVectors * hn::Lanes(D()), columns = to[0].columns;
  if (columns < width) return false;
  for (std::size_t x = 0; x + width <= columns; x += width) correlate_block<kVectors>(filter, rows, to, x);
  if (columns % width != 0) correlate_block<kVectors>(filter, rows, to, columns - width);
  return true;
}

void correlate_rows(const FilterView& filter, const StencilRows& rows,
                    const std::array<StencilOutput, kFilterRows>& to) noexcept {
  if (correlate_blocks<kFilterVectors>(filter, rows, to) || correlate_blocks<2>(filter, rows, to) ||
      correlate_blocks<1>(filter, rows, to))
    return;
  for (std::uint32_t o = 0; o < kFilterRows; ++o)
    correlate_vectors<1>(filter, {rows.row + o, rows.step + o}, to[o], false, 0);
}

// The order of operations is that of opcodes.def. load(j, i) loads the cells of row j, column i of the three.
template <class Op, bool kEight, class Load>
HWY_INLINE V join_neighbours(const Load& load) {
  const V sides = Op::apply(load(1, 0), load(1, 2), zero());
  if constexpr (!kEight) return Op::apply(sides, Op::apply(load(0, 1), load(2, 1), zero()), zero());
  const V north = Op::apply(Op::apply(load(0, 0), load(0, 2), zero()), load(0, 1), zero());
  const V south = Op::apply(Op::apply(load(2, 0), load(2, 2), zero()), load(2, 1), zero());
  return Op::apply(sides, Op::apply(north, south, zero()), zero());
}

template <class Op, bool kEight>
void near(const StencilRows& rows, const StencilOutput& to) noexcept {
  const D d;
  std::size_t x = 0;
  const auto from = [&](std::size_t j, std::size_t i) {
    return rows.row[j] + rows.step[j] * static_cast<std::ptrdiff_t>(x) + i;
  };
  const auto whole = [&](std::size_t j, std::size_t i) { return hn::LoadU(d, from(j, i)); };
  const auto part = [&](std::size_t j, std::size_t i) { return load_cells(from(j, i), to.columns - x); };
  for (; x + hn::Lanes(d) <= to.columns; x += hn::Lanes(d))
    store_cells(to, x, join_neighbours<Op, kEight>(whole));
  if (x < to.columns) store_cells(to, x, join_neighbours<Op, kEight>(part));
}

template <class... Ops>
StencilKernels make_stencil_kernels() {
  StencilKernels kernels;
  kernels.correlate = correlate;
  kernels.correlate_rows = correlate_rows;
  kernels.near = {{{near<Ops, false>, near<Ops, true>}...}};
  return kernels;
}

// ---- matrix products ----

// kVectors vectors of kMatrixRows outputs at once: a vector of cells is loaded once for all of them, and a
// weight once for all vectors.
template <std::size_t kVectors>
HWY_INLINE void multiply_block(const MatrixProduct& product, std::size_t first_output, std::ptrdiff_t at) {
  static_assert(kMatrixRows == 4);
  const D d;
  const std::size_t lanes = hn::Lanes(d);
  V sums[kMatrixRows][kVectors];
#pragma GCC unroll 4
  for (std::size_t o = 0; o < kMatrixRows; ++o)
#pragma GCC unroll 4
    for (std::size_t v = 0; v < kVectors; ++v) sums[o][v] = zero();
  const float* weights = product.weights + first_output * product.inputs;
  const float* const* const end = product.x + product.inputs;
  for (const float* const* x = product.x; x != end; ++x, weights += kMatrixRows) {
    V cells[kVectors];
#pragma GCC unroll 4
    for (std::size_t v = 0; v < kVectors; ++v) cells[v] = hn::Load(d, *x + at + v * lanes);
#pragma GCC unroll 4
    for (std::size_t o = 0; o < kMatrixRows; ++o) {
      const V weight = hn::Set(d, weights[o]);
#pragma GCC unroll 4
      for (std::size_t v = 0; v < kVectors; ++v) sums[o][v] = hn::Add(sums[o][v], hn::Mul(cells[v], weight));
    }
  }
#pragma GCC unroll 4
  for (std::size_t o = 0; o < kMatrixRows; ++o) {
    if (first_output + o >= product.outputs) return;
    float* y = product.y[first_output + o] + at;
#pragma GCC unroll 4
    for (std::size_t v = 0; v < kVectors; ++v) {
      V value = sums[o][v];
      if (product.mask != nullptr)
        value = hn::IfThenElse(is_true(hn::Load(d, product.mask + at + v * lanes)), value,
                               hn::Load(d, y + v * lanes));
      hn::Store(value, d, y + v * lanes);
    }
  }
}

void multiply_matrix(const MatrixProduct& product, std::uint32_t first_row, std::uint32_t last_row) noexcept {
  const std::size_t lanes = hn::Lanes(D()), columns = (product.columns + kLanes - 1) / kLanes * kLanes;
  for (std::uint32_t row = first_row; row < last_row; ++row) {
    const std::ptrdiff_t start = row * product.pitch;
    std::size_t x = 0;
    for (; x + kFilterVectors * lanes <= columns; x += kFilterVectors * lanes)
      for (std::size_t o = 0; o < product.outputs; o += kMatrixRows)
        multiply_block<kFilterVectors>(product, o, start + static_cast<std::ptrdiff_t>(x));
    for (; x < columns; x += lanes)
      for (std::size_t o = 0; o < product.outputs; o += kMatrixRows)
        multiply_block<1>(product, o, start + static_cast<std::ptrdiff_t>(x));
  }
}

}  // namespace

void add_filter_kernels(KernelTable& table) {
  table.stencils = make_stencil_kernels<Add, Min, Max, Or, And>();
  table.matrix_product = multiply_matrix;
}

}  // namespace HWY_NAMESPACE
}  // namespace apron::vm
HWY_AFTER_NAMESPACE();
