#include "smartsurf/script/EventQueue.h"

#include <cassert>

namespace smartsurf::script {

void EventQueue::schedule_at(double time_s, int callback) {
  pending_.push_back({.due_s = time_s, .sequence = next_sequence_++, .callback = callback});
}

void EventQueue::schedule_every(double start_s, double period_s, int callback) {
  assert(period_s > 0.0);
  pending_.push_back({.due_s = start_s + period_s,
                      .sequence = next_sequence_++,
                      .callback = callback,
                      .start_s = start_s,
                      .period_s = period_s,
                      .repetitions = 1});
}

void EventQueue::merge_pending() {
  for (const TimedEvent& event : pending_) queue_.push(event);
  pending_.clear();
}

void EventQueue::archive(common::StateArchive& a) {
  merge_pending();
  std::vector<TimedEvent> events;
  for (auto queue = queue_; a.saves() && !queue.empty(); queue.pop()) events.push_back(queue.top());
  a(events, next_sequence_);
  if (!a.saves()) queue_ = std::priority_queue(FiresLater(), std::move(events));
}

void EventQueue::run_due(double horizon_s, const std::function<bool(const TimedEvent&)>& invoke) {
  merge_pending();
  while (!queue_.empty() && queue_.top().due_s <= horizon_s) {
    TimedEvent event = queue_.top();
    queue_.pop();
    const bool repeat = invoke(event) && event.period_s > 0.0;
    if (!repeat) continue;
    ++event.repetitions;
    event.due_s = event.start_s + static_cast<double>(event.repetitions) * event.period_s;
    queue_.push(event);
  }
}

}  // namespace smartsurf::script
