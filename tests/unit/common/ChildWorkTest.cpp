#include "common/process/ChildWork.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <new>
#include <stdexcept>
#include <vector>

#include "common/confine/Confinement.h"

namespace common {
namespace {

constexpr ChildLimits kLimits{.cpu_s = 10.0, .memory_bytes = std::size_t{256} << 20};

ChildResult::End end_of(const std::function<std::string()>& work, ChildLimits limits = kLimits) {
  return run_in_child(work, limits).end;
}

TEST(ChildWork, ReturnsBytes) {
  const ChildResult result = run_in_child([] { return std::string(300000, 'x'); }, kLimits);
  EXPECT_EQ(result.end, ChildResult::End::kReturned);
  EXPECT_EQ(result.bytes, std::string(300000, 'x'));
}

TEST(ChildWork, FailsOnCrashesExceptionsAndLimits) {
  EXPECT_EQ(end_of([]() -> std::string { std::abort(); }), ChildResult::End::kFailed);
  EXPECT_EQ(end_of([]() -> std::string { throw std::runtime_error("no"); }), ChildResult::End::kFailed);
  EXPECT_EQ(end_of([]() -> std::string { throw std::bad_alloc(); }), ChildResult::End::kOutOfMemory);
  const double before_s = child_time_s();
  EXPECT_EQ(end_of(
                []() -> std::string {
                  std::atomic<int> count = 0;
                  while (count >= 0) count = 1;
                  return "";
                },
                {.cpu_s = 0.05, .memory_bytes = kLimits.memory_bytes}),
            ChildResult::End::kOutOfTime);
  EXPECT_GE(child_time_s() - before_s, 0.03);  // what the child used, but for the kernel's resolution
  EXPECT_NE(end_of([] { return std::string(std::size_t{1} << 30, 'x'); }), ChildResult::End::kReturned);
}

// Foreign code in the child may switch off what it can.
TEST(ChildWork, HijackedChildKeepsItsLimits) {
  const auto loop = []() -> std::string {
    std::signal(SIGPROF, SIG_IGN);
    const itimerval never{};
    ::setitimer(ITIMER_PROF, &never, nullptr);
    const rlimit none{RLIM_INFINITY, RLIM_INFINITY};
    for (const auto resource : {RLIMIT_CPU, RLIMIT_AS}) ::setrlimit(resource, &none);
    std::atomic<int> count = 0;
    while (count >= 0) count = 1;
    return "";
  };
  EXPECT_EQ(end_of(loop, {.cpu_s = 0.05, .memory_bytes = kLimits.memory_bytes}),
            ChildResult::End::kOutOfTime);
  const auto write_without_end = []() -> std::string {
    const std::string block(1 << 16, 'x');
    while (::write(STDERR_FILENO + 1, block.data(), block.size()) > 0) {
    }
    return "";
  };
  const ChildResult result = run_in_child(
      write_without_end, {.cpu_s = 10.0, .memory_bytes = kLimits.memory_bytes, .answer_bytes = 100'000});
  EXPECT_EQ(result.end, ChildResult::End::kFailed);
  EXPECT_LT(result.bytes.size(), 200'000U);
}

TEST(ChildWork, ChildMayNotChangeItsLimits) {
  if (!confinement_support().seccomp || confinement_mode() == ConfinementMode::kOff) GTEST_SKIP();
  const auto try_all = [] {
    const itimerval never{};
    rlimit now{};
    ::getrlimit(RLIMIT_CPU, &now);
    return std::to_string(now.rlim_cur) + " " + std::to_string(now.rlim_max) + " " +
           std::to_string(::setitimer(ITIMER_PROF, &never, nullptr)) + " " +
           std::to_string(::setrlimit(RLIMIT_CPU, &now));
  };
  EXPECT_EQ(run_in_child(try_all, kLimits).bytes, "10 11 -1 -1");
}

TEST(ChildWork, HasNoOpenFiles) {
  const int file = ::fcntl(STDERR_FILENO, F_DUPFD, 100);  // above the descriptor of the result
  const ChildResult result =
      run_in_child([&] { return std::string(::fcntl(file, F_GETFD) < 0 ? "closed" : "open"); }, kLimits);
  EXPECT_EQ(result.bytes, "closed");
}

}  // namespace
}  // namespace common
