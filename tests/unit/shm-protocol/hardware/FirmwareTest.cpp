// The reference firmware with a late, silent or partly received host.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "shm-protocol/hardware/bridge/DeviceLink.h"
#include "shm-protocol/hardware/fake/ToyDevice.h"

namespace hardware {
namespace {

using Bytes = std::vector<std::uint8_t>;

struct FirmwareHarness {
  FirmwareHarness()
      : device(4, 5, 1000, [this](const std::uint8_t* b, std::size_t n) {
          out.insert(out.end(), b, b + n);
          return true;
        }) {
    link.write(SSW_DESCRIBE, 0, in);
    link.write(SSW_START, 0, in);
    deliver();
  }
  void deliver() {
    for (const std::uint8_t b : std::exchange(in, {})) device.receive(b);
    for (const std::uint8_t b : std::exchange(out, {}))
      frames += link.receive(b) == DeviceLink::Event::kFrame;
  }
  void answer(std::uint32_t tick, float height) {
    link.write_frame(tick, std::vector<float>(20, height), in);
    deliver();
  }
  const SensorFrame& period() {
    device.period();
    deliver();
    return link.frame();
  }
  bool all(std::uint8_t raw) const {
    return std::ranges::all_of(device.heights(), [=](std::uint8_t h) { return h == raw; });
  }

  Bytes in, out;
  ToyDevice device;
  DeviceLink link;
  int frames = 0;
};

// The firmware's library alone, with 2 by 3 cells of one channel, started.
struct OneChannelDevice {
  explicit OneChannelDevice(ssd_channel& channel) {
    const ssw_hello hello{SSW_VERSION, 1, 2, 3, 1000, 1, 1, "skin"};
    const auto write = [](void* to, const std::uint8_t* bytes, std::size_t count) {
      static_cast<Bytes*>(to)->insert(static_cast<Bytes*>(to)->end(), bytes, bytes + count);
      return 1;
    };
    ssd_init(&device, &hello, &channel, 1, write, &out);
    link.write(SSW_DESCRIBE, 0, in);
    link.write(SSW_START, 0, in);
  }
  OneChannelDevice(const OneChannelDevice&) = delete;
  OneChannelDevice& operator=(const OneChannelDevice&) = delete;
  const SensorFrame& period() {
    for (const std::uint8_t b : std::exchange(in, {})) ssd_receive(&device, b);
    ssd_period(&device);
    for (const std::uint8_t b : std::exchange(out, {})) link.receive(b);
    return link.frame();
  }

