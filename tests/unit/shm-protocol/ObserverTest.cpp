// Observers: complete frames of both directions through a read-only mapping, without side effects.
#include <gtest/gtest.h>
#include <shm_protocol/ControllerEndpoint.h>
#include <shm_protocol/ObserverEndpoint.h>

#include <algorithm>
#include <fstream>
#include <thread>

#include "tests/unit/shm-protocol/RawSegment.h"

namespace shm_protocol {
namespace {

using namespace std::chrono_literals;

// The flags ("r--s", "rw-s") of this process's mappings of the segment.
std::vector<std::string> mappings_of(const std::string& name) {
  std::vector<std::string> flags;
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);)
    if (line.ends_with(file_path(name))) flags.push_back(line.substr(line.find(' ') + 1, 4));
  return flags;
}

TEST(Observer, MapsReadOnly) {
  const auto config = small_surface(unique_name("ro"));
  auto surface = SurfaceEndpoint::create(config);
  auto observer = ObserverEndpoint::attach(config.name);
  auto flags = mappings_of(config.name);
  std::ranges::sort(flags);
  EXPECT_EQ(flags, (std::vector<std::string>{"r--s", "rw-s"}));
}

TEST(Observer, DoesNotModifyTheSegment) {
  const auto config = small_surface(unique_name("bytes"));
  auto surface = SurfaceEndpoint::create(config);
  auto controller = ControllerEndpoint::attach(config.name);
  ASSERT_EQ(surface.publish(1, 0.0), Status::kOk);
  ASSERT_EQ(controller.await_sensors(), Status::kOk);
  ASSERT_EQ(controller.publish(), Status::kOk);
  RawSegment raw(config.name);
  const auto before = raw.copy();
  {
    auto observer = ObserverEndpoint::attach(config.name);
    EXPECT_EQ(observer.latest(Direction::kSensor), Status::kOk);
    EXPECT_EQ(observer.latest(Direction::kActuator), Status::kOk);
    EXPECT_EQ(observer.await(Direction::kSensor, {.timeout = 5ms}), Status::kTimeout);
    (void)observer.surface_state();
    (void)observer.controller_counters();
  }
  EXPECT_EQ(raw.copy(), before);
}

