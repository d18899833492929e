// The fake hardware in C, driven by a controller that knows what its sensors must show.
#include <gtest/gtest.h>
#include <shm_protocol/ControllerEndpoint.h>

#include <cmath>

#include "shm-protocol/hardware/fake/toy.h"
#include "tests/system/hardware/Program.h"

namespace hardware {
namespace {

using namespace std::chrono_literals;
using shm_protocol::ControllerEndpoint;
using shm_protocol::Direction;
using shm_protocol::Status;

TEST(FakeSurface, SensorsShowDiscsAndPinsFollowTargets) {
  const std::string name = surface_name("fake");
  Program fake({FAKE_SURFACE, "--shm", name, "--size", "24x16", "--ticks", "300"});
  auto controller = ControllerEndpoint::attach(name, {.timeout = 60s});
  const auto& d = controller.description();
  ASSERT_EQ(d.columns, 24u);
  ASSERT_EQ(d.rows, 16u);
  const int hit = d.channel(Direction::kSensor, "proximity_hit"),
            pin = d.channel(Direction::kSensor, "pin_height");
  const int height = d.channel(Direction::kActuator, "height");
  ASSERT_TRUE(hit >= 0 && pin >= 0 && height >= 0);
  float expected_pin = 0;
  for (std::uint64_t tick = 0; tick < 300; ++tick) {
    ASSERT_EQ(controller.await_sensors({.timeout = 60s}), Status::kOk);
    ASSERT_EQ(controller.sensor_info().tick, tick);
    for (std::uint32_t cell = 0; cell < 24 * 16; ++cell) {
      ASSERT_EQ(controller.sensor(hit)[cell],
                static_cast<float>(toy_hit(16, 24, tick, cell / 24, cell % 24)));
      ASSERT_EQ(controller.sensor(pin)[cell], expected_pin);
    }
    std::ranges::fill(controller.actuator(height), 3.0F);
    ASSERT_EQ(controller.publish(), Status::kOk);
    expected_pin = toy_follow(expected_pin, 3.0F);
  }
  EXPECT_EQ(controller.await_sensors({.timeout = 60s}), Status::kSurfaceClosed);
  EXPECT_EQ(fake.wait(), 0);
  EXPECT_FALSE(segment_exists(name));
}

TEST(FakeSurface, RunsUnchangedCaseStudy) {
  const std::string name = surface_name("fake-sort");
  for (const char* mode : {"time-step", "passive"}) {
    Program fake({FAKE_SURFACE, "--shm", name, "--size", "32x32", "--mode", mode, "--period-ms", "1"});
    fake.await_output("waiting");
    Program apron({APRON, "run", CASE_STUDY, "--shm", name, "--ticks", "200"});
    EXPECT_EQ(apron.wait(), 0) << apron.output();
    Program next({APRON, "run", CASE_STUDY, "--shm", name, "--ticks", "10"});  // in the same session
    EXPECT_EQ(next.wait(), 0) << next.output();
    fake.signal(SIGINT);
    EXPECT_EQ(fake.wait(), 130);
    EXPECT_FALSE(segment_exists(name));
  }
}

TEST(FakeSurface, InvalidInputIsOneLineError) {
  for (const std::vector<std::string>& flags : {std::vector<std::string>{"--size", "0x4"},
                                                {"--size", "4"},
                                                {"--period-ms", "0"},
                                                {"--mode", "fast"},
                                                {"--ticks", "many"},
                                                {"--shm", ".hidden"},
                                                {"extra"}}) {
    std::vector<std::string> words{FAKE_SURFACE};
    words.insert(words.end(), flags.begin(), flags.end());
    Program fake(words);
    EXPECT_EQ(fake.wait(), 2) << flags[0];
    const std::string said = fake.output();
    EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
  }
  Program help({FAKE_SURFACE, "--help"});
  EXPECT_EQ(help.wait(), 0);
}

}  // namespace
}  // namespace hardware
