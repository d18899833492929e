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
  for (Line& line : recent_)
    if (line.repetitions != 0) print(line);
  print_left_out();
}

void EventLog::add(const std::string& text, Clock::time_point now) {
  if (now - reports_since_ >= kInterval) print_left_out();
  auto* const known = std::ranges::find(recent_, text, &Line::text);
  if (known == recent_.end()) {
    Line& line = recent_[oldest_];
    oldest_ = (oldest_ + 1) % recent_.size();
    if (line.repetitions != 0) print(line);
    line = {.text = text, .printed = now, .repetitions = 0};
    print_(text);
    return;
  }
  ++known->repetitions;
  if (now - known->printed < kInterval) return;
  known->printed = now;
  print(*known);
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

// Prints the line, with the number of its repetitions if there is more than one.
void EventLog::print(Line& line) {
  const std::uint64_t times = std::exchange(line.repetitions, 0);
  print_(times == 1 ? line.text : line.text + " (" + std::to_string(times) + " times more)");
}

}  // namespace hardware
