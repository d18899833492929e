// Gaps between tops that the engine and the views treat as closed.
#pragma once

namespace smartsurf::scene {

// The widest narrow gap, in pitches: a quarter, and the rounding of a top of three quarters.
inline constexpr double kMaxNarrowGap = 0.25 + 1e-4;

}  // namespace smartsurf::scene
