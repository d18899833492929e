// A recurring line is printed once a second, with the number of its repetitions.
#include "shm-protocol/hardware/bridge/EventLog.h"

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <string>
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

TEST(EventLog, RepetitionsArePrintedWhenTheirSecondIsOver) {
  std::vector<std::string> printed;
  const EventLog::Clock::time_point start{};
  EventLog log([&](const std::string& line) { printed.push_back(line); });
  for (const int ms : {0, 300, 400}) log.add("cut", start + milliseconds(ms));
  log.print_due(start + milliseconds(999));
  EXPECT_EQ(printed, (std::vector<std::string>{"cut"}));
  log.print_due(start + milliseconds(1000));
  EXPECT_EQ(printed, (std::vector<std::string>{"cut", "cut (2 times more)"}));
  log.print_due(start + milliseconds(5000));
  EXPECT_EQ(printed.size(), 2u);
}

// Boards come and go at random. No event is lost, and each board's last line is what holds of it: once it is
// quiet for a second, and before every line that is new.
TEST(EventLog, LastLineOfABoardIsItsState) {
  std::mt19937 random(9);
  for (int round = 0; round < 100; ++round) {
    std::map<std::string, std::string> state, last;
    std::map<std::string, int> said, heard;
    bool is_current = true;
    EventLog::Clock::time_point now{};
    {
      EventLog log([&](const std::string& line) {
        const std::string text = line.substr(0, 4);  // "b0:+", a number of repetitions may follow
        heard[text] += line.size() > 4 ? std::stoi(line.substr(6)) : 1;
        last[text.substr(0, 2)] = text;
      });
      for (int i = 0; i < 60; ++i) {
        now += milliseconds(random() % 20 == 0 ? 1000 : random() % 200);
        log.print_due(now);
        const std::string board = "b" + std::to_string(random() % 6);
        std::string& text = state[board];
        text = board + (text == board + ":+" ? ":-" : ":+");
        const bool is_new = !said[text]++;
        log.add(text, now);
        if (is_new) is_current = is_current && last == state;
      }
      log.print_due(now + milliseconds(1000));
      EXPECT_EQ(last, state) << round;
    }
    EXPECT_TRUE(is_current) << round;
    EXPECT_EQ(heard, said) << round;
  }
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
