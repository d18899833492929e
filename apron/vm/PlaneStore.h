// Allocates and owns planes. Each plane is zeroed, its rows are 64-byte aligned, and it is padded so that
// kernels may load and store whole vectors: the pitch is the width rounded up to 16 floats plus 16 more, and
// 16 floats precede the first row.
#pragma once

#include <cstdlib>
#include <memory>
#include <vector>

#include "apron/vm/Plane.h"

namespace apron::vm {

inline constexpr std::uint32_t kLanes = 16;  // floats in the widest vector; unit of padding

class PlaneStore {
 public:
  // width and height must be at least 1. The plane lives as long as the store. Throws std::bad_alloc.
  Plane allocate(std::uint32_t width, std::uint32_t height);

 private:
  struct FreeDeleter {
    void operator()(float* p) const noexcept { std::free(p); }
  };
  std::vector<std::unique_ptr<float[], FreeDeleter>> allocations_;
};

}  // namespace apron::vm
