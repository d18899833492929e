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
class MotionProfile {
 public:
  struct Constants {
    float speed_step, inverse_speed_step;  // of the speed: the acceleration over one time step
    float inverse_dt;
    float max_speed;  // of the speed
    float max_units;  // beyond so many steps of way the limit binds; it keeps k small
  };

  MotionProfile(float max_speed, float max_acceleration, float dt_s)
      : c_{max_acceleration * dt_s, 1.0F / (max_acceleration * dt_s), 1.0F / dt_s, max_speed, 0.0F} {
    const float max_steps = std::min(max_speed * c_.inverse_speed_step, 1e6F) + 1.0F;
    c_.max_units = (max_steps + 1.0F) * (max_steps + 2.0F);
  }

  const Constants& constants() const { return c_; }

  float operator()(float distance, float speed) const {
    const float arrival_speed =
        std::abs(distance) * c_.inverse_dt;  // speed that would arrive in this very step
    const float units = arrival_speed * c_.inverse_speed_step < c_.max_units
                            ? arrival_speed * c_.inverse_speed_step
                            : c_.max_units;
    const float k = std::trunc(0.5F * (std::sqrt(1.0F + 8.0F * units) - 1.0F));
    const float stopping_speed =
        k * c_.speed_step + (arrival_speed - 0.5F * c_.speed_step * k * (k + 1.0F)) / (k + 1.0F);
    const float desired =
        std::copysign(stopping_speed < c_.max_speed ? stopping_speed : c_.max_speed, distance);
    const float low = speed - c_.speed_step, high = speed + c_.speed_step;
    const float at_least_low = desired > low ? desired : low;
    return at_least_low < high ? at_least_low : high;
  }

  // Where a mover is after a step at that speed. Rounding must not leave it an ulp beside its target for
  // ever.
  static float advance(float position, float speed, float target, float dt_s) {
    const float next = position + speed * dt_s;
    const float magnitude = std::abs(next), scale = magnitude > 1.0F ? magnitude : 1.0F;
    return std::abs(target - next) <= 1e-6F * scale ? target : next;
  }

 private:
  Constants c_;
};

}  // namespace smartsurf::surface
