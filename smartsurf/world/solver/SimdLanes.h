// The number of bodies or manifolds in one SIMD batch.
#pragma once

namespace smartsurf::world {

inline constexpr int kLanes = 8;

}  // namespace smartsurf::world
