#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <optional>
#include <random>
#include <string>
#include <vector>

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
// Bodies of all shapes and of masses that differ by up to 1000, some of them joined, fixed, fast or in parts,
// on level, uneven or moving pins with or without a force limit.
std::uint64_t hash_of_random_crowd(unsigned seed, int threads) {
  std::mt19937_64 random(seed);
  const auto draw = [&random](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 0x1p64);
  };
  const auto happens = [&draw](double share) { return draw(0, 1) < share; };
  const auto draw_point = [&draw](double low, double high) {
    const double x = draw(low, high), y = draw(low, high);
    return Eigen::Vector3d(x, y, draw(low, high));
  };
  PhysicsFixture fixture;
  fixture.threads = threads;
  auto& world = fixture.scene.world;
  auto& surface = fixture.scene.surface;
  world.dt_s = happens(0.5) ? 1.0 / 60 : 1.0 / 120;
  world.iterations = happens(0.5) ? 4 : 10;
  fixture.scene.materials[0].restitution = happens(0.5) ? 0.0 : draw(0.1, 0.8);
  surface.rows = surface.columns = 44;
  surface.border_height = 6.0;
  surface.pin.max_speed = 4.0;
  if (happens(0.3)) fixture.cell_force_limit = draw(20, 200);
  const double heavy = happens(0.5) ? draw(0, 0.4) : 0.0, joined = happens(0.7) ? draw(0, 0.6) : 0.0,
               calm = draw(0, 1), apart = draw(1.9, 2.6);
  const bool of_rings = happens(0.2);
  const int across = static_cast<int>(42 / apart);
  std::optional<smartsurf::scene::ObjectId> previous;
  Eigen::Vector3d before;
  for (int i = 0; i < 560; ++i) {
    const Eigen::Vector3d jitter = draw_point(-0.05, 0.05);
    const Eigen::Vector3d at =
        Eigen::Vector3d(1.5 + apart * (i % across), 1.5 + apart * (i / across % across),
                        (of_rings ? 0.3 : 0.7) + 1.7 * (i / (across * across))) +
        jitter;
    smartsurf::scene::ObjectSpec o;
    const int kind = of_rings ? 4 : static_cast<int>(draw(0, 7));
    if (kind == 0) o = sphere(draw(0.4, 0.9), at);
    if (kind == 1) o = cylinder(draw(0.4, 0.8), draw(0.4, 1.4), at);
    if (kind == 2) o = capsule(draw(0.2, 0.4), draw(0.8, 1.4), at);
    if (kind == 3) o = cone(draw(0.5, 0.8), draw(0.8, 1.4), at);
    if (kind == 4) {
      std::vector<Block> blocks;
      const auto parts = static_cast<int>(draw(2, 13));
      for (int k = 0; k < parts; ++k) {
        const double angle = 2 * M_PI * k / parts;
        blocks.push_back({{0.3, 0.3, 0.5}, {0.7 * std::cos(angle), 0.7 * std::sin(angle), 0}});
      }
      o = compound(blocks);
      o.position = at;
      o.mass = 0.045 * parts;
      o.inertia = 0.045 * parts * Eigen::Matrix3d(Eigen::Vector3d(0.27, 0.27, 0.5).asDiagonal());
    }
    if (kind > 4) {
      const double x = draw(0.5, 1.7), y = draw(0.5, 1.7);
      o = box({x, y, draw(0.2, 1.3)}, at);
    }
    if (happens(heavy) && kind != 4) o.mass = std::pow(10.0, draw(0, 3));
    if (!happens(calm)) o.velocity = draw_point(-3, 3);
    if (happens(0.01)) o.velocity = draw_point(-60, 60);
    o.fixed = happens(0.02);
    const auto id = fixture.add(o);
    if (previous && i % across != 0 && happens(joined)) {
      smartsurf::scene::JointSpec joint{.kind = static_cast<smartsurf::scene::JointKind>(draw(0, 4)),
                                        .a = *previous,
                                        .b = id,
                                        .anchor = 0.5 * (before + at),
                                        .axis = draw_point(-1, 1)};
      if (joint.has_coordinate()) {
        if (happens(0.4)) joint.limits = smartsurf::scene::JointLimits{-draw(0, 0.5), draw(0, 0.5)};
        if (happens(0.4)) joint.motor = smartsurf::scene::JointMotor{draw(-3, 3), draw(0, 50)};
      }
      fixture.world().add_joint(joint);
    }
    previous = id, before = at;
  }
  const double swell = happens(0.3) ? 0.0 : draw(0.1, 2), length = draw(0.2, 1.5);
  int step = 0;
  fixture.run(18 * world.dt_s, [&] {
    ++step;
    for (int r = 0; r < surface.rows; ++r)
      for (int c = 0; c < surface.columns; ++c)
        fixture.cells().set_target(
            0, r, c, static_cast<float>(swell * (1.0 + std::sin(length * c + 0.3 * r + 0.1 * step))));
  });
  return fixture.snapshot().state_hash;
}
}  // namespace

// CROWD_SEEDS draws more.
TEST(Determinism, RandomCrowdsAreTheSameOnAnyThreads) {
  const char* const seeds = std::getenv("CROWD_SEEDS");
  for (unsigned seed = 1; seed <= (seeds ? std::strtoul(seeds, nullptr, 10) : 6); ++seed) {
    const std::uint64_t alone = hash_of_random_crowd(seed, 1);
    for (const int threads : {2, 3})
      EXPECT_EQ(hash_of_random_crowd(seed, threads), alone)
          << "crowd " << seed << ", " << threads << " threads";
  }
}

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
  EXPECT_EQ(fixture.world().version(), SMARTSURF_VERSION "+physics39");
  EXPECT_EQ(hash_after(3.0), 0xc5550bf733c25872U);
  EXPECT_EQ(hash_of_crowd(1), 0x89cb5d555983d3c1U);
  EXPECT_EQ(hash_of_mechanisms(1), 0x19192b7bd5dbc915U);
}
