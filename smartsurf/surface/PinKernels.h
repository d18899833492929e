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

// Moves the pins by a step at their speeds; the highest of them.
float advance(std::size_t n, const float* target, const float* speed, float dt_s, float* height) noexcept;

}  // namespace smartsurf::surface
