// Runs a debug session on its own thread, so that the program and the user interface do not block each other.
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

// All functions are called by one other thread and do not wait for the program. Commands and snapshot
// requests are handled between ticks. If a tick delays them by more than 50 ms, interrupt_if_overdue()
// interrupts it; it resumes afterwards.
class SessionThread {
 public:
  // interrupt: the stop flag of the session's VM and host. Both arguments must outlive this.
  SessionThread(DebugSession& session, std::atomic<bool>& interrupt);
  // Interrupts the program and joins the thread.
  ~SessionThread();
  SessionThread(const SessionThread&) = delete;
  SessionThread& operator=(const SessionThread&) = delete;

  // Commands are called on the session's thread, in order.
  void post(std::function<void(DebugSession&)> command);
  // Requests a snapshot for poll_snapshot(); replaces a pending request.
  void request_snapshot(SnapshotRequest request);
  // Moves a completed snapshot to `snapshot`; false if there is none.
  bool poll_snapshot(DebugSnapshot& snapshot);
  // Call a few times per second, so that a long tick does not delay requests.
  void interrupt_if_overdue();

 private:
  using Clock = std::chrono::steady_clock;

  void run_loop();
  void handle_requests(std::unique_lock<std::mutex>& lock);

  DebugSession& session_;
  std::atomic<bool>& interrupt_;
  std::mutex mutex_;
  std::condition_variable wake_up_;
  // Guarded by mutex_.
  std::vector<std::function<void(DebugSession&)>> commands_;
  SnapshotRequest request_;
  DebugSnapshot snapshot_;
  bool snapshot_requested_ = false, snapshot_ready_ = false, quit_ = false;
  Clock::time_point pending_since_;   // when the oldest pending command or request arrived
  std::atomic<bool> pending_{false};  // commands, a request or quit_; written under mutex_, polled without
  std::thread thread_;
};

}  // namespace apron::debugger
