// Pins as a workshop makes them: each has a zero, a slope, play, speeds, lag, delay and a sensor of its own,
// drawn from a seed; some are stuck, and some sensors dead. What calibration is tested with.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace hardware {

class ImperfectPins {
 public:
  struct Cell {
    double zero, slope, play, speed_up, speed_down, lag_s;
    int delay;  // periods
    double sensor_zero, noise;
    int state;  // 0 good, 1 stuck, 2 dead sensor
    double stuck_at;
  };

  // `range`: of the heights, from 0.
  ImperfectPins(std::size_t cells, double range, double period_s, std::uint64_t seed);

  // Pins lie at 0, undriven.
  void reset();
  // One period under these commands.
  void advance(std::span<const float> commands);
  // The present reading of a cell's sensor.
  double read(std::size_t cell);

  // The cells as lines of CSV, without a header: row, column, and the fields above from `zero` to `state`.
  std::string truth(std::size_t columns, std::size_t first_row, std::size_t first_column) const;
  const std::vector<Cell>& cells() const { return cells_; }

 private:
  struct Motion {
    double drive = 0, height = 0;
    double past[4] = {};  // commands, the newest first
    bool driven = false;
  };
  double uniform(double from, double to);
  double normal();

  double range_, period_s_;
  std::uint64_t random_;
  std::vector<Cell> cells_;
  std::vector<Motion> motion_;
};

}  // namespace hardware
