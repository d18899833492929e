// Distinguishes new sensor frames from those repeated by hung firmware and those of a device that restarted
// unnoticed. No I/O.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "shm-protocol/hardware/bridge/DeviceLink.h"

namespace hardware {

class FrameSequence {
 public:
  struct Step {
    std::uint32_t ticks = 1;   // since the last frame: 1 if none is lost, and if ticks began again
    std::uint32_t missed = 0;  // deadlines that the device newly counts, at most one a tick
    bool restarted = false;    // no description had told it
  };

  // Nothing: a repeated frame. After a silence of `silence_us`, a frame of the same tick is one of a device
  // that has restarted: firmware that hangs repeats its frame every period.
  std::optional<Step> next(const SensorFrame& frame, std::int64_t now_us, std::int64_t silence_us) {
    // The device counts ticks and missed deadlines up, from the start on.
    const std::uint32_t ticks = frame.tick - tick_, missed = frame.missed - missed_;
    const bool fewer_missed = missed > kMaxLostTicks, was_silent = now_us - heard_us_ > silence_us;
    heard_us_ = now_us;
    Step step;
    if (known_) {
      if (ticks == 0 && !fewer_missed && !was_silent) return std::nullopt;
      step.restarted = ticks == 0 || ticks > kMaxLostTicks || fewer_missed;
      if (!step.restarted) step = {ticks, std::min(missed, ticks), false};
    }
    tick_ = frame.tick;
    missed_ = frame.missed;
    known_ = true;
    return step;
  }
  // The next frame does not succeed the last one: the line was cut, or the device restarted.
  void restart() { known_ = false; }

  bool known() const { return known_; }         // a frame came since the last restart()
  std::uint32_t tick() const { return tick_; }  // of the newest frame

 private:
  std::int64_t heard_us_ = 0;
  std::uint32_t tick_ = 0, missed_ = 0;
  bool known_ = false;
};

}  // namespace hardware
