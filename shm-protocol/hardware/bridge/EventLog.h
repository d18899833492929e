// The bridge's log of events: a line that keeps recurring is printed at most once a second, and what devices
// report at a limited rate.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

namespace hardware {

// A lasting fault of the line or the device repeats the same few lines. Each is printed at once; its
// repetitions within a second are counted, and printed when the second is over, or before the next other
// line: "… (57 times more)". Lines that recur in turn come in the order in which they were said last, so that
// the last one is what holds.
class EventLog {
 public:
  using Clock = std::chrono::steady_clock;
  using Print = std::function<void(const std::string& line)>;

  explicit EventLog(Print);
  ~EventLog();  // prints the lines still counted
  EventLog(const EventLog&) = delete;
  EventLog& operator=(const EventLog&) = delete;

  void add(const std::string& text, Clock::time_point now = Clock::now());
  // Prints what was counted if its second is over. To be called about as often as the loop turns.
  void print_due(Clock::time_point now = Clock::now());
  // A line in a device's words, which may always be others: eight new ones a second are printed, and how many
  // more there were.
  void add_report(const std::string& text, Clock::time_point now = Clock::now());

 private:
  struct Line {
    std::string text;
    Clock::time_point printed;
    std::uint64_t repetitions = 0;  // since then
    std::uint64_t last = 0;         // the number of its last repetition among all
  };
  void print_counted(Clock::time_point now);
  void print_left_out();

  Print print_;
  std::array<Line, 8> recent_;  // the newest texts: more than one fault repeats
  std::size_t oldest_ = 0;
  std::uint64_t repetitions_ = 0;  // of all lines
  Clock::time_point reports_since_{};
  std::uint64_t reports_ = 0, left_out_ = 0;  // since then
};

}  // namespace hardware
