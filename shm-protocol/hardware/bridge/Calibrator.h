// Drives each cell of a table through its range, at several speeds, and fits how it answers.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
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

// Whether readings stand still, over windows of equal length.
class Stillness {
 public:
  void reset(std::size_t cells, int window);
  // Returns whether a window ends with these readings and no cell's mean differs from that of the window
  // before by more than noise.
  bool add(std::span<const float> readings);

 private:
  int window_ = 1, count_ = 0, windows_ = 0;
  std::vector<double> last_, mean_, sum_, squares_;  // by cell
};

// Commands in force and readings are known by the boards' own ticks. Where they are not, because the host was
// suspended, a board silent or its safe values in effect, readings are discarded until a full stroke has
// reset the cells' state; then the plan resumes from before that.
class Calibrator final : public TableDriver {
 public:
  Calibrator(const TableSpec&, CalibratorOptions);

  bool begins_at_rest() const override { return options_.rest.has_value(); }
  Answer drive(TableTick) override;

  // Why the recording ended early: one line; "": it is whole, or has not ended.
  const std::string& failure() const { return failure_; }
  bool done() const { return phase_ == Phase::kDone; }
  // Parts of the plan that were repeated, and why the last one was.
  int repeats() const { return repeats_; }
  const std::string& last_disturbance() const { return last_disturbance_; }
  // Fits all cells. Call when done().
  Calibration fit() const;
  // "board 'b1'": those that were not there, or have not both channels. Call when done().
  std::vector<std::string> absent_boards() const;
  // Range of the actuator.
  double lowest() const { return lowest_; }
  double highest() const { return highest_; }

 private:
  // From kApproach to kUp a level is held until the cells have settled there.
  enum class Phase { kStart, kRest, kApproach, kSettle, kDown, kUp, kPlan, kDone };
  // What a board said, by its own ticks: its clock, not the table's, orders its frames.
  struct BoardRecord {
    std::uint32_t first_tick = 0, last_tick = 0;
    std::int64_t last_table_tick = 0;
    bool begun = false;
    std::uint64_t silences = 0, restarts = 0;
    DeviceChannel drive;    // its actuator
    double resolution = 0;  // of its sensor
    bool has_channels = false;
    std::vector<std::uint8_t> valid;  // by tick: the reading is known
    // By tick: the table's tick whose answer is in force from there on; nothing: unknown.
    std::vector<std::optional<std::int64_t>> in_force;
    std::vector<float> readings;  // [tick][cell of the board]
    std::vector<float> at_rest;   // [sample][cell of the board]
    bool is_absent() const { return !has_channels || !begun || valid.empty(); }
  };

  void choose_channels(const TableTick&);
  void begin(const TableTick&);
  void record_rest(const TableTick&);
  void begin_boards(const TableTick&);
  std::string disturbance(const TableTick&) const;
  void note_in_force(const TableTick&, bool leave_out);
  void record(const TableTick&);
  bool has_settled(const TableTick&, bool disturbed);
  void enter(Phase, const TableTick&);
  void repeat(const TableTick&);
  double level() const;
  double command_of(std::int64_t tick) const;
  static std::vector<std::int64_t> commands_in_force(const BoardRecord&, std::size_t ticks);

  const TableSpec& spec_;
  CalibratorOptions options_;
  Phase phase_ = Phase::kStart;
  std::string failure_;
  std::size_t actuator_ = 0, sensor_ = 0;  // of the table
  std::string actuator_name_, sensor_name_, unit_;
  double lowest_ = 0, highest_ = 1;
  std::uint32_t rows_ = 0, columns_ = 0;
  int hold_ = 1;
  std::int64_t phase_began_ = 0, last_tick_ = 0, last_good_ = 0;  // ticks of the table
  std::optional<std::int64_t> settling_since_;
  Stillness stillness_;
  std::int64_t position_ = 0, spent_ = 0;  // in the plan; on it, with repeats
  int repeats_ = 0;
  std::string last_disturbance_;
  std::vector<float> plan_;
  std::int64_t first_command_ = 0;  // tick
  std::vector<float> commands_;     // by tick, as fractions of the range
  std::vector<MountedBoard> mounted_;
  std::vector<BoardRecord> records_;
};

}  // namespace hardware
