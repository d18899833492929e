#include "common/ThreadPool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>
#include <vector>

using smartsurf::surface::ThreadPool;

TEST(WorkerPool, CoversEveryRowOnce) {
  for (const int threads : {1, 2, 3, 8})
    for (const int rows : {0, 1, 2, 5, 16, 101}) {
      ThreadPool pool(threads);
      EXPECT_EQ(pool.thread_count(), threads);
      std::vector<std::atomic<int>> visits(static_cast<std::size_t>(rows));
      for (int round = 0; round < 50; ++round)
        pool.parallel_for_rows(rows, [&](int begin, int end) {
          for (int r = begin; r < end; ++r) ++visits[static_cast<std::size_t>(r)];
        });
      for (const auto& v : visits) EXPECT_EQ(v, 50);
    }
}

TEST(WorkerPool, LeavesLittleWorkToTheCaller) {
  ThreadPool pool(3);
  const auto caller = std::this_thread::get_id();
  for (const double cost_ns :
       {0.0, ThreadPool::kMinParallelCost_ns / 2, 2 * ThreadPool::kMinParallelCost_ns}) {
    std::atomic<int> rows = 0, bands = 0, elsewhere = 0;
    pool.parallel_for_rows(100, cost_ns, [&](int begin, int end) {
      rows += end - begin;
      ++bands;
      elsewhere += std::this_thread::get_id() != caller;
    });
    EXPECT_EQ(rows, 100);
    EXPECT_EQ(bands, cost_ns < ThreadPool::kMinParallelCost_ns ? 1 : 3);
    EXPECT_EQ(elsewhere, bands - 1);
  }
}

TEST(WorkerPool, WakesThoseWhoFellAsleep) {
  ThreadPool pool(2);
  for (int round = 0; round < 20; ++round) {
    if (round % 5 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(2));
    int sum[2] = {0, 0};  // written by others, read after they are done
    pool.parallel_for_rows(8, [&](int begin, int end) { sum[begin / 4] = end; });
    ASSERT_EQ(sum[0] + sum[1], 12) << round;
  }
}
