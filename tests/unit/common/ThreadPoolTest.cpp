#include "common/threads/ThreadPool.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <random>
#include <thread>
#include <vector>

using common::LossBudget;
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
  ThreadPool pool(3), sharing(3, 0.0);
  const auto caller = std::this_thread::get_id();
  const auto count_bands = [&](ThreadPool& of, double cost_ns) {
    std::atomic<int> rows = 0, bands = 0, elsewhere = 0;
    of.parallel_for_rows(100, cost_ns, [&](int begin, int end) {
      rows += end - begin;
      ++bands;
      elsewhere += std::this_thread::get_id() != caller;
    });
    EXPECT_EQ(rows, 100);
    EXPECT_EQ(elsewhere, bands - 1);
    return bands.load();
  };
  EXPECT_EQ(count_bands(pool, 0.0), 1);
  EXPECT_EQ(count_bands(pool, ThreadPool::kMinParallelCost_ns / 2), 1);
  EXPECT_EQ(count_bands(sharing, 0.0), 3);
  EXPECT_TRUE(pool.pays(2 * ThreadPool::kMinParallelCost_ns));
}

TEST(ThreadPool, WakesSleepingThreads) {
  ThreadPool pool(2, 0.0);
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
    const auto meet = [&](int thread) {
      ++calls[static_cast<std::size_t>(thread)];
      ++arrived;
      while (arrived < kThreads) std::this_thread::yield();  // returns only if all threads are inside
    };
    ASSERT_TRUE(pool.fork_join_or(meet, [] { ADD_FAILURE(); }));
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
    ASSERT_TRUE(pool.fork_join_or([&](int thread) { sum += thread; }, [] {}));
  }
  EXPECT_EQ(sum, 2000 * (10 + 3));
}

// Whether its threads come in time or not, each job runs once: on all of them or on the caller.
TEST(ThreadPool, EachJobIsSharedOrAlone) {
  for (const int threads : {2, 3, 5}) {
    ThreadPool pool(threads);
    const auto start = std::chrono::steady_clock::now();
    for (int job = 0; std::chrono::steady_clock::now() - start < std::chrono::milliseconds(60); ++job) {
      std::vector<int> calls(static_cast<std::size_t>(threads));
      int alone = 0;
      const auto spin = [] { common::spin_until([] { return false; }, std::chrono::microseconds(50)); };
      const bool is_shared = pool.fork_join_or(
          [&](int thread) {
            ++calls[static_cast<std::size_t>(thread)];
            spin();
          },
          [&] {
            ++alone;
            spin();
          });
      ASSERT_EQ(alone, is_shared ? 0 : 1);
      for (const int n : calls) ASSERT_EQ(n, is_shared ? 1 : 0) << job;
    }
  }
}

TEST(ThreadPool, SpinsEndWithTheWaitOrAfterAWhile) {
  const std::int64_t before = common::spins_of_this_thread;
  int looks = 0;
  EXPECT_TRUE(common::spin_until([&] { return ++looks == 100; }));
  EXPECT_EQ(common::spins_of_this_thread - before, 99 - common::kChecksBeforePause);
  EXPECT_FALSE(common::spin_until([] { return false; }));
}

TEST(ThreadPool, OneWithoutLeastCostAlwaysShares) {
  ThreadPool pool(2, 0.0);
  const auto sleep = [](int thread) {
    if (thread == 1) std::this_thread::sleep_for(std::chrono::milliseconds(4));
  };
  for (int job = 0; job < 5; ++job) EXPECT_TRUE(pool.fork_join_or(sleep, [] {}));
}

