// Chooses between ordinary and non-temporal stores for large frames.
//
// Which is faster depends on how the two cores are connected, which a virtual machine does not reveal and
// which may change at run time. Both are sampled alternately; the one with the shorter best time from the
// first byte to the peer's answer is used until the next sampling. Affects speed only.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>

#include "shm-protocol/src/wait/FutexWait.h"

namespace shm_protocol {

class StorePolicy {
 public:
  // To be called before each write; only the first call of a frame has an effect.
  void begin_frame() noexcept {
    if (in_frame_) return;
    in_frame_ = true;
    if (is_sampling()) start_ = Clock::now();
  }

  bool use_non_temporal() const noexcept { return is_sampling() ? sample_ % 2 == 0 : non_temporal_; }

  // The peer answered the last frame begun. Without answers, as in passive mode, sampling never ends and
  // non-temporal stores stay selected.
  void end_frame() noexcept {
    if (!in_frame_) return;
    in_frame_ = false;
    if (is_sampling())
      record_sample(Clock::now() - start_);
    else if (--frames_left_ == 0)
      restart_sampling();
  }

 private:
  static constexpr int kSamplesPerPolicy = 8;                   // the minimum counts, to ignore disturbances
  static constexpr int kMinInterval = 64, kMaxInterval = 1024;  // frames between samplings

  bool is_sampling() const noexcept { return sample_ < 2 * kSamplesPerPolicy; }

  void record_sample(std::chrono::nanoseconds elapsed) noexcept {
    auto& best = best_[sample_ % 2];
    best = std::min(best, elapsed);
    if (++sample_ < 2 * kSamplesPerPolicy) return;
    non_temporal_ = best_[0] <= best_[1];
    frames_left_ = interval_;
    interval_ = std::min(2 * interval_, kMaxInterval);
  }
  void restart_sampling() noexcept {
    sample_ = 0;
    best_.fill(std::chrono::nanoseconds::max());
  }

  bool in_frame_ = false, non_temporal_ = true;
  int sample_ = 0, frames_left_ = 0, interval_ = kMinInterval;
  Clock::time_point start_{};
  std::array<std::chrono::nanoseconds, 2> best_{std::chrono::nanoseconds::max(),
                                                std::chrono::nanoseconds::max()};
};

}  // namespace shm_protocol
