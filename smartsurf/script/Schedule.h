// The calendar of timed events: which callbacks are due, in which order.
//
// Order: by the nominal time of the event, then by registration. A periodic event's n-th time is start +
// n·period, computed afresh, so no rounding accumulates.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <queue>
#include <vector>

namespace smartsurf::script {

struct Event {
  double due_s = 0.0;
  std::uint64_t order = 0;  // of registration
  int callback = 0;         // whatever the caller knows the function by
  double start_s = 0.0;
  double period_s = 0.0;  // 0 = once
  std::uint64_t count = 0;
};

class Schedule {
 public:
  void at(double time_s, int callback);
  // First at start_s + period_s. Requires period_s > 0.
  void every(double start_s, double period_s, int callback);

  // Calls `call` for each event due at or before horizon_s, in order; a periodic event goes on as long as
  // `call` returns true. Events registered meanwhile wait for the next run_due.
  void run_due(double horizon_s, const std::function<bool(const Event&)>& call);

  std::size_t size() const { return queue_.size() + incoming_.size(); }

 private:
  struct Later {
    bool operator()(const Event& a, const Event& b) const {
      return a.due_s != b.due_s ? a.due_s > b.due_s : a.order > b.order;
    }
  };
  void admit_incoming();

  std::priority_queue<Event, std::vector<Event>, Later> queue_;
  std::vector<Event> incoming_;
  std::uint64_t registered_ = 0;
};

}  // namespace smartsurf::script
