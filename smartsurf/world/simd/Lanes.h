// The width of a SIMD batch, which all kernels and the arrays that they read share.
#pragma once

namespace smartsurf::world {

// Bodies, manifolds or samples per SIMD batch.
inline constexpr int kLanes = 8;

}  // namespace smartsurf::world
