// Both sides in two threads of one process, for ThreadSanitizer; and the absence of allocations on the tick
// path.
#include <gtest/gtest.h>
#include <shm_protocol/ControllerEndpoint.h>

#include <algorithm>
#include <atomic>
#include <thread>

#include "tests/unit/common/AllocationCounter.h"
#include "tests/unit/shm-protocol/RawSegment.h"

namespace shm_protocol {
namespace {

using namespace std::chrono_literals;
constexpr WaitOptions kPatient{.timeout = 60s};

TEST(Threads, LockstepWithEveryValueChecked) {
  constexpr std::uint64_t kTicks = 3000;
  const auto config = small_surface(unique_name("threads"));
  auto surface = SurfaceEndpoint::create(config);
  std::uint64_t answered = 0;
  std::jthread other([&] {
    auto controller = ControllerEndpoint::attach(config.name);
    while (controller.await_sensors(kPatient) == Status::kOk) {
      const auto in = controller.sensor(kDistance);
      const auto expected = static_cast<float>(controller.sensor_info().tick % 1000);
      if (std::ranges::count(in, expected) != std::ranges::ssize(in)) break;
      std::ranges::fill(controller.actuator(kHeight), expected / 1000.0f);
      if (controller.publish() != Status::kOk) break;
      ++answered;
      if (answered == kTicks) break;
    }
  });
  ASSERT_EQ(surface.await_controller(kPatient), Status::kOk);
  for (std::uint64_t tick = 0; tick < kTicks; ++tick) {
    std::ranges::fill(surface.sensor(kDistance), static_cast<float>(tick % 1000));
    ASSERT_EQ(surface.publish(tick, 0.0), Status::kOk);
    ASSERT_EQ(surface.await_actuators(tick, kPatient), Status::kOk);
    const float expected = static_cast<float>(tick % 1000) / 1000.0f;
    for (const float v : surface.actuator(kHeight)) ASSERT_EQ(v, expected);
  }
  other.join();
  EXPECT_EQ(answered, kTicks);
}

TEST(Threads, PassiveFramesAreNeverMixed) {
  auto config = small_surface(unique_name("mixed"), Mode::kPassive);
  config.rows = config.columns = 48;
  auto surface = SurfaceEndpoint::create(config);
  std::atomic<int> attached{0};
  std::atomic<std::uint64_t> frames{0}, mixed{0};
  std::jthread other([&](const std::stop_token& enough) {
    auto controller = ControllerEndpoint::attach(config.name);
    attached = 1;
    while (!enough.stop_requested()) {
      const Status s = controller.latest_sensors();
      if (s != Status::kOk) continue;
      ++frames;
      const auto in = controller.sensor(kDistance);
      const auto expected = static_cast<float>(controller.sensor_info().tick);
      if (std::ranges::count(in, expected) != std::ranges::ssize(in)) ++mixed;
      std::ranges::fill(controller.actuator(kHeight), static_cast<float>(frames % 4));
      if (controller.publish() != Status::kOk) ++mixed;
    }
  });
  while (!attached) std::this_thread::yield();
  std::uint64_t taken = 0;
  // On a busy machine the other thread may not run at all during the first 20 000.
  for (std::uint64_t tick = 0; tick < 20'000 || frames < 10 || taken < 10; ++tick) {
    std::ranges::fill(surface.sensor(kDistance), static_cast<float>(tick));
    ASSERT_EQ(surface.publish(tick, 0.0), Status::kOk);
    if (surface.latest_actuators() != Status::kOk) continue;
    ++taken;
    const auto in = surface.actuator(kHeight);
    ASSERT_EQ(std::ranges::count(in, in[0]), std::ranges::ssize(in));
  }
  other.request_stop();
  other.join();
  EXPECT_EQ(mixed, 0u);
}

// A surface that laps the ring many times while the controller copies one frame.
TEST(Threads, RejectsFrameOverwrittenDuringCopy) {
  auto config = small_surface(unique_name("lapped"), Mode::kPassive);
  config.rows = config.columns = 256;
  config.channels[kDistance].maximum = 1e9;
  auto surface = SurfaceEndpoint::create(config);
  auto controller = ControllerEndpoint::attach(config.name);
  std::atomic<std::uint64_t> copies{0};
  std::jthread other([&](const std::stop_token& enough) {
    for (std::uint64_t tick = 0; !enough.stop_requested(); ++tick) {
      auto out = surface.sensor(kDistance);
      out.front() = out.back() = static_cast<float>(tick % 1'000'000);
      if (surface.publish(tick, 0.0) != Status::kOk) break;
      if (tick % 100 != 0) continue;
      // Occasionally leaves time for a complete copy: the one after that which these frames overtook.
      // Relaxed, so that ThreadSanitizer takes it for no synchronisation.
      const std::uint64_t enough_copies = copies.load(std::memory_order_relaxed) + 2;
      while (copies.load(std::memory_order_relaxed) < enough_copies && !enough.stop_requested())
        std::this_thread::yield();
    }
  });
  std::uint64_t whole = 0, mixed = 0;
  while (whole < 300) {
    const Status status = controller.latest_sensors();
    copies.fetch_add(1, std::memory_order_relaxed);
    if (status != Status::kOk) continue;
    ++whole;
    const auto in = controller.sensor(kDistance);
    const auto expected = static_cast<float>(controller.sensor_info().tick % 1'000'000);
    if (in.front() != expected || in.back() != expected) ++mixed;
  }
  other.request_stop();
  other.join();
  EXPECT_EQ(mixed, 0u);
}

#ifdef COUNTS_ALLOCATIONS
TEST(Threads, TickPathDoesNotAllocate) {
  const auto config = small_surface(unique_name("allocate"));
  auto surface = SurfaceEndpoint::create(config);
  auto controller = ControllerEndpoint::attach(config.name);
  const std::size_t before = allocations;
  for (std::uint64_t tick = 0; tick < 50; ++tick) {
    ASSERT_EQ(surface.publish(tick, 0.0), Status::kOk);
    ASSERT_EQ(surface.await_actuators(tick, {.timeout = tick == 7 ? 120ms : 0ms}), Status::kTimeout);
    ASSERT_EQ(controller.await_sensors(kPatient), Status::kOk);
    ASSERT_EQ(controller.publish(), Status::kOk);
    ASSERT_EQ(surface.await_actuators(tick, kPatient), Status::kOk);
  }
  EXPECT_EQ(allocations, before);
}
#endif

}  // namespace
}  // namespace shm_protocol
