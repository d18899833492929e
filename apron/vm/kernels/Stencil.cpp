#include "apron/vm/kernels/Stencil.h"

#include <algorithm>
#include <array>

#include "apron/vm/PlaneStore.h"

namespace apron::vm {
namespace {

using program::BoundaryRule;
using program::Opcode;

constexpr std::size_t kMaxExtent = program::kMaxFilterExtent;

// A stencil of width x height cells over a plane extended by a boundary condition. Rows and columns that lie
// inside are read where they are; the columns at the west and east edge are copied together first.
class StencilPass {
 public:
  StencilPass(std::uint32_t width, std::uint32_t height, Plane y, ConstPlane a, BoundaryCondition boundary,
              const float* mask)
      : width_(width),
        height_(height),
        west_((static_cast<std::int64_t>(width) - 1) / 2),
        north_((static_cast<std::int64_t>(height) - 1) / 2),
        y_(y),
        a_(a),
        boundary_(boundary),
        mask_(mask) {
    constant_row_.fill(boundary.rule == BoundaryRule::kValue ? static_cast<float>(boundary.value) : 0.0F);
  }

  // Calls inner(rows, output) for the columns whose stencil lies inside the plane, and edge(begin, output)
  // for those at the west and east edge, of which `begin` is the first.
  template <class Inner, class Edge>
  void run_row(std::int64_t row, const Inner& inner, const Edge& edge) {
    const auto [first, last] = inner_columns();
    const std::int64_t columns = y_.width;
    find_rows(row, height_);
    for (const auto& [begin, end] : {std::pair{std::int64_t{0}, first}, std::pair{last, columns}})
      if (begin < end) edge(begin, output(row, begin, end));
    if (first < last) inner(StencilRows{row_.data(), step_.data()}, output(row, first, last));
  }

  // The same of kFilterRows rows at once: inner(rows, outputs) and edge(begin, outputs).
  template <class Inner, class Edge>
  void run_rows(std::int64_t row, const Inner& inner, const Edge& edge) {
    const auto [first, last] = inner_columns();
    const std::int64_t columns = y_.width;
    find_rows(row, height_ + kFilterRows - 1);
    for (const auto& [begin, end] : {std::pair{std::int64_t{0}, first}, std::pair{last, columns}})
      if (begin < end) edge(begin, outputs(row, begin, end));
    if (first < last) inner(StencilRows{row_.data(), step_.data()}, outputs(row, first, last));
  }

  // For edge(): row j of the stencil for the columns [begin, begin + columns), valid until the next call.
  const float* edge_row(std::uint32_t j, std::int64_t begin, std::uint32_t columns) {
    if (step_[j] == 0) return constant_row_.data();
    const std::int64_t cells = static_cast<std::int64_t>(columns) + width_ - 1, west = begin - west_;
    const std::int64_t first = std::clamp<std::int64_t>(-west, 0, cells);
    const std::int64_t last = std::clamp<std::int64_t>(y_.width - west, first, cells);
    const auto fill = [&](std::int64_t i, std::int64_t end) {
      for (; i < end; ++i) {
        const std::int64_t from = resolve_boundary_index(west + i, y_.width, boundary_.rule);
        edge_row_[i] = from == kOutside ? constant_row_[0] : row_[j][from];
      }
    };
    fill(0, first);
    std::copy_n(row_[j] + (west + first), last - first, edge_row_.data() + first);
    fill(last, cells);
    return edge_row_.data();
  }
  const std::ptrdiff_t& step(std::uint32_t j) const { return step_[j]; }

