#include "smartsurf/world/solver/AxisLaw.h"

#include <cmath>

namespace smartsurf::world {

void AxisLaw::add_step(Cause cause, double speed, double below, double above) {
  int i = count_;
  while (i > 0 && step_[i - 1].speed >= speed) --i;
  const std::size_t at = i;
  if (i < count_ && step_[at].speed == speed) {
    step_[at].below += below, step_[at].above += above, step_[at].causes |= cause;
    return;
  }
  for (std::size_t k = count_; k > at; --k) step_[k] = step_[k - 1];
  step_[at] = {speed, below, above, cause};
  ++count_;
}

double AxisLaw::offset(int segment) const {
  double sum = impulse_without_steps(0.0);
  for (int i = 0; i < count_; ++i) {
    const Step& s = step_[i];
    sum += 2 * i + 1 > segment ? s.below : s.above;
  }
  return sum;
}

int AxisLaw::segment_of(std::uint8_t causes, double speed) const {
  int segment = 0;
  for (int i = 0; i < count_; ++i) {
    const Step& s = step_[i];
    if ((s.causes & causes) != 0) return 2 * i + 1;
    const bool is_above = speed >= speed_of(s);
    if (std::isinf(is_above ? s.above : s.below)) return 2 * i + 1;
    if (is_above) segment = 2 * i + 2;
  }
  return segment;
}

int AxisLaw::first_segment(std::uint8_t causes, double speed, double impulse, double response) const {
  int segment = segment_of(causes, speed);
  if (is_held(segment)) return segment;
  for (int i = 0; i < 2 * count_; ++i) {
    const double end = is_held(segment)
                           ? held_speed(segment)
                           : (speed + response * (offset(segment) - impulse)) / (1.0 + response * slope_);
    const int next = next_segment(segment, end, impulse + (end - speed) / response, 0.0, 0.0);
    if (next == segment) break;
    segment = next;
  }
  return segment;
}

int AxisLaw::next_segment(int segment, double speed, double impulse, double speed_tolerance,
                          double impulse_tolerance) const {
  if (is_held(segment)) {
    const double rest = impulse + slope_ * held_speed(segment);
    const double below = offset(segment - 1), above = offset(segment + 1);
    // Beyond a bound, only the bound itself is possible.
    if (rest > below + impulse_tolerance) return segment - (std::isinf(below) ? 2 : 1);
    if (rest < above - impulse_tolerance) return segment + (std::isinf(above) ? 2 : 1);
    return segment;
  }
  if (segment > 0 && speed < speed_of(step_[index_of(segment) - 1]) - speed_tolerance) return segment - 1;
  if (segment < 2 * count_ && speed > speed_of(step_[index_of(segment)]) + speed_tolerance)
    return segment + 1;
  return segment;
}

}  // namespace smartsurf::world
