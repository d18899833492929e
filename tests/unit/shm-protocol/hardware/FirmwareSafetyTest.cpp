// The firmware's safe values, limits and emergency stop, whatever the line and the main loop do.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "shm-protocol/hardware/firmware/device.h"

namespace hardware {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::uint32_t kPeriod_us = 10'000;
constexpr int kRows = 3, kColumns = 4, kCells = kRows * kColumns;

// A device of one f32 sensor and one actuator, driven packet by packet.
template <class T>
struct Rig {
  explicit Rig(std::uint8_t dtype, float minimum, float maximum, float safe, float scale = 1,
               float offset = 0)
      : channels{{{0, SSW_SENSOR, SSW_F32, 1, -1e9F, 1e9F, 0, 1, 0, "echo", ""}, sensed.data(), nullptr},
                 {{0, SSW_ACTUATOR, dtype, 1, minimum, maximum, safe, scale, offset, "height", "u"},
                  values.data(),
                  next.data()}} {
    const ssw_hello hello{0, 0, kRows, kColumns, kPeriod_us, 1, 1, "rig"};
    ssd_init(
        &device, &hello, channels, 2,
        [](void* self, const std::uint8_t* b, std::size_t n) {
          Rig& rig = *static_cast<Rig*>(self);
          if (rig.full) return 0;
          rig.out.insert(rig.out.end(), b, b + n);
          return 1;
        },
        this);
    send(SSW_START, {});
  }
  void limit(const ssw_limits& limits) { ssd_limit(&device, 1, &limits, motion.data()); }
  void send(std::uint8_t type, const Bytes& payload) {
    std::uint8_t framed[SSW_MAX_ENCODED + 2];
    const ssw_packet packet{type, sequence++, device.tick, payload.data(), payload.size()};
    const std::size_t n = ssw_write(&packet, framed);
    for (std::size_t i = 0; i < n; ++i) ssd_receive(&device, framed[i]);
  }
  void send_reason(std::uint8_t type, std::uint32_t reason) {
    Bytes payload(4);
    ssw_put_u32(payload.data(), reason);
    send(type, payload);
  }
  void send_data(const std::vector<T>& raw) {
    Bytes payload(SSW_DATA_HEADER + raw.size() * sizeof(T));
    payload[0] = 1;
    for (std::size_t i = 0; i < raw.size(); ++i) {
      std::uint8_t* to = payload.data() + SSW_DATA_HEADER + i * sizeof(T);
      if constexpr (sizeof(T) == 4) ssw_put_f32(to, raw[i]);
      if constexpr (sizeof(T) == 2) ssw_put_u16(to, raw[i]);
      if constexpr (sizeof(T) == 1) *to = raw[i];
    }
    send(SSW_ACTUATOR_DATA, payload);
  }
  void send_end() {
    Bytes end(4);
    ssw_put_u32(end.data(), kCells);
    send(SSW_ACTUATOR_END, end);
  }
  void period(const std::vector<T>& raw) {
    send_data(raw);
    send_end();
    ssd_period(&device);
  }
  bool all(T raw) const {
    return std::ranges::all_of(values, [=](T v) { return v == raw; });
  }

