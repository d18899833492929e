#include "apron/debugger/SessionThread.h"

#include <utility>

namespace apron::debugger {
namespace {

constexpr std::chrono::milliseconds kInterruptDelay{50};

}  // namespace

SessionThread::SessionThread(DebugSession& session, std::atomic<bool>& interrupt)
    : session_(session), interrupt_(interrupt), thread_([this] { run_loop(); }) {}

SessionThread::~SessionThread() {
  {
    const std::lock_guard lock(mutex_);
    quit_ = true;
    pending_ = true;
    interrupt_ = true;
  }
  wake_up_.notify_one();
  thread_.join();
}

void SessionThread::post(std::function<void(DebugSession&)> command) {
  {
    const std::lock_guard lock(mutex_);
    if (!pending_) pending_since_ = Clock::now();
    commands_.push_back(std::move(command));
    pending_ = true;
  }
  wake_up_.notify_one();
}

void SessionThread::request_snapshot(SnapshotRequest request) {
  {
    const std::lock_guard lock(mutex_);
    if (!pending_) pending_since_ = Clock::now();
    request_ = std::move(request);
    snapshot_requested_ = true;
    pending_ = true;
  }
  wake_up_.notify_one();
}

bool SessionThread::poll_snapshot(DebugSnapshot& snapshot) {
  const std::lock_guard lock(mutex_);
  if (!snapshot_ready_) return false;
  snapshot_ready_ = false;
  std::swap(snapshot, snapshot_);
  return true;
}

void SessionThread::interrupt_if_overdue() {
  const std::lock_guard lock(mutex_);
  if (pending_ && Clock::now() - pending_since_ > kInterruptDelay) interrupt_ = true;
}

// Runs the commands, takes the requested snapshot and lowers the interrupt flag. Releases the lock meanwhile.
void SessionThread::handle_requests(std::unique_lock<std::mutex>& lock) {
  while (!commands_.empty()) {
    std::vector<std::function<void(DebugSession&)>> commands;
    commands.swap(commands_);
    lock.unlock();
    for (const auto& command : commands) command(session_);
    lock.lock();
  }
  if (snapshot_requested_) {
    const SnapshotRequest request = std::exchange(request_, {});
    snapshot_requested_ = false;
    lock.unlock();
    DebugSnapshot snapshot;
    session_.capture_snapshot(request, snapshot);
    lock.lock();
    std::swap(snapshot_, snapshot);
    snapshot_ready_ = true;
  }
  if (quit_) return;
  pending_ = !commands_.empty() || snapshot_requested_;
  interrupt_ = false;
}

void SessionThread::run_loop() {
  Clock::time_point next_walk{};
  std::unique_lock lock(mutex_);
  for (;;) {
    if (pending_) handle_requests(lock);
    if (quit_) return;
    const auto has_requests = [this] { return pending_.load(); };
    if (!session_.active()) {
      wake_up_.wait(lock, has_requests);
      continue;
    }
    if (session_.state() == ExecutionState::kWalking) {
      if (wake_up_.wait_until(lock, next_walk, has_requests)) continue;
      next_walk = Clock::now() + session_.walk_period();
    }
    lock.unlock();
    // Polls the atomic flag instead of taking the lock after every tick.
    do session_.advance();
    while (session_.state() == ExecutionState::kRunning && !pending_.load(std::memory_order_relaxed));
    lock.lock();
  }
}

}  // namespace apron::debugger
