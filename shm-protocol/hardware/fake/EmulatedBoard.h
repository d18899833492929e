// An emulated device at the end of a line that can be noisy, late, silent or unplugged, with a clock of its
// own.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "shm-protocol/hardware/fake/EmulatedDevice.h"
#include "shm-protocol/hardware/fake/EmulatedLine.h"
#include "shm-protocol/hardware/fake/NoisyLine.h"

namespace hardware {

struct EmulatedBoardOptions {
  std::string link;  // of the pseudo-terminal
  int tcp = -1;      // port; -1: a pseudo-terminal
  std::uint32_t period_us = 10'000;
  NoiseOptions noise;
  double drift_ppm = 0;               // by which the board's clock is fast
  std::uint32_t clock_start_us = 0;   // what it shows at first
  std::size_t queue_bytes = 1 << 16;  // for the host; a full queue drops sensor frames
  bool blocking = false;              // writes wait for room instead, as they must not
  bool version_1 = false;             // ignores version 2 of the byte protocol
  std::uint64_t silent_at = 0, silent_for = 50, unplug_at = 0, unplug_for = 50;  // *_at 0: never
  bool restarts = false;  // as it falls silent or its line is cut
};

class EmulatedBoard {
 public:
  using Time = NoisyLine::Time;
  using MakeDevice = std::function<std::unique_ptr<EmulatedDevice>(EmulatedDevice::Write)>;

  // Throws std::runtime_error if the line cannot be made.
  EmulatedBoard(const EmulatedBoardOptions&, const MakeDevice&);

  // Forwards what has arrived at either end, and ends the period if it is over, unless it is held.
  void step();
  // Forwards what has arrived at either end.
  void carry();
  // A period that is held when it is over goes on for a whole period, so that the board keeps its phase.
  void hold_period(bool held) { is_held_ = held; }
  // True if the board's last frame has been answered, or will not be: the board does not run, or follows
  // nobody yet.
  bool has_answer() const;
  // When step() has something to do again, unless the host sends something.
  Time next_event() const;

  void fall_silent() { options_.silent_at = period_ + 1; }
  void cut_line() { options_.unplug_at = period_ + 1; }
  void set_faults(std::uint64_t silent_for, std::uint64_t unplug_for, bool restart) {
    options_.silent_for = silent_for, options_.unplug_for = unplug_for, options_.restarts = restart;
  }
  void set_noise(double drop, double corrupt);
  void restart() { device_->restart(); }

  // Returns whether the host closed the line and did not open it again within a second.
  bool host_has_left() const { return host_seen_at_ && now() > *host_seen_at_ + std::chrono::seconds(1); }

  static Time now();
  // The board's clock. While a period ends, it shows when the timer went off, as a timer's capture register
  // does.
  std::uint32_t micros() const;
  std::uint64_t periods() const { return period_; }
  // When the current period began, 0: none has, and when it ends.
  Time period_begin() const { return sent_at_; }
  Time period_end() const { return period_end_; }
  EmulatedDevice& device() { return *device_; }
  const EmulatedDevice& device() const { return *device_; }
  const EmulatedLine& line() const { return line_; }
  std::uint64_t dropped() const { return from_host_.dropped + to_host_.dropped; }
  std::uint64_t corrupted() const { return from_host_.corrupted + to_host_.corrupted; }
  // From each sensor frame to the last byte of its answer, µs.
  std::vector<std::uint32_t>& latencies() { return latency_us_; }
  std::function<void()> on_period;  // called after each period

 private:
  static constexpr std::size_t kMaxLatencies = 10'000'000;

  bool write(const std::uint8_t* bytes, std::size_t count);
  bool within(std::uint64_t at, std::uint64_t length) const {
    return at != 0 && period_ >= at && period_ < at + length;
  }
  void deliver(std::uint8_t byte);
  void measure_latency();
  void next_period();
  Time period_length(std::uint32_t us) const;

  EmulatedBoardOptions options_;
  EmulatedLine line_;
  NoisyLine from_host_, to_host_;
  std::unique_ptr<EmulatedDevice> device_;
  std::uint64_t period_ = 0;
  Time period_end_{};
  bool period_ends_ = false, is_held_ = false;
  std::vector<std::uint8_t> bytes_;
  ssw_receiver receiver_{};           // version_1: reads the packets before the device does
  std::optional<Time> host_seen_at_;  // last; moves on while the line is unplugged
  Time sent_at_{};                    // when the last sensor frame was sent, as its period began
  std::uint32_t answered_tick_ = 0;   // tick whose latency was measured last
  std::vector<std::uint32_t> latency_us_;
};

}  // namespace hardware
