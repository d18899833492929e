// Whether a large frame is better written through the caches or past them. That depends on how the two cores
// are connected, which no table of a virtual machine tells, and it may change while the program runs. So both
// are tried in turns, and the way with the shorter time from the first byte to the peer's answer is kept for
// a while. Only the speed depends on it.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>

#include "Waiting.h"

namespace shm_protocol {

class StoreChoice {
 public:
  // The frame in hand is the first of its kind, or the next: called at its first byte.
  void begin() noexcept {
    if (begun_) return;
    begun_ = true;
    if (on_trial()) start_ = Clock::now();
  }

  bool past_caches() const noexcept { return on_trial() ? trial_ % 2 == 0 : past_; }

  // The peer answered the frame that was begun last. Without answers, as in passive mode, the way past the
  // caches stays.
  void end() noexcept {
    if (!begun_) return;
    begun_ = false;
    if (on_trial())
      judge(Clock::now() - start_);
    else if (--left_ == 0)
      start_anew();
  }

 private:
  static constexpr int kTrials = 8;  // frames each way; the best counts, so that a disturbance does not
  static constexpr int kFirstTerm = 64, kLongestTerm = 1024;  // frames until it is tried again

  bool on_trial() const noexcept { return trial_ < 2 * kTrials; }

  void judge(std::chrono::nanoseconds took) noexcept {
    auto& best = best_[trial_ % 2];
    best = std::min(best, took);
    if (++trial_ < 2 * kTrials) return;
    past_ = best_[0] <= best_[1];
    left_ = term_;
    term_ = std::min(2 * term_, kLongestTerm);
  }
  void start_anew() noexcept {
    trial_ = 0;
    best_.fill(std::chrono::nanoseconds::max());
  }

  bool begun_ = false, past_ = true;
  int trial_ = 0, left_ = 0, term_ = kFirstTerm;
  Clock::time_point start_{};
  std::array<std::chrono::nanoseconds, 2> best_{std::chrono::nanoseconds::max(),
                                                std::chrono::nanoseconds::max()};
};

}  // namespace shm_protocol
