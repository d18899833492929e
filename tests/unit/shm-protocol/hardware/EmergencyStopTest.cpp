#include "shm-protocol/hardware/bridge/EmergencyStop.h"

#include <gtest/gtest.h>

namespace hardware {
namespace {

constexpr std::uint32_t kPeriod_us = 20'000, kHalfASecond = 25;  // frames

class EmergencyStopTest : public testing::Test {
 protected:
  // What the bridge answers to the board's newest frame.
  std::uint8_t look(std::uint64_t frame, bool stopped, std::uint32_t period_us = kPeriod_us) {
    return stop.packet_for(stopped ? SSW_STOPPED : 0, frame, period_us, release, "b");
  }
  // The user's stop, which the board reports with its frame 10, and the release after that.
  void stop_and_release() {
    stop.stop(SSW_STOP_BY_HOST, "the user");
    EXPECT_EQ(look(9, false), SSW_STOP_NOW);
    EXPECT_EQ(look(10, true), 0);
    stop.arm();
    release = EmergencyStop::Release(10);
  }
  EmergencyStop stop;
  EmergencyStop::Release release;
};

TEST_F(EmergencyStopTest, LineOfABoardStopsAtOnce) {
  EXPECT_EQ(look(1, false), 0);
  EXPECT_EQ(look(2, true), 0);
  EXPECT_EQ(stop.cause(), "board 'b'");
}

TEST_F(EmergencyStopTest, BoardThatStillReportsTheFormerStopIsReleasedAgain) {
  stop_and_release();
  for (std::uint64_t frame = 10; frame < 10 + kHalfASecond; ++frame) EXPECT_EQ(look(frame, true), SSW_ARM);
  EXPECT_FALSE(stop.active());
  EXPECT_EQ(look(10 + kHalfASecond, true), 0);
  EXPECT_EQ(stop.cause(), "board 'b'");
}

TEST_F(EmergencyStopTest, BoardOrHostThatStandsStillHasNotRefusedTheRelease) {
  stop_and_release();
  for (int i = 0; i < 100'000; ++i) EXPECT_EQ(look(10, true), SSW_ARM);  // no new frame of the board
  EXPECT_EQ(look(200, true), SSW_ARM);                                   // many at one look of the host
  EXPECT_EQ(look(201, false), 0);
  EXPECT_FALSE(stop.active());
}

TEST_F(EmergencyStopTest, SlowBoardHasThreeFrames) {
  stop_and_release();
  for (std::uint64_t frame = 11; frame < 13; ++frame) EXPECT_EQ(look(frame, true, 700'000), SSW_ARM);
  EXPECT_EQ(look(13, true, 700'000), 0);
  EXPECT_TRUE(stop.active());
}

TEST_F(EmergencyStopTest, LineThatIsPressedLaterStopsAtOnce) {
  stop_and_release();
  for (std::uint64_t frame = 11; frame < 11 + kHalfASecond; ++frame) EXPECT_EQ(look(frame, false), 0);
  EXPECT_EQ(look(11 + kHalfASecond, true), 0);
  EXPECT_TRUE(stop.active());
}

}  // namespace
}  // namespace hardware
