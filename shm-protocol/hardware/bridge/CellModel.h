// How a cell of a table answers its commands: the model that calibration fits. Plain functions without I/O.
//
//   w  = zero + slope · u(t − delay)                        the commanded height, u as the board rounds it
//   r ← min(max(r, w − play / 2), w + play / 2)              play: the drive follows after its slack
//   p' = min(max((r − p) / lag, −speed_down), speed_up)      first order, of limited speed
//   y  = sensor_zero + p + noise                             what the sensor says
//
// Commands change at the beginning of a control period, so that each period has a closed form.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>

namespace hardware {

struct CellModel {
  double zero = 0, slope = 1;  // unit of the actuator, 1
  double play = 0;             // dead band between both directions
  double speed_up = std::numeric_limits<double>::infinity();
  double speed_down = std::numeric_limits<double>::infinity();  // units a second
  double lag_s = 0;
  int delay = 0;  // whole periods, beyond the one in which a command comes into force
};

// The state of a cell, period by period.
class CellMotion {
 public:
  // At rest at the height that it reaches under command u from below (`upwards`) or above.
  CellMotion(const CellModel&, double period_s, double u, bool upwards);
  // The height one period later, with u in force.
  double advance(double u);
  double height() const { return p_; }
  // Periods in which a speed limit was in effect.
  int limited_up() const { return limited_up_; }
  int limited_down() const { return limited_down_; }

 private:
  CellModel m_;
  double period_s_, decay_, r_, p_;
  int limited_up_ = 0, limited_down_ = 0;
};

// A recording of one cell: the command in force during period k, and what the sensor says at its end. The
// cell is at rest at the beginning.
struct CellRecording {
  double period_s = 0;
  std::span<const float> command;       // u[k]
  std::span<const float> reading;       // y[k]
  std::span<const std::uint8_t> valid;  // 1: y[k] is known
  bool upwards = true;                  // the first command was approached from below
  std::span<const float> at_rest;       // readings of the cell at the height `rest`, before it is driven
  double rest = 0;
  double resolution = 0;  // of the sensor: the step between its values
};

enum class CellState : std::uint8_t {
  kGood = 0,
  kStuck = 1,  // the sensor works, but what it says does not depend on the command, or fits no usable model
  kDead = 2,   // the sensor always says the same
  kAbsent = 3  // there is no cell, or its board was not there or has not both channels
};

struct CellFit {
  // In the order of kCellParameters.
  static constexpr std::size_t kCount = 9;
  enum Parameter { kZero, kSlope, kPlay, kSpeedUp, kSpeedDown, kLag, kDelay, kSensorZero, kNoise };
  CellState state = CellState::kAbsent;
  // Neutral values with error 0 where nothing is known: slope 1, all others 0. A speed of 0 was never
  // reached.
  std::array<double, kCount> value{0, 1, 0, 0, 0, 0, 0, 0, 0};
  std::array<double, kCount> error{};  // standard errors
};
struct CellParameter {
  const char *name, *title;
  int length, time;  // dimension: powers of the actuator's unit and of seconds
};
inline constexpr std::array<CellParameter, CellFit::kCount> kCellParameters{{
    {"zero", "zero", 1, 0},
    {"slope", "slope", 0, 0},
    {"play", "dead band", 1, 0},
    {"speed_up", "speed upwards", 1, -1},
    {"speed_down", "speed downwards", 1, -1},
    {"lag", "lag", 0, 1},
    {"delay", "delay, periods", 0, 0},
    {"sensor_zero", "zero of the sensor", 1, 0},
    {"sensor_noise", "noise of the sensor", 1, 0},
}};

// Output-error least squares: the parameters whose motion is closest to the readings, by Levenberg-Marquardt
// over zero, slope, play, speeds and lag, for each delay up to `most_delay` until the residual grows.
// Standard errors are those of the linear model at the optimum: s² (JᵀJ)⁻¹ with s² = residual / (n − k).
CellFit fit_cell(const CellRecording&, int most_delay = 8);

}  // namespace hardware
