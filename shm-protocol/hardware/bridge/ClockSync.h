// Estimates when a board's periods begin on the host's clock, and keeps them in phase with the table's ticks.
//
// Times are in µs of the host's steady clock, except where they are said to be the board's. No I/O.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "shm-protocol/hardware/firmware/wire.h"

namespace hardware {

class ClockSync {
 public:
  // The offset is that of the fastest of so many round trips.
  static constexpr std::size_t kRoundTrips = 16;

  explicit ClockSync(std::uint32_t period_us) : period_us_(period_us) {}

  // The next SSW_SYNC, sent at `now`. Tick k of the table begins at epoch + k periods.
  ssw_sync next(std::int64_t now, std::int64_t epoch);
  // When next() is due.
  std::int64_t due() const { return due_; }
  void receive(const ssw_clock&, std::int64_t now, std::int64_t epoch);
  // Forgets the board's clock.
  void reset();

  // Time from the beginning of the table's tick to that of the board's period at the latest estimate;
  // nothing: unknown.
  std::optional<double> phase_us() const { return phase_; }
  // The tick of the table in which the board's period of that tick began; nothing: unknown.
  std::optional<std::int64_t> table_tick(std::uint32_t board_tick, std::int64_t epoch) const;
  // The board's clock at the beginning of that period.
  std::uint32_t board_clock(std::uint32_t board_tick) const;
  double round_trip_us() const { return best_.round_trip; }
  double rate_ppb() const { return rate_ppb_; }

 private:
  struct RoundTrip {
    double round_trip = 0;
    std::int64_t began = 0;         // of the board's period of `tick`, on the host's clock
    std::uint32_t board_began = 0;  // on the board's
    std::uint32_t tick = 0;
  };
  void estimate(std::int64_t epoch);

  std::uint32_t period_us_;
  std::array<RoundTrip, kRoundTrips> recent_{};
  std::size_t count_ = 0, estimates_ = 0;  // count_: round trips since the last estimate
  RoundTrip best_;
  std::optional<RoundTrip> reference_, candidate_;  // from which the rate is measured, and what follows it
  std::optional<double> phase_;
  double rate_ppb_ = 0;
  std::int64_t due_ = 0;
  bool correct_ = false;  // the next SSW_SYNC carries a correction
};

}  // namespace hardware
