// flood, distance, spread.max and spread.sum: the fixed point of their one-step rules (opcodes.def), in a few
// passes over the array, independent of the distance.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "apron/vm/Plane.h"
#include "apron/vm/kernels/KernelTable.h"

namespace apron::vm {

// 4-connected components of a mask: run-based labelling with union-find. Not thread-safe.
class ConnectedComponents {
 public:
  // Reserves memory for any mask of this shape, so that the other functions do not allocate.
  void reserve(std::uint32_t width, std::uint32_t height);

  // The masks and the seed may be of any type.
  // y = 1 in the components of the mask that contain a non-zero cell of seed, else 0. y may alias seed or
  // mask.
  void flood(Plane y, ConstPlane seed, ConstPlane mask, const KernelTable& kernels) noexcept;
  // y = the largest a of each component of the mask, 0 outside. -0 counts as 0 and NaN as -infinity. y is of
  // the type of a, and may alias a or mask.
  void spread_max(Plane y, ConstPlane a, ConstPlane mask, const KernelTable& kernels) noexcept;
  // y = the sum of a over each component of the mask, added in double precision, row by row, or of integers
  // modulo 2^n, 0 outside. y is of the type of a, and may alias a or mask.
  void spread_sum(Plane y, ConstPlane a, ConstPlane mask, const KernelTable& kernels) noexcept;
  // y, of int32, = the number from 1, row by row, of the last cell of each component of the mask, 0 outside.
  // y may alias mask.
  void spread_number(Plane y, ConstPlane mask, const KernelTable& kernels) noexcept;

 private:
  // Runs of true cells, row by row: the columns [first, last).
  std::uint32_t first_of(std::uint32_t run) const noexcept { return edges_[2 * std::size_t{run}]; }
  std::uint32_t last_of(std::uint32_t run) const noexcept { return edges_[2 * std::size_t{run} + 1]; }
  void find_components(ConstPlane mask, const KernelTable& kernels) noexcept;
  void unite_with_row_above(std::uint32_t above, std::uint32_t this_row, std::uint32_t end) noexcept;
  std::uint32_t find_root(std::uint32_t run) noexcept;
  template <class T, class Value, class Accumulate>
  void write_accumulated(Plane y, Value start, Accumulate accumulate) noexcept;
  template <class T, class Value>
  void write_values(Plane y, const Value* values) noexcept;

  std::size_t capacity_ = 0;                // runs
  std::unique_ptr<std::uint32_t[]> edges_;  // two of each run
  std::unique_ptr<std::uint32_t[]> roots_;  // the first run of its component, or one on the way to it
  std::unique_ptr<std::byte[]> values_;     // of the components, at their roots
  std::vector<std::uint32_t> row_starts_;   // first run of each row, then the number of runs
  std::vector<std::uint64_t> truths_;       // of a row: a bit a cell
};

// y = city-block distance to the nearest cell that is 0; cells beyond the edge are 0. y may alias a. Does not
// allocate.
void distance_transform(Plane y, ConstPlane a) noexcept;

}  // namespace apron::vm
