#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;

namespace {
// `nudge` shifts all objects along x, u.
std::uint64_t hash_after(double seconds, double nudge = 0.0, int threads = 1) {
  PhysicsFixture fixture;
  fixture.threads = threads;
  for (int i = 0; i < 40; ++i) {
    const Eigen::Vector3d at(4.0 + (i % 6) * 4.5 + nudge, 4.0 + (i / 6 % 6) * 4.5, 4.0 + i / 36 * 4.0);
    if (i % 3 == 0) fixture.add(sphere(1.0 + 0.1 * (i % 5), at));
    if (i % 3 == 1) fixture.add(box({2, 1.5, 1.2}, at));
    if (i % 3 == 2) fixture.add(cylinder(0.8, 2, at));
  }
  int step = 0;
  fixture.run(seconds, [&] {
    if (++step % 16 == 0)
      for (int c = 0; c < 32; ++c)
        fixture.cells().set_target(0, step / 16 % 32, c, static_cast<float>((c + step) % 3));
  });
  return fixture.snapshot().state_hash;
}
}  // namespace

// The recorded property is compared between machines by scripts/check-arm.
TEST(Determinism, RepeatedRunsAreBitIdentical) {
  const std::uint64_t hash = hash_after(3.0);
  EXPECT_EQ(hash, hash_after(3.0));
  RecordProperty("state_hash", std::to_string(hash));
}

TEST(Determinism, HashDetectsSmallDifference) { EXPECT_NE(hash_after(1.0), hash_after(1.0, 1e-5)); }

// The hash of a field at rest is kept from snapshot to snapshot.
TEST(Determinism, HashDoesNotDependOnEarlierSnapshots) {
  for (const int steps : {1, 2, 20, 45, 46, 47, 48, 49, 50, 60, 100}) {
    PhysicsFixture often, once;
    for (PhysicsFixture* fixture : {&often, &once}) {
      fixture->cells();
      fixture->snapshot();
      fixture->cells().set_targets(0, std::vector<float>(32 * 32, 1.0F));
    }
    often.run(steps * often.scene.world.dt_s, [&] { often.snapshot(); });
    once.run(steps * once.scene.world.dt_s);
    EXPECT_EQ(often.snapshot().state_hash, once.snapshot().state_hash) << steps;
  }
}

// Enough bodies for the step to run in parallel.
namespace {
std::uint64_t hash_of_crowd(int threads) {
  PhysicsFixture fixture;
  fixture.threads = threads;
  fixture.scene.world.dt_s = 1.0 / 60;
  fixture.scene.surface.rows = fixture.scene.surface.columns = 48;
  fixture.scene.surface.border_height = 6.0;
  fixture.scene.surface.pin.max_speed = 4.0;
  for (int i = 0; i < 700; ++i) {
    const Eigen::Vector3d at(3.0 + (i % 15) * 3.0, 3.0 + (i / 15 % 15) * 3.0, 4.0 + i / 225 * 3.0);
    if (i % 4 != 1) fixture.add(sphere(0.8 + 0.1 * (i % 7), at));
    if (i % 8 == 1) fixture.add(box({2, 1.5, 1.2}, at));
    if (i % 8 == 5) fixture.add(cylinder(0.8, 2, at));
  }
  int step = 0;
  fixture.run(2.0, [&] {
    ++step;
    for (int r = 0; r < 48; ++r)
      for (int c = 0; c < 48; ++c)
        fixture.cells().set_target(0, r, c, static_cast<float>(1.0 + std::sin(0.4 * c + 0.05 * step)));
  });
  return fixture.snapshot().state_hash;
}

// Jointed threes that bounce on heaving pins and on each other.
std::uint64_t hash_of_mechanisms(int threads) {
  using smartsurf::scene::JointKind;
  PhysicsFixture fixture;
  fixture.threads = threads;
  fixture.scene.world.dt_s = 1.0 / 60;
  fixture.scene.materials[0].restitution = 0.6;
  fixture.scene.surface.border_height = 6.0;
  for (int i = 0; i < 120; ++i) {
    const Eigen::Vector3d at(3.0 + (i % 6) * 5.0, 3.0 + (i / 6 % 10) * 2.8, 4.0 + i / 60 * 3.0);
    const auto first = fixture.add(sphere(0.6 + 0.1 * (i % 4), at)),
               second = fixture.add(box({1.2, 1, 0.8}, at + Eigen::Vector3d(1.6, 0, 0.3))),
               third = fixture.add(cylinder(0.5, 1, at + Eigen::Vector3d(3, 0, 0)));
    const auto kind = static_cast<JointKind>(i % 4);
    fixture.world().add_joint(
        {.kind = kind, .a = first, .b = second, .anchor = at + Eigen::Vector3d(0.9, 0, 0)});
    fixture.world().add_joint(
        {.kind = JointKind::kHinge, .a = second, .b = third, .anchor = at + Eigen::Vector3d(2.4, 0, 0)});
  }
  int step = 0;
  fixture.run(1.0, [&] {
    ++step;
    for (int r = 0; r < 32; ++r)
      for (int c = 0; c < 32; ++c)
        fixture.cells().set_target(0, r, c, static_cast<float>(1.0 + std::sin(0.4 * c + 0.05 * step)));
  });
  return fixture.snapshot().state_hash;
}

// Jointed pairs of boxes that slide on level pins, where their support patches share batches.
std::uint64_t hash_of_sliding_pairs(int threads) {
  using smartsurf::scene::JointKind;
  PhysicsFixture fixture;
  fixture.threads = threads;
  fixture.scene.world.dt_s = 1.0 / 60;
  for (int i = 0; i < 260; ++i) {
    const Eigen::Vector3d at(1.0 + (i % 13) * 2.4, 1.0 + (i / 13) * 1.5, 0.41);
    auto first = box({1.0, 1.2, 0.8}, at), second = box({1.0, 1.2, 0.8}, at + Eigen::Vector3d(1.15, 0, 0));
    first.velocity = {0.5 * std::sin(i), 2.0 * std::cos(i), 0};
    fixture.world().add_joint({.kind = static_cast<JointKind>(i % 4),
                               .a = fixture.add(first),
                               .b = fixture.add(second),
                               .anchor = at + Eigen::Vector3d(0.575, 0, 0)});
  }
  fixture.run(0.5);
  return fixture.snapshot().state_hash;
}
}  // namespace

TEST(Determinism, BitIdenticalForAnyThreadCount) {
  const std::uint64_t single_threaded = hash_of_crowd(1);
  for (const int threads : {2, 3, 8}) EXPECT_EQ(hash_of_crowd(threads), single_threaded) << threads;
  for (const int threads : {2, 3}) EXPECT_EQ(hash_of_mechanisms(threads), hash_of_mechanisms(1)) << threads;
  for (const int threads : {2, 3})
    EXPECT_EQ(hash_of_sliding_pairs(threads), hash_of_sliding_pairs(1)) << threads;
  RecordProperty("state_hash", std::to_string(single_threaded));
}

// Recordings of another version are refused, so that each version has its own bits. Where this fails, the
// physics has changed: raise NativeEngine::version(), and write both here.
TEST(Determinism, VersionOfThePhysicsNamesItsBits) {
  PhysicsFixture fixture;
  EXPECT_EQ(fixture.world().version(), SMARTSURF_VERSION "+physics38");
  EXPECT_EQ(hash_after(3.0), 0xc5550bf733c25872U);
  EXPECT_EQ(hash_of_crowd(1), 0x89cb5d555983d3c1U);
  EXPECT_EQ(hash_of_mechanisms(1), 0x62026dae4ec066bcU);
}