namespace {

constexpr std::int64_t kMillisecond = 1'000'000;
const auto never = [] { return false; };  // oversubscribed

// A caller that works alone until the budget allows to share, in jobs of 1 ms. Returns when, in ms.
std::int64_t time_until_allowed(LossBudget& budget, std::int64_t now_ns,
                                std::int64_t cpu_ns_of_job = kMillisecond) {
  std::int64_t ms = 0;
  for (; ms < 10'000 && !budget.allows(now_ns + ms * kMillisecond, never); ++ms)
    budget.record_serial(kMillisecond, cpu_ns_of_job);
  return ms;
}

}  // namespace

TEST(LossBudget, SharesOnceTheCallerIsUndisturbed) {
  LossBudget budget;
  EXPECT_FALSE(budget.allows(0, never));
  EXPECT_FALSE(budget.is_pause(0));
  EXPECT_EQ(time_until_allowed(budget, 0, kMillisecond / 2), 10'000);  // another program takes its core
  EXPECT_EQ(time_until_allowed(budget, 0), 50);
  EXPECT_TRUE(budget.allows(1, never));
}

// Other programs come and go, or the caller may use cores that they do not.
TEST(LossBudget, LooksAgainForAWhileWhereOthersWantTheCores) {
  for (const bool stays_oversubscribed : {false, true}) {
    LossBudget budget;
    std::int64_t ms = 0;
    for (int round = 0; round < 2; ++round) {
      const std::int64_t begin_ms = ms,
                         oversubscribed_end_ms = begin_ms + (stays_oversubscribed ? 100'000 : 1000);
      int looks = 0;
      for (;; ++ms) {
        if (budget.allows(ms * kMillisecond, [&] { return ++looks, ms < oversubscribed_end_ms; })) break;
        budget.record_serial(kMillisecond, kMillisecond);
      }
      EXPECT_NEAR(ms - begin_ms, stays_oversubscribed ? 8000 : 1000, 101);
      EXPECT_GT(looks, 10);
      EXPECT_LE(looks, (ms - begin_ms) / 50);
      budget.charge(kMillisecond, ms * kMillisecond);
    }
  }
}

TEST(LossBudget, LossesAreASmallShareOfTheTime) {
  LossBudget budget;
  std::int64_t now_ns = 0, lost_ns = 0;
  for (int job = 0; job < 20; ++job) {
    now_ns += kMillisecond * time_until_allowed(budget, now_ns);
    EXPECT_LE(100 * lost_ns, LossBudget::kMaxLossShare_percent * now_ns) << job;
    const std::int64_t loss_ns = (1 + job % 5) * kMillisecond;
    lost_ns += loss_ns, now_ns += loss_ns;
    budget.charge(loss_ns, now_ns);
  }
}

TEST(LossBudget, SpendsWhatJobsHaveGained) {
  LossBudget budget;
  time_until_allowed(budget, 0);
  for (int job = 0; job < 100; ++job) {
    budget.charge(kMillisecond / 4, 0);
    budget.charge(-kMillisecond / 4, 0);
    ASSERT_TRUE(budget.allows(0, never));
  }
  budget.charge(-100 * kMillisecond, 0);
  budget.charge(LossBudget::kMaxCredit_ns, 0);  // no more than that is kept
  EXPECT_TRUE(budget.allows(0, never));
  budget.charge(kMillisecond, 0);
  EXPECT_FALSE(budget.allows(0, never));
}

TEST(LossBudget, WaitsLongerAfterEachLossUntilJobsGain) {
  LossBudget budget;
  std::int64_t now_ns = kMillisecond * time_until_allowed(budget, 0);
  const auto uncontended_after_loss = [&] {
    budget.charge(kMillisecond, now_ns);
    now_ns += 10'000 * kMillisecond;  // the pause is over
    const std::int64_t ms = time_until_allowed(budget, now_ns);
    now_ns += ms * kMillisecond;
    return ms;
  };
  for (const std::int64_t ms : {50, 100, 200, 400, 400}) EXPECT_EQ(uncontended_after_loss(), ms);
  budget.charge(-LossBudget::kMaxCredit_ns, now_ns);
  budget.charge(LossBudget::kMaxCredit_ns, now_ns);
  EXPECT_EQ(uncontended_after_loss(), 50);
}

// A virtual machine loses a core to others for 2 % of the time or more, in bursts of milliseconds.
TEST(LossBudget, SharesWhereACoreIsStolenNowAndThen) {
  for (const std::int64_t burst_ms : {1, 4, 10}) {
    LossBudget budget;
    std::mt19937 random(1);
    std::bernoulli_distribution is_stolen(0.02 / static_cast<double>(burst_ms));
    int shared = 0, jobs = 0;
    for (std::int64_t now_ns = 0; now_ns < 20'000 * kMillisecond; ++jobs) {
      const std::int64_t stolen_ns = is_stolen(random) ? burst_ms * kMillisecond : 0;
      now_ns += kMillisecond + stolen_ns;
      if (budget.allows(now_ns, never))
        budget.charge(stolen_ns - kMillisecond / 2, now_ns), ++shared;
      else
        budget.record_serial(kMillisecond + stolen_ns, kMillisecond);
    }
    EXPECT_GT(shared, 0.97 * jobs) << burst_ms;
  }
}

TEST(LossBudget, PausesForLessAfterAGain) {
  LossBudget budget;
  const auto lose = [&] { budget.charge(LossBudget::kMaxLoss_ns + kMillisecond, 0); };
  const auto pause_ms = [&] {
    std::int64_t ms = 0;
    while (budget.is_pause(ms * kMillisecond)) ++ms;
    return ms;
  };
  budget.charge(-LossBudget::kMaxCredit_ns, 0), budget.charge(LossBudget::kMaxCredit_ns, 0), lose();
  EXPECT_EQ(pause_ms(), 15);
  lose();
  EXPECT_EQ(pause_ms(), 150);
}

TEST(LossBudget, MeasuresFewJobs) {
  LossBudget budget;
  int measured = 0, jobs = 0;
  for (; jobs < 1000 && !budget.allows(0, never); ++jobs) {
    if (budget.is_measurement_due())
      budget.record_serial(kMillisecond / 2, kMillisecond / 2), ++measured;
    else
      budget.record_unmeasured(kMillisecond / 2);
  }
  EXPECT_NEAR(jobs, 100, 9);  // 50 ms
  EXPECT_EQ(measured, jobs / 9);
}

TEST(LossBudget, MeasuresFewerJobsWhileItLosesItsCore) {
  LossBudget budget;
  const auto measured_in = [&budget](int jobs, std::int64_t cpu_ns) {
    int measured = 0;
    for (int job = 0; job < jobs; ++job)
      if (budget.is_measurement_due())
        budget.record_serial(kMillisecond, cpu_ns), ++measured;
      else
        budget.record_unmeasured(kMillisecond);
    return measured;
  };
  EXPECT_LT(measured_in(10'000, kMillisecond / 2), 50);
  int jobs = 0;
  for (; !budget.allows(0, never); ++jobs) measured_in(1, kMillisecond);
  EXPECT_GE(jobs, 45);
  EXPECT_LE(jobs, 256 + 50);
}

// A stop of the whole machine is no reason to stay alone for minutes.
TEST(LossBudget, PausesEnd) {
  LossBudget budget;
  time_until_allowed(budget, 0);
  budget.charge(60'000 * kMillisecond, 0);
  EXPECT_TRUE(budget.is_pause(999 * kMillisecond));
  EXPECT_FALSE(budget.is_pause(1000 * kMillisecond));
  EXPECT_EQ(time_until_allowed(budget, 0), 1000);
}
