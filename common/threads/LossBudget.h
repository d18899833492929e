// When jobs of a thread pool are shared, so that they never cost much where other programs keep the cores
// busy.
#pragma once

#include <algorithm>
#include <cstdint>

namespace common {

// After shared jobs have lost kMostLoss_ns against the caller alone, the caller works alone for so long that
// the loss is kMostLossShare_percent of that time, at most for kMostPause_ns. Then, and at first, it must
// have had its own core to itself for kCalm_ns of work; after a further loss for twice that, up to
// kMostCalm_ns. Where more threads want cores than there are, it then looks again after as much work, for
// kMostCrowd_ns: after an attempt to share such a machine, Linux was seen to give the caller less time for
// seconds.
//
// An idle machine takes a core away, too, now and then, above all a virtual one. So up to kMostCredit_ns of
// what jobs have gained is spent before losses count, and after jobs that had gained all of that, the pause
// is for kMostLossShareAfterGain_percent and the calm is kCalm_ns again.
//
// now_ns is the time of any steady clock.
class LossBudget {
 public:
  static constexpr std::int64_t kMostLoss_ns = 500'000, kMostPause_ns = 1'000'000'000, kCalm_ns = 50'000'000,
                                kMostCalm_ns = 400'000'000, kMostCrowd_ns = 8'000'000'000;
  static constexpr std::int64_t kMostLossShare_percent = 1, kMostLossShareAfterGain_percent = 10;
  static constexpr std::int64_t kMostCredit_ns = 20'000'000, kWatchInterval_ns = 4'000'000,
                                kMostWatchInterval_ns = 256'000'000;

  // is_crowded(): whether another thread would find no core. It may be wrong, as where the caller may use
  // some of the machine's cores only.
  template <class IsCrowded>
  bool allows(std::int64_t now_ns, const IsCrowded& is_crowded) noexcept {
    if (!is_spent_) return true;
    if (crowd_end_ns_ == kUnset) crowd_end_ns_ = now_ns + kMostCrowd_ns;
    if (calm_ns_ < needed_calm_ns_ || is_pause(now_ns)) return false;
    if (now_ns < crowd_end_ns_ && is_crowded()) {
      calm_ns_ = 0;
      return false;
    }
    is_spent_ = false;
    return true;
  }
  // After a loss. Jobs whose threads do not wait for each other need no calm.
  bool is_pause(std::int64_t now_ns) const noexcept { return now_ns < pause_end_ns_; }

  // For a shared job. A negative loss is a gain.
  void charge(std::int64_t loss_ns, std::int64_t now_ns) noexcept {
    lost_ns_ = std::max(-kMostCredit_ns, lost_ns_ + loss_ns);
    if (lost_ns_ == -kMostCredit_ns)
      next_calm_ns_ = kCalm_ns, share_percent_ = kMostLossShareAfterGain_percent;
    if (lost_ns_ <= kMostLoss_ns) return;
    pause_end_ns_ = now_ns + std::min(lost_ns_ * 100 / share_percent_, kMostPause_ns);
    crowd_end_ns_ = now_ns + kMostCrowd_ns;
    is_spent_ = true;
    needed_calm_ns_ = next_calm_ns_;
    next_calm_ns_ = std::min(2 * next_calm_ns_, kMostCalm_ns);
    share_percent_ = kMostLossShare_percent;
    lost_ns_ = calm_ns_ = 0;
  }

  // Whether the caller has to measure the processor time of its next job alone. It does so rarely, and ever
  // more rarely while it loses its core: each reading enters the kernel, where Linux may take the core.
  bool is_watch_due() const noexcept { return unwatched_ns_ >= watch_interval_ns_; }
  // For a job that the caller did alone, unmeasured.
  void pass_alone(std::int64_t wall_ns) noexcept { unwatched_ns_ += wall_ns; }
  // For a job that the caller did alone, in wall_ns, of which it had a core for cpu_ns. Where it loses its
  // core, there are more programs than cores; a little goes to the system itself.
  void watch_alone(std::int64_t wall_ns, std::int64_t cpu_ns) noexcept {
    constexpr std::int64_t kSystem_ns = 50'000, kSystemShare_percent = 5;
    if (wall_ns - cpu_ns > kSystem_ns + wall_ns * kSystemShare_percent / 100) {
      calm_ns_ = 0;
      watch_interval_ns_ = std::min(2 * watch_interval_ns_, kMostWatchInterval_ns);
    } else {
      calm_ns_ += std::min(unwatched_ns_, kWatchInterval_ns) + wall_ns;
      watch_interval_ns_ = kWatchInterval_ns;
    }
    unwatched_ns_ = 0;
  }

 private:
  static constexpr std::int64_t kUnset = -1;
  bool is_spent_ = true;
  std::int64_t lost_ns_ = 0;                             // by shared jobs; negative: the credit
  std::int64_t share_percent_ = kMostLossShare_percent;  // of the loss in the next pause
  std::int64_t needed_calm_ns_ = kCalm_ns;
  std::int64_t next_calm_ns_ = kCalm_ns;  // needed after the next loss
  std::int64_t unwatched_ns_ = 0, watch_interval_ns_ = kWatchInterval_ns;
  std::int64_t pause_end_ns_ = 0, crowd_end_ns_ = kUnset;
  std::int64_t calm_ns_ = 0;  // work of the caller alone since it last lost its core
};

}  // namespace common
