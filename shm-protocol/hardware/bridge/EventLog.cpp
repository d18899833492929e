#include "shm-protocol/hardware/bridge/EventLog.h"

#include <algorithm>
#include <utility>

namespace hardware {
namespace {

constexpr std::chrono::seconds kInterval{1};
constexpr std::uint64_t kMaxReports = 8;  // in an interval

}  // namespace

EventLog::EventLog(Print print) : print_(std::move(print)) {}

EventLog::~EventLog() {
  print_counted({});
  print_left_out();
}

void EventLog::add(const std::string& text, Clock::time_point now) {
  auto* const known = std::ranges::find(recent_, text, &Line::text);
  if (known != recent_.end()) {
    ++known->repetitions;
    known->last = ++repetitions_;
    return print_due(now);
  }
  print_due(now);
  print_counted(now);
  recent_[oldest_] = {.text = text, .printed = now};
  oldest_ = (oldest_ + 1) % recent_.size();
  print_(text);
}

void EventLog::print_due(Clock::time_point now) {
  if (now - reports_since_ >= kInterval) print_left_out();
  if (std::ranges::any_of(recent_, [&](const Line& line) {
        return line.repetitions != 0 && now - line.printed >= kInterval;
      }))
    print_counted(now);
}

void EventLog::add_report(const std::string& text, Clock::time_point now) {
  if (std::ranges::find(recent_, text, &Line::text) != recent_.end()) return add(text, now);
  if (now - reports_since_ >= kInterval) {
    print_left_out();
    reports_since_ = now;
    reports_ = 0;
  }
  if (reports_++ < kMaxReports)
    add(text, now);
  else
    ++left_out_;
}

void EventLog::print_left_out() {
  if (left_out_ != 0) print_("reports left out: " + std::to_string(std::exchange(left_out_, 0)));
}

// Prints the lines that were repeated, each with the number of its repetitions if there is more than one.
void EventLog::print_counted(Clock::time_point now) {
  for (;;) {
    Line* first = nullptr;
    for (Line& line : recent_)
      if (line.repetitions != 0 && (!first || line.last < first->last)) first = &line;
    if (!first) return;
    const std::uint64_t times = std::exchange(first->repetitions, 0);
    first->printed = now;
    print_(times == 1 ? first->text : first->text + " (" + std::to_string(times) + " times more)");
  }
}

}  // namespace hardware
