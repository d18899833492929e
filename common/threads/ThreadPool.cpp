#include "common/threads/ThreadPool.h"

#include <algorithm>
#include <ctime>
#include <string>
#include <system_error>

#include "common/arithmetic/StandardArithmetic.h"
#include "common/error/UserError.h"
#include "common/threads/Core.h"

namespace common {
namespace {

std::int64_t clock_ns(clockid_t clock) noexcept {
  struct timespec now {};
  ::clock_gettime(clock, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

// The least of several, because another program may take the core in between.
double measure_spin_ns() noexcept {
  constexpr int kTries = 3;
  double least_ns = 1e6;
  for (int attempt = 0; attempt < kTries; ++attempt) {
    const std::int64_t spins = spins_of_this_thread, begin_ns = clock_ns(CLOCK_THREAD_CPUTIME_ID);
    for (int looks = 0; !spin_until([&looks] { return ++looks > 4 * kSpinsPerLook; });) continue;
    const std::int64_t took_ns = clock_ns(CLOCK_THREAD_CPUTIME_ID) - begin_ns;
    least_ns =
        std::min(least_ns, static_cast<double>(took_ns) / static_cast<double>(spins_of_this_thread - spins));
  }
  return least_ns;
}

// Processor time of this thread without its spins.
class WorkClock {
 public:
  explicit WorkClock(double spin_ns) noexcept : spin_ns_(spin_ns) {}
  std::int64_t elapsed_ns() const noexcept {
    const double spun_ns = static_cast<double>(spins_of_this_thread - spins_begin_) * spin_ns_;
    return std::max<std::int64_t>(
        0, clock_ns(CLOCK_THREAD_CPUTIME_ID) - cpu_begin_ns_ - static_cast<std::int64_t>(spun_ns));
  }

 private:
  double spin_ns_;
  std::int64_t spins_begin_ = spins_of_this_thread, cpu_begin_ns_ = clock_ns(CLOCK_THREAD_CPUTIME_ID);
};

}  // namespace

std::int64_t ThreadPool::now_ns() noexcept { return clock_ns(CLOCK_MONOTONIC); }
std::int64_t ThreadPool::cpu_ns() noexcept { return clock_ns(CLOCK_THREAD_CPUTIME_ID); }

ThreadPool::ThreadPool(int threads, double min_cost_ns)
    : min_cost_ns_(min_cost_ns),
      spins_(static_cast<unsigned>(threads) <= std::thread::hardware_concurrency()),
      spin_ns_(threads > 1 ? measure_spin_ns() : 0.0) {
  try {
    for (unsigned thread = 1; thread < static_cast<unsigned>(threads); ++thread)
      workers_.emplace_back([this, thread] { serve(thread); });
  } catch (const std::system_error& error) {
    stop();
    throw UserError("cannot start " + std::to_string(threads) + " threads: " + error.code().message() +
                    "; take fewer (--threads)");
  }
}

ThreadPool::~ThreadPool() { stop(); }

void ThreadPool::stop() noexcept {
  stop_.store(true, std::memory_order_release);
  round_.fetch_add(1, std::memory_order_release);
  round_.notify_all();
  for (std::thread& worker : workers_) worker.join();
}

template <class Word>
void ThreadPool::wait_while(const std::atomic<Word>& word, Word old) const noexcept {
  if (spins_ && spin_until([&] { return word.load(std::memory_order_acquire) != old; })) return;
  word.wait(old, std::memory_order_acquire);
}

bool ThreadPool::has_cores() noexcept {
  const auto is_oversubscribed = [this] {
    const CoreDemand demand = core_demand();
    return demand.runnable_threads - 1 + thread_count() > demand.cores && demand.cores > 0;
  };
  return !is_single() && (always_shares() || budget_.allows(clock_ns(CLOCK_MONOTONIC), is_oversubscribed));
}

bool ThreadPool::is_pause() const noexcept {
  return !always_shares() && budget_.is_pause(clock_ns(CLOCK_MONOTONIC));
}

// Returns false, and has called nothing, if a thread did not come. The job stays in place until every call of
// it has returned; only then may the next one replace it.
bool ThreadPool::run(const Job& job) noexcept {
  const std::int64_t begin_ns = clock_ns(CLOCK_MONOTONIC);
  const WorkClock clock(spin_ns_);
  job_ = job;
  caller_core_.store(current_core(), std::memory_order_relaxed);
  const bool is_fork = job.count == kEveryThread;
  const auto workers = static_cast<std::uint32_t>(workers_.size());
  const std::uint32_t calls = is_fork ? workers + 1 : job.count;
  const std::uint32_t round = round_.load(std::memory_order_relaxed) + 1;
  unfinished_.store(calls, std::memory_order_relaxed);
  worked_ns_.store(0, std::memory_order_relaxed);
  claim_.store(std::uint64_t{round} << 32U | (is_fork ? kEveryThread + workers : job.count),
               std::memory_order_release);
  round_.store(round, std::memory_order_release);
  round_.notify_all();
  if (is_fork && !all_come(round)) {
    const std::int64_t now_ns = clock_ns(CLOCK_MONOTONIC);
    budget_.charge(now_ns - begin_ns, now_ns);
    return false;
  }
  const std::uint32_t own_calls = work_on(round, 0);
  const std::int64_t own_ns = clock.elapsed_ns();
  for (std::uint32_t left = unfinished_.load(std::memory_order_acquire); left != 0;
       left = unfinished_.load(std::memory_order_acquire))
    wait_while(unfinished_, left);
  if (own_calls == 0) return true;
  // The caller alone would take about as long as all threads work together, less what it costs to share.
  // Indices are too short to be timed by each thread: those of the others take as long as the caller's.
  const std::int64_t worked_ns =
      is_fork ? own_ns + worked_ns_.load(std::memory_order_relaxed) : own_ns * calls / own_calls;
  const std::int64_t now_ns = clock_ns(CLOCK_MONOTONIC);
  budget_.charge(now_ns - begin_ns - worked_ns * kWorkAlone_percent / 100, now_ns);
  return true;
}

// For the caller: whether every thread has come to the fork/join. If not, none works on it.
bool ThreadPool::all_come(std::uint32_t round) noexcept {
  const std::uint64_t all = std::uint64_t{round} << 32U | kEveryThread;
  std::uint64_t claim = claim_.load(std::memory_order_acquire);
  if (always_shares()) {
    for (; claim != all; claim = claim_.load(std::memory_order_acquire)) wait_while(claim_, claim);
    return true;
  }
  if (spin_until([&] { return claim_.load(std::memory_order_acquire) == all; }, kMaxDelay)) return true;
  claim = claim_.load(std::memory_order_acquire);
  while (claim != all)
    if (claim_.compare_exchange_weak(claim, std::uint64_t{round} << 32U, std::memory_order_acq_rel)) {
      claim_.notify_all();
      return false;
    }
  return true;
}

// For the others: whether they work on the fork/join.
bool ThreadPool::come(std::uint32_t round) noexcept {
  const auto is_open = [round](std::uint64_t claim) {
    return claim >> 32U == round && (claim & kEveryThread) != 0;
  };
  std::uint64_t claim = claim_.load(std::memory_order_acquire);
  do {
    if (!is_open(claim)) return false;
  } while (!claim_.compare_exchange_weak(claim, claim - 1, std::memory_order_acq_rel));
  claim_.notify_all();
  for (--claim; is_open(claim); claim = claim_.load(std::memory_order_acquire)) {
    if (static_cast<std::uint32_t>(claim) == kEveryThread) return true;
    wait_while(claim_, claim);
  }
  return false;
}

void ThreadPool::finish_one() noexcept {
  if (unfinished_.fetch_sub(1, std::memory_order_acq_rel) == 1) unfinished_.notify_one();
}

// Returns the number of calls that this thread made. A late thread may find the claim of a later round. Then
// this round is over, and the thread joins that one next.
std::uint32_t ThreadPool::work_on(std::uint32_t round, unsigned thread) noexcept {
  std::uint64_t claim = claim_.load(std::memory_order_acquire);
  if (claim >> 32U == round && (claim & kEveryThread) != 0) {
    if (thread == 0) {
      job_.call(job_.of, thread, thread);
    } else {
      if (!come(round)) return 0;
      const WorkClock clock(spin_ns_);
      job_.call(job_.of, thread, thread);
      worked_ns_.fetch_add(clock.elapsed_ns(), std::memory_order_relaxed);
    }
    finish_one();
    return 1;
  }
  for (std::uint32_t calls = 0;;) {
    const auto left = static_cast<std::uint32_t>(claim);
    if (claim >> 32U != round || left == 0) return calls;
    if (!claim_.compare_exchange_weak(claim, claim - 1, std::memory_order_acq_rel)) continue;
    job_.call(job_.of, job_.count - left, thread);
    finish_one();
    ++calls;
    claim = claim_.load(std::memory_order_acquire);
  }
}

void ThreadPool::serve(unsigned thread) noexcept {
  const common::StandardArithmetic arithmetic;
  std::uint32_t round = 0;
  for (;;) {
    wait_while(round_, round);
    round = round_.load(std::memory_order_acquire);
    if (stop_.load(std::memory_order_acquire)) return;
    if (spins_ && caller_core_.load(std::memory_order_relaxed) == current_core()) leave_core();
    work_on(round, thread);
  }
}

}  // namespace common
