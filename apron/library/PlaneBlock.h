// Storage of one register that a program and its caller share: a plane with the padding that kernels need.
#pragma once

#include <cstdint>
#include <memory>

#include "apron/vm/PlaneStore.h"

namespace apron::library {

class PlaneBlock {
 public:
  PlaneBlock(std::uint32_t width, std::uint32_t height, vm::CellType type)
      : plane_(store_.allocate(width, height, type)) {}

  const vm::Plane& plane() const noexcept { return plane_; }
  // False once a program may have written the padding.
  bool has_zero_padding() const noexcept { return has_zero_padding_; }
  void mark_padding_written() noexcept { has_zero_padding_ = false; }
  void clear_padding() noexcept;

 private:
  vm::PlaneStore store_;
  vm::Plane plane_;
  bool has_zero_padding_ = true;
};

// Blocks for the results of large arrays. Those that nobody uses any more are kept for the next result,
// because the system takes longer to provide memory than a program to fill it. Thread-safe.
using SharedBlock = std::shared_ptr<PlaneBlock>;
// Cells have any values, the padding is zero. Throws std::bad_alloc.
SharedBlock acquire_block(std::uint32_t width, std::uint32_t height,
                          vm::CellType type = vm::CellType::kFloat32);

}  // namespace apron::library
