#include "smartsurf/world/parallel/Barrier.h"

#include <gtest/gtest.h>
#include <sched.h>

#include <atomic>
#include <thread>

#include "common/threads/Core.h"

using smartsurf::world::Barrier;

// Two threads begin on one core: the system leaves them there for tens of milliseconds.
TEST(Barrier, MembersOnOneCorePart) {
  cpu_set_t all;
  ASSERT_EQ(::sched_getaffinity(0, sizeof all, &all), 0);
  if (CPU_COUNT(&all) < 2) GTEST_SKIP() << "one core";
  constexpr int kTrials = 20, kRounds = 10;
  int parted = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const int core = common::current_core();
    Barrier barrier(2);
    std::atomic<int> cores[2];
    const auto meet = [&](int member) {
      cpu_set_t only;
      CPU_ZERO(&only);
      CPU_SET(core, &only);
      ::sched_setaffinity(0, sizeof only, &only);
      ::sched_setaffinity(0, sizeof all, &all);
      bool differ = false;
      for (int round = 0; round < kRounds; ++round) {
        cores[member] = common::current_core();
        barrier.arrive(member), barrier.wait(member);
        differ |= cores[0] != cores[1];
        barrier.arrive(member), barrier.wait(member);
      }
      return differ;
    };
    std::thread other([&] { meet(1); });
    parted += meet(0);
    other.join();
  }
  EXPECT_GE(parted, kTrials / 2);
}
