#include "smartsurf/run/Progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

namespace smartsurf::run {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

}  // namespace

Progress::Progress(std::string who)
    : who_(std::move(who)),
      terminal_(who_.empty() && isatty(STDERR_FILENO) != 0),
      started_(Clock::now()),
      next_(started_) {}

void Progress::restart() { started_ = Clock::now(); }

void Progress::show(double simulated_s, std::optional<double> until_s) {
  if (!terminal_) return;
  const auto now = Clock::now();
  if (now < next_) return;
  next_ = now + 250ms;
  draw(simulated_s, until_s, "");
}

void Progress::finish(double simulated_s) {
  if (shown_) draw(simulated_s, std::nullopt, "\n");
}

void Progress::draw(double simulated_s, std::optional<double> until_s, const char* end) {
  shown_ = true;
  const double wall_s = std::chrono::duration<double>(Clock::now() - started_).count();
  const double factor = simulated_s / std::max(1e-9, wall_s);
  std::string left;
  if (until_s && factor > 0.0)
    left = fmt::format("   at most {:.0f} s left", (*until_s - simulated_s) / factor);
  fmt::print(stderr, "\r{:9.2f} s simulated   {:6.1f}x real time{}\033[K{}", simulated_s, factor, left, end);
}

void Progress::say(const std::string& message) {
  if (shown_) fmt::print(stderr, "\r\033[K");
  fmt::print(stderr, "smartsurf: {}{}{}\n", who_, who_.empty() ? "" : ": ", message);
}

}  // namespace smartsurf::run
