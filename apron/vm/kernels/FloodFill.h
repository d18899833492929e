// flood, distance, spread.max and spread.sum: the fixed point of their one-step rules (opcodes.def), in a few
// passes over the array, independent of the distance.
#pragma once

#include <cstdint>
#include <vector>

#include "apron/vm/Plane.h"
#include "apron/vm/kernels/KernelTable.h"

namespace apron::vm {

// 4-connected components of a mask: run-based labelling with union-find. Not thread-safe.
class ConnectedComponents {
 public:
  // Reserves memory for any mask of this shape, so that the other functions do not allocate.
  void reserve(std::uint32_t width, std::uint32_t height);

  // y = 1 in the components of the mask that contain a non-zero cell of seed, else 0. y may alias seed or
  // mask.
  void flood(Plane y, ConstPlane seed, ConstPlane mask, const KernelTable& kernels) noexcept;
  // y = the largest a of each component of the mask, 0 outside. -0 counts as 0 and NaN as -infinity. All
  // three are of one type. y may alias a or mask.
  void spread_max(Plane y, ConstPlane a, ConstPlane mask, const KernelTable& kernels) noexcept;
  // y = the sum of a over each component of the mask, added in double precision, row by row, or modulo 2^n if
  // all three are integers of one type, 0 outside. y may alias a or mask.
  void spread_sum(Plane y, ConstPlane a, ConstPlane mask, const KernelTable& kernels) noexcept;

 private:
  struct Run {
    std::uint32_t first, last;  // columns [first, last)
    std::uint32_t parent;       // union-find parent; a root is its own parent
  };
  std::size_t find_edges(ConstPlane mask, std::uint32_t row, const KernelTable& kernels) noexcept;
  template <class Value>
  void label_components(ConstPlane mask, const KernelTable& kernels, const Value& value) noexcept;
  void union_with_row_above(std::uint32_t row_above, std::uint32_t this_row) noexcept;
  std::uint32_t find_root(std::uint32_t run) noexcept;
  template <class T>
  void write_values(Plane y) noexcept;

  std::vector<Run> runs_;
  std::vector<double> values_;             // of the components, at their roots
  std::vector<std::uint64_t> truths_;      // of a row: a bit a cell
  std::vector<std::uint32_t> edges_;       // of its runs, see find_edges()
  std::vector<std::uint32_t> row_starts_;  // first run of each row, then the number of runs
};

// y = city-block distance to the nearest cell that is 0; cells beyond the edge are 0. y may alias a. Does not
// allocate.
void distance_transform(Plane y, ConstPlane a) noexcept;

}  // namespace apron::vm
