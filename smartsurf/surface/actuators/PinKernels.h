// SIMD loops over contiguous pins. Every instruction set gives the same bits as MotionProfile. Private to
// smartsurf/surface.
//
// Arrays have n entries, or one per cell where runs of cells are given; heights and targets in u, speeds in
// u/s.
#pragma once

#include <cstddef>
#include <span>

#include "smartsurf/surface/actuators/CellRun.h"
#include "smartsurf/surface/actuators/MotionProfile.h"

namespace smartsurf::surface {

// How many commands clamp_commands() replaced: as beyond the range, infinite ones included, and as NaN.
struct CommandUpdate {
  std::size_t clamped = 0, nan = 0;
  bool changed = false;  // false if the commands have the same bits as those before
  CommandUpdate& operator+=(const CommandUpdate& other) {
    clamped += other.clamped, nan += other.nan, changed |= other.changed;
    return *this;
  }
};

// Copies the commands of the cells of the runs that are `within`, clamped to [low, high], with NaN replaced
// by the cell's `safe` value. commands: of the cells within.begin to within.end − 1.
// `commands` may be memory that another process writes: each value is copied before it is checked.
CommandUpdate clamp_commands(std::span<const CellRun>, const CellRun& within, const float* commands,
                             float low, float high, const float* safe, float* clamped) noexcept;

// Sets target = base + command for the cells of the runs. Returns whether any target changed.
bool update_targets(std::span<const CellRun>, const float* base, const float* commands,
                    float* target) noexcept;

// Summary of a run of pins for the coming step.
struct PinMotion {
  bool moving = false;     // some pin is off its target or has a speed
  float max_speed = 0.0F;  // maximum |speed|
};

// Updates `speed` for the coming step towards the targets.
PinMotion plan_speeds(std::size_t n, const float* target, const float* height, const MotionProfile&,
                      float* speed) noexcept;

// Advances the heights by one step at their speeds. Returns the maximum height. unit: as of MotionProfile.
float advance_pins(std::size_t n, const float* target, const float* speed, float dt_s, float unit,
                   float* height) noexcept;

}  // namespace smartsurf::surface
