// When jobs of a thread pool are shared, so that they never cost much where other programs keep the cores
// busy.
#pragma once

#include <algorithm>
#include <cstdint>

namespace common {

// Once shared jobs have lost kMaxLoss_ns against the caller alone, the caller pauses sharing for so long that
// the loss is kMaxLossShare_percent of that time, at most kMaxPause_ns. Before it shares again, and at first,
// it must have had its core to itself for kMinUncontended_ns of work; after each further loss for twice that,
// up to kMaxUncontended_ns. Where more threads want cores than there are, it waits for as much work again,
// for at most kMaxOversubscribed_ns: after an attempt to share such a machine, Linux gives the caller less
// time for seconds.
//
// An idle machine, above all a virtual one, takes a core away now and then, too. So up to kMaxCredit_ns of
// past gains is spent before losses count; after jobs that had gained all of it, the pause is for
// kMaxLossShareAfterGain_percent and kMinUncontended_ns suffice again.
//
// now_ns is the time of any steady clock.
class LossBudget {
 public:
  static constexpr std::int64_t kMaxLoss_ns = 500'000, kMaxPause_ns = 1'000'000'000,
                                kMinUncontended_ns = 50'000'000, kMaxUncontended_ns = 400'000'000,
                                kMaxOversubscribed_ns = 8'000'000'000;
  static constexpr std::int64_t kMaxLossShare_percent = 1, kMaxLossShareAfterGain_percent = 10;
  static constexpr std::int64_t kMaxCredit_ns = 20'000'000, kMeasureInterval_ns = 4'000'000,
                                kMaxMeasureInterval_ns = 256'000'000;

  // is_oversubscribed(): true if another thread would find no core. It may be wrong, as where the caller may
  // use some of the machine's cores only.
  template <class IsOversubscribed>
  bool allows(std::int64_t now_ns, const IsOversubscribed& is_oversubscribed) noexcept {
    if (!is_spent_) return true;
    if (oversubscribed_end_ns_ == kUnset) oversubscribed_end_ns_ = now_ns + kMaxOversubscribed_ns;
    if (uncontended_ns_ < needed_uncontended_ns_ || is_pause(now_ns)) return false;
    if (now_ns < oversubscribed_end_ns_ && is_oversubscribed()) {
      uncontended_ns_ = 0;
      return false;
    }
    is_spent_ = false;
    return true;
  }
  // After a loss. Jobs whose threads do not wait for each other look at nothing else.
  bool is_pause(std::int64_t now_ns) const noexcept { return now_ns < pause_end_ns_; }

  // For a shared job. A negative loss is a gain.
  void charge(std::int64_t loss_ns, std::int64_t now_ns) noexcept {
    lost_ns_ = std::max(-kMaxCredit_ns, lost_ns_ + loss_ns);
    if (lost_ns_ == -kMaxCredit_ns)
      next_uncontended_ns_ = kMinUncontended_ns, share_percent_ = kMaxLossShareAfterGain_percent;
    if (lost_ns_ <= kMaxLoss_ns) return;
    pause_end_ns_ = now_ns + std::min(lost_ns_ * 100 / share_percent_, kMaxPause_ns);
    oversubscribed_end_ns_ = now_ns + kMaxOversubscribed_ns;
    is_spent_ = true;
    needed_uncontended_ns_ = next_uncontended_ns_;
    next_uncontended_ns_ = std::min(2 * next_uncontended_ns_, kMaxUncontended_ns);
    share_percent_ = kMaxLossShare_percent;
    lost_ns_ = uncontended_ns_ = 0;
  }

  // True if the caller has to measure the processor time of its next job alone. It does so rarely, and ever
  // more rarely while it loses its core: each reading enters the kernel, where Linux may take the core.
  bool is_measurement_due() const noexcept { return unmeasured_ns_ >= measure_interval_ns_; }
  // For a job that the caller did alone, unmeasured.
  void record_unmeasured(std::int64_t wall_ns) noexcept { unmeasured_ns_ += wall_ns; }
  // For a job that the caller did alone, in wall_ns, of which it had a core for cpu_ns. Where it loses its
  // core, there are more programs than cores; a little goes to the system itself.
  void record_serial(std::int64_t wall_ns, std::int64_t cpu_ns) noexcept {
    constexpr std::int64_t kSystem_ns = 50'000, kSystemShare_percent = 5;
    if (wall_ns - cpu_ns > kSystem_ns + wall_ns * kSystemShare_percent / 100) {
      uncontended_ns_ = 0;
      measure_interval_ns_ = std::min(2 * measure_interval_ns_, kMaxMeasureInterval_ns);
    } else {
      uncontended_ns_ += std::min(unmeasured_ns_, kMeasureInterval_ns) + wall_ns;
      measure_interval_ns_ = kMeasureInterval_ns;
    }
    unmeasured_ns_ = 0;
  }

 private:
  static constexpr std::int64_t kUnset = -1;
  bool is_spent_ = true;
  std::int64_t lost_ns_ = 0;                            // by shared jobs; negative: the credit
  std::int64_t share_percent_ = kMaxLossShare_percent;  // of the loss in the next pause
  std::int64_t needed_uncontended_ns_ = kMinUncontended_ns;
  std::int64_t next_uncontended_ns_ = kMinUncontended_ns;  // needed after the next loss
  std::int64_t unmeasured_ns_ = 0, measure_interval_ns_ = kMeasureInterval_ns;
  std::int64_t pause_end_ns_ = 0, oversubscribed_end_ns_ = kUnset;
  std::int64_t uncontended_ns_ = 0;  // work of the caller alone since it last lost its core
};

}  // namespace common
