#include "common/process/ChildWork.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <new>
#include <stdexcept>
#include <vector>

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

TEST(ChildWork, HasNoOpenFiles) {
  const int file = ::fcntl(STDERR_FILENO, F_DUPFD, 100);  // above the descriptor of the result
  const ChildResult result =
      run_in_child([&] { return std::string(::fcntl(file, F_GETFD) < 0 ? "closed" : "open"); }, kLimits);
  EXPECT_EQ(result.bytes, "closed");
}

}  // namespace
}  // namespace common
