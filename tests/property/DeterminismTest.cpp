#include <gtest/gtest.h>

#include "tests/property/PhysicsBench.h"

using namespace physics_bench;

namespace {
std::uint64_t hash_after(double seconds, double nudge = 0.0) {
  PhysicsBench bench;
  for (int i = 0; i < 40; ++i) {
    const Eigen::Vector3d at(4.0 + (i % 6) * 4.5 + nudge, 4.0 + (i / 6 % 6) * 4.5, 4.0 + i / 36 * 4.0);
    if (i % 3 == 0) bench.add(sphere(1.0 + 0.1 * (i % 5), at));
    if (i % 3 == 1) bench.add(box({2, 1.5, 1.2}, at));
    if (i % 3 == 2) bench.add(cylinder(0.8, 2, at));
  }
  int step = 0;
  bench.run(seconds, [&] {
    if (++step % 16 == 0)
      for (int c = 0; c < 32; ++c) bench.cells().set_target(0, step / 16 % 32, c, static_cast<float>((c + step) % 3));
  });
  return bench.look().state_hash;
}
}  // namespace

TEST(Determinism, TwoRunsGiveTheSameBits) { EXPECT_EQ(hash_after(3.0), hash_after(3.0)); }

TEST(Determinism, TheHashSeesTheSmallestDifference) { EXPECT_NE(hash_after(1.0), hash_after(1.0, 1e-5)); }