  // For edge() of stencils that has_edge_rows() allows: all rows that `outputs` rows read, of which kLanes
  // output columns may be computed. A row is copied together once for all output rows that read it, if they
  // follow one another.
  bool has_edge_rows() const { return width_ <= kEdgeExtent && height_ + kFilterRows - 1 <= kEdgeExtent; }
  StencilRows edge_rows(std::int64_t row, std::int64_t begin, std::uint32_t columns, std::uint32_t outputs) {
    Edge& edge = edges_[begin == 0 ? 0 : 1];
    for (std::uint32_t j = 0; j < height_ + outputs - 1; ++j) {
      const std::int64_t wanted = row + j - north_;
      const std::size_t slot = (wanted + north_) % kEdgeExtent;
      if (edge.row[slot] != wanted) {
        auto& cells = edge.cells[slot];
        const auto end = std::copy_n(edge_row(j, begin, columns), columns + width_ - 1, cells.begin());
        std::fill(end, cells.end(), 0.0F);
        edge.row[slot] = wanted;
      }
      edge_cells_[j] = edge.cells[slot].data();
    }
    return {edge_cells_.data(), kEdgeSteps.data()};
  }

 private:
  // The columns whose stencil lies inside the plane.
  std::pair<std::int64_t, std::int64_t> inner_columns() const {
    const std::int64_t columns = y_.width, first = std::min(west_, columns);
    return {first, std::max(first, columns - (width_ - 1 - west_))};
  }
  // Locates `count` rows, from the northernmost on that `row` reads.
  void find_rows(std::int64_t row, std::uint32_t count) {
    for (std::uint32_t j = 0; j < count; ++j) {
      const std::int64_t from = resolve_boundary_index(row + j - north_, y_.height, boundary_.rule);
      row_[j] = from == kOutside ? constant_row_.data() : a_.data + from * a_.pitch;
      step_[j] = from == kOutside ? 0 : 1;
    }
  }
  StencilOutput output(std::int64_t row, std::int64_t begin, std::int64_t end) const {
    const std::ptrdiff_t at = row * y_.pitch + begin;
    return {y_.data + at, mask_ != nullptr ? mask_ + at : nullptr, static_cast<std::uint32_t>(end - begin)};
  }
  std::array<StencilOutput, kFilterRows> outputs(std::int64_t row, std::int64_t begin,
                                                 std::int64_t end) const {
    std::array<StencilOutput, kFilterRows> all;
    for (std::uint32_t o = 0; o < kFilterRows; ++o) all[o] = output(row + o, begin, end);
    return all;
  }

