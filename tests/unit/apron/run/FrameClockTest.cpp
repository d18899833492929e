// Frames on a fake clock, and scripted keys.
#include "apron/run/host/FrameClock.h"

#include <gtest/gtest.h>

#include "apron/run/host/KeyScript.h"

namespace apron::run {
namespace {

TEST(FrameClock, CountsWithoutReadingTheClock) {
  const std::atomic<bool> stop{true};  // there is no wait to stop
  FrameClock frames({4.0, std::nullopt}, [] { return ADD_FAILURE() << "read the clock", 0.0; });
  EXPECT_EQ(frames.period_s(), 0.25);
  for (int i = 0; i < 6; ++i) EXPECT_EQ(frames.advance(stop), vm::HostStatus::kOk);
  EXPECT_EQ(frames.frame(), 6U);
  EXPECT_EQ(frames.time_s(), 1.5);
  frames.restart();
  EXPECT_EQ(frames.time_s(), 0.0);
}

// At 4 frames per second and twice the program's speed a frame takes 1/8 s.
TEST(FrameClock, KeepsThePaceAndDoesNotCatchUp) {
  double now = 100.0;
  const std::atomic<bool> stop{false};
  FrameClock frames({4.0, 2.0}, [&] { return now += 1.0 / 64; });
  EXPECT_EQ(frames.advance(stop), vm::HostStatus::kOk);
  EXPECT_NEAR(now, 100.125, 0.05);
  EXPECT_EQ(frames.advance(stop), vm::HostStatus::kOk);
  EXPECT_NEAR(now, 100.25, 0.05);
  now = 200.0;  // a long frame
  EXPECT_EQ(frames.advance(stop), vm::HostStatus::kOk);
  EXPECT_NEAR(now, 200.0, 0.05);
  EXPECT_EQ(frames.advance(stop), vm::HostStatus::kOk);
  EXPECT_EQ(frames.advance(stop), vm::HostStatus::kOk);
  EXPECT_GT(now, 200.15);  // not all at once
}

TEST(FrameClock, InterruptedWaitResumes) {
  double now = 0.0;
  std::atomic<bool> stop{false};
  FrameClock frames({1.0, 0.1}, [&] {
    now += 1.0;
    if (now == 4.0) stop = true;
    return now;
  });
  EXPECT_EQ(frames.advance(stop), vm::HostStatus::kInterrupted);
  EXPECT_EQ(frames.frame(), 0U);
  stop = false;
  now = 10.5;  // due at 11
  EXPECT_EQ(frames.advance(stop), vm::HostStatus::kOk);
  EXPECT_EQ(frames.frame(), 1U);
  EXPECT_LT(now, 14.0);
}

TEST(KeyScript, HoldsKeysAndQueuesPresses) {
  std::string error;
  const auto press = [&](const char* text) { return *parse_key_press(text, error); };
  KeyScript keys({press("right@5-7"), press("A@3"), press("@@3")});
  EXPECT_FALSE(keys.is_down('a', 2));
  EXPECT_TRUE(keys.is_down('a', 3));
  EXPECT_FALSE(keys.is_down('a', 4));
  EXPECT_TRUE(keys.is_down(258, 7));
  EXPECT_FALSE(keys.is_down(258, 8));
  EXPECT_EQ(keys.take(2), 0);
  EXPECT_EQ(keys.take(6), 'a');
  EXPECT_EQ(keys.take(6), '@');
  EXPECT_EQ(keys.take(6), 258);
  EXPECT_EQ(keys.take(6), 0);
  for (const char* wrong :
       {"", "a", "a@", "@3", "a@x", "a@3-2", "a@-2", "a@1-2-3", "ctrl@4", "a@99999999999999999999"})
    EXPECT_FALSE(parse_key_press(wrong, error)) << wrong;
  EXPECT_EQ(error.find('\n'), std::string::npos);
}

}  // namespace
}  // namespace apron::run
