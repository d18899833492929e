// Runs a session on a thread of its own, so that the program never waits for a picture nor a picture for the
// program.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "apron/debugger/Session.h"

namespace apron::debugger {

// All functions are for one other thread, and none of them waits for the program. What is posted and asked
// for is done between two ticks, or in the middle of one that takes longer than 50 ms, which then goes on.
class Runner {
 public:
  // interrupt: the stop flag of the session's VM and host. Both must outlive this.
  Runner(Session& session, std::atomic<bool>& interrupt);
  // Stops the program where it is.
  ~Runner();
  Runner(const Runner&) = delete;
  Runner& operator=(const Runner&) = delete;

  // Is called with the session on its thread, in the order posted.
  void post(std::function<void(Session&)> order);
  // A look for take(); the latest request counts.
  void ask(LookRequest request);
  // Gives the look that was asked for, once it is there; then another may be asked for.
  bool take(Look& look);
  // To be called a few times a second: sees to it that a long tick answers.
  void tend();

 private:
  using Clock = std::chrono::steady_clock;

  void serve();
  void answer(std::unique_lock<std::mutex>& lock);

  Session& session_;
  std::atomic<bool>& interrupt_;
  std::mutex mutex_;
  std::condition_variable wake_;
  // Guarded by the mutex.
  std::vector<std::function<void(Session&)>> orders_;
  LookRequest request_;
  Look look_;
  bool asked_ = false, answered_ = false, quit_ = false;
  Clock::time_point since_;          // of the oldest order or request
  std::atomic<bool> wanted_{false};  // there are orders, a request, or the end
  std::thread thread_;
};

}  // namespace apron::debugger
