// The frames of a program without a surface: their number, their time, and their pace on the wall clock.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>

#include "apron/run/host/Timers.h"

namespace apron::run {

struct FrameRate {
  double per_s = 30.0;         // frames per second of the program's time
  std::optional<double> pace;  // program seconds per wall second; nullopt: as fast as possible
};

class FrameClock {
 public:
  // clock_s is only read if there is a pace.
  explicit FrameClock(FrameRate rate, Timers::Clock clock_s = wall_clock_s)
      : rate_(rate), clock_s_(std::move(clock_s)) {}

  std::uint64_t frame() const noexcept { return frame_; }
  double time_s() const noexcept { return static_cast<double>(frame_) / rate_.per_s; }
  double period_s() const noexcept { return 1.0 / rate_.per_s; }

  // Waits until the next frame is due and starts it. A program that is late does not catch up. kInterrupted
  // if stop is raised meanwhile; the next call then resumes the wait.
  vm::HostStatus advance(const std::atomic<bool>& stop);
  void restart() noexcept {
    frame_ = 0;
    due_s_.reset();
  }

 private:
  FrameRate rate_;
  Timers::Clock clock_s_;
  std::uint64_t frame_ = 0;
  std::optional<double> due_s_;  // of the next frame
};

}  // namespace apron::run
