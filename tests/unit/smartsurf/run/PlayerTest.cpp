#include "smartsurf/run/replay/Player.h"

#include <gtest/gtest.h>

namespace smartsurf::run {
namespace {

const std::vector<double> kTime = {0.0, 0.1, 0.2, 0.3, 0.4};

view::Commands steps(int count) {
  view::Commands commands;
  commands.steps = count;
  return commands;
}

view::Commands toggle() {
  view::Commands commands;
  commands.toggle_pause = true;
  return commands;
}

TEST(Player, PlaysAtPaceAndPausesAtEnd) {
  Player player(kTime, 2.0);
  player.advance(0.06);
  EXPECT_EQ(player.frame(), 1u);
  player.advance(0.1);
  EXPECT_EQ(player.frame(), 3u);
  EXPECT_FALSE(player.paused());
  player.advance(9.0);
  EXPECT_EQ(player.frame(), 4u);
  EXPECT_TRUE(player.paused());
  player.apply(toggle());
  EXPECT_EQ(player.frame(), 0u) << "resuming at the end restarts from the first frame";
}

TEST(Player, StepsPauseAndClampToEnds) {
  Player player(kTime, 1.0);
  player.apply(steps(2));
  EXPECT_EQ(player.frame(), 2u);
  EXPECT_TRUE(player.paused());
  player.apply(steps(-1));
  EXPECT_EQ(player.frame(), 1u);
  player.apply(steps(-5));
  EXPECT_EQ(player.frame(), 0u);
  player.apply(steps(50));
  EXPECT_EQ(player.frame(), 4u);
}

TEST(Player, ContinuesAfterSeek) {
  Player player(kTime, 1.0);
  view::Commands commands;
  commands.seek = 3;
  player.apply(commands);
  EXPECT_EQ(player.frame(), 3u);
  EXPECT_FALSE(player.paused());
  player.advance(0.05);
  EXPECT_EQ(player.frame(), 3u);
  commands.seek = 99;
  player.apply(commands);
  EXPECT_EQ(player.frame(), 4u);
}

TEST(Player, SeeksTheFirstFrameAtOrAfterATime) {
  Player player(kTime, 1.0);
  view::Commands commands;
  commands.seek_time_s = kTime[2] - 1e-6;
  player.apply(commands);
  EXPECT_EQ(player.frame(), 2u);
  commands.seek_time_s = 1e9;
  player.apply(commands);
  EXPECT_EQ(player.frame(), 4u);
}

TEST(Player, ZeroPaceShowsEveryFrame) {
  Player player(kTime, 0.0);
  for (std::size_t frame = 1; frame < 5; ++frame) {
    player.advance(100.0);
    EXPECT_EQ(player.frame(), frame);
  }
}

}  // namespace
}  // namespace smartsurf::run
