#include "common/process/StopSignals.h"

#include <unistd.h>

#include <csignal>

namespace common {
namespace {

std::atomic<bool> stop{false}, interrupt{false};
std::atomic<int> received{0};
static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<int>::is_always_lock_free,
              "a signal handler may use lock-free atomics only");

extern "C" void on_stop_signal(int signal) {
  if (stop.exchange(true)) ::_exit(128 + signal);
  received.store(signal);
  interrupt.store(true);
}

}  // namespace

const std::atomic<bool>& catch_stop_signals() {
  struct sigaction action {};
  action.sa_handler = on_stop_signal;
  for (const int signal : {SIGINT, SIGTERM}) sigaction(signal, &action, nullptr);
  struct sigaction before {};
  if (sigaction(SIGHUP, nullptr, &before) == 0 && before.sa_handler != SIG_IGN)
    sigaction(SIGHUP, &action, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
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
}

}  // namespace common
