#include "smartsurf/script/Schedule.h"

#include <cassert>

namespace smartsurf::script {

void Schedule::at(double time_s, int callback) {
  incoming_.push_back({.due_s = time_s, .order = registered_++, .callback = callback});
}

void Schedule::every(double start_s, double period_s, int callback) {
  assert(period_s > 0.0);
  incoming_.push_back({.due_s = start_s + period_s,
                       .order = registered_++,
                       .callback = callback,
                       .start_s = start_s,
                       .period_s = period_s,
                       .count = 1});
}

void Schedule::admit_incoming() {
  for (const Event& event : incoming_) queue_.push(event);
  incoming_.clear();
}

void Schedule::run_due(double horizon_s, const std::function<bool(const Event&)>& call) {
  admit_incoming();
  while (!queue_.empty() && queue_.top().due_s <= horizon_s) {
    Event event = queue_.top();
    queue_.pop();
    const bool again = call(event) && event.period_s > 0.0;
    if (!again) continue;
    ++event.count;
    event.due_s = event.start_s + static_cast<double>(event.count) * event.period_s;
    queue_.push(event);
  }
}

}  // namespace smartsurf::script
