// The emulated array of pillars with touch: its ball rolls down what the host commands, and loads the pillars
// under it.
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "shm-protocol/hardware/bridge/DeviceLink.h"
#include "shm-protocol/hardware/fake/PillarDevice.h"

namespace hardware {
namespace {

constexpr std::uint16_t kEdge = 16;  // pillars along each edge

struct PillarHarness {
  PillarHarness()
      : device(kEdge, kEdge, 10'000, [this](const std::uint8_t* b, std::size_t n) {
          out.insert(out.end(), b, b + n);
          return true;
        }) {
    link.write(SSW_DESCRIBE, 0, in);
    link.write(SSW_START, 0, in);
    deliver();
  }
  void deliver() {
    for (const std::uint8_t b : std::exchange(in, {})) device.receive(b);
    for (const std::uint8_t b : std::exchange(out, {})) link.receive(b);
  }
  // Periods in which the pillars are commanded to slope · the distance from the middle, in cells.
  void run(int periods, float slope) {
    std::vector<float> heights;
    const float middle = 0.5F * (kEdge - 1);
    for (int row = 0; row < kEdge; ++row)
      for (int column = 0; column < kEdge; ++column)
        heights.push_back(slope *
                          std::hypot(static_cast<float>(row) - middle, static_cast<float>(column) - middle));
    for (int i = 0; i < periods; ++i) {
      device.period();
      deliver();
      link.write_frame(link.frame().tick, heights, in);
      deliver();
    }
  }

  std::vector<std::uint8_t> in, out;
  PillarDevice device;
  DeviceLink link;
};

TEST(PillarDevice, BallRestsOnLevelPillarsAndLoadsThem) {
  PillarHarness h;
  const double before = h.device.distance();
  h.run(200, 0.0F);
  EXPECT_GT(before, 1.0);
  EXPECT_EQ(h.device.distance(), before);
  const std::vector<float>& pressure = h.link.frame().values;
  ASSERT_EQ(pressure.size(), std::size_t{kEdge * kEdge});
  EXPECT_NEAR(std::accumulate(pressure.begin(), pressure.end(), 0.0F), 9.81F,
              0.2F);  // its weight, in kg·cm/s²
}

TEST(PillarDevice, BallRollsIntoABowl) {
  PillarHarness h;
  h.run(600, 0.3F);
  EXPECT_LT(h.device.distance(), 0.5);
}

TEST(PillarDevice, BallIsPlacedAnewEveryTenSeconds) {
  PillarHarness h;
  h.run(995, 0.3F);
  const double settled = h.device.distance();
  h.run(10, 0.3F);
  EXPECT_GT(h.device.distance(), settled + 1.0);
  EXPECT_LT(h.device.seconds_since_placed(), 0.1);
}

}  // namespace
}  // namespace hardware
