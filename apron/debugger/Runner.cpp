#include "apron/debugger/Runner.h"

#include <utility>

namespace apron::debugger {
namespace {

constexpr std::chrono::milliseconds kPatience{50};

}  // namespace

Runner::Runner(Session& session, std::atomic<bool>& interrupt)
    : session_(session), interrupt_(interrupt), thread_([this] { serve(); }) {}

Runner::~Runner() {
  {
    const std::lock_guard lock(mutex_);
    quit_ = true;
    wanted_ = true;
    interrupt_ = true;
  }
  wake_.notify_one();
  thread_.join();
}

void Runner::post(std::function<void(Session&)> order) {
  {
    const std::lock_guard lock(mutex_);
    if (!wanted_) since_ = Clock::now();
    orders_.push_back(std::move(order));
    wanted_ = true;
  }
  wake_.notify_one();
}

void Runner::ask(LookRequest request) {
  {
    const std::lock_guard lock(mutex_);
    if (!wanted_) since_ = Clock::now();
    request_ = std::move(request);
    asked_ = true;
    wanted_ = true;
  }
  wake_.notify_one();
}

bool Runner::take(Look& look) {
  const std::lock_guard lock(mutex_);
  if (!answered_) return false;
  answered_ = false;
  std::swap(look, look_);
  return true;
}

void Runner::tend() {
  const std::lock_guard lock(mutex_);
  if (wanted_ && Clock::now() - since_ > kPatience) interrupt_ = true;
}

// The orders, the look, and the flag down again.
void Runner::answer(std::unique_lock<std::mutex>& lock) {
  while (!orders_.empty()) {
    std::vector<std::function<void(Session&)>> orders;
    orders.swap(orders_);
    lock.unlock();
    for (const auto& order : orders) order(session_);
    lock.lock();
  }
  if (asked_) {
    const LookRequest request = std::exchange(request_, {});
    asked_ = false;
    lock.unlock();
    Look look;
    session_.look(request, look);
    lock.lock();
    std::swap(look_, look);
    answered_ = true;
  }
  if (quit_) return;
  wanted_ = !orders_.empty() || asked_;
  interrupt_ = false;
}

void Runner::serve() {
  Clock::time_point next_walk{};
  std::unique_lock lock(mutex_);
  for (;;) {
    if (wanted_) answer(lock);
    if (quit_) return;
    const auto called = [this] { return wanted_.load(); };
    if (!session_.active()) {
      wake_.wait(lock, called);
      continue;
    }
    if (session_.mode() == Mode::kWalking) {
      if (wake_.wait_until(lock, next_walk, called)) continue;
      next_walk = Clock::now() + session_.period();
    }
    lock.unlock();
    // Without the lock: only the flag says that somebody wants something.
    do session_.advance();
    while (session_.mode() == Mode::kRunning && !wanted_.load(std::memory_order_relaxed));
    lock.lock();
  }
}

}  // namespace apron::debugger
