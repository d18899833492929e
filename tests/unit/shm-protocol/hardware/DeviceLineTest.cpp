// What is counted on the line to a device: answers that were sent, and new frames.
#include "shm-protocol/hardware/bridge/DeviceLine.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "shm-protocol/hardware/bridge/FrameSequence.h"
#include "shm-protocol/hardware/fake/EmulatedLine.h"
#include "shm-protocol/hardware/fake/ToyDevice.h"

namespace hardware {
namespace {

// A device whose frames are larger than what its terminal takes at once.
struct LargeDevice {
  LargeDevice() {
    std::string why;
    auto port = Port::open(PortAddress::parse(far.name(), 115200), why);
    if (!port) throw std::runtime_error(why);
    line.open(std::move(*port));
    line.write(SSW_DESCRIBE, 0);
    while (!line.link().described()) {
      line.flush();
      receive();
      line.receive([] { return true; }, [](DeviceLink::Event) {});
    }
    values.assign(line.link().actuator_elements(), 1.0F);
  }
  void receive() {
    std::vector<std::uint8_t> bytes;
    far.read(bytes);
    for (const std::uint8_t b : bytes) device.receive(b);
  }
  void send_all() {
    while (line.pending_bytes() != 0) {
      receive();
      ASSERT_TRUE(line.flush());
    }
  }

  EmulatedLine far = EmulatedLine::terminal(testing::TempDir() + "device-line-" + std::to_string(::getpid()));
  ToyDevice device{512, 512, 10'000, [this](const std::uint8_t* bytes, std::size_t count) {
                     far.write(std::vector<std::uint8_t>(bytes, bytes + count));
                     return true;
                   }};
  DeviceLine line;
  std::vector<float> values;
};

TEST(DeviceLine, AnswerCountsOnceItsLastByteIsSent) {
  LargeDevice d;
  EXPECT_TRUE(d.line.write_frame(1, d.values, true));
  EXPECT_TRUE(d.line.flush());
  EXPECT_GT(d.line.pending_bytes(), 0u);
  EXPECT_EQ(d.line.answers(), 0u);
  EXPECT_FALSE(d.line.write_frame(2, d.values, true)) << "earlier bytes wait";
  EXPECT_EQ(d.line.unsent(), 1u);
  d.line.write(SSW_HEARTBEAT, 2);
  d.send_all();
  EXPECT_EQ(d.line.answers(), 1u);
  EXPECT_TRUE(d.line.write_frame(3, d.values, false)) << "no controller's";
  d.send_all();
  EXPECT_EQ(d.line.answers(), 1u);
  EXPECT_EQ(d.line.unsent(), 1u);
}

TEST(DeviceLine, AnswerThatIsDiscardedIsNotSent) {
  LargeDevice d;
  EXPECT_TRUE(d.line.write_frame(1, d.values, true));
  EXPECT_TRUE(d.line.flush());
  d.line.discard_pending();
  d.line.write_safe_frame(1);
  d.send_all();
  EXPECT_EQ(d.line.answers(), 0u);
  EXPECT_EQ(d.line.unsent(), 1u);
}

TEST(DeviceLine, NoiseIsSaidWhereNoDeviceDescribesItself) {
  EmulatedLine far = EmulatedLine::terminal(testing::TempDir() + "device-line-" + std::to_string(::getpid()));
  std::string why;
  auto port = Port::open(PortAddress::parse(far.name(), 9600), why);
  ASSERT_TRUE(port) << why;
  DeviceLine line;
  line.open(std::move(*port));
  EXPECT_EQ(line.why_undescribed(), "no device describes itself there");
  far.write({0, 0x55, 0xAA, 0x55, 0, 0xAA, 0x55, 0xAA, 0});
  while (line.link().damaged_packets() < 2) line.receive([] { return true; }, [](DeviceLink::Event) {});
  EXPECT_EQ(line.why_undescribed(),
            "no device describes itself there; 2 damaged packets came: is the line's speed right?");
}

SensorFrame frame(std::uint32_t tick, std::uint32_t missed) {
  SensorFrame frame;
  frame.tick = tick;
  frame.missed = missed;
  return frame;
}

constexpr std::int64_t kSilence_us = 500'000;

TEST(FrameSequence, CountsLostFramesAndMissedDeadlines) {
  FrameSequence sequence;
  EXPECT_EQ(sequence.next(frame(7, 3), 0, kSilence_us)->ticks, 1u) << "the first one";
  const auto step = sequence.next(frame(12, 5), 50'000, kSilence_us);
  EXPECT_EQ(step->ticks, 5u);
  EXPECT_EQ(step->missed, 2u);
  EXPECT_FALSE(step->restarted);
  EXPECT_EQ(sequence.next(frame(13, 9), 60'000, kSilence_us)->missed, 1u) << "at most one a tick";
  sequence.restart();
  EXPECT_EQ(sequence.next(frame(100, 50), 70'000, kSilence_us)->ticks, 1u);
}

TEST(FrameSequence, RepeatedFrameIsNoNewFrameHoweverLong) {
  FrameSequence sequence;
  ASSERT_TRUE(sequence.next(frame(7, 3), 0, kSilence_us));
  for (std::int64_t now = 0; now < 4 * kSilence_us; now += 10'000)
    ASSERT_FALSE(sequence.next(frame(7, 3), now, kSilence_us)) << now;
  EXPECT_EQ(sequence.next(frame(8, 3), 4 * kSilence_us, kSilence_us)->ticks, 1u);
}

TEST(FrameSequence, DeviceThatRestartedUnheardIsNoted) {
  for (const std::uint32_t tick : {1u, 5u, 7u, 9u}) {  // before, at and beyond the last tick
    FrameSequence sequence;
    ASSERT_TRUE(sequence.next(frame(7, 3), 0, kSilence_us));
    const auto step = sequence.next(frame(tick, 0), 10'000, kSilence_us);
    ASSERT_TRUE(step) << tick;
    EXPECT_TRUE(step->restarted) << tick;
    EXPECT_EQ(step->ticks, 1u) << tick;
    EXPECT_EQ(step->missed, 0u) << tick;
  }
  FrameSequence sequence;
  ASSERT_TRUE(sequence.next(frame(1, 0), 0, kSilence_us));
  const auto step = sequence.next(frame(1, 0), kSilence_us + 1, kSilence_us);
  ASSERT_TRUE(step) << "firmware that hangs is not silent";
  EXPECT_TRUE(step->restarted);
}

}  // namespace
}  // namespace hardware
