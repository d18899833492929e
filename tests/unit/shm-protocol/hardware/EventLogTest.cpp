// A recurring line is printed once a second, with the number of its repetitions.
#include "shm-protocol/hardware/bridge/EventLog.h"

#include <gtest/gtest.h>

#include <vector>

namespace hardware {
namespace {

using std::chrono::milliseconds;

TEST(EventLog, RepetitionsAreCountedAndPrintedOnceASecond) {
  std::vector<std::string> printed;
  const EventLog::Clock::time_point start{};
  {
    EventLog log([&](const std::string& line) { printed.push_back(line); });
    for (int ms = 0; ms <= 1000; ms += 10) log.add("cut", start + milliseconds(ms));
    EXPECT_EQ(printed, (std::vector<std::string>{"cut", "cut (100 times more)"}));
    log.add("cut", start + milliseconds(5000));
    log.add("back", start + milliseconds(5010));
    log.add("back", start + milliseconds(5020));
    log.add("back", start + milliseconds(5030));
    EXPECT_EQ(printed.size(), 4u);
    EXPECT_EQ(printed[2], "cut");  // an event of its own again
    EXPECT_EQ(printed[3], "back");
  }
  EXPECT_EQ(printed.back(), "back (2 times more)");
}

TEST(EventLog, ManyDifferentLinesAreAllPrinted) {
  std::vector<std::string> printed;
  EventLog log([&](const std::string& line) { printed.push_back(line); });
  for (int i = 0; i < 100; ++i) log.add(std::to_string(i), {});
  EXPECT_EQ(printed.size(), 100u);
}

TEST(EventLog, FloodOfReportsIsCounted) {
  std::vector<std::string> printed;
  const EventLog::Clock::time_point start = EventLog::Clock::now();
  {
    EventLog log([&](const std::string& line) { printed.push_back(line); });
    for (int i = 0; i < 100; ++i) log.add_report(std::to_string(i), start + milliseconds(i));
    EXPECT_EQ(printed.size(), 8u);
    log.add("cut", start + milliseconds(500));
    EXPECT_EQ(printed.back(), "cut");
    log.add("back", start + milliseconds(1000));
    EXPECT_EQ(printed[9], "reports left out: 92");
    for (int i = 0; i < 9; ++i) log.add_report("b" + std::to_string(i), start + milliseconds(2000 + i));
    EXPECT_EQ(printed.size(), 19u);
  }
  EXPECT_EQ(printed.back(), "reports left out: 1");
}

}  // namespace
}  // namespace hardware
