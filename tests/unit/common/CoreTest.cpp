#include "common/threads/Core.h"

#include <gtest/gtest.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace {

cpu_set_t allowed_cores() {
  cpu_set_t cores;
  EXPECT_EQ(::sched_getaffinity(0, sizeof cores, &cores), 0);
  return cores;
}

// Allows the calling thread that core alone, so that it is there at once.
void enter(int core) {
  cpu_set_t only;
  CPU_ZERO(&only);
  CPU_SET(core, &only);
  ASSERT_EQ(::sched_setaffinity(0, sizeof only, &only), 0);
}

}  // namespace

TEST(Core, LeavesItAndMayUseTheSameOnes) {
  const cpu_set_t before = allowed_cores();
  if (CPU_COUNT(&before) < 2) GTEST_SKIP() << "one core";
  int left = 0;
  for (int attempt = 0; attempt < 20; ++attempt) {
    const int core = common::current_core();
    common::leave_core();
    left += common::current_core() != core;
    const cpu_set_t after = allowed_cores();
    ASSERT_TRUE(CPU_EQUAL(&before, &after));
  }
  EXPECT_GE(left, 10);  // the system may move it in between
}

TEST(Core, StaysWhereNoOtherIsAllowed) {
  std::thread([] {
    const int core = common::current_core();
    enter(core);
    common::leave_core();
    EXPECT_EQ(common::current_core(), core);
    const cpu_set_t after = allowed_cores();
    EXPECT_EQ(CPU_COUNT(&after), 1);
  }).join();
}

// Other programs run beside this test: the least of many looks is what they want all the time.
TEST(Core, DemandCountsTheThreadsThatRunOrWait) {
  if (common::core_demand().cores == 0) GTEST_SKIP() << "the system does not say";
  const auto least = [] {
    int threads = 1000;
    for (int look = 0; look < 200; ++look) {
      const common::CoreDemand demand = common::core_demand();
      EXPECT_EQ(demand.cores, ::sysconf(_SC_NPROCESSORS_ONLN));
      EXPECT_GE(demand.runnable_threads, 1);
      threads = std::min(threads, demand.runnable_threads);
    }
    return threads;
  };
  std::atomic<bool> is_done = false;
  std::vector<std::thread> busy;
  for (int k = 0; k < 5; ++k)
    busy.emplace_back([&] {
      while (!is_done) continue;
    });
  EXPECT_GE(least(), 6);
  is_done = true;
  for (std::thread& thread : busy) thread.join();
}
