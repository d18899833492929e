// Owns the VM's planes: registers, masks, scratch. Each is zeroed, 64-byte aligned, and padded so that
// kernels may load and store whole vectors: rows to a multiple of 16 floats plus 16 more, and 16 floats
// before the first row.
#pragma once

#include <cstdlib>
#include <memory>
#include <vector>

#include "apron/vm/Plane.h"

namespace apron::vm {

inline constexpr std::uint32_t kLanes = 16;  // floats in the widest vector; the padding's unit

class PlaneStore {
 public:
  // Allocates; throws std::bad_alloc. width and height at least 1.
  Plane allocate(std::uint32_t width, std::uint32_t height);

 private:
  struct FreeDeleter {
    void operator()(float* p) const noexcept { std::free(p); }
  };
  std::vector<std::unique_ptr<float[], FreeDeleter>> allocations_;
};

}  // namespace apron::vm
