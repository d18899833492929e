// The progress line on stderr: simulated time, real-time factor, time left. Shown only on a terminal.
#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace smartsurf::run {

class Progress {
 public:
  // label: prefix of every message, for example "world 3". With a label the progress line is not shown.
  explicit Progress(std::string label = "");

  // Redraws the line, at most four times a second. until_s: the latest simulated end time.
  void update(double simulated_s, std::optional<double> until_s);
  // Prints the line a last time and ends it; does nothing if no line is shown.
  void finish(double simulated_s);
  // Clears the line and prints a message on stderr.
  void print_message(const std::string& message);
  void restart();  // the real-time factor counts from now
  // Leaves the time out of the real-time factor, but not out of the estimate of the time left.
  void leave_out(std::chrono::steady_clock::duration time) { left_out_ += time; }

 private:
  void print_line(double simulated_s, std::optional<double> until_s, const char* line_end);

  std::string label_;
  bool is_terminal_, line_visible_ = false;
  std::chrono::steady_clock::time_point start_time_, next_update_;
  std::chrono::steady_clock::duration left_out_{};
};

}  // namespace smartsurf::run
