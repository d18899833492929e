// The inner loops over pins that lie side by side in memory: eight or sixteen at a time, on any instruction
// set with the bits that Approach gives. Internal to the room.
#pragma once

#include <cstddef>

#include "smartsurf/surface/Approach.h"

namespace smartsurf::surface {

// Keeps the commands within [low, high]; where there is none (NaN), the cell keeps its old one.
void take_commands(std::size_t n, const float* commands, float low, float high, float* kept) noexcept;

// target = base + command; whether any target is another than before.
bool aim(std::size_t n, const float* base, const float* commands, float* target) noexcept;

// What a stretch of pins is about to do.
struct Course {
  bool moving = false;   // any is not at its target, or not at rest
  float fastest = 0.0F;  // greatest |speed|
};

// The speeds of the step to come, towards the targets.
Course steer(std::size_t n, const float* target, const float* height, const Approach&, float* speed) noexcept;

// A drive as strong as `limit`, mass·u/s². Its line is v = max_speed·(1 − load/limit): as fast as it may
// without a load, standing at the greatest one. More trips it: the load pushes the pin back, down to the
// lower stop, and only after a while it tries again.
struct Drive {
  float limit, dt_s;
  float lowest;   // of the range, over the base
  float pause_s;  // after it tripped
};
struct LoadedPins {
  const float *base, *target, *height;
  const float* load;    // mass·u/s²
  float *wait, *speed;  // wait: s until it tries again
};
Course steer_loaded(std::size_t n, const LoadedPins&, const Approach&, const Drive&) noexcept;

// Lets each load follow the impulse of the last step, by that share of the difference; whether any load is
// over the limit.
bool weigh(std::size_t n, const float* impulse, float per_dt, float share, float limit, float* load) noexcept;

// Moves the pins by a step at their speeds; the highest of them.
float advance(std::size_t n, const float* target, const float* speed, float dt_s, float* height) noexcept;

}  // namespace smartsurf::surface
