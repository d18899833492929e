// Soak tests. By default short; SHM_PROTOCOL_SOAK=1 takes a million ticks and a thousand kills.
#include <gtest/gtest.h>
#include <shm_protocol/Segments.h>

#include <cstdlib>
#include <filesystem>
#include <random>

#include "tests/system/shm-protocol/ObserverCheck.h"
#include "tests/system/shm-protocol/Peer.h"
#include "tests/unit/shm-protocol/RawSegment.h"

namespace shm_protocol {
namespace {

template <class T>
T full(T all, T usual) {
  return std::getenv("SHM_PROTOCOL_SOAK") ? all : usual;
}

std::ptrdiff_t open_descriptors() {
  return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {});
}

// Lock-step with every value of every frame checked on both sides, observers coming and going.
TEST(Soak, TicksWithEveryFrameChecked) {
  const auto config = pair_config("soak");
  const auto ticks = full<std::uint64_t>(1'000'000, 100'000);
  Peer surface([&] {
    auto own = SurfaceEndpoint::create(config);
    Status s = own.await_controller({.timeout = 20s});
    for (std::uint64_t tick = 0; s == Status::kOk && tick < ticks; ++tick) s = run_tick(own, tick);
    return s == Status::kOk && own.counters().clamped == 0 && own.actuator_info().frame == ticks ? 0 : 1;
  });
  Peer controller([&] {
    auto mine = ControllerEndpoint::attach(config.name, {.timeout = 20s});
    return serve(mine, ticks - 1) == Status::kOk && mine.sensor_info().frame == ticks ? 0 : 1;
  });
  std::mt19937 random(3);
  for (int life = 0; life < 10; ++life) {
    Peer observer([&] {
      std::uint64_t seen = 0;
      return check_observed_frames(config.name, seen);
    });
    ::usleep(static_cast<unsigned>(random() % 20'000));
    observer.signal(SIGKILL);
    const int end = observer.wait();
    EXPECT_TRUE(end == -SIGKILL || end == 0 || end == 99) << end;  // 99: it came too late
  }
  EXPECT_EQ(surface.wait(), 0);
  EXPECT_EQ(controller.wait(), 0);
  EXPECT_FALSE(exists(file_path(config.name)));
}

// Either side, killed at a random moment; the other goes on with the next one. Frames are checked on both
// sides.
TEST(Soak, KillsOfEitherSide) {
  const auto config = pair_config("kills");
  const int cycles = full(1000, 40);
  std::mt19937 random(4);
  const auto descriptors = open_descriptors();
  std::unique_ptr<Peer> surface, controller;
  const auto new_surface = [&] {
    surface = std::make_unique<Peer>([&] {
      for (;;) {
        auto own = SurfaceEndpoint::create(config);
        std::uint64_t tick = 0;
        for (;;) {
          Status s = own.await_controller({.timeout = 100s});
          if (s != Status::kOk) return 1;
          // What a dead predecessor left unanswered comes first.
          if (tick != 0) s = own.await_actuators(tick - 1, {.timeout = 100s});
          while (s == Status::kOk) s = run_tick(own, tick++);
          if (s != Status::kControllerDead && s != Status::kControllerClosed) return 2;
          if (own.actuator_info().frame && !matches(own.actuator(1), own.actuator_info().tick, commanded))
            return 3;
        }
      }
    });
  };
  const auto new_controller = [&] {
    controller = std::make_unique<Peer>([&] {
      auto mine = ControllerEndpoint::attach(config.name, {.timeout = 100s});
      for (;;) {
        const Status s = serve(mine, kForever);
        if (s != Status::kSurfaceDead) return 2;
        mine.reconnect({.timeout = 100s});
      }
      return 0;
    });
  };
  new_surface();
  new_controller();
  for (int cycle = 0; cycle < cycles; ++cycle) {
    ::usleep(static_cast<unsigned>(random() % 6000));
    auto& victim = random() % 2 ? surface : controller;
    victim->signal(SIGKILL);
    // Whoever ended by itself saw a wrong frame or a wrong status.
    ASSERT_EQ(victim->wait(), -SIGKILL) << "cycle " << cycle;
    if (&victim == &surface)
      new_surface();
    else
      new_controller();
  }
  // After the last kill the two still find each other and tick.
  {
    auto observer = ObserverEndpoint::attach(config.name, {.timeout = 100s});
    const auto before = observer.published(Direction::kActuator);
    for (int i = 0; i < 100'000 && observer.published(Direction::kActuator) == before; ++i) ::usleep(1000);
    EXPECT_NE(observer.published(Direction::kActuator), before);
  }
  controller->signal(SIGKILL);
  surface->signal(SIGKILL);
  EXPECT_EQ(controller->wait(), -SIGKILL);
  EXPECT_EQ(surface->wait(), -SIGKILL);
  EXPECT_EQ(open_descriptors(), descriptors);
  EXPECT_EQ(remove_orphans(config.name).size(), 1u);
  for (const auto& s : list_segments()) EXPECT_FALSE(s.name.starts_with(config.name)) << s.name;
}

}  // namespace
}  // namespace shm_protocol