TEST(Observer, ReadsBothDirectionsUnchecked) {
  const auto config = small_surface(unique_name("both"));
  auto surface = SurfaceEndpoint::create(config);
  auto controller = ControllerEndpoint::attach(config.name);
  auto observer = ObserverEndpoint::attach(config.name);
  EXPECT_EQ(observer.latest(Direction::kSensor), Status::kRepeated);
  EXPECT_EQ(observer.info(Direction::kSensor).frame, 0u);
  EXPECT_EQ(observer.array(kDistance)[0], 0.0f);

  std::ranges::fill(surface.sensor(kDistance), 3.0f);
  std::ranges::fill(surface.sensor<std::uint8_t>(kColour), std::uint8_t{9});
  std::ranges::fill(surface.sensor<std::uint32_t>(kFlags), 70'000u);
  ASSERT_EQ(surface.publish(41, 0.5, 6), Status::kOk);
  ASSERT_EQ(observer.latest(Direction::kSensor), Status::kOk);
  EXPECT_EQ(observer.array(kDistance)[34], 3.0f);
  EXPECT_EQ(observer.array<std::uint8_t>(kColour).size(), 3u * 35);
  EXPECT_EQ(observer.array<std::uint8_t>(kColour)[104], 9);
  EXPECT_EQ(observer.array<std::uint32_t>(kFlags)[0], 70'000u);
  EXPECT_EQ(observer.info(Direction::kSensor).tick, 41u);
  EXPECT_EQ(observer.info(Direction::kSensor).status, 6u);
  EXPECT_EQ(observer.latest(Direction::kSensor), Status::kRepeated);

  ASSERT_EQ(controller.await_sensors(), Status::kOk);
  std::ranges::fill(controller.actuator(kHeight), 99.0f);  // out of range: returned unchecked
  ASSERT_EQ(controller.publish(), Status::kOk);
  ASSERT_EQ(observer.latest(Direction::kActuator), Status::kOk);
  EXPECT_EQ(observer.array(kHeight)[0], 99.0f);
  EXPECT_EQ(observer.info(Direction::kActuator).answers, 1u);
  ASSERT_EQ(surface.await_actuators(41), Status::kOk);
  EXPECT_EQ(observer.surface_counters().clamped, 35u);
  EXPECT_EQ(observer.published(Direction::kActuator), 1u);
}

TEST(Observer, TakesNewestFrameAndSkipsOlder) {
  const auto config = small_surface(unique_name("newest"), Mode::kPassive);
  auto surface = SurfaceEndpoint::create(config);
  auto observer = ObserverEndpoint::attach(config.name);
  for (std::uint64_t tick = 0; tick < 11; ++tick) {
    std::ranges::fill(surface.sensor(kDistance), static_cast<float>(tick));
    ASSERT_EQ(surface.publish(tick, 0.0), Status::kOk);
  }
  ASSERT_EQ(observer.latest(Direction::kSensor), Status::kOk);
  EXPECT_EQ(observer.info(Direction::kSensor).frame, 11u);
  EXPECT_EQ(observer.array(kDistance)[7], 10.0f);
}

TEST(Observer, ReportsStatesAndProcesses) {
  const auto config = small_surface(unique_name("states"));
  auto surface = std::make_unique<SurfaceEndpoint>(SurfaceEndpoint::create(config));
  auto observer = ObserverEndpoint::attach(config.name);
  EXPECT_EQ(observer.surface_state(), State::kReady);
  EXPECT_EQ(observer.controller_state(), State::kNone);
  EXPECT_EQ(observer.controller_pid(), 0u);
  {
    auto controller = ControllerEndpoint::attach(config.name);
    EXPECT_EQ(observer.controller_state(), State::kReady);
    EXPECT_EQ(observer.controller_pid(), static_cast<std::uint32_t>(::getpid()));
    controller.set_state(State::kPaused);
    EXPECT_EQ(observer.controller_state(), State::kPaused);
  }
  EXPECT_EQ(observer.controller_state(), State::kNone);
  EXPECT_EQ(observer.controllers_seen(), 1u);
  surface->set_state(State::kPaused);
  EXPECT_EQ(observer.surface_state(), State::kPaused);
  surface->miss_deadline();
  EXPECT_EQ(observer.surface_counters().deadline_misses, 1u);
  ASSERT_EQ(surface->publish(0, 0.0), Status::kOk);
  surface.reset();
  EXPECT_EQ(observer.latest(Direction::kSensor), Status::kOk);  // the last frame, though both peers ended
  EXPECT_EQ(observer.latest(Direction::kSensor), Status::kSurfaceClosed);
  EXPECT_EQ(observer.await(Direction::kActuator), Status::kSurfaceClosed);
}

TEST(Observer, IncompleteFrameIsTorn) {
  const auto config = small_surface(unique_name("torn"), Mode::kPassive);
  auto surface = SurfaceEndpoint::create(config);
  auto observer = ObserverEndpoint::attach(config.name);
  std::ranges::fill(surface.sensor(kDistance), 1.0f);
  ASSERT_EQ(surface.publish(0, 0.0), Status::kOk);
  ASSERT_EQ(observer.latest(Direction::kSensor), Status::kOk);
  std::ranges::fill(surface.sensor(kDistance), 2.0f);
  ASSERT_EQ(surface.publish(1, 0.0), Status::kOk);
  RawSegment(config.name).sensor_slot(2).sequence = 2 * 6 - 1;  // the writer has lapped the ring
  EXPECT_EQ(observer.latest(Direction::kSensor), Status::kTorn);
  EXPECT_EQ(observer.info(Direction::kSensor).frame, 1u);
  EXPECT_EQ(observer.array(kDistance)[0], 1.0f);
}

// An observer of a running pair, for ThreadSanitizer.
TEST(Threads, ObserverSeesCompleteFramesOnly) {
  auto config = small_surface(unique_name("observed"));
  config.rows = config.columns = 32;
  config.channels[kDistance].maximum = 1e9;
  config.channels[kHeight].maximum = 1e9;
  auto surface = SurfaceEndpoint::create(config);
  std::jthread controller([&] {
    auto mine = ControllerEndpoint::attach(config.name);
    while (mine.await_sensors({.timeout = 60s}) == Status::kOk) {
      std::ranges::copy(mine.sensor(kDistance), mine.actuator(kHeight).begin());
      if (mine.publish() != Status::kOk) break;
    }
  });
  std::uint64_t frames = 0, mixed = 0;
  // Attached here: on a busy machine the thread may begin when the surface is closing.
  std::jthread watcher(
      [&, observer = ObserverEndpoint::attach(config.name)](const std::stop_token& over) mutable {
        do {
          for (const auto& [d, channel] :
               {std::pair{Direction::kSensor, kDistance}, {Direction::kActuator, kHeight}}) {
            if (observer.latest(d) != Status::kOk) continue;
            ++frames;
            const auto in = observer.array(channel);
            if (std::ranges::count(in, static_cast<float>(observer.info(d).tick)) != std::ranges::ssize(in))
              ++mixed;
          }
        } while (!over.stop_requested());
      });
  ASSERT_EQ(surface.await_controller({.timeout = 60s}), Status::kOk);
  for (std::uint64_t tick = 0; tick < 3000; ++tick) {
    std::ranges::fill(surface.sensor(kDistance), static_cast<float>(tick));
    ASSERT_EQ(surface.publish(tick, 0.0), Status::kOk);
    ASSERT_EQ(surface.await_actuators(tick, {.timeout = 60s}), Status::kOk);
  }
  surface.set_state(State::kClosing);
  watcher.request_stop();
  watcher.join();
  controller.join();
  EXPECT_EQ(mixed, 0u);
  EXPECT_GT(frames, 0u);
}

}  // namespace
}  // namespace shm_protocol
