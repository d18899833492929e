// The emergency stop of a surface: latches, whether the user or a board's line caused it, and holds all
// boards until the user releases it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>

#include "shm-protocol/hardware/firmware/wire.h"

namespace hardware {

class EmergencyStop {
 public:
  // A board that has been sent SSW_ARM. Its frames of the next half second may still report the former stop.
  // They are counted, not timed: a board or a host that stands still meanwhile has not refused the release.
  class Release {
   public:
    Release() = default;  // none
    explicit Release(std::uint64_t newest_frame) : frame_(newest_frame), new_frames_(0) {}
    // Notes the newest frame. True: the frames report the release, or the board has refused it.
    bool note_frame(std::uint64_t newest_frame, std::uint32_t period_us) {
      if (std::exchange(frame_, newest_frame) != newest_frame && new_frames_ != kNone) ++new_frames_;
      return new_frames_ >= std::max(kMinFrames, kTime_us / std::max(period_us, 1U));
    }

   private:
    static constexpr std::uint32_t kTime_us = 500'000, kMinFrames = 3;
    static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
    std::uint64_t frame_ = 0;
    std::uint32_t new_frames_ = kNone;  // noted; those between two looks of the bridge count once
  };

  bool active() const { return reason_ != 0; }
  std::uint32_t reason() const { return reason_; }
  const std::string& cause() const { return cause_; }  // "": none

  void stop(std::uint32_t reason, const std::string& cause) {
    if (active()) return;
    reason_ = reason;
    cause_ = cause;
  }
  // A board whose line is still pressed stops all again.
  void arm() {
    reason_ = 0;
    cause_.clear();
  }
  // The flag for a board whose newest frame has this number and these flags (SSW_STOPPED): SSW_STOP_NOW,
  // SSW_ARM or 0. A board that reports a stop of its own stops all.
  std::uint8_t packet_for(std::uint32_t flags, std::uint64_t frame, std::uint32_t period_us, Release& release,
                          const std::string& board) {
    const bool stopped = (flags & SSW_STOPPED) != 0, is_over = release.note_frame(frame, period_us);
    if (active()) return stopped ? 0 : SSW_STOP_NOW;
    if (!stopped) return 0;
    if (!is_over) return SSW_ARM;
    stop(SSW_STOP_BY_LINE, "board '" + board + "'");
    return 0;
  }

 private:
  std::uint32_t reason_ = 0;
  std::string cause_;
};

}  // namespace hardware
