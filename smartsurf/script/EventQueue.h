// A priority queue of timed callbacks, one-shot and periodic.
//
// Events are ordered by due time, then by registration. The n-th occurrence of a periodic event is
// start + n·period, computed directly so that rounding errors do not accumulate.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <queue>
#include <vector>

#include "common/state/StateArchive.h"

namespace smartsurf::script {

struct TimedEvent {
  double due_s = 0.0;
  std::uint64_t sequence = 0;  // registration order
  int callback = 0;            // opaque to the queue
  double start_s = 0.0;
  double period_s = 0.0;          // 0 = one-shot
  std::uint64_t repetitions = 0;  // n of the occurrence at due_s
};

class EventQueue {
 public:
  void schedule_at(double time_s, int callback);
  // The first occurrence is at start_s + period_s. Requires period_s > 0.
  void schedule_every(double start_s, double period_s, int callback);

  // Calls `invoke` for each event due at or before horizon_s, in order. A periodic event is rescheduled while
  // `invoke` returns true. Events scheduled from inside `invoke` wait for the next call of run_due.
  void run_due(double horizon_s, const std::function<bool(const TimedEvent&)>& invoke);

  // The events carry over, with their order.
  void archive(common::StateArchive&);

 private:
  struct FiresLater {
    bool operator()(const TimedEvent& a, const TimedEvent& b) const {
      return a.due_s != b.due_s ? a.due_s > b.due_s : a.sequence > b.sequence;
    }
  };
  void merge_pending();

  std::priority_queue<TimedEvent, std::vector<TimedEvent>, FiresLater> queue_;
  std::vector<TimedEvent> pending_;
  std::uint64_t next_sequence_ = 0;
};

}  // namespace smartsurf::script
