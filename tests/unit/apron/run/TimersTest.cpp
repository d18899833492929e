// Timers with a fake clock.
#include "apron/run/host/Timers.h"

#include <gtest/gtest.h>

namespace apron::run {
namespace {

TEST(Timers, CountFromStartToStop) {
  double now = 100.0;
  Timers timers([&] { return now; });
  EXPECT_EQ(timers.read_s(""), 0.0);
  timers.start("");
  now = 102.0;
  timers.start("lap");
  now = 103.0;
  EXPECT_EQ(timers.read_s(""), 3.0);
  EXPECT_EQ(timers.read_s("lap"), 1.0);
  timers.stop("");
  now = 110.0;
  EXPECT_EQ(timers.read_s(""), 3.0);
  EXPECT_EQ(timers.read_s("lap"), 8.0);
  timers.reset("lap");
  EXPECT_EQ(timers.read_s("lap"), 0.0);
  timers.start("");
  EXPECT_EQ(timers.read_s(""), 0.0);
}

TEST(Timers, ReadZeroWithoutClock) {
  const std::atomic<bool> stop{true};
  Timers timers;
  timers.start("a");
  EXPECT_EQ(timers.read_s("a"), 0.0);
  EXPECT_EQ(timers.wait(1e9, stop), vm::HostStatus::kOk);
}

TEST(Timers, InterruptedWaitResumes) {
  double now = 0.0;
  std::atomic<bool> stop{false};
  Timers timers([&] {
    now += 1.0;  // every reading of the clock takes a second
    if (now == 4.0) stop = true;
    return now;
  });
  EXPECT_EQ(timers.wait(6.005, stop), vm::HostStatus::kInterrupted);
  EXPECT_LT(now, 6.0);
  stop = false;
  now = 6.5;  // the deadline is 7.005
  EXPECT_EQ(timers.wait(6.005, stop), vm::HostStatus::kOk);
  EXPECT_LT(now, 9.0);
  EXPECT_EQ(timers.wait(0.0, stop), vm::HostStatus::kOk);
}

}  // namespace
}  // namespace apron::run
