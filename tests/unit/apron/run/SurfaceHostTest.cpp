// SurfaceHost against a surface endpoint in another thread: frames, dtypes, components, refusals, shutdown,
// allocations.
#include "apron/run/host/SurfaceHost.h"

#include <gtest/gtest.h>
#include <shm_protocol/SurfaceEndpoint.h>
#include <unistd.h>

#include <cmath>
#include <thread>

#include "apron/vm/PlaneStore.h"
#include "tests/unit/common/AllocationCounter.h"

namespace apron::run {
namespace {

using shm_protocol::Direction;
using shm_protocol::DType;
using shm_protocol::Mode;
using shm_protocol::Status;
using shm_protocol::SurfaceEndpoint;
using vm::HostStatus;
using vm::Plane;

constexpr std::uint32_t kRows = 3, kColumns = 5;
enum Channel { kProximity, kForce, kTouch, kHeight, kMode, kDrive, kTemperature, kVelocity };
// Longer than what std::string holds without an allocation.
constexpr const char* kLongSensor = "temperature_of_the_cell";
constexpr const char* kLongActuator = "tangential_velocity";

SurfaceEndpoint create(const std::string& name, Mode mode) {
  shm_protocol::SurfaceConfig config;
  config.name = name;
  config.rows = kRows;
  config.columns = kColumns;
  config.period_ns = 20'000'000;
  config.mode = mode;
  config.channels = {{"proximity", Direction::kSensor, DType::kF32, 1, "u", 0, 100, 0},
                     {"force", Direction::kSensor, DType::kF32, 3, "N", -10, 10, 0},
                     {"touch", Direction::kSensor, DType::kU8, 1, "", 0, 1, 0},
                     {"height", Direction::kActuator, DType::kF32, 1, "u", 0, 8, 4},
                     {"mode", Direction::kActuator, DType::kU8, 1, "", 0, 255, 7},
                     {"drive", Direction::kActuator, DType::kF32, 2, "u/s", -10, 10, 1},
                     {kLongSensor, Direction::kSensor, DType::kF32, 3, "K", 0, 400, 0},
                     {kLongActuator, Direction::kActuator, DType::kF32, 2, "u/s", -10, 10, 0}};
  return SurfaceEndpoint::create(config);
}

// In frame k, proximity cell i is k + i, force component c is c in every cell, and touch is k.
void publish(SurfaceEndpoint& surface, std::uint64_t tick) {
  const auto proximity = surface.sensor(kProximity), force = surface.sensor(kForce);
  const auto touch = surface.sensor<std::uint8_t>(kTouch);
  for (std::size_t i = 0; i < kRows * kColumns; ++i) {
    proximity[i] = static_cast<float>(tick + i);
    touch[i] = static_cast<std::uint8_t>(tick);
    for (std::size_t c = 0; c < 3; ++c) force[c * kRows * kColumns + i] = static_cast<float>(c);
  }
  ASSERT_EQ(surface.publish(tick, static_cast<double>(tick) * 0.02), Status::kOk);
}

// Unique per process and test, and short enough for a segment's name.
std::string test_surface_name() {
  const auto* test = testing::UnitTest::GetInstance()->current_test_info();
  return "ah_" + std::to_string(getpid()) + "_" + std::string(test->name()).substr(0, 20);
}

class SurfaceHostTest : public testing::Test {
 protected:
  // A surface, and a host attached to it.
  struct Connection {
    explicit Connection(Mode mode) : surface(create(test_surface_name(), mode)) {}
    // Publishes a frame, which the host takes as its first.
    void begin(std::uint64_t tick) {
      publish(surface, tick);
      ASSERT_EQ(host.await_first_frame(), HostStatus::kOk);
    }

    std::atomic<bool> stop{false};
    SurfaceEndpoint surface;
    shm_protocol::ControllerEndpoint endpoint = shm_protocol::ControllerEndpoint::attach(
        surface.description().name, {.timeout = std::chrono::seconds(10)});
    SurfaceHost host{endpoint, stop, {}};
  };

