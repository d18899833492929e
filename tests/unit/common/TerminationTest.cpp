// A failed allocation where no exception may leave ends the process in one line, and leaves no unfinished
// file.
#include "common/process/Termination.h"

#include <gtest/gtest.h>

#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <new>
#include <optional>

#include "common/files/UnfinishedFile.h"
#include "tests/unit/common/TemporaryFolder.h"

namespace common {
namespace {

using testing::ExitedWithCode;
using testing::KilledBySignal;

constexpr const char* kOneLine = "^program: there is not enough memory\n$";

void crash(int last_error, const std::filesystem::path& part) {
  std::signal(SIGSEGV, SIG_DFL);  // instead of a sanitizer's handler
  const Termination termination("program");
  const UnfinishedFile unfinished(part);
  errno = last_error;
  std::raise(SIGSEGV);
}

TEST(Termination, CrashAfterFailedAllocationIsOneLine) {
#ifdef __SANITIZE_THREAD__
  GTEST_SKIP() << "ThreadSanitizer calls signal handlers with an errno of its own";
#endif
  const TemporaryFolder folder;
  const auto part = folder.path() / "part";
  std::ofstream(part) << "half";
  EXPECT_EXIT(crash(ENOMEM, part), ExitedWithCode(1), kOneLine);
  EXPECT_FALSE(std::filesystem::exists(part));
}

// NOLINTNEXTLINE(misc-no-recursion)
int recurse(volatile int* depth) {
  volatile int here = *depth + 1;
  return here < 1'000'000'000 ? recurse(&here) + here : 0;
}

TEST(Termination, EndlessRecursionAfterFailedAllocationIsOneLine) {
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
  GTEST_SKIP() << "a sanitizer has stacks of its own";
#endif
  const auto run = [] {
    const Termination termination("program");
    errno = ENOMEM;
    volatile int depth = 0;
    recurse(&depth);
  };
  EXPECT_EXIT(run(), ExitedWithCode(1), kOneLine);
}

TEST(Termination, OtherCrashIsACrash) {
  const TemporaryFolder folder;
  const auto part = folder.path() / "part";
  std::ofstream(part) << "half";
  EXPECT_EXIT(crash(0, part), KilledBySignal(SIGSEGV), "^$");
  EXPECT_TRUE(std::filesystem::exists(part));
}

template <class Exception>
[[noreturn]] void throw_it() {
  throw Exception();
}

void call(void (*action)()) noexcept { action(); }

TEST(Termination, FailedAllocationInNoexceptFunctionIsOneLine) {
  const auto run = [](void (*action)()) {
    const Termination termination("program");
    errno = ENOMEM;
    call(action);
  };
  EXPECT_EXIT(run(throw_it<std::bad_alloc>), ExitedWithCode(1), kOneLine);
  EXPECT_EXIT(run(throw_it<int>), KilledBySignal(SIGABRT), "");
}

TEST(Termination, LibraryThatExitsIsOneLine) {
  EXPECT_EXIT(
      {
        const Termination termination("program");
        errno = ENOMEM;
        std::exit(255);
      },
      ExitedWithCode(1), kOneLine);
  EXPECT_EXIT(
      {
        { const Termination termination("program"); }
        std::exit(7);
      },
      ExitedWithCode(7), "^$");
}

TEST(UnfinishedFile, IsKeptOnceFinished) {
  const TemporaryFolder folder;
  const auto kept = folder.path() / "kept", part = folder.path() / "part";
  for (const auto& path : {kept, part}) std::ofstream(path) << "text";
  { const UnfinishedFile finished(kept); }
  const auto empty = folder.path() / "empty";
  std::filesystem::create_directory(empty);
  const UnfinishedFile unfinished(part), folder_of_nothing(empty);
  if (const pid_t child = ::fork(); child == 0) {
    remove_unfinished_files();  // its parent's
    ::_exit(0);
  } else {
    ::waitpid(child, nullptr, 0);
  }
  EXPECT_TRUE(std::filesystem::exists(part));
  remove_unfinished_files();
  EXPECT_TRUE(std::filesystem::exists(kept));
  EXPECT_FALSE(std::filesystem::exists(part));
  EXPECT_FALSE(std::filesystem::exists(empty));
}

TEST(Termination, EndsTheProcessAtOnce) {
  const TemporaryFolder folder;
  const auto part = folder.path() / "part";
  std::ofstream(part) << "half";
  const auto run = [&](const char* reason, int status) {
    const Termination termination("program");
    const UnfinishedFile unfinished(part);
    end_process(reason, status);
  };
  EXPECT_EXIT(run("it takes too long", 2), ExitedWithCode(2), "^program: it takes too long\n$");
  EXPECT_FALSE(std::filesystem::exists(part));
  EXPECT_EXIT(run(nullptr, 143), ExitedWithCode(143), "^$");
}

}  // namespace
}  // namespace common
