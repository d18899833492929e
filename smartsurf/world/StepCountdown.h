// The steps that a duration takes, of which the last may be a part.
#pragma once

#include <algorithm>
#include <cmath>

namespace smartsurf::world {

class StepCountdown {
 public:
  StepCountdown() = default;
  StepCountdown(double duration_s, double dt_s) : steps_left_(duration_s / dt_s) {
    // Durations that are meant to be whole steps.
    constexpr double kRounding = 1e-6;
    const double whole = std::round(steps_left_);
    if (std::abs(steps_left_ - whole) <= kRounding * whole) steps_left_ = whole;
  }

  bool is_over() const { return steps_left_ <= 0.0; }
  // Takes a step. Returns the part of it that the duration covers.
  double take() {
    const double part = std::min(steps_left_, 1.0);
    steps_left_ -= part;
    return part;
  }

 private:
  double steps_left_ = 0.0;
};

}  // namespace smartsurf::world
