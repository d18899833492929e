#include "apron/run/host/StepWatchdog.h"

#include <chrono>
#include <csignal>
#include <cstdio>

#include "common/text/Printable.h"

namespace apron::run {
namespace {

using namespace std::chrono_literals;

std::int64_t steady_ns() noexcept {
  return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

// Signals go to the program's thread, whose waits they interrupt.
StepWatchdog::StepWatchdog() {
  sigset_t all, previous;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &previous);
  thread_ = std::thread([this] { watch(); });
  pthread_sigmask(SIG_SETMASK, &previous, nullptr);
}

StepWatchdog::~StepWatchdog() {
  {
    const std::lock_guard lock(mutex_);
    quit_ = true;
  }
  wake_up_.notify_one();
  thread_.join();
}

void StepWatchdog::arm() noexcept { armed_ns_ = steady_ns(); }

void StepWatchdog::watch() {
  constexpr std::int64_t kPatience_ns = std::chrono::nanoseconds(2s).count();
  std::unique_lock lock(mutex_);
  while (!wake_up_.wait_for(lock, 250ms, [this] { return quit_; })) {
    const std::int64_t armed_ns = armed_ns_;
    if (armed_ns == 0 || steady_ns() - armed_ns < kPatience_ns) continue;
    common::print_message("apron: warning: the surface has waited 2 s for surface.step\n");
    warned_ = true;
    return;
  }
}

}  // namespace apron::run
