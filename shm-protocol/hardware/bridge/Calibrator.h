// Drives each cell of a table through its range, at several speeds, and fits how it answers.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "shm-protocol/hardware/bridge/Calibration.h"
#include "shm-protocol/hardware/bridge/TableBridge.h"

namespace hardware {

struct CalibratorOptions {
  std::string actuator, sensor;  // "": the only ones of equal unit
  double hold_s = 1;             // that a step is held
  // The height at which all cells rest before they are driven; nothing: unknown, so that the zero of the
  // sensors cannot be told from that of the actuators.
  std::optional<double> rest;
};

// Commands as fractions of the actuator's range, period by period: a staircase up and down, full steps, short
// steps of random lengths for the lag, and ramps of three speeds. The cells stay within 15 to 85 % of the
// range, so that stops do not hold them.
std::vector<float> calibration_plan(int hold_periods);

class Calibrator final : public TableDriver {
 public:
  Calibrator(const TableSpec&, CalibratorOptions);

  bool begins_at_rest() const override { return options_.rest.has_value(); }
  Answer drive(TableTick) override;

  // Why the recording ended early: one line; "": it is whole, or has not ended.
  const std::string& failure() const { return failure_; }
  bool done() const { return phase_ == Phase::kDone; }
  // Fits all cells. Call when done().
  Calibration fit() const;
  // Range of the actuator.
  double lowest() const { return lowest_; }
  double highest() const { return highest_; }

 private:
  enum class Phase { kStart, kRest, kApproach, kSettle, kPlan, kDone };
  // What a board said, by its own ticks: its clock, not the table's, orders its frames.
  struct BoardRecord {
    std::uint32_t first_tick = 0, last_tick = 0;
    bool begun = false;
    std::uint64_t silences = 0;                              // before it began
    double scale = 0, offset = 0, safe = 0, resolution = 0;  // of its channels
    bool has_channels = false;
    std::vector<std::uint8_t> valid;  // by tick: the reading is known
    // By tick: the table's tick whose answer is in force from there on; nothing: unknown.
    std::vector<std::optional<std::int64_t>> in_force;
    std::vector<float> readings;  // [tick][cell of the board]
    std::vector<float> at_rest;   // [sample][cell of the board]
  };

  void choose_channels(const TableTick&);
  void begin(const TableTick&);
  bool record(const TableTick&);
  bool has_settled(const TableTick&) const;
  double command_of(std::int64_t tick) const;
  static std::vector<std::int64_t> commands_in_force(const BoardRecord&, std::size_t ticks);
  void leave_out_guesses(const BoardRecord&, std::vector<std::uint8_t>& valid) const;

  const TableSpec& spec_;
  CalibratorOptions options_;
  Phase phase_ = Phase::kStart;
  std::string failure_;
  std::size_t actuator_ = 0, sensor_ = 0;  // of the table
  std::string actuator_name_, sensor_name_, unit_;
  double lowest_ = 0, highest_ = 1;
  std::uint32_t rows_ = 0, columns_ = 0;
  int hold_ = 1;
  std::int64_t phase_began_ = 0, plan_began_ = 0;
  std::vector<float> plan_;
  std::vector<MountedBoard> mounted_;
  std::vector<BoardRecord> records_;
};

}  // namespace hardware
