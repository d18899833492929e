// One of the two processes is killed at random moments, again and again, and the other carries on.
#include <gtest/gtest.h>
#include <shm_protocol/Segments.h>

#include <filesystem>
#include <random>

#include "tests/system/shm-protocol/Peer.h"
#include "tests/unit/shm-protocol/RawSegment.h"

namespace shm_protocol {
namespace {

std::ptrdiff_t open_descriptors() {
  return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {});
}

// Kills `victim` after a random while, so that it falls anywhere within a tick.
Peer killer_of(const Peer& victim, unsigned microseconds) {
  const pid_t pid = victim.pid();
  return Peer([=] {
    ::usleep(microseconds);
    ::kill(pid, SIGKILL);
    return 0;
  });
}

TEST(Death, ControllersAreKilledAndOthersGoOnInTheSameSession) {
  const auto config = pair_config("controllers");
  auto surface = SurfaceEndpoint::create(config);
  const auto session = surface.description().session;
  std::mt19937 random(42);
  std::uint64_t tick = 0, answered_ticks = 0;
  const auto descriptors = open_descriptors();
  for (int life = 0; life < 60; ++life) {
    Peer controller([&] {
      auto mine = ControllerEndpoint::attach(config.name, {.timeout = 20s});
      return mine.description().session == session && serve(mine, kForEver) == Status::kOk ? 0 : 1;
    });
    ASSERT_EQ(surface.await_controller({.timeout = 20s}), Status::kOk);
    Peer killer = killer_of(controller, static_cast<unsigned>(random() % 3000));
    // The frame that the predecessor left unanswered comes first.
    Status s = tick == 0 ? Status::kOk : surface.await_actuators(tick - 1, {.timeout = 100s});
    while (s == Status::kOk) {
      s = turn(surface, tick);
      ++tick;
      if (s == Status::kOk) ++answered_ticks;
    }
    EXPECT_EQ(s, Status::kControllerDead) << text(s);
    EXPECT_EQ(controller.wait(), -SIGKILL);
    // What stands is the last frame that was taken in whole.
    if (surface.actuator_info().frame != 0) {
      EXPECT_TRUE(holds(surface.actuator(1), surface.actuator_info().tick, commanded));
    }
    EXPECT_FALSE(surface.has_controller());
  }
  EXPECT_EQ(surface.controllers_seen(), 60u);
  EXPECT_GT(answered_ticks, 60u);
  EXPECT_EQ(surface.counters().clamped, 0u);
  EXPECT_EQ(open_descriptors(), descriptors);
}

TEST(Death, PassiveSurfaceNoticesAndAcceptsTheNext) {
  const auto config = pair_config("passive-death", Mode::kPassive);
  auto surface = SurfaceEndpoint::create(config);
  std::mt19937 random(43);
  std::uint64_t tick = 0;
  for (int life = 0; life < 15; ++life) {
    Peer controller([&] {
      auto mine = ControllerEndpoint::attach(config.name, {.timeout = 20s});
      return static_cast<int>(serve(mine, kForEver));
    });
    ASSERT_EQ(surface.await_controller({.timeout = 20s}), Status::kOk);
    Peer killer = killer_of(controller, static_cast<unsigned>(random() % 3000));
    Status s = Status::kOk;
    while (s == Status::kOk || s == Status::kRepeated || s == Status::kTorn) {
      fill(surface.sensor(0), tick, sensed);
      ASSERT_EQ(surface.publish(tick++, 0.0), Status::kOk);
      s = surface.latest_actuators();
      if (s == Status::kOk) {
        ASSERT_TRUE(holds(surface.actuator(1), surface.actuator_info().tick, commanded));
      }
      ::usleep(20);
    }
    EXPECT_EQ(s, Status::kControllerDead) << text(s);
    EXPECT_EQ(controller.wait(), -SIGKILL);
  }
}

TEST(Death, SurfacesAreKilledAndTheControllerFindsTheNext) {
  const auto config = pair_config("surfaces");
  std::mt19937 random(44);
  const auto descriptors = open_descriptors();
  const auto new_surface = [&] {
    return Peer([&] {
      auto own = SurfaceEndpoint::create(config);
      Status s = own.await_controller({.timeout = 20s});
      for (std::uint64_t tick = 0; s == Status::kOk; ++tick) s = turn(own, tick);
      return static_cast<int>(s);
    });
  };
  {
    std::unique_ptr<ControllerEndpoint> controller;
    for (int life = 0; life < 25; ++life) {
      Peer surface = new_surface();
      if (controller)
        controller->reconnect({.timeout = 20s});
      else
        controller =
            std::make_unique<ControllerEndpoint>(ControllerEndpoint::attach(config.name, {.timeout = 20s}));
      EXPECT_EQ(controller->description().surface_pid, static_cast<std::uint32_t>(surface.pid()));
      Peer killer = killer_of(surface, static_cast<unsigned>(random() % 3000));
      EXPECT_EQ(serve(*controller, kForEver), Status::kSurfaceDead);
      EXPECT_EQ(surface.wait(), -SIGKILL);
      EXPECT_TRUE(exists(file_path(config.name)));  // left behind; the next one reclaims it
    }
  }
  EXPECT_EQ(open_descriptors(), descriptors);
  ASSERT_EQ(remove_orphans(config.name).size(), 1u);
  EXPECT_FALSE(exists(file_path(config.name)));
}

TEST(Death, SurfacesKilledWhileTheyAreBuiltLeaveTheNameUsable) {
  auto config = pair_config("builders");
  config.rows = config.columns = 256;
  std::mt19937 random(45);
  for (int life = 0; life < 40; ++life) {
    Peer surface([&] {
      for (;;) auto own = SurfaceEndpoint::create(config);
      return 0;
    });
    ::usleep(static_cast<unsigned>(random() % 4000));
    surface.signal(SIGKILL);
    surface.wait();
    ASSERT_NO_THROW(SurfaceEndpoint::create(config));
  }
  remove_orphans(config.name);
  for (const auto& s : list_segments()) EXPECT_FALSE(s.name.starts_with(config.name)) << s.name;
}

TEST(Death, KilledWhileStoppedIsNoticedToo) {
  const auto config = pair_config("stopped-killed");
  auto surface = SurfaceEndpoint::create(config);
  Peer controller([&] {
    auto mine = ControllerEndpoint::attach(config.name, {.timeout = 20s});
    return static_cast<int>(serve(mine, kForEver));
  });
  ASSERT_EQ(surface.await_controller({.timeout = 20s}), Status::kOk);
  ASSERT_EQ(turn(surface, 0), Status::kOk);
  controller.signal(SIGSTOP);
  ASSERT_EQ(surface.publish(1, 0.0), Status::kOk);
  EXPECT_EQ(surface.await_actuators(1, {.timeout = 300ms}), Status::kTimeout);  // alive, only stopped
  controller.signal(SIGKILL);
  EXPECT_EQ(surface.await_actuators(1, {.timeout = 100s}), Status::kControllerDead);
}

}  // namespace
}  // namespace shm_protocol
