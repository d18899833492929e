// wait_until() with a scripted peer: polling, sleeping and termination.
#include "shm-protocol/src/wait/FutexWait.h"

#include <gtest/gtest.h>

namespace shm_protocol {
namespace {

using namespace std::chrono_literals;

// The peer CPU is unknown, so that the wait does not spin and every poll is scripted.
struct ScriptedPeer {
  std::uint32_t word = 0, flag = 0, peer_cpu = SSP_CPU_UNKNOWN;
  int ready_at = 0;  // the poll that returns true
  int calls = 0, calls_after_ready = 0;
  WaitState patience{};

  Status wait(std::chrono::nanoseconds timeout) {
    const auto ready = [&]() noexcept {
      calls_after_ready += calls >= ready_at;
      return ++calls >= ready_at;
    };
    return wait_until(Doorbell{word, flag, peer_cpu}, {.timeout = timeout}, patience, ready,
                      [](bool) noexcept { return Status::kOk; });
  }
};

// ready() delivers a chunk when it returns true; a second call would deliver another and lose the first.
// Polls: immediately; before the sleep, with the flag raised; after it; before the next sleep; and so on.
TEST(FutexWait, StopsPollingOnceReady) {
  for (int question = 1; question <= 4; ++question) {
    ScriptedPeer script{.ready_at = question};
    EXPECT_EQ(script.wait(10s), Status::kOk) << question;
    EXPECT_EQ(script.calls, question);
    EXPECT_EQ(script.calls_after_ready, 0) << question;
    EXPECT_EQ(script.flag, 0u) << question;  // no wake-up is due outside a sleep
  }
}

TEST(FutexWait, TimesOutAtTheDeadline) {
  ScriptedPeer script{.ready_at = 1 << 30};
  EXPECT_EQ(script.wait(1ms), Status::kTimeout);
  EXPECT_EQ(script.flag, 0u);
  EXPECT_EQ(script.wait(0ns), Status::kTimeout);
}

}  // namespace
}  // namespace shm_protocol
