// The inner loops over pins that lie side by side in memory: eight or sixteen at a time, on any instruction
// set with the bits that Approach gives. Internal to the room.
#pragma once

#include <cstddef>

#include "smartsurf/surface/actuators/MotionProfile.h"

namespace smartsurf::surface {

// Copies commands into [low, high]; a NaN becomes `safe`. Returns how many values were replaced. The commands may lie
// in memory that another process writes: each value is copied before it is checked.
std::size_t clamp_commands(std::size_t n, const float* commands, float low, float high, float safe,
                           float* clamped) noexcept;

// target = base + command; whether any target is another than before.
bool update_targets(std::size_t n, const float* base, const float* commands, float* target) noexcept;

// What a stretch of pins is about to do.
struct PinMotion {
  bool moving = false;     // any is not at its target, or not at rest
  float max_speed = 0.0F;  // greatest |speed|
};

// The speeds of the step to come, towards the targets.
PinMotion plan_speeds(std::size_t n, const float* target, const float* height, const MotionProfile&,
                      float* speed) noexcept;

// Moves the pins by a step at their speeds; the highest of them.
float advance_pins(std::size_t n, const float* target, const float* speed, float dt_s,
                   float* height) noexcept;

}  // namespace smartsurf::surface
