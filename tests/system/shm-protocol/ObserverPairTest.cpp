// Observers that come, stay, are stopped and killed while a pair runs: none of them changes anything.
#include <gtest/gtest.h>
#include <shm_protocol/ObserverEndpoint.h>

#include <filesystem>
#include <random>

#include "tests/system/shm-protocol/ObserverCheck.h"
#include "tests/system/shm-protocol/Peer.h"
#include "tests/unit/shm-protocol/RawSegment.h"

namespace shm_protocol {
namespace {

TEST(ObserverPair, ObserversDoNotDisturbThePair) {
  const auto config = pair_config("watched");
  constexpr std::uint64_t kTicks = 60'000;
  Peer controller([&] {
    auto mine = ControllerEndpoint::attach(config.name, {.timeout = 20s});
    return serve(mine, kTicks - 1) == Status::kOk ? 0 : 1;
  });
  int seen_by_faithful[2];
  ASSERT_EQ(::pipe(seen_by_faithful), 0);
  Peer surface([&] {
    ::close(seen_by_faithful[1]);
    auto own = SurfaceEndpoint::create(config);
    Status s = own.await_controller({.timeout = 20s});
    if (s == Status::kOk) s = run_tick(own, 0);
    if (char byte; ::read(seen_by_faithful[0], &byte, 1) != 1) return 2;
    for (std::uint64_t tick = 1; s == Status::kOk && tick < kTicks; ++tick) s = run_tick(own, tick);
    return s == Status::kOk && own.counters().clamped == 0 ? 0 : 1;
  });
  Peer faithful([&] {
    std::uint64_t seen = 0;
    const auto tell = [&] { (void)!::write(seen_by_faithful[1], "", 1); };
    const int wrong = check_observed_frames(config.name, seen, tell);
    return wrong ? wrong : seen > 0 ? 0 : 4;
  });
  for (const int end : seen_by_faithful) ::close(end);
  std::mt19937 random(17);
  for (int life = 0; life < 30; ++life) {
    Peer passing([&] {
      std::uint64_t seen = 0;
      return check_observed_frames(config.name, seen);
    });
    ::usleep(static_cast<unsigned>(random() % 3000));
    if (life % 3 == 0) {
      passing.signal(SIGSTOP);
      ::usleep(2000);
    }
    passing.signal(SIGKILL);
    const int end = passing.wait();
    EXPECT_TRUE(end == -SIGKILL || end == 0 || end == 99) << end;  // 99: the pair was done before it attached
  }
  EXPECT_EQ(surface.wait(), 0);
  EXPECT_EQ(controller.wait(), 0);
  EXPECT_EQ(faithful.wait(), 0);
  EXPECT_FALSE(exists(file_path(config.name)));
}

TEST(ObserverPair, DetectsKilledSurface) {
  const auto config = pair_config("watched-death");
  Peer surface([&] {
    auto own = SurfaceEndpoint::create(config);
    fill(own.sensor(0), 0, sensed);
    if (own.publish(0, 0.0) != Status::kOk) return 1;
    for (;;) ::pause();
    return 0;
  });
  auto observer = ObserverEndpoint::attach(config.name, {.timeout = 20s});
  ASSERT_EQ(observer.await(Direction::kSensor, {.timeout = 20s}), Status::kOk);
  surface.signal(SIGKILL);
  surface.wait();
  EXPECT_EQ(observer.await(Direction::kSensor, {.timeout = 20s}), Status::kSurfaceDead);
  EXPECT_EQ(observer.surface_state(), State::kDead);
  EXPECT_TRUE(matches(observer.array(0), 0, sensed));  // the last frame stands
  std::string what;
  EXPECT_EQ(error_of([&] { ObserverEndpoint::attach(config.name); }, &what), ErrorCode::kNotFound);
  EXPECT_NE(what.find("is dead"), std::string::npos) << what;
  std::filesystem::remove(file_path(config.name));
}

}  // namespace
}  // namespace shm_protocol
