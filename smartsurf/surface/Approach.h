// The law by which cells move to a target height or angle.
#pragma once

#include <algorithm>
#include <cmath>

namespace smartsurf::surface {

// The fastest speed, within a limit and an acceleration, from which a mover still stops exactly on its
// target.
//
// A mover that brakes by s = a·dt every step from k·s + f (f < s) covers ((k+1)·f + s·k·(k+1)/2)·dt before it
// rests. Solved for the distance left, that is the speed of the step to come. PinKernels has the same law in
// lanes.
class Approach {
 public:
  struct Constants {
    float step, inverse_step;  // of the speed: the acceleration over one time step
    float inverse_dt;
    float limit;  // of the speed
    float far;    // beyond so many steps of way the limit binds; it keeps k small
  };

  Approach(float speed_limit, float acceleration_limit, float dt_s)
      : c_{acceleration_limit * dt_s, 1.0F / (acceleration_limit * dt_s), 1.0F / dt_s, speed_limit, 0.0F} {
    const float most = std::min(speed_limit * c_.inverse_step, 1e6F) + 1.0F;
    c_.far = (most + 1.0F) * (most + 2.0F);
  }

  const Constants& constants() const { return c_; }

  float operator()(float distance, float speed) const {
    const float per_step = std::abs(distance) * c_.inverse_dt;  // speed that would arrive in this very step
    const float units = per_step * c_.inverse_step < c_.far ? per_step * c_.inverse_step : c_.far;
    const float k = std::trunc(0.5F * (std::sqrt(1.0F + 8.0F * units) - 1.0F));
    const float stoppable = k * c_.step + (per_step - 0.5F * c_.step * k * (k + 1.0F)) / (k + 1.0F);
    const float wanted = std::copysign(stoppable < c_.limit ? stoppable : c_.limit, distance);
    const float low = speed - c_.step, high = speed + c_.step;
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
  Constants c_;
};

}  // namespace smartsurf::surface
