// The emergency stop of a surface: latches, whether the user or a board's line caused it, and holds all
// boards until the user releases it.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "shm-protocol/hardware/firmware/wire.h"

namespace hardware {

class EmergencyStop {
 public:
  using Clock = std::chrono::steady_clock;

  bool active() const { return reason_ != 0; }
  std::uint32_t reason() const { return reason_; }
  const std::string& cause() const { return cause_; }  // "": none

  void stop(std::uint32_t reason, const std::string& cause) {
    if (active()) return;
    reason_ = reason;
    cause_ = cause;
  }
  // A board whose line is still pressed stops all again.
  void arm(Clock::time_point now = Clock::now()) {
    reason_ = 0;
    cause_.clear();
    armed_at_ = now;
  }
  // What a board needs that reports these flags (SSW_STOPPED): SSW_STOP_NOW, SSW_ARM or 0. Its report of an
  // own stop stops all.
  std::uint8_t packet_for(std::uint32_t flags, const std::string& board,
                          Clock::time_point now = Clock::now()) {
    const bool stopped = (flags & SSW_STOPPED) != 0;
    if (active()) return stopped ? 0 : SSW_STOP_NOW;
    if (!stopped) return 0;
    if (now - armed_at_ < kArming) return SSW_ARM;
    stop(SSW_STOP_BY_LINE, "board '" + board + "'");
    return 0;
  }

 private:
  static constexpr std::chrono::milliseconds kArming{500};  // that boards may take to be released
  std::uint32_t reason_ = 0;
  std::string cause_;
  Clock::time_point armed_at_{};
};

}  // namespace hardware
