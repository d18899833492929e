// One of the two processes is killed repeatedly at random times, and the other continues.
#include <gtest/gtest.h>
#include <shm_protocol/Segments.h>

#include <algorithm>
#include <filesystem>
#include <random>
#include <vector>

#include "tests/system/shm-protocol/Peer.h"
#include "tests/unit/shm-protocol/RawSegment.h"

namespace shm_protocol {
namespace {

// On a busy machine, a life may be over before its first answer: so many may follow until enough answers
// came.
constexpr int kMaxLives = 1000;

std::ptrdiff_t open_descriptors() {
  return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {});
}

// Kills `victim` after a random delay, at an arbitrary point of a tick.
Peer killer_of(const Peer& victim, unsigned microseconds) {
  const pid_t pid = victim.pid();
  return Peer([=] {
    ::usleep(microseconds);
    ::kill(pid, SIGKILL);
    return 0;
  });
}

TEST(Death, SessionSurvivesKilledControllers) {
  const auto config = pair_config("controllers");
  auto surface = SurfaceEndpoint::create(config);
  const auto session = surface.description().session;
  std::mt19937 random(42);
  std::uint64_t tick = 0, answered_ticks = 0;
  const auto descriptors = open_descriptors();
  std::uint64_t lives = 0;
  for (; lives < 60 || (answered_ticks <= 60 && lives < kMaxLives); ++lives) {
    Peer controller([&] {
      auto mine = ControllerEndpoint::attach(config.name, {.timeout = 20s});
      return mine.description().session == session && serve(mine, kForever) == Status::kOk ? 0 : 1;
    });
    ASSERT_EQ(surface.await_controller({.timeout = 20s}), Status::kOk);
    Peer killer = killer_of(controller, static_cast<unsigned>(random() % 3000));
    // The frame that the predecessor left unanswered comes first.
    Status s = tick == 0 ? Status::kOk : surface.await_actuators(tick - 1, {.timeout = 100s});
    while (s == Status::kOk) {
      s = run_tick(surface, tick);
      ++tick;
      if (s == Status::kOk) ++answered_ticks;
    }
    EXPECT_EQ(s, Status::kControllerDead) << text(s);
    EXPECT_EQ(controller.wait(), -SIGKILL);
    // The last complete frame taken is in effect.
    if (surface.actuator_info().frame != 0) {
      EXPECT_TRUE(matches(surface.actuator(1), surface.actuator_info().tick, commanded));
    }
    EXPECT_FALSE(surface.has_controller());
  }
  EXPECT_EQ(surface.controllers_seen(), lives);
  EXPECT_GT(answered_ticks, 60u);
  EXPECT_EQ(surface.counters().clamped, 0u);
  EXPECT_EQ(open_descriptors(), descriptors);
}

TEST(Death, PassiveSurfaceAcceptsNextController) {
  const auto config = pair_config("passive-death", Mode::kPassive);
  auto surface = SurfaceEndpoint::create(config);
  std::mt19937 random(43);
  std::uint64_t tick = 0;
  for (int life = 0; life < 15; ++life) {
    Peer controller([&] {
      auto mine = ControllerEndpoint::attach(config.name, {.timeout = 20s});
      return static_cast<int>(serve(mine, kForever));
    });
    ASSERT_EQ(surface.await_controller({.timeout = 20s}), Status::kOk);
    Peer killer = killer_of(controller, static_cast<unsigned>(random() % 3000));
    Status s = Status::kOk;
    while (s == Status::kOk || s == Status::kRepeated || s == Status::kTorn) {
      fill(surface.sensor(0), tick, sensed);
      ASSERT_EQ(surface.publish(tick++, 0.0), Status::kOk);
      s = surface.latest_actuators();
      if (s == Status::kOk) {
        ASSERT_TRUE(matches(surface.actuator(1), surface.actuator_info().tick, commanded));
      }
      ::usleep(20);
    }
    EXPECT_EQ(s, Status::kControllerDead) << text(s);
    EXPECT_EQ(controller.wait(), -SIGKILL);
  }
}

TEST(Death, ControllerReconnectsAfterSurfaceDeath) {
  const auto config = pair_config("surfaces");
  std::mt19937 random(44);
  const auto descriptors = open_descriptors();
  const auto new_surface = [&] {
    return Peer([&] {
      auto own = SurfaceEndpoint::create(config);
      Status s = own.await_controller({.timeout = 20s});
      for (std::uint64_t tick = 0; s == Status::kOk; ++tick) s = run_tick(own, tick);
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
      EXPECT_EQ(serve(*controller, kForever), Status::kSurfaceDead);
      EXPECT_EQ(surface.wait(), -SIGKILL);
      EXPECT_TRUE(exists(file_path(config.name)));  // left behind; the next one reclaims it
    }
  }
  EXPECT_EQ(open_descriptors(), descriptors);
  ASSERT_EQ(remove_orphans(config.name).size(), 1u);
  EXPECT_FALSE(exists(file_path(config.name)));
}

TEST(Death, SurfaceKilledDuringCreationLeavesNameUsable) {
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

// The controller answers each chunk as it arrives; half the answer is in the surface's hands when it is
// killed.
Status serve_chunked(ControllerEndpoint& controller, std::vector<float>& out) {
  for (;;) {
    std::size_t at = 0;
    for (auto in = controller.next_cells(0); !in.empty(); in = controller.next_cells(0)) {
      const auto chunk = std::span(out).subspan(at, in.size());
      std::ranges::transform(in, chunk.begin(), [](float value) { return value + 1; });
      controller.write(1, at, std::span<const float>(chunk));
      at += in.size();
    }
    if (const Status s = controller.await_sensors({.timeout = 100s}); s != Status::kOk) return s;
    if (const Status s = controller.publish(); s != Status::kOk) return s;
  }
}

TEST(Death, ControllerKilledMidAnswerLeavesNoMixedFrame) {
  auto config = pair_config("chunks");
  config.rows = config.columns = 200;
  config.channels[0].maximum = config.channels[1].maximum = 1e6;
  auto surface = SurfaceEndpoint::create(config);
  std::mt19937 random(46);
  const std::size_t cells = surface.description().cells();
  std::vector<float> out(cells);
  std::uint64_t tick = 0, whole = 0;
  for (int life = 0; life < 25 || (whole <= 25 && life < kMaxLives); ++life) {
    Peer controller([&] {
      auto mine = ControllerEndpoint::attach(config.name, {.timeout = 20s});
      return static_cast<int>(serve_chunked(mine, out));
    });
    ASSERT_EQ(surface.await_controller({.timeout = 20s}), Status::kOk);
    Peer killer = killer_of(controller, static_cast<unsigned>(random() % 2000));
    Status s = tick == 0 ? Status::kOk : surface.await_actuators(tick - 1, {.timeout = 100s});
    while (s == Status::kOk) {
      const std::uint64_t mine = tick++;
      // The values tell the life, too: an answer to an older frame, or of two lives, would show.
      const auto value = static_cast<float>(mine);
      std::ranges::fill(out, value);
      for (std::size_t at = 0; at < cells; at += 4096)
        surface.write(0, at,
                      std::span<const float>(out).subspan(at, std::min<std::size_t>(4096, cells - at)));
      ASSERT_EQ(surface.publish(mine, 0.0), Status::kOk);
      std::size_t taken = 0;
      bool good = true;
      for (auto in = surface.next_cells(1); !in.empty(); in = surface.next_cells(1)) {
        good &= std::ranges::count(in, value + 1) == std::ranges::ssize(in);
        taken += in.size();
      }
      s = surface.await_actuators(mine, {.timeout = 100s});
      if (s != Status::kOk) break;
      const auto all = surface.actuator(1);
      ASSERT_TRUE(good && taken == cells) << mine;
      ASSERT_EQ(std::ranges::count(all, value + 1), std::ranges::ssize(all)) << mine;
      ++whole;
    }
    EXPECT_EQ(s, Status::kControllerDead) << text(s);
    const auto all = surface.actuator(1);
    EXPECT_EQ(std::ranges::count(all, all[0]), std::ranges::ssize(all));  // a single frame is in effect
  }
  EXPECT_GT(whole, 25u);
}

// Whoever is killed, a wait of one second ends with that and not with its deadline.
TEST(Death, DetectedWithinOneSecond) {
  const auto config = pair_config("second");
  auto surface = std::make_unique<SurfaceEndpoint>(SurfaceEndpoint::create(config));
  {
    Peer controller([&] {
      auto mine = ControllerEndpoint::attach(config.name, {.timeout = 20s});
      return static_cast<int>(serve(mine, kForever));
    });
    ASSERT_EQ(surface->await_controller({.timeout = 20s}), Status::kOk);
    ASSERT_EQ(run_tick(*surface, 0), Status::kOk);
    controller.signal(SIGKILL);
    controller.wait();
    ASSERT_EQ(surface->publish(1, 0.0), Status::kOk);
    EXPECT_EQ(surface->await_actuators(1, {.timeout = 1s}), Status::kControllerDead);
  }
  surface.reset();
  Peer other([&] {
    auto own = SurfaceEndpoint::create(config);
    ::pause();
    return 0;
  });
  auto controller = ControllerEndpoint::attach(config.name, {.timeout = 20s});
  other.signal(SIGKILL);
  other.wait();
  EXPECT_EQ(controller.await_sensors({.timeout = 1s}), Status::kSurfaceDead);
  remove_orphans(config.name);
}

TEST(Death, DetectedWhileStopped) {
  const auto config = pair_config("stopped-killed");
  auto surface = SurfaceEndpoint::create(config);
  Peer controller([&] {
    auto mine = ControllerEndpoint::attach(config.name, {.timeout = 20s});
    return static_cast<int>(serve(mine, kForever));
  });
  ASSERT_EQ(surface.await_controller({.timeout = 20s}), Status::kOk);
  ASSERT_EQ(run_tick(surface, 0), Status::kOk);
  controller.stop();
  ASSERT_EQ(surface.publish(1, 0.0), Status::kOk);
  EXPECT_EQ(surface.await_actuators(1, {.timeout = 300ms}), Status::kTimeout);  // stopped, but alive
  controller.signal(SIGKILL);
  EXPECT_EQ(surface.await_actuators(1, {.timeout = 100s}), Status::kControllerDead);
}

}  // namespace
}  // namespace shm_protocol
