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

TEST(StopSignals, SecondSignalEndsProcess) {
  const pid_t child = ::fork();
  if (child == 0) {
    catch_stop_signals();
    std::raise(SIGINT);
    std::raise(SIGINT);
    ::_exit(0);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 128 + SIGINT);
}

}  // namespace
