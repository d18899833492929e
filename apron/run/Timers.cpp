#include "apron/run/Timers.h"

#include <algorithm>
#include <chrono>
#include <thread>

namespace apron::run {
namespace {

constexpr double kLookEvery_s = 0.02;  // at the stop flag

}  // namespace

Timers::Timer& Timers::of(std::string_view name) {
  const auto found = all_.find(name);
  return found != all_.end() ? found->second : all_[std::string(name)];
}

void Timers::start(std::string_view name) { of(name) = {now(), 0.0}; }

void Timers::stop(std::string_view name) { of(name) = {std::nullopt, read_s(name)}; }

void Timers::reset(std::string_view name) { of(name) = {}; }

double Timers::read_s(std::string_view name) const {
  const auto found = all_.find(name);
  if (found == all_.end()) return 0.0;
  const Timer& timer = found->second;
  return timer.counted_s + (timer.running_since ? now() - *timer.running_since : 0.0);
}

vm::HostStatus Timers::wait(double seconds, const std::atomic<bool>& stop) {
  if (!clock_s_) return vm::HostStatus::kOk;
  if (!waiting_until_) waiting_until_ = now() + seconds;
  // Written so that a wait for NaN is none.
  while (*waiting_until_ > now()) {
    if (stop.load(std::memory_order_relaxed)) return vm::HostStatus::kInterrupted;
    std::this_thread::sleep_for(
        std::chrono::duration<double>(std::min(kLookEvery_s, *waiting_until_ - now())));
  }
  waiting_until_.reset();
  return vm::HostStatus::kOk;
}

double wall_clock_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace apron::run
