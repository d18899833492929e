// Two processes: lock-step and passive, on one and two cores, stopped and continued.
#include <gtest/gtest.h>
#include <sched.h>
#include <shm_protocol/Segments.h>

#include <random>

#include "tests/system/shm-protocol/Peer.h"
#include "tests/unit/shm-protocol/RawSegment.h"

namespace shm_protocol {
namespace {

constexpr std::uint64_t kTicks = 10'000;
constexpr AttachOptions kSoon{.timeout = 20s};

int run_controller(const std::string& name, std::uint64_t last_tick) {
  auto controller = ControllerEndpoint::attach(name, kSoon);
  const Status s = serve(controller, last_tick);
  if (s != Status::kOk) std::fprintf(stderr, "controller: %s\n", text(s));
  return s == Status::kOk ? 0 : 1;
}

int run_surface(const SurfaceConfig& config, std::uint64_t ticks) {
  auto surface = SurfaceEndpoint::create(config);
  Status s = surface.await_controller({.timeout = 20s});
  for (std::uint64_t tick = 0; s == Status::kOk && tick < ticks; ++tick) s = run_tick(surface, tick);
  if (s != Status::kOk) std::fprintf(stderr, "surface: %s\n", text(s));
  return s == Status::kOk ? 0 : 1;
}

void pin_to(int cpu) {
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(cpu, &set);
  ASSERT_EQ(::sched_setaffinity(0, sizeof set, &set), 0);
}

int first_cpu() {
  cpu_set_t set;
  ::sched_getaffinity(0, sizeof set, &set);
  int cpu = 0;
  while (!CPU_ISSET(cpu, &set)) ++cpu;
  return cpu;
}

TEST(Pair, TenThousandTicksWithEveryValueChecked) {
  const auto config = pair_config("ticks");
  Peer controller([&] { return run_controller(config.name, kTicks - 1); });
  EXPECT_EQ(run_surface(config, kTicks), 0);
  EXPECT_EQ(controller.wait(), 0);
}

TEST(Pair, TenThousandTicksOnOneCore) {
  const auto config = pair_config("core");
  const int cpu = first_cpu();
  Peer controller([&] {
    pin_to(cpu);
    return run_controller(config.name, kTicks - 1);
  });
  Peer surface([&] {
    pin_to(cpu);
    return run_surface(config, kTicks);
  });
  EXPECT_EQ(surface.wait(), 0);
  EXPECT_EQ(controller.wait(), 0);
}

TEST(Pair, StopAndContinueHasNoEffect) {
  const auto config = pair_config("stopped");
  Peer surface([&] { return run_surface(config, 3 * kTicks); });
  Peer controller([&] { return run_controller(config.name, 3 * kTicks - 1); });
  std::mt19937 random(11);
  for (int i = 0; i < 6; ++i) {
    const Peer& victim = i % 2 ? surface : controller;
    ::usleep(random() % 5000);
    victim.signal(SIGSTOP);
    ::usleep(130'000);  // longer than two looks at the peer's process
    victim.signal(SIGCONT);
  }
  EXPECT_EQ(surface.wait(), 0);
  EXPECT_EQ(controller.wait(), 0);
}

TEST(Pair, PassiveFramesAreCompleteAndSeenOrCounted) {
  const auto config = pair_config("passive", Mode::kPassive);
  auto controller = [&] {
    Peer surface([&] {
      auto own = SurfaceEndpoint::create(config);
      if (own.await_controller({.timeout = 20s}) != Status::kOk) return 1;
      for (std::uint64_t tick = 0; tick < 2000; ++tick) {
        fill(own.sensor(0), tick, sensed);
        if (own.publish(tick, 0.0) != Status::kOk) return 2;
        const Status s = own.latest_actuators();
        if (s == Status::kOk && !matches(own.actuator(1), own.actuator_info().tick, commanded)) return 3;
        if (s != Status::kOk && s != Status::kRepeated) return 4;
        if (own.actuator_info().tick > tick) return 5;
        ::usleep(50);
      }
      // The controller reads on until it is told that this is the end.
      own.set_state(State::kClosing);
      for (int i = 0; own.has_controller() && i < 20'000; ++i) ::usleep(1000);
      return own.has_controller() ? 6 : 0;
    });
    std::uint64_t seen = 0, first = 0, last = 0;
    {
      auto mine = ControllerEndpoint::attach(config.name, kSoon);
      Status s = Status::kOk;
      for (;;) {
        s = mine.await_sensors({.timeout = 20s});
        if (s != Status::kOk) break;
        const auto& info = mine.sensor_info();
        EXPECT_TRUE(matches(mine.sensor(0), info.tick, sensed)) << info.tick;
        EXPECT_GT(info.frame, last);
        if (seen++ == 0) first = info.frame;
        last = info.frame;
        fill(mine.actuator(1), info.tick, commanded);
        EXPECT_EQ(mine.publish(), Status::kOk);
        ::usleep(400);  // slower than the surface
      }
      EXPECT_EQ(s, Status::kSurfaceClosed);
      EXPECT_EQ(seen + mine.counters().skipped, last - first + 1);
      EXPECT_GT(mine.counters().skipped, 0u);
      EXPECT_GT(mine.surface_counters().repeated, 0u);
      EXPECT_EQ(last, 2000u);
    }
    EXPECT_EQ(surface.wait(), 0);
  };
  controller();
}

TEST(Pair, RejectsSecondControllerAndReportsPid) {
  const auto config = pair_config("second");
  auto surface = SurfaceEndpoint::create(config);
  Peer first([&] {
    auto mine = ControllerEndpoint::attach(config.name);
    for (;;) ::pause();
    return 0;
  });
  ASSERT_EQ(surface.await_controller({.timeout = 20s}), Status::kOk);
  std::uint32_t pid = 0;
  EXPECT_EQ(error_of([&] { ControllerEndpoint::attach(config.name); }, nullptr, &pid),
            ErrorCode::kControllerLives);
  EXPECT_EQ(pid, static_cast<std::uint32_t>(first.pid()));
}

TEST(Pair, RejectsSurfaceOfOtherMajorVersion) {
  const auto config = pair_config("version");
  Peer surface([&] {
    auto own = SurfaceEndpoint::create(config);
    RawSegment(config.name).header().identity.version = 3u << 16;
    for (;;) ::pause();
    return 0;
  });
  std::string message;
  for (int i = 0; i < 2000 && !exists(file_path(config.name)); ++i) ::usleep(1000);
  ErrorCode code{};
  for (int i = 0; i < 2000 && code != ErrorCode::kWrongVersion; ++i) {
    ::usleep(1000);
    try {
      ControllerEndpoint::attach(config.name);
    } catch (const Error& e) {
      code = e.code();
      message = e.what();
    }
  }
  EXPECT_EQ(code, ErrorCode::kWrongVersion);
  EXPECT_NE(message.find("3.0"), std::string::npos) << message;
  EXPECT_NE(message.find("program 2.0"), std::string::npos) << message;
  surface.signal(SIGKILL);
  surface.wait();
  EXPECT_EQ(remove_orphans(config.name).size(), 1u);  // whose it is can be told in every version
}

TEST(Pair, OrderlyEndRemovesTheSegment) {
  const auto config = pair_config("order");
  Peer surface([&] { return run_surface(config, 100); });
  auto controller = ControllerEndpoint::attach(config.name, kSoon);
  EXPECT_EQ(serve(controller, kForever), Status::kSurfaceClosed);
  EXPECT_EQ(surface.wait(), 0);
  EXPECT_FALSE(exists(file_path(config.name)));
}

}  // namespace
}  // namespace shm_protocol
