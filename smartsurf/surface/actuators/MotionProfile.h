// The motion profile by which cells approach a target height or angle.
#pragma once

#include <algorithm>
#include <cmath>

namespace smartsurf::surface {

// Computes the highest speed, within limits of speed and acceleration, from which a cell can still stop
// exactly on its target.
//
// A cell that brakes by s = a·dt per step from the speed k·s + f, 0 ≤ f < s, covers
// ((k + 1)·f + s·k·(k + 1)/2)·dt until it stops. Solving this for the remaining distance gives the speed of
// the coming step. A first-order lag covers the part p of the distance in a step, and slows the cell by s in
// a step from the speed s/p, that is, at the distance s·dt/p². Nearer, the lag bounds the speed; farther
// away, the cell brakes to arrive there with that speed. PinKernels holds a vectorised copy that must stay
// bit-identical.
class MotionProfile {
 public:
  struct Constants {
    float speed_step, inverse_speed_step;  // max_acceleration·dt, u/s, and its inverse
    float inverse_dt;
    float max_speed;
    float max_units;  // cap of distance/(speed_step·dt): max_speed binds beyond it; keeps k small
    float most_part;  // p; above 1 without a lag, so that it never binds
    // Distances over dt, u/s; 0 without a lag: from where it slows, and by which it is longer than that in
    // which the cell would stop from the same speed without a lag.
    float lag_distance, lag_excess;
  };

  MotionProfile(float max_speed, float max_acceleration, float dt_s, float lag_s = 0.0F)
      : c_{max_acceleration * dt_s,
           1.0F / (max_acceleration * dt_s),
           1.0F / dt_s,
           max_speed,
           0.0F,
           lag_s > 0.0F ? -std::expm1(-dt_s / lag_s) : 2.0F,
           0.0F,
           0.0F} {
    if (lag_s > 0.0F) {
      const float k = std::trunc(1.0F / c_.most_part), rest = 1.0F / c_.most_part - k;
      c_.lag_distance = c_.speed_step / (c_.most_part * c_.most_part);
      c_.lag_excess = c_.lag_distance - c_.speed_step * ((k + 1.0F) * rest + 0.5F * k * (k + 1.0F));
    }
    const float max_steps = std::min(max_speed * c_.inverse_speed_step, 1e6F) + 1.0F;
    c_.max_units = (max_steps + 1.0F) * (max_steps + 2.0F);
  }

  const Constants& constants() const { return c_; }

  // Returns the speed of the coming step. distance: target − position; speed: of the last step.
  float operator()(float distance, float speed) const {
    const float arrival_speed = std::abs(distance) * c_.inverse_dt;  // arrives within this step
    const float room = arrival_speed > c_.lag_distance ? arrival_speed - c_.lag_excess : arrival_speed;
    const float units =
        room * c_.inverse_speed_step < c_.max_units ? room * c_.inverse_speed_step : c_.max_units;
    const float k = std::trunc(0.5F * (std::sqrt(1.0F + 8.0F * units) - 1.0F));
    const float stopping_speed =
        k * c_.speed_step + (room - 0.5F * c_.speed_step * k * (k + 1.0F)) / (k + 1.0F);
    const float lagging_speed = arrival_speed * c_.most_part;
    const float most_speed = lagging_speed < c_.max_speed ? lagging_speed : c_.max_speed;
    const float desired = std::copysign(stopping_speed < most_speed ? stopping_speed : most_speed, distance);
    const float low = speed - c_.speed_step, high = speed + c_.speed_step;
    const float at_least_low = desired > low ? desired : low;
    return at_least_low < high ? at_least_low : high;
  }

  // Returns the position after a step at that speed. Snaps to a target within rounding error, which the cell
  // might otherwise never reach. unit: a pitch, or a radian where positions are angles.
  static float advance(float position, float speed, float target, float dt_s, float unit = 1.0F) {
    const float next = position + speed * dt_s;
    const float magnitude = std::abs(next), scale = magnitude > unit ? magnitude : unit;
    return std::abs(target - next) <= 1e-6F * scale ? target : next;
  }

 private:
  Constants c_;
};

}  // namespace smartsurf::surface
