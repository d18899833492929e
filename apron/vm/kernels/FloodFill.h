// flood, distance and spread.max: the fixed point of their one-step rules (opcodes.def), in a few passes over
// the array whatever the distance.
#pragma once

#include <cstdint>
#include <vector>

#include "apron/vm/Plane.h"
#include "apron/vm/kernels/Kernels.h"

namespace apron::vm {

// The connected objects of a mask: runs of neighbouring cells in a row, joined where runs of two rows touch.
class ConnectedComponents {
 public:
  // Makes room for every mask of this shape; what follows allocates nothing.
  void reserve(std::uint32_t width, std::uint32_t height);

  // y = 1 in the objects of the mask that hold a non-zero cell of seed, else 0. y may be seed or mask.
  void flood(Plane y, ConstPlane seed, ConstPlane mask) noexcept;
  // y = the largest a of each object of the mask, -0 as 0 and NaN as -infinity, and 0 outside. y may be a or
  // mask.
  void spread_max(Plane y, ConstPlane a, ConstPlane mask, const KernelTable& kernels) noexcept;

 private:
  struct Run {
    std::uint32_t first, last;  // columns, last excluded
    std::uint32_t parent;       // a run of the same object; itself at its root
    float value;                // of the object, at the root
  };
  template <class Value>
  void label_components(ConstPlane mask, const Value& value) noexcept;
  void union_with_row_above(std::uint32_t row_above, std::uint32_t this_row) noexcept;
  std::uint32_t find_root(std::uint32_t run) noexcept;
  void write_values(Plane y) noexcept;

  std::vector<Run> runs_;
  std::vector<std::uint32_t> row_starts_;  // first run of each row, and the end
};

// y = steps to the nearest cell that is 0, through the 4 neighbours; beyond the edge all are 0. y may be a.
void distance_transform(Plane y, ConstPlane a) noexcept;

}  // namespace apron::vm
