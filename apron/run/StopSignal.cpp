#include "apron/run/StopSignal.h"

#include <csignal>

namespace apron::run {
namespace {

std::atomic<bool> stop{false}, interrupt{false};
std::atomic<int> signal_number{0};
static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<int>::is_always_lock_free,
              "a signal handler may touch nothing else");

void on_signal(int number) {
  signal_number.store(number);
  stop.store(true);
  interrupt.store(true);
}

}  // namespace

void catch_stop_signals() {
  struct sigaction action {};
  action.sa_handler = on_signal;
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  // nohup has it ignored, so that the program outlives its terminal.
  struct sigaction before {};
  if (sigaction(SIGHUP, nullptr, &before) == 0 && before.sa_handler != SIG_IGN)
    sigaction(SIGHUP, &action, nullptr);
}

void clear_stop_signal() {
  signal_number.store(0);
  stop.store(false);
  catch_stop_signals();
}

const std::atomic<bool>& stop_flag() noexcept { return stop; }
std::atomic<bool>& interrupt_flag() noexcept { return interrupt; }
int stop_signal() noexcept { return signal_number.load(); }

}  // namespace apron::run