  const std::int64_t width_;
  const std::uint32_t height_;
  const std::int64_t west_, north_;
  const Plane y_;
  const ConstPlane a_;
  const BoundaryCondition boundary_;
  const float* const mask_;
  static constexpr std::uint32_t kEdgeExtent = 33;  // at most 16 columns at an edge
  static constexpr auto kEdgeSteps = [] {
    std::array<std::ptrdiff_t, kEdgeExtent> steps{};
    steps.fill(1);
    return steps;
  }();
  struct Edge {
    Edge() { row.fill(INT64_MIN); }
    std::array<std::int64_t, kEdgeExtent> row;
    std::array<std::array<float, kLanes + kEdgeExtent - 1>, kEdgeExtent> cells;
  };
  std::array<Edge, 2> edges_;
  std::array<const float*, kEdgeExtent> edge_cells_;
  std::array<float, kStencilBlockCells + kMaxExtent> constant_row_;
  std::array<float, 2 * kMaxExtent> edge_row_;
  std::array<const float*, kMaxExtent + kFilterRows> row_;
  std::array<std::ptrdiff_t, kMaxExtent + kFilterRows> step_;
};

}  // namespace

void reduce_neighbours(Executor& executor, Opcode op, bool eight_connected, Plane y, ConstPlane a,
                       BoundaryCondition boundary, const float* mask) noexcept {
  const std::size_t index = index_of(op) - index_of(Opcode::kNearSum);
  const auto reduce = executor.kernels().stencils.near[index][eight_connected ? 1 : 0];
  executor.parallel_for_rows(y.height, y.width, [&](std::uint32_t first, std::uint32_t last) {
    StencilPass pass(3, 3, y, a, boundary, mask);
    const auto edge = [&](std::int64_t begin, const StencilOutput& to) {
      // At most two columns: of a plane of two, or of each edge one.
      std::array<std::array<float, 4>, 3> cells;
      constexpr std::array<std::ptrdiff_t, 3> kSteps{1, 1, 1};
      for (std::uint32_t j = 0; j < 3; ++j)
        std::copy_n(pass.edge_row(j, begin, to.columns), to.columns + 2, cells[j].begin());
      const std::array<const float*, 3> rows{cells[0].data(), cells[1].data(), cells[2].data()};
      reduce({rows.data(), kSteps.data()}, to);
    };
    for (std::uint32_t row = first; row < last; ++row) pass.run_row(row, reduce, edge);
  });
}

void apply_filter(Executor& executor, const FilterView& filter, Plane y, ConstPlane a,
                  BoundaryCondition boundary, const float* mask) noexcept {
  const auto correlate = executor.kernels().stencils.correlate;
  const auto correlate_rows = executor.kernels().stencils.correlate_rows;
  const std::size_t elements = std::size_t{filter.width} * filter.height;
  const bool has_zeros =
      std::find(filter.coefficients, filter.coefficients + elements, 0.0F) != filter.coefficients + elements;
  executor.parallel_for_rows(y.height, y.width, [&](std::uint32_t first, std::uint32_t last) {
    StencilPass pass(filter.width, filter.height, y, a, boundary, mask);
    const auto inner = [&](const StencilRows& rows, const StencilOutput& to) {
      correlate(filter, rows, to, false);
    };
    const auto write = [](const StencilOutput& to, const float* sums) {
      for (std::uint32_t x = 0; x < to.columns; ++x)
        if (to.mask == nullptr || to.mask[x] != 0.0F) to.y[x] = sums[x];
    };
    // Large filters run row by row, because the cells of each edge row are copied together.
    std::int64_t current = 0;
    const auto edge = [&](std::int64_t begin, const StencilOutput& to) {
      std::array<float, kMaxExtent> sums;
      if (pass.has_edge_rows())
        correlate(filter, pass.edge_rows(current, begin, to.columns, 1), {sums.data(), nullptr, kLanes},
                  false);
      for (std::uint32_t j = 0; j < filter.height && !pass.has_edge_rows(); ++j) {
        const float* row = pass.edge_row(j, begin, to.columns);
        correlate({filter.width, 1, filter.coefficients + std::size_t{j} * filter.width},
                  {&row, &pass.step(j)}, {sums.data(), nullptr, to.columns}, j > 0);
      }
      write(to, sums.data());
    };
    const auto inner_rows = [&](const StencilRows& rows, const auto& to) {
      correlate_rows(filter, rows, to);
    };
    const auto edge_rows = [&](std::int64_t begin, const std::array<StencilOutput, kFilterRows>& to) {
      std::array<std::array<float, kLanes>, kFilterRows> sums;
      std::array<StencilOutput, kFilterRows> whole;
      for (std::size_t o = 0; o < kFilterRows; ++o) whole[o] = {sums[o].data(), nullptr, kLanes};
      correlate_rows(filter, pass.edge_rows(current, begin, to[0].columns, kFilterRows), whole);
      for (std::size_t o = 0; o < kFilterRows; ++o) write(to[o], sums[o].data());
    };
    const auto nothing = [](const auto&...) {};
    for (std::uint32_t row = first; row < last && !executor.is_stopped();) {
      current = row;
      if (has_zeros || row + kFilterRows > last) {
        pass.run_row(row++, inner, edge);
      } else if (pass.has_edge_rows()) {
        pass.run_rows(row, inner_rows, edge_rows);
        row += kFilterRows;
      } else {
        pass.run_rows(row, inner_rows, nothing);
        for (const std::uint32_t end = row + kFilterRows; row < end; ++row) pass.run_row(row, nothing, edge);
      }
    }
  });
}

}  // namespace apron::vm
