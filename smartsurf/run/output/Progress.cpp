#include "smartsurf/run/output/Progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <utility>

#include "common/text/Printable.h"

namespace smartsurf::run {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

// The only control sequences that are printed, all of them constants of this file.
void show(const std::string& line) { std::fputs(line.c_str(), stderr); }

}  // namespace

Progress::Progress(std::string label)
    : label_(std::move(label)),
      is_terminal_(label_.empty() && isatty(STDERR_FILENO) != 0),
      start_time_(Clock::now()),
      next_update_(start_time_) {}

void Progress::restart() {
  start_time_ = Clock::now();
  left_out_ = {};
}

void Progress::update(double simulated_s, std::optional<double> until_s) {
  if (!is_terminal_) return;
  const auto now = Clock::now();
  if (now < next_update_) return;
  next_update_ = now + 250ms;
  print_line(simulated_s, until_s, "");
}

void Progress::finish(double simulated_s) {
  if (line_visible_) print_line(simulated_s, std::nullopt, "\n");
}

void Progress::print_line(double simulated_s, std::optional<double> until_s, const char* line_end) {
  line_visible_ = true;
  const auto seconds = [](Clock::duration time) {
    return std::max(1e-9, std::chrono::duration<double>(time).count());
  };
  const Clock::duration passed = Clock::now() - start_time_;
  const double real_time_factor = simulated_s / seconds(passed - left_out_);
  std::string remaining;
  if (until_s && simulated_s > 0.0)
    remaining =
        fmt::format("   at most {:.0f} s left", (*until_s - simulated_s) / simulated_s * seconds(passed));
  show(fmt::format("\r{:9.2f} s simulated   {:6.1f}x real time{}\033[K{}", simulated_s, real_time_factor,
                   remaining, line_end));
}

void Progress::print_message(const std::string& message) {
  if (line_visible_) show("\r\033[K");
  common::print_message(fmt::format("smartsurf: {}{}{}\n", label_, label_.empty() ? "" : ": ", message));
}

}  // namespace smartsurf::run
