// The impulse along the axis of a joint in a substep, which does not grow with the speed:
// friction, motor and limits are steps of it, and a spring makes it slope.
//
// Either the speed is that of a step, where the impulse is whatever holds it there, or the impulse is that
// between two steps. Which of these holds, the segment, is found together with the speeds of all joints.
#pragma once

#include <array>
#include <cstdint>

namespace smartsurf::world {

class AxisLaw {
 public:
  enum Cause : std::uint8_t { kFriction = 1, kMotor = 2, kLower = 4, kUpper = 8 };

  // The impulse is `offset` − `slope`·speed − `lead_slope`·lead, without steps.
  void reset(double offset, double slope, double lead_slope = 0.0) {
    offset_ = offset, slope_ = slope, lead_slope_ = lead_slope, lead_ = 0.0, count_ = 0;
  }
  // On a curved path the coordinate changes faster than the speed along its axis, by the lead. The speeds of
  // the steps are those of the coordinate, all others those along the axis.
  void set_lead(double lead) { lead_ = lead; }
  // Adds `below` to the impulse at speeds less than `speed`, and `above` at greater ones; below ≥ above.
  // Infinity makes the speed a bound.
  void add_step(Cause, double speed, double below, double above);

  // Segments: 2·i + 1: at step i; 2·i: between the steps before and after it.
  static bool is_held(int segment) { return segment % 2 == 1; }
  double held_speed(int segment) const { return speed_of(step_[index_of(segment)]); }
  std::uint8_t causes(int segment) const { return step_[index_of(segment)].causes; }
  double slope() const { return slope_; }
  double impulse_without_steps(double speed) const { return offset_ - lead_slope_ * lead_ - slope_ * speed; }
  // The impulse at speed 0, if it went on as between the steps.
  double offset(int segment) const;
  // The segment of a step with one of the causes; otherwise the one between the steps to which the speed
  // belongs.
  int segment_of(std::uint8_t causes, double speed) const;
  // The same, or the segment to which this impulse per speed brings an axis that nothing else holds: the
  // impulse of a strong motor alone would leave speeds from which no pose can be predicted.
  int first_segment(std::uint8_t causes, double speed, double impulse, double response) const;
  // The segment to try next when at `segment` the solution has this speed and impulse; `segment` itself if
  // they obey the law.
  int next_segment(int segment, double speed, double impulse, double speed_tolerance,
                   double impulse_tolerance) const;

 private:
  struct Step {
    double speed, below, above;
    std::uint8_t causes;
  };
  static std::size_t index_of(int segment) { return segment / 2; }
  double speed_of(const Step& s) const { return s.speed - lead_; }

  std::array<Step, 4> step_{};  // ascending by speed
  int count_ = 0;
  double offset_ = 0.0, slope_ = 0.0, lead_slope_ = 0.0, lead_ = 0.0;
};

}  // namespace smartsurf::world
