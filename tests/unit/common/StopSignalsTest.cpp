#include "common/process/StopSignals.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

using namespace common;

namespace {

TEST(StopSignals, FirstSignalSetsFlags) {
  catch_stop_signals();
  EXPECT_EQ(status_after_signals(0), 0);
  std::raise(SIGTERM);
  EXPECT_TRUE(stop_flag());
  EXPECT_TRUE(interrupt_flag());
  EXPECT_EQ(stop_signal(), SIGTERM);
  EXPECT_EQ(status_after_signals(0), 128 + SIGTERM);
  EXPECT_EQ(status_after_signals(3), 3);
  clear_stop_signal();
  EXPECT_FALSE(stop_flag());
  EXPECT_EQ(stop_signal(), 0);
}

// The exit status of a child that catches stop signals and runs `body`.
template <class Body>
int status_of_child(const Body& body) {
  const pid_t child = ::fork();
  if (child == 0) {
    catch_stop_signals();
    body();
    ::_exit(0);
  }
  int status = 0;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  return WEXITSTATUS(status);
}

TEST(StopSignals, LaterSignalEndsProcess) {
  EXPECT_EQ(status_of_child([] {
              std::raise(SIGINT);
              ::usleep(600'000);
              std::raise(SIGINT);
            }),
            128 + SIGINT);
}

// timeout(1) signals its child and then the whole group.
TEST(StopSignals, SignalsOfOneRequestCountOnce) {
  EXPECT_EQ(status_of_child([] {
              std::raise(SIGTERM);
              std::raise(SIGTERM);
              std::raise(SIGHUP);
              if (stop_signal() != SIGTERM) ::_exit(1);
            }),
            0);
}

// ulimit -S -t
TEST(StopSignals, LimitOfProcessorTimeIsARequest) {
  EXPECT_EQ(status_of_child([] {
              std::raise(SIGXCPU);
              if (stop_signal() != SIGXCPU || !stop_flag()) ::_exit(1);
            }),
            0);
}

TEST(StopSignals, ClearedSignalStartsNewRequest) {
  EXPECT_EQ(status_of_child([] {
              std::raise(SIGINT);
              clear_stop_signal();
              ::usleep(600'000);
              std::raise(SIGINT);
              if (!stop_flag()) ::_exit(1);
            }),
            0);
}

}  // namespace
