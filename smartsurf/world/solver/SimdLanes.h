// How many bodies or pairs the kernels work on at a time.
#pragma once

namespace smartsurf::world {

inline constexpr int kLanes = 8;

}  // namespace smartsurf::world
