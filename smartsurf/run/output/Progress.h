// The progress line on stderr: simulated time, real-time factor, time left. Shown only on a terminal.
#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace smartsurf::run {

class Progress {
 public:
  // who: stands before every message, as "world 3"; such a one of many shows no line.
  explicit Progress(std::string label = "");

  // Redraws the line, four times a second at most. until_s: the simulated time at which the work ends at the
  // latest.
  void update(double simulated_s, std::optional<double> until_s);
  // Leaves the line as it is at the end; nothing when none was shown.
  void finish(double simulated_s);
  // A message on stderr that the line makes room for.
  void print_message(const std::string& message);
  void restart();  // the real-time factor counts from now

 private:
  void print_line(double simulated_s, std::optional<double> until_s, const char* line_end);

  std::string label_;
  bool is_terminal_, line_visible_ = false;
  std::chrono::steady_clock::time_point start_time_, next_update_;
};

}  // namespace smartsurf::run