  std::vector<float> sensed = std::vector<float>(kCells);
  std::vector<T> values = std::vector<T>(kCells), next = std::vector<T>(kCells);
  std::vector<ssd_motion> motion = std::vector<ssd_motion>(kCells);
  ssd_channel channels[2];
  ssd_device device;
  Bytes out;
  bool full = false;
  std::uint8_t sequence = 0;
};

std::vector<std::uint8_t> everywhere(std::uint8_t raw) { return std::vector<std::uint8_t>(kCells, raw); }

TEST(FirmwareSafety, WatchdogNeedsNoRoomOnTheLine) {
  Rig<std::uint8_t> rig(SSW_U8, 0, 4, 1, 0.02F);
  ssd_period(&rig.device);
  rig.period(everywhere(200));
  ASSERT_TRUE(rig.all(200));
  rig.full = true;  // the host is gone, and nobody reads the line
  for (unsigned i = 0; i + 2 < SSD_PATIENCE; ++i) ssd_period(&rig.device);
  EXPECT_TRUE(rig.all(200));
  ssd_period(&rig.device);
  EXPECT_TRUE(rig.all(50));
  EXPECT_EQ(rig.device.dropped, SSD_PATIENCE - 1);
}

TEST(FirmwareSafety, WatchdogRunsInInterruptsWhileTheMainLoopHangs) {
  Rig<std::uint8_t> rig(SSW_U8, 0, 4, 1, 0.02F);
  ssd_period(&rig.device);
  rig.period(everywhere(200));
  int applied = 0;
  EXPECT_EQ(ssd_watchdog(&rig.device, 1000), 0);  // sees the packets above
  for (int ms = 0; ms < 159; ++ms) applied += ssd_watchdog(&rig.device, 1000);
  EXPECT_EQ(applied, 0);
  EXPECT_TRUE(rig.all(200));
  EXPECT_EQ(ssd_watchdog(&rig.device, 1000), 1);
  EXPECT_TRUE(rig.all(50));
  EXPECT_EQ(ssd_watchdog(&rig.device, 1000), 0);
  EXPECT_TRUE(rig.all(50));
  // The main loop goes on, and with the host's next frame, so does the session.
  ssd_period(&rig.device);
  EXPECT_TRUE(rig.device.flags & SSW_SAFE);
  rig.period(everywhere(30));
  EXPECT_FALSE(rig.device.flags & SSW_SAFE);
  EXPECT_TRUE(rig.all(30));
}

// The neighbours of a board live on when the host is gone.
TEST(FirmwareSafety, EdgesDoNotFeedTheWatchdog) {
  Rig<std::uint8_t> rig(SSW_U8, 0, 4, 0, 0.02F);
  ssd_period(&rig.device);
  rig.period(everywhere(200));
  ssd_watchdog(&rig.device, 1000);
  for (unsigned i = 0; i < SSD_PATIENCE; ++i) {
    rig.send(SSW_EDGE, Bytes(8));
    ssd_watchdog(&rig.device, kPeriod_us);
  }
  EXPECT_TRUE(rig.all(0));
}

// Neighbours count their own packets.
TEST(FirmwareSafety, EdgesDoNotDiscardFrames) {
  Rig<std::uint8_t> rig(SSW_U8, 0, 4, 0, 0.02F);
  ssd_period(&rig.device);
  const auto send_edge = [&] {
    const std::uint8_t host = std::exchange(rig.sequence, 77);
    rig.send(SSW_EDGE, Bytes(8));
    rig.sequence = host;
  };
  rig.send_data(everywhere(200));
  send_edge();
  rig.send_end();
  ssd_period(&rig.device);
  EXPECT_TRUE(rig.all(200));
}

TEST(FirmwareSafety, DroppedPacketsLeaveNoGapInTheSequence) {
  Rig<std::uint8_t> rig(SSW_U8, 0, 4, 0, 0.02F);
  ssd_period(&rig.device);
  const std::uint8_t before = rig.device.sequence;
  rig.full = true;
  rig.period(everywhere(1));
  rig.full = false;
  EXPECT_EQ(rig.device.sequence, before);
  EXPECT_EQ(rig.device.dropped, 1u);
}

TEST(FirmwareSafety, RangeIsKeptOnTheDevice) {
  Rig<float> rig(SSW_F32, -1, 2, 0.5F);
  ssd_period(&rig.device);
  std::vector<float> wild(kCells, 1.5F);
  wild[0] = 7;
  wild[1] = -7;
  wild[2] = std::numeric_limits<float>::quiet_NaN();
  wild[3] = std::numeric_limits<float>::infinity();
  rig.period(wild);
  EXPECT_EQ(rig.values[0], 2);
  EXPECT_EQ(rig.values[1], -1);
  EXPECT_EQ(rig.values[2], 0.5F);
  EXPECT_EQ(rig.values[3], 2);
  EXPECT_EQ(rig.values[4], 1.5F);
  EXPECT_EQ(rig.device.clamped, 4u);
  Rig<std::uint16_t> scaled(SSW_U16, -5, 5, 0, 0.01F, -10);  // raw 500 … 1500
  ssd_period(&scaled.device);
  std::vector<std::uint16_t> raw(kCells, 1000);
  raw[0] = 499;
  raw[1] = 1501;
  scaled.period(raw);
  EXPECT_EQ(scaled.values[0], 500);
  EXPECT_EQ(scaled.values[1], 1500);
  EXPECT_EQ(scaled.values[2], 1000);
}

TEST(FirmwareSafety, EmergencyStopLatchesUntilItsReasonIsArmed) {
  Rig<std::uint8_t> rig(SSW_U8, 0, 4, 1, 0.02F);
  ssd_period(&rig.device);
  rig.period(everywhere(200));
  rig.send_reason(SSW_STOP_NOW, SSW_STOP_BY_HOST);
  EXPECT_TRUE(rig.all(50)) << "at once, not at the period's end";
  for (int i = 0; i < 50; ++i) rig.period(everywhere(200));
  EXPECT_TRUE(rig.all(50));
  EXPECT_TRUE(rig.device.flags & SSW_STOPPED);
  rig.send_reason(SSW_ARM, SSW_STOP_BY_LINE);
  rig.period(everywhere(200));
  EXPECT_TRUE(rig.all(50)) << "another reason";
  rig.send_reason(SSW_ARM, SSW_STOP_BY_HOST);
  EXPECT_TRUE(rig.all(50));
  rig.period(everywhere(200));
  EXPECT_TRUE(rig.all(200));
  ssd_stop(&rig.device, SSW_STOP_BY_LINE);
  EXPECT_TRUE(rig.all(50));
  rig.send_reason(SSW_ARM, SSW_NONE);
  rig.period(everywhere(200));
  EXPECT_TRUE(rig.all(200));
}

// Firmware calls ssd_stop in each period in which the line is pressed.
TEST(FirmwareSafety, HeldLineStopsAgain) {
  Rig<std::uint8_t> rig(SSW_U8, 0, 4, 1, 0.02F);
  const auto period = [&](bool is_pressed) {
    rig.send_data(everywhere(200));
    rig.send_end();
    if (is_pressed) ssd_stop(&rig.device, SSW_STOP_BY_LINE);
    ssd_period(&rig.device);
  };
  ssd_stop(&rig.device, SSW_STOP_BY_LINE);  // pressed as the device starts
  ssd_period(&rig.device);
  for (int i = 0; i < 100; ++i) {
    if (i % 10 == 9) rig.send_reason(SSW_ARM, SSW_NONE);
    period(true);
    ASSERT_TRUE(rig.all(50)) << i;
    ASSERT_TRUE(rig.device.flags & SSW_STOPPED) << i;
  }
  EXPECT_EQ(rig.device.missed, 10u) << "answers that a new stop discards";
  rig.send_reason(SSW_ARM, SSW_STOP_BY_LINE);
  period(false);
  EXPECT_TRUE(rig.all(200));
}

// Random limits and targets: speed, change of speed, number of moving elements and range are never exceeded,
// and once the targets rest, all elements arrive, in the time that the limits allow.
TEST(FirmwareSafety, LimitsHoldForRandomTargets) {
  std::mt19937_64 random(7);
  const auto uniform = [&](double a, double b) {
    return a + (b - a) * static_cast<double>(random() >> 11) * 0x1p-53;
  };
  for (int trial = 0; trial < 300; ++trial) {
    Rig<float> rig(SSW_F32, -2, 3, 0.25F);
    ssw_limits limits{};
    if (random() % 4) limits.slew = static_cast<float>(uniform(0.5, 60));
    if (random() % 2) limits.acceleration = static_cast<float>(uniform(20, 4000));
    if (random() % 2) limits.soft_start = static_cast<float>(uniform(0.2, 5));
    if (random() % 2) limits.most_moving = static_cast<std::uint16_t>(1 + random() % kCells);
    rig.limit(limits);
    ssd_period(&rig.device);
    constexpr double dt = kPeriod_us * 1e-6;
    const double v_most = limits.slew > 0 ? limits.slew * dt : 1e9, a_most = limits.acceleration * dt * dt;
    std::vector<float> before = rig.values, speed(kCells, 0), target(kCells);
    int periods = 0, settled_at = -1;
    for (; periods < 30'000 && settled_at < 0; ++periods) {
      if (periods < 200 && periods % (1 + trial % 17) == 0)
        for (float& t : target) t = static_cast<float>(uniform(-3, 4));
      const bool soft = periods == 0 && limits.soft_start > 0;
      rig.period(target);
      int moving = 0;
      for (int c = 0; c < kCells; ++c) {
        const float v = rig.values[c] - before[c];
        moving += v != 0;
        ASSERT_GE(rig.values[c], -2.0F);
        ASSERT_LE(rig.values[c], 3.0F);
        ASSERT_LE(std::abs(v), v_most + 1e-5) << trial << " period " << periods;
        if (soft) {
          ASSERT_LE(std::abs(v), limits.soft_start * dt + 1e-5) << trial;
        }
        if (a_most > 0) {
          ASSERT_LE(std::abs(v - speed[c]), a_most + 1e-5) << trial << " period " << periods << " cell " << c;
        }
        speed[c] = v;
      }
      if (limits.most_moving) {
        ASSERT_LE(moving, limits.most_moving) << trial;
      }
      before = rig.values;
      bool there = periods >= 200;
      for (int c = 0; c < kCells && there; ++c)
        there = rig.values[c] == std::clamp(target[c], -2.0F, 3.0F) && speed[c] == 0;
      if (there) settled_at = periods;
    }
    ASSERT_GE(settled_at, 0) << "trial " << trial << " slew " << limits.slew << " acceleration "
                             << limits.acceleration << " most " << limits.most_moving;
    EXPECT_FALSE(rig.device.flags & SSW_LIMITED);
  }
}

// One element under both limits takes the time of the trapezoidal profile: d/v + v/a.
TEST(FirmwareSafety, LimitedMotionTakesTheTimeOfItsProfile) {
  Rig<float> rig(SSW_F32, 0, 100, 0);
  rig.limit({20.0F, 200.0F, 0, 0});
  ssd_period(&rig.device);
  int periods = 0;
  while (rig.values[0] < 10.0F && periods < 1000) rig.period(std::vector<float>(kCells, 10.0F)), ++periods;
  EXPECT_NEAR(periods * kPeriod_us * 1e-6, 10.0 / 20 + 20.0 / 200, 0.021);
}

// Elements that wait for their turn get it, although the others never arrive.
TEST(FirmwareSafety, EveryElementGetsItsTurn) {
  Rig<float> rig(SSW_F32, 0, 10, 0);
  rig.limit({1.0F, 0, 0, 2});
  ssd_period(&rig.device);
  for (int i = 0; i < 300; ++i) rig.period(std::vector<float>(kCells, i % 2 ? 10.0F : 9.0F));
  for (const float v : rig.values) EXPECT_GT(v, 0.0F);
}

// A raw value moves slower than one step per period.
TEST(FirmwareSafety, SlewBelowOneStepPerPeriod) {
  Rig<std::uint8_t> rig(SSW_U8, 0, 4, 0, 0.02F);
  rig.limit({0.2F, 0, 0, 0});  // a tenth of a step per period
  ssd_period(&rig.device);
  for (int i = 0; i < 100; ++i) rig.period(everywhere(200));
  EXPECT_TRUE(rig.all(10));
}

TEST(FirmwareSafety, SoftStartFollowsTheSafeValues) {
  Rig<std::uint8_t> rig(SSW_U8, 0, 4, 0, 0.02F);
  rig.limit({0, 0, 2.0F, 0});  // one step per period
  ssd_period(&rig.device);
  for (int i = 1; i <= 100; ++i) {
    rig.period(everywhere(100));
    ASSERT_TRUE(rig.all(static_cast<std::uint8_t>(i)));
    ASSERT_TRUE(rig.device.flags & SSW_SOFT_START);
  }
  rig.period(everywhere(100));
  EXPECT_FALSE(rig.device.flags & SSW_SOFT_START);
  rig.period(everywhere(0));
  EXPECT_TRUE(rig.all(0)) << "full speed after the start";
  rig.period(everywhere(100));
  rig.send_reason(SSW_STOP_NOW, SSW_STOP_BY_HOST);
  rig.send_reason(SSW_ARM, SSW_STOP_BY_HOST);
  rig.period(everywhere(100));
  EXPECT_TRUE(rig.all(1));
}

}  // namespace
}  // namespace hardware
