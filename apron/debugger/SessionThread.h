// Runs a session on its own thread, so that program and drawing do not wait for each other.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "apron/debugger/DebugSession.h"

namespace apron::debugger {

// All functions are for one other thread, and none of them waits for the program. What is posted and asked
// for is done between two ticks, or in the middle of one that takes longer than 50 ms, which then goes on.
class SessionThread {
 public:
  // interrupt: the stop flag of the session's VM and host. Both must outlive this.
  SessionThread(DebugSession& session, std::atomic<bool>& interrupt);
  // Stops the program where it is.
  ~SessionThread();
  SessionThread(const SessionThread&) = delete;
  SessionThread& operator=(const SessionThread&) = delete;

  // Is called with the session on its thread, in the order posted.
  void post(std::function<void(DebugSession&)> command);
  // A look for take(); the latest request counts.
  void request_snapshot(SnapshotRequest request);
  // Gives the look that was asked for, once it is there; then another may be asked for.
  bool poll_snapshot(DebugSnapshot& snapshot);
  // To be called a few times a second: sees to it that a long tick answers.
  void interrupt_if_overdue();

 private:
  using Clock = std::chrono::steady_clock;

  void run_loop();
  void handle_requests(std::unique_lock<std::mutex>& lock);

  DebugSession& session_;
  std::atomic<bool>& interrupt_;
  std::mutex mutex_;
  std::condition_variable wake_up_;
  // Guarded by the mutex.
  std::vector<std::function<void(DebugSession&)>> commands_;
  SnapshotRequest request_;
  DebugSnapshot snapshot_;
  bool snapshot_requested_ = false, snapshot_ready_ = false, quit_ = false;
  Clock::time_point pending_since_;   // of the oldest order or request
  std::atomic<bool> pending_{false};  // there are orders, a request, or the end
  std::thread thread_;
};

}  // namespace apron::debugger
