#include "common/threads/ThreadPool.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <thread>
#include <vector>

using common::ThreadPool;

TEST(ThreadPool, ProcessesEachRowOnce) {
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

TEST(ThreadPool, RunsCheapWorkOnCaller) {
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

TEST(ThreadPool, WakesSleepingThreads) {
  ThreadPool pool(2);
  for (int round = 0; round < 20; ++round) {
    if (round % 5 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(2));
    int sum[2] = {0, 0};  // written by the pool's threads, read after the join
    pool.parallel_for_rows(8, [&](int begin, int end) { sum[begin / 4] = end - begin; });
    ASSERT_EQ(sum[0] + sum[1], 8) << round;
  }
}

TEST(ThreadPool, ForkJoinRunsOnAllThreadsConcurrently) {
  constexpr int kThreads = 4;
  ThreadPool pool(kThreads, 0.0);
  for (int round = 0; round < 100; ++round) {
    std::atomic<int> arrived = 0;
    std::array<std::atomic<int>, kThreads> calls{};
    ASSERT_TRUE(pool.try_fork_join([&](int thread) {
      ++calls[static_cast<std::size_t>(thread)];
      ++arrived;
      while (arrived < kThreads) std::this_thread::yield();  // returns only if all threads are inside
    }));
    for (const auto& c : calls) ASSERT_EQ(c, 1) << round;
  }
}

TEST(ThreadPool, ParallelForProcessesEachIndexOnce) {
  for (const int threads : {1, 2, 5}) {
    ThreadPool pool(threads);
    for (const std::uint32_t count : {0U, 1U, 3U, 1000U}) {
      std::vector<std::atomic<int>> visits(count);
      std::atomic<bool> bad_thread = false;
      pool.parallel_for(count, [&](std::uint32_t index, unsigned thread) {
        ++visits[index];
        if (thread >= static_cast<unsigned>(threads)) bad_thread = true;
      });
      for (const auto& v : visits) ASSERT_EQ(v, 1);
      EXPECT_FALSE(bad_thread);
    }
  }
}

TEST(ThreadPool, AlternatesParallelForAndForkJoin) {
  ThreadPool pool(3, 0.0);
  std::atomic<long> sum = 0;
  for (int round = 0; round < 2000; ++round) {
    pool.parallel_for(5, [&](std::uint32_t index, unsigned) { sum += index; });
    ASSERT_TRUE(pool.try_fork_join([&](int thread) { sum += thread; }));
  }
  EXPECT_EQ(sum, 2000 * (10 + 3));
}

// A thread that gets no core is a sleeping thread, as far as the caller can see. `wait` is what the caller does
// meanwhile. Each pause is twice as long as the one before it.
template <class Wait>
void expect_pauses(int most_jobs_between, const Wait& wait) {
  using namespace std::chrono_literals;
  ThreadPool pool(2);
  const auto start = std::chrono::steady_clock::now();
  int shared = 0, alone = 0;
  for (auto now = start; now - start < 400ms; now = std::chrono::steady_clock::now()) {
    std::atomic<bool> slept = false;
    if (pool.try_fork_join([&](int thread) {
          if (thread == 0) return wait(slept);
          std::this_thread::sleep_for(2ms);
          slept = true;
        })) {
      ++shared;
    } else {
      ++alone;
      std::this_thread::sleep_for(1ms);
    }
  }
  EXPECT_GT(alone, 0);
  EXPECT_GE(shared, 1);
  const int pauses = (shared - 1) / most_jobs_between;  // that have ended
  EXPECT_GE(std::chrono::steady_clock::now() - start, 30ms * ((1 << pauses) - 1)) << shared;
}

TEST(ThreadPool, PausesWhereThreadsGetNoCore) {
  expect_pauses(1, [](const std::atomic<bool>&) {});
}

TEST(ThreadPool, SpinsInsideAJobCountAsWaits) {
  expect_pauses(2, [](const std::atomic<bool>& slept) {
    while (!common::spin_until([&] { return slept.load(); })) continue;
  });
}

TEST(ThreadPool, SpinsEndWithTheWaitOrAfterAWhile) {
  const std::int64_t before = common::spins_of_this_thread;
  int looks = 0;
  EXPECT_TRUE(common::spin_until([&] { return ++looks == 100; }));
  EXPECT_EQ(common::spins_of_this_thread - before, 99);
  EXPECT_FALSE(common::spin_until([] { return false; }));
}

TEST(ThreadPool, SharesAgainWhenTheCoresAreFree) {
  ThreadPool pool(2);
  const auto wait = [](int thread) {
    if (thread == 1) std::this_thread::sleep_for(std::chrono::milliseconds(4));
  };
  for (int job = 0; pool.try_fork_join(wait) && job < 100;) ++job;
  int waits = 0;
  for (; !pool.try_fork_join([](int) {}) && waits < 10'000; ++waits)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_LT(waits, 10'000);
}

TEST(ThreadPool, OneWithoutLeastCostAlwaysShares) {
  ThreadPool pool(2, 0.0);
  for (int job = 0; job < 5; ++job) {
    EXPECT_TRUE(pool.try_fork_join([](int thread) {
      if (thread == 1) std::this_thread::sleep_for(std::chrono::milliseconds(4));
    }));
  }
}