  vm::PlaneStore store_;
};

TEST_F(SurfaceHostTest, RunsInLockStep) {
  constexpr std::uint64_t kTicks = 50;
  Connection c(Mode::kTimeStep);
  std::thread physics([&] {
    for (std::uint64_t tick = 0; tick < kTicks; ++tick) {
      publish(c.surface, tick);
      ASSERT_EQ(c.surface.await_actuators(tick), Status::kOk);
      // The safe value until the program writes the channel.
      const float want = tick == 0 ? 4.0F : static_cast<float>(tick) / 10;
      for (const float height : c.surface.actuator(kHeight)) ASSERT_EQ(height, want);
      for (const std::uint8_t mode : c.surface.actuator<std::uint8_t>(kMode))
        ASSERT_EQ(mode, tick == 0 ? 7 : 3);
    }
    c.surface.set_state(shm_protocol::State::kClosing);
  });
  const Plane p = store_.allocate(kColumns, kRows);
  ASSERT_EQ(c.host.await_first_frame(), HostStatus::kOk);
  EXPECT_EQ(c.host.dt_s(), 0.02);
  for (std::uint64_t tick = 0; tick < kTicks; ++tick) {
    EXPECT_EQ(c.host.tick(), static_cast<double>(tick));
    EXPECT_EQ(c.host.time_s(), static_cast<double>(tick) * 0.02);
    ASSERT_EQ(c.host.sense("proximity", p), HostStatus::kOk);
    for (std::uint32_t i = 0; i < kRows * kColumns; ++i)
      ASSERT_EQ(p.row(i / kColumns)[i % kColumns], static_cast<float>(tick + i));
    ASSERT_EQ(c.host.sense("touch", p), HostStatus::kOk);
    ASSERT_EQ(p.row(2)[4], static_cast<float>(tick));
    ASSERT_EQ(c.host.sense("force[2]", p), HostStatus::kOk);
    ASSERT_EQ(p.row(1)[1], 2.0F);
    ASSERT_EQ(c.host.sense("force.g", p), HostStatus::kOk);
    ASSERT_EQ(p.row(1)[1], 1.0F);
    if (tick > 0) {
      for (std::uint32_t i = 0; i < kRows * kColumns; ++i)
        p.row(i / kColumns)[i % kColumns] = static_cast<float>(tick) / 10;
      ASSERT_EQ(c.host.actuate("height", p), HostStatus::kOk);
      if (tick == 1) {
        ASSERT_EQ(c.host.actuate("mode", 3.2F), HostStatus::kOk);  // continues in later frames
      }
    }
    ASSERT_EQ(c.host.step(), tick + 1 < kTicks ? HostStatus::kOk : HostStatus::kClosed);
  }
  physics.join();
}

TEST_F(SurfaceHostTest, PassiveStepsWaitForAFrame) {
  Connection c(Mode::kPassive);
  c.begin(8);
  publish(c.surface, 9);
  publish(c.surface, 10);
  ASSERT_EQ(c.host.step(), HostStatus::kOk);
  EXPECT_EQ(c.host.tick(), 10.0);
  c.stop = true;
  ASSERT_EQ(c.host.actuate("height", 2.5F), HostStatus::kOk);
  EXPECT_EQ(c.host.step(), HostStatus::kInterrupted);  // there is no frame
  ASSERT_EQ(c.surface.latest_actuators(), Status::kOk);
  EXPECT_EQ(c.surface.actuator(kHeight)[0], 2.5F);  // published before the wait
  c.stop = false;
  publish(c.surface, 11);
  EXPECT_EQ(c.host.step(), HostStatus::kOk);
  EXPECT_EQ(c.host.tick(), 11.0);
}

TEST_F(SurfaceHostTest, PassiveStepsThatRunFreeDoNotWait) {
  Connection c(Mode::kPassive);
  c.begin(8);
  c.host.set_free_run(true);
  ASSERT_EQ(c.host.actuate("height", 2.5F), HostStatus::kOk);
  ASSERT_EQ(c.host.step(), HostStatus::kOk);  // no new frame
  EXPECT_EQ(c.host.tick(), 8.0);
  ASSERT_EQ(c.surface.latest_actuators(), Status::kOk);
  EXPECT_EQ(c.surface.actuator(kHeight)[0], 2.5F);
  publish(c.surface, 9);
  publish(c.surface, 10);
  ASSERT_EQ(c.host.step(), HostStatus::kOk);
  EXPECT_EQ(c.host.tick(), 10.0);
}

// Frames alternate between two slots, so unwritten components must be copied from the latest frame.
TEST_F(SurfaceHostTest, UnwrittenComponentsKeepTheLastFrame) {
  Connection c(Mode::kPassive);
  c.begin(0);
  c.host.set_free_run(true);
  constexpr std::size_t kCells = kRows * kColumns;
  const auto step_and_expect = [&](float drive_x, float drive_y, float height) {
    ASSERT_EQ(c.host.step(), HostStatus::kOk);
    ASSERT_EQ(c.surface.latest_actuators(), Status::kOk);
    const auto drive = c.surface.actuator(kDrive);
    for (std::size_t i = 0; i < kCells; ++i) {
      ASSERT_EQ(drive[i], drive_x);
      ASSERT_EQ(drive[kCells + i], drive_y);
      ASSERT_EQ(c.surface.actuator(kHeight)[i], height);
    }
  };
  ASSERT_EQ(c.host.actuate("drive[1]", 2.0F), HostStatus::kOk);
  step_and_expect(1, 2, 4);
  ASSERT_EQ(c.host.actuate("drive[0]", 9.0F), HostStatus::kOk);
  ASSERT_EQ(c.host.actuate("drive[0]", 3.0F), HostStatus::kOk);  // the last value counts
  step_and_expect(3, 2, 4);
  ASSERT_EQ(c.host.actuate("height", 5.0F), HostStatus::kOk);
  for (int i = 0; i < 6; ++i) step_and_expect(3, 2, 5);
}

TEST_F(SurfaceHostTest, IntegerChannelsClampAndReplaceNaN) {
  Connection c(Mode::kPassive);
  c.begin(0);
  const Plane p = store_.allocate(kColumns, kRows);
  const float values[] = {NAN, INFINITY, -5, 2.6F, 1e20F}, want[] = {7, 255, 0, 3, 255};
  std::copy(values, values + 5, p.row(0));
  ASSERT_EQ(c.host.actuate("mode", p), HostStatus::kOk);
  publish(c.surface, 1);
  ASSERT_EQ(c.host.step(), HostStatus::kOk);
  ASSERT_EQ(c.surface.latest_actuators(), Status::kOk);
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(c.surface.actuator<std::uint8_t>(kMode)[i], want[i]) << i;
}

TEST_F(SurfaceHostTest, RefusesUnknownChannelsAndWrongShapes) {
  Connection c(Mode::kPassive);
  c.begin(0);
  const Plane p = store_.allocate(kColumns, kRows), other = store_.allocate(kRows, kColumns);
  EXPECT_EQ(c.host.sense("proximty", p), HostStatus::kRefused);
  EXPECT_EQ(c.host.message(),
            "the surface has no sensor channel 'proximty'; its sensor channels: proximity, force, touch, "
            "temperature_of_the_cell");
  EXPECT_EQ(c.host.actuate("proximity", 1.0F), HostStatus::kRefused);
  EXPECT_EQ(c.host.message(),
            "the surface has no actuator channel 'proximity'; its actuator channels: height, mode, drive, "
            "tangential_velocity");
  EXPECT_EQ(c.host.sense("proximity", other), HostStatus::kRefused);
  EXPECT_EQ(c.host.message(), "channel 'proximity' is 5x3, but the register is 3x5");
  for (const char* bad :
       {"force", "force[3]", "force[", "force[]", "force[0", "force[-1]", "force[0]x", "proximity[1]"})
    EXPECT_EQ(c.host.sense(bad, p), HostStatus::kRefused) << bad;
  EXPECT_EQ(c.host.sense("proximity[0]", p), HostStatus::kOk);
  EXPECT_TRUE(c.host.has("height"));
  EXPECT_TRUE(c.host.has("proximity"));
  EXPECT_FALSE(c.host.has("pressure"));
  EXPECT_TRUE(c.host.has("force"));
  EXPECT_TRUE(c.host.has("force[2]"));
  EXPECT_FALSE(c.host.has("force[3]"));
}

#ifdef COUNTS_ALLOCATIONS
TEST_F(SurfaceHostTest, TicksDoNotAllocate) {
  Connection c(Mode::kPassive);
  c.begin(0);
  c.host.set_free_run(true);
  const Plane p = store_.allocate(kColumns, kRows);
  const std::size_t before = allocations;
  for (int tick = 0; tick < 10; ++tick) {
    ASSERT_TRUE(c.host.has("tangential_velocity"));
    ASSERT_EQ(c.host.sense("temperature_of_the_cell[2]", p), HostStatus::kOk);
    ASSERT_EQ(c.host.sense("temperature_of_the_cell.g", p), HostStatus::kOk);
    ASSERT_EQ(c.host.actuate("tangential_velocity[0]", p), HostStatus::kOk);
    ASSERT_EQ(c.host.actuate("tangential_velocity[1]", 2.0F), HostStatus::kOk);
    ASSERT_EQ(c.host.step(), HostStatus::kOk);
  }
  EXPECT_EQ(allocations, before);
}
#endif

TEST_F(SurfaceHostTest, StopFlagInterruptsWait) {
  Connection c(Mode::kTimeStep);
  std::thread other([&] { c.stop = true; });
  EXPECT_EQ(c.host.await_first_frame(), HostStatus::kInterrupted);
  other.join();
}

}  // namespace
}  // namespace apron::run
