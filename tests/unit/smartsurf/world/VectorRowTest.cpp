#include "smartsurf/world/body/VectorRow.h"

#include <gtest/gtest.h>

#include <random>

using namespace smartsurf::world;

TEST(VectorRow, RowsGiveTheBitsOfVectors) {
  for (unsigned seed = 1; seed <= 1000; ++seed) {
    std::mt19937 random(seed);
    std::normal_distribution<float> normal;
    Vec3 a, b;
    for (int i = 0; i < 3; ++i) a[i] = 1e3F * normal(random), b[i] = normal(random);
    EXPECT_EQ(from_row(to_row(a)), a) << seed;
    EXPECT_EQ(from_row(cross(to_row(a), to_row(b))), a.cross(b)) << seed;
    EXPECT_EQ(dot(to_row(a), to_row(b)), a.dot(b)) << seed;
  }
}

TEST(VectorRow, LastComponentsDoNotCount) {
  Float4 a = to_row({1, 2, 3}), b = to_row({4, -5, 6});
  const Vec3 product = from_row(cross(a, b));
  const float sum = dot(a, b);
  a[3] = 7.0F, b[3] = 8.0F;
  EXPECT_EQ(from_row(cross(a, b)), product);
  EXPECT_EQ(dot(a, b), sum);
}
