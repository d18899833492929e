// The law by which cells move to a target height or angle.
#pragma once

#include <algorithm>
#include <cmath>

namespace smartsurf::surface {

// The fastest speed, within a limit and an acceleration, from which a mover still stops exactly on its
// target.
//
// A mover that brakes by s = a·dt every step from k·s + f (f < s) covers ((k+1)·f + s·k·(k+1)/2)·dt before it
// rests. Solved for the distance left, that is the speed of the step to come.
class Approach {
 public:
  Approach(float speed_limit, float acceleration_limit, float dt_s)
      : s_(acceleration_limit * dt_s),
        inverse_dt_(1.0F / dt_s),
        inverse_s_(1.0F / s_),
        limit_(speed_limit),
        // Beyond this the speed limit binds; it keeps k small enough for an int.
        far_((steps_left_limit() + 1.0F) * (steps_left_limit() + 2.0F)) {}

  float operator()(float distance, float speed) const { return (*this)(distance, speed, limit_); }

  // The same under another limit. Branch-free, so that loops over it vectorise.
  float operator()(float distance, float speed, float limit) const {
    const float per_step = std::abs(distance) * inverse_dt_;  // speed that would arrive in this very step
    const float units = per_step * inverse_s_ < far_ ? per_step * inverse_s_ : far_;
    const auto k = static_cast<float>(static_cast<int>(0.5F * (std::sqrt(1.0F + 8.0F * units) - 1.0F)));
    const float stoppable = k * s_ + (per_step - 0.5F * s_ * k * (k + 1.0F)) / (k + 1.0F);
    const float wanted = std::copysign(stoppable < limit ? stoppable : limit, distance);
    const float low = speed - s_, high = speed + s_;
    const float raised = wanted > low ? wanted : low;
    return raised < high ? raised : high;
  }

  // Where a mover is after a step at that speed. Rounding must not leave it an ulp beside its target for
  // ever.
  static float arrive(float position, float speed, float goal, float dt_s) {
    const float next = position + speed * dt_s;
    const float magnitude = std::abs(next), size = magnitude > 1.0F ? magnitude : 1.0F;
    return std::abs(goal - next) <= 1e-6F * size ? goal : next;
  }

 private:
  float steps_left_limit() const { return std::min(limit_ * inverse_s_, 1e6F) + 1.0F; }

  float s_, inverse_dt_, inverse_s_, limit_, far_;
};

}  // namespace smartsurf::surface
