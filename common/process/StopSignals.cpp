#include "common/process/StopSignals.h"

#include <unistd.h>

#include <csignal>
#include <cstdint>
#include <ctime>

#include "common/process/ParentWatch.h"

namespace common {
namespace {

constexpr std::int64_t kGrace_ns = 500'000'000;

std::atomic<bool> stop{false}, interrupt{false};
std::atomic<int> received{0};
std::atomic<std::int64_t> first_at_ns{0};
static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<int>::is_always_lock_free &&
                  std::atomic<std::int64_t>::is_always_lock_free,
              "a signal handler may use lock-free atomics only");

std::int64_t monotonic_ns() noexcept {  // clock_gettime() is async-signal-safe
  struct timespec now {};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

// The handler runs with all stop signals blocked, so that only handlers on different threads overlap.
extern "C" void on_stop_signal(int signal) {
  const std::int64_t now = monotonic_ns();
  std::int64_t none = 0;
  if (!first_at_ns.compare_exchange_strong(none, now)) {
    if (now - none >= kGrace_ns) ::_exit(128 + signal);
    return;
  }
  received.store(signal);
  interrupt.store(true);
  stop.store(true);
}

}  // namespace

void report_file_size_errors() noexcept { std::signal(SIGXFSZ, SIG_IGN); }

const std::atomic<bool>& catch_stop_signals() {
  struct sigaction action {};
  action.sa_handler = on_stop_signal;
  for (const int signal : {SIGINT, SIGTERM, SIGXCPU, SIGHUP}) sigaddset(&action.sa_mask, signal);
  for (const int signal : {SIGINT, SIGTERM, SIGXCPU}) sigaction(signal, &action, nullptr);
  struct sigaction before {};
  if (sigaction(SIGHUP, nullptr, &before) == 0 && before.sa_handler != SIG_IGN)
    sigaction(SIGHUP, &action, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  watch_parent();
  return stop;
}

const std::atomic<bool>& stop_flag() noexcept { return stop; }
std::atomic<bool>& interrupt_flag() noexcept { return interrupt; }
int stop_signal() noexcept { return received.load(); }

int status_after_signals(int status) noexcept {
  const int signal = stop_signal();
  return status == 0 && signal != 0 ? 128 + signal : status;
}

void clear_stop_signal() noexcept {
  received.store(0);
  interrupt.store(false);
  stop.store(false);
  first_at_ns.store(0);
}

}  // namespace common