  Bytes in, out;
  ssd_device device;
  DeviceLink link;
};

TEST(Firmware, SendsNoFramesBeforeStart) {
  Bytes out;
  ToyDevice device(4, 5, 1000, [&](const std::uint8_t* b, std::size_t n) {
    out.insert(out.end(), b, b + n);
    return true;
  });
  for (int i = 0; i < 5; ++i) device.period();
  EXPECT_TRUE(out.empty());
}

TEST(Firmware, AppliesAnswerAtEndOfPeriod) {
  FirmwareHarness b;
  EXPECT_EQ(b.period().tick, 1u);
  b.answer(1, 2.0F);
  EXPECT_TRUE(b.all(0));
  EXPECT_EQ(b.period().flags, 0u);
  EXPECT_TRUE(b.all(100));
  EXPECT_EQ(b.link.frame().active_tick, 1u);
}

TEST(Firmware, MissedDeadlineKeepsPreviousFrame) {
  FirmwareHarness b;
  b.period();
  b.answer(1, 2.0F);
  b.period();
  EXPECT_EQ(b.period().flags, SSW_MISSED);
  EXPECT_EQ(b.link.frame().missed, 1u);
  EXPECT_EQ(b.link.frame().active_tick, 1u);
  EXPECT_TRUE(b.all(100));
  b.answer(2, 3.0F);  // late, but newer than the active frame
  EXPECT_EQ(b.period().flags, SSW_MISSED);
  EXPECT_EQ(b.link.frame().missed, 2u);
  EXPECT_EQ(b.link.frame().active_tick, 2u);
  EXPECT_TRUE(b.all(150));
}

// Ticks are counted modulo 2^32, and FFFFFFFF, which stands for no answer, cannot be answered.
TEST(Firmware, EachUnansweredTickIsMissedWhereTicksBeginAgain) {
  std::mt19937 random(2);
  for (int session = 0; session < 50; ++session) {
    std::uint8_t height[6] = {}, next[6] = {};
    ssd_channel channel{{0, SSW_ACTUATOR, SSW_U8, 1, 0, 255, 0, 1, 0, "height", ""}, height, next};
    OneChannelDevice b(channel);
    b.period();
    b.device.tick = SSW_NONE - random() % 16;
    std::uint32_t missed = b.period().missed, in_force = SSW_NONE;
    for (int i = 0; i < 32; ++i) {
      const std::uint32_t tick = b.link.frame().tick;
      const bool is_sent = random() % 4 != 0, is_answer = is_sent && tick != SSW_NONE;
      if (is_sent) b.link.write_frame(tick, std::vector<float>(6, static_cast<float>(tick % 256)), b.in);
      if (is_answer) in_force = tick;
      if (!is_answer) ++missed;
      const SensorFrame& frame = b.period();
      EXPECT_EQ(frame.tick, tick + 1);
      EXPECT_EQ(frame.missed, missed) << tick;
      EXPECT_EQ(frame.flags & SSW_MISSED, is_answer ? 0u : SSW_MISSED) << tick;
      EXPECT_EQ(frame.active_tick, in_force) << tick;
      EXPECT_EQ(height[5], in_force == SSW_NONE ? 0 : in_force % 256) << tick;
    }
  }
}

TEST(Firmware, AnswerToADeviceWithoutActuatorsIsOne) {
  std::uint8_t touch[6] = {};
  ssd_channel channel{{0, SSW_SENSOR, SSW_U8, 1, 0, 1, 0, 1, 0, "touch", ""}, touch, nullptr};
  OneChannelDevice b(channel);
  for (std::uint32_t tick = 1; tick <= 5; ++tick) {
    ASSERT_EQ(b.period().tick, tick);
    EXPECT_EQ(b.link.frame().missed, 0u);
    EXPECT_EQ(b.link.frame().active_tick, tick == 1 ? SSW_NONE : tick - 1);
    b.link.write_frame(tick, {}, b.in);
  }
}

TEST(Firmware, IgnoresIncompleteFrame) {
  FirmwareHarness b;
  b.period();
  Bytes whole;
  b.link.write_frame(1, std::vector<float>(20, 2.0F), whole);
  b.in.assign(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(whole.size() - 8));
  b.deliver();
  EXPECT_EQ(b.period().flags, SSW_MISSED | SSW_SAFE);
  EXPECT_TRUE(b.all(0));
}

TEST(Firmware, AppliesSafeValuesWhenHostIsSilent) {
  FirmwareHarness b;
  b.period();
  b.answer(1, 2.0F);
  b.period();
  for (unsigned i = 0; i + 2 < SSD_PATIENCE; ++i) EXPECT_EQ(b.period().flags & SSW_SAFE, 0u) << i;
  EXPECT_TRUE(b.all(100));
  EXPECT_EQ(b.period().flags & SSW_SAFE, SSW_SAFE);
  EXPECT_TRUE(b.all(0));
  b.answer(b.link.frame().tick, 1.0F);
  EXPECT_EQ(b.period().flags & SSW_SAFE, 0u);
  EXPECT_TRUE(b.all(50));
}

TEST(Firmware, HeartbeatKeepsLastFrame) {
  FirmwareHarness b;
  b.period();
  b.answer(1, 2.0F);
  for (int i = 0; i < 100; ++i) {
    b.link.write(SSW_HEARTBEAT, 0, b.in);
    b.deliver();
    EXPECT_EQ(b.period().flags & SSW_SAFE, 0u);
  }
  EXPECT_TRUE(b.all(100));
}

TEST(Firmware, StopAppliesSafeValuesAndEndsFrames) {
  FirmwareHarness b;
  b.period();
  b.answer(1, 2.0F);
  b.period();
  EXPECT_TRUE(b.all(100));
  b.link.write(SSW_STOP, 0, b.in);
  b.deliver();
  EXPECT_TRUE(b.all(0));
  const int before = b.frames;
  b.period();
  EXPECT_EQ(b.frames, before);
}

TEST(Firmware, RestartChangesBootNumber) {
  FirmwareHarness b;
  const auto boot = b.link.description().boot;
  b.period();
  b.device.restart();
  b.link.write(SSW_DESCRIBE, 0, b.in);
  b.deliver();
  EXPECT_NE(b.link.description().boot, boot);
}

// Values that are not a multiple of their size lie anywhere in memory, and the safe value of a scaled channel
// is raw.
TEST(Firmware, SafeValuesAreScaledForEachType) {
  std::uint8_t memory[64] = {};
  ssd_channel channels[] = {
      {{0, SSW_ACTUATOR, SSW_F32, 1, -1, 1, 0.25F, 1, 0, "a", ""}, memory + 1, memory + 5},
      {{0, SSW_ACTUATOR, SSW_U16, 1, -10, 10, 2.5F, 0.01F, -10, "b", ""}, memory + 9, memory + 11},
      {{0, SSW_ACTUATOR, SSW_U8, 1, 0, 4, 1, 0.02F, 0, "c", ""}, memory + 13, memory + 14},
      {{0, SSW_ACTUATOR, SSW_U8, 1, 0, 1, 1, 0.4F, 0, "d", ""}, memory + 15, memory + 16}};
  const ssw_hello hello{0, 0, 1, 1, 1000, 1, 0, "odd"};
  ssd_device device;
  ssd_init(
      &device, &hello, channels, 4, [](void*, const std::uint8_t*, std::size_t) { return 1; }, nullptr);
  EXPECT_EQ(ssw_get_f32(memory + 1), 0.25F);
  EXPECT_EQ(ssw_get_u16(memory + 9), 1250);
  EXPECT_EQ(memory[13], 50);
  EXPECT_EQ(memory[15], 2) << "3 is beyond the range";
}

}  // namespace
}  // namespace hardware
