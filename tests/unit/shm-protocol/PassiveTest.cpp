// Passive mode with both sides in one process: newest complete frame, skipped frames, torn frames.
#include <gtest/gtest.h>
#include <shm_protocol/ControllerEndpoint.h>

#include <algorithm>

#include "tests/unit/shm-protocol/RawSegment.h"

namespace shm_protocol {
namespace {

using namespace std::chrono_literals;

struct PassivePair {
  explicit PassivePair(const std::string& what)
      : name(unique_name(what)),
        surface(SurfaceEndpoint::create(small_surface(name, Mode::kPassive))),
        controller(std::make_unique<ControllerEndpoint>(ControllerEndpoint::attach(name))) {}

  void publish_sensors(float value) {
    std::ranges::fill(surface.sensor(kDistance), value);
    EXPECT_EQ(surface.publish(tick++, 0.0), Status::kOk);
  }
  void publish_actuators(float value) {
    std::ranges::fill(controller->actuator(kHeight), value);
    EXPECT_EQ(controller->publish(), Status::kOk);
  }

  std::string name;
  SurfaceEndpoint surface;
  std::unique_ptr<ControllerEndpoint> controller;
  std::uint64_t tick = 0;
};

TEST(Passive, ControllerReadsNewestFrameAndCountsSkipped) {
  PassivePair p("newest");
  EXPECT_EQ(p.controller->latest_sensors(), Status::kRepeated);  // no frame yet
  for (int i = 1; i <= 3; ++i) p.publish_sensors(static_cast<float>(i));
  ASSERT_EQ(p.controller->latest_sensors(), Status::kOk);
  EXPECT_EQ(p.controller->sensor(kDistance)[34], 3.0f);
  EXPECT_EQ(p.controller->counters().skipped, 0u);  // frames before the first one taken are not counted
  for (int i = 4; i <= 9; ++i) p.publish_sensors(static_cast<float>(i));
  ASSERT_EQ(p.controller->latest_sensors(), Status::kOk);
  EXPECT_EQ(p.controller->sensor(kDistance)[0], 9.0f);
  EXPECT_EQ(p.controller->sensor_info().tick, 8u);
  EXPECT_EQ(p.controller->counters().skipped, 5u);
  EXPECT_EQ(p.controller->latest_sensors(), Status::kRepeated);
  EXPECT_EQ(p.controller->counters().repeated, 2u);
  EXPECT_EQ(p.surface.controller_counters().skipped, 5u);
  EXPECT_EQ(p.surface.controller_counters().repeated, 2u);
}

TEST(Passive, SurfaceReadsNewestFrameAndCountsSkipped) {
  PassivePair p("counts");
  EXPECT_EQ(p.surface.latest_actuators(), Status::kRepeated);
  p.publish_sensors(1);
  ASSERT_EQ(p.controller->await_sensors({.timeout = 0ns}), Status::kOk);
  for (int i = 1; i <= 4; ++i) p.publish_actuators(static_cast<float>(i));
  ASSERT_EQ(p.surface.latest_actuators(), Status::kOk);
  EXPECT_EQ(p.surface.actuator(kHeight)[34], 4.0f);
  EXPECT_EQ(p.surface.actuator_info().answers, 1u);
  EXPECT_EQ(p.surface.counters().skipped, 3u);
  EXPECT_EQ(p.surface.latest_actuators(), Status::kRepeated);
  EXPECT_EQ(p.controller->surface_counters().skipped, 3u);
  EXPECT_EQ(p.controller->surface_counters().repeated, 2u);
}

TEST(Passive, IncompleteFrameIsTornAndPreviousIsKept) {
  PassivePair p("torn");
  RawSegment raw(p.name);
  p.publish_sensors(1);
  p.publish_actuators(1);
  ASSERT_EQ(p.controller->latest_sensors(), Status::kOk);
  ASSERT_EQ(p.surface.latest_actuators(), Status::kOk);
  p.publish_sensors(2);
  p.publish_actuators(2);
  raw.sensor_slot(2).sequence = 2 * 6 - 1;  // as if the surface were writing frame 6 there
  raw.actuator_slot(2).sequence = 2 * 6 - 1;
  EXPECT_EQ(p.controller->latest_sensors(), Status::kTorn);
  EXPECT_EQ(p.controller->sensor(kDistance)[0], 1.0f);
  EXPECT_EQ(p.controller->sensor_info().frame, 1u);
  EXPECT_EQ(p.surface.latest_actuators(), Status::kTorn);
  EXPECT_EQ(p.surface.actuator(kHeight)[0], 1.0f);
  raw.sensor_slot(2).sequence = 4;
  raw.actuator_slot(2).sequence = 4;
  EXPECT_EQ(p.controller->latest_sensors(), Status::kOk);
  EXPECT_EQ(p.surface.latest_actuators(), Status::kOk);
  EXPECT_EQ(p.surface.actuator(kHeight)[0], 2.0f);
}

TEST(Passive, DiscardsUnreadFramesOfLostController) {
  PassivePair p("lost");
  p.publish_actuators(1);
  ASSERT_EQ(p.surface.latest_actuators(), Status::kOk);
  p.publish_actuators(2);
  p.controller.reset();
  EXPECT_EQ(p.surface.latest_actuators(), Status::kControllerClosed);
  EXPECT_EQ(p.surface.latest_actuators(), Status::kNoController);
  EXPECT_EQ(p.surface.actuator(kHeight)[0], 1.0f);
  p.controller = std::make_unique<ControllerEndpoint>(ControllerEndpoint::attach(p.name));
  EXPECT_EQ(p.surface.latest_actuators(), Status::kRepeated);
  p.publish_actuators(3);
  EXPECT_EQ(p.surface.latest_actuators(), Status::kOk);
  EXPECT_EQ(p.surface.actuator(kHeight)[0], 3.0f);
  EXPECT_EQ(p.surface.counters().skipped, 0u);
}

}  // namespace
}  // namespace shm_protocol
