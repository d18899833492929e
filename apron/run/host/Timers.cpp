#include "apron/run/host/Timers.h"

#include <algorithm>
#include <chrono>
#include <thread>

namespace apron::run {
namespace {

constexpr double kPollInterval_s = 0.02;  // of the stop flag

}  // namespace

Timers::Timer& Timers::find_or_create(std::string_view name) {
  const auto found = timers_.find(name);
  return found != timers_.end() ? found->second : timers_[std::string(name)];
}

void Timers::start(std::string_view name) { find_or_create(name) = {now(), 0.0}; }

void Timers::stop(std::string_view name) { find_or_create(name) = {std::nullopt, read_s(name)}; }

void Timers::reset(std::string_view name) { find_or_create(name) = {}; }

double Timers::read_s(std::string_view name) const {
  const auto found = timers_.find(name);
  if (found == timers_.end()) return 0.0;
  const Timer& timer = found->second;
  return timer.elapsed_s + (timer.running_since ? now() - *timer.running_since : 0.0);
}

vm::HostStatus Timers::wait(double seconds, const std::atomic<bool>& stop) {
  if (!clock_s_) return vm::HostStatus::kOk;
  if (!wait_deadline_) wait_deadline_ = now() + seconds;
  const vm::HostStatus status = wait_until(clock_s_, *wait_deadline_, stop);
  if (status == vm::HostStatus::kOk) wait_deadline_.reset();
  return status;
}

vm::HostStatus wait_until(const Timers::Clock& clock_s, double deadline_s, const std::atomic<bool>& stop) {
  // The comparison is false for NaN, so that waiting for NaN seconds returns at once.
  for (double now_s = clock_s(); deadline_s > now_s; now_s = clock_s()) {
    if (stop.load(std::memory_order_relaxed)) return vm::HostStatus::kInterrupted;
    std::this_thread::sleep_for(std::chrono::duration<double>(std::min(kPollInterval_s, deadline_s - now_s)));
  }
  return vm::HostStatus::kOk;
}

double wall_clock_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace apron::run
