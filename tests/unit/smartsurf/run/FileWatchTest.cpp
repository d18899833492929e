#include "smartsurf/run/FileWatch.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <string>
#include <thread>

namespace smartsurf::run {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

class FileWatchTest : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder); }
  void TearDown() override { fs::remove_all(folder); }
  void write(const std::string& name, const std::string& text) const { std::ofstream(folder / name) << text; }
  // The number of changes that are reported: the first, however late, and those that follow it at once.
  static int await_changes(FileWatch& watch) {
    const auto end = Clock::now() + 60s;
    while (!watch.changed()) {
      if (Clock::now() > end) return 0;
      std::this_thread::sleep_for(10ms);
    }
    return 1 + changes(watch, 300ms);
  }
  // The number of changes that are reported within a time.
  static int changes(FileWatch& watch, std::chrono::milliseconds time) {
    const auto end = Clock::now() + time;
    int count = 0;
    for (; Clock::now() < end; std::this_thread::sleep_for(10ms)) count += watch.changed();
    return count;
  }
  const fs::path folder = fs::temp_directory_path() / ("smartsurf-watch-" + std::to_string(getpid()));
};

TEST_F(FileWatchTest, ReportsEachSaveOnce) {
  write("a", "one");
  FileWatch watch(folder / "a", "one");
  EXPECT_EQ(changes(watch, 400ms), 0);
  write("a", "second");
  EXPECT_EQ(await_changes(watch), 1);
  write("b", "third!");  // as editors do that replace the file
  fs::rename(folder / "b", folder / "a");
  EXPECT_EQ(await_changes(watch), 1);
}

TEST_F(FileWatchTest, ReportsAChangeBetweenReadingAndWatching) {
  write("a", "two");
  FileWatch watch(folder / "a", "one");
  EXPECT_EQ(await_changes(watch), 1);
}

TEST_F(FileWatchTest, WaitsForAFileThatIsGoneAndForOneThatIsWrittenInSteps) {
  write("a", "one");
  FileWatch watch(folder / "a", "one");
  fs::remove(folder / "a");
  EXPECT_EQ(changes(watch, 500ms), 0);
  for (int i = 0; i < 5; ++i) {
    const auto before = Clock::now();
    write("a", std::string(static_cast<std::size_t>(i + 1), 'x'));
    const int count = changes(watch, 100ms);
    if (Clock::now() - before < 200ms) {  // else the file was quiet for as long as one that is complete
      EXPECT_EQ(count, 0);
    }
  }
  write("a", "complete");
  EXPECT_EQ(await_changes(watch), 1);
}

}  // namespace
}  // namespace smartsurf::run
