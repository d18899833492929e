// Allocates and owns planes. Each plane is zeroed, its rows are 64-byte aligned, and it is padded so that
// kernels may load and store whole vectors: the pitch is the width rounded up to 64 bytes plus 64 more, and
// 64 bytes precede the first row.
#pragma once

#include <cstdlib>
#include <memory>
#include <vector>

#include "apron/vm/Plane.h"

namespace apron::vm {

inline constexpr std::uint32_t kVectorBytes = program::kVectorBytes;  // unit of padding
inline constexpr std::uint32_t kLanes = 16;                           // floats in it
// Cells in the widest vector.
constexpr std::uint32_t lanes(CellType type) noexcept {
  return kVectorBytes / static_cast<std::uint32_t>(program::cell_bytes(type));
}

class PlaneStore {
 public:
  // width and height must be at least 1. The plane lives as long as the store. Throws std::bad_alloc.
  Plane allocate(std::uint32_t width, std::uint32_t height, CellType type = CellType::kFloat32);

 private:
  struct FreeDeleter {
    void operator()(float* p) const noexcept { std::free(p); }
  };
  std::vector<std::unique_ptr<float[], FreeDeleter>> allocations_;
};

}  // namespace apron::vm
