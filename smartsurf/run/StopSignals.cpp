#include "smartsurf/run/StopSignals.h"

#include <signal.h>
#include <unistd.h>

namespace smartsurf::run {
namespace {

std::atomic<bool> stop_requested{false};
std::atomic<int> stop_signal{0};

extern "C" void on_stop_signal(int signal) {
  // A second Ctrl-C ends at once a run that does not get to its next tick.
  if (stop_requested.exchange(true)) _exit(128 + signal);
  stop_signal = signal;
}

}  // namespace

const std::atomic<bool>& catch_stop_signals() {
  struct sigaction action {};
  action.sa_handler = on_stop_signal;
  for (const int s : {SIGINT, SIGTERM}) sigaction(s, &action, nullptr);
  // nohup has it ignored, so that the run outlives its terminal.
  struct sigaction before {};
  if (sigaction(SIGHUP, nullptr, &before) == 0 && before.sa_handler != SIG_IGN)
    sigaction(SIGHUP, &action, nullptr);
  signal(SIGPIPE, SIG_IGN);
  return stop_requested;
}

int status_after_signals(int status) { return status == 0 && stop_signal != 0 ? 128 + stop_signal : status; }

}  // namespace smartsurf::run
