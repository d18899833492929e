#include "smartsurf/world/body/Shape.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

using namespace smartsurf::world;

TEST(LinearFunctions, ArgmaxFindsLargestDotProduct) {
  std::mt19937 random(2);
  std::normal_distribution<float> u;
  auto any = [&] { return Vec3(u(random), u(random), u(random)); };
  for (const std::size_t count : {1U, 3U, 4U, 5U, 12U, 30U, 256U, 700U}) {
    std::vector<Vec3> vectors(count);
    for (Vec3& v : vectors) v = any().normalized() * 3.0F;
    LinearFunctions blocks;
    blocks.assign(vectors);
    for (int i = 0; i < 100; ++i) {
      const Vec3 direction = any();
      float most = -1e9F;
      for (const Vec3& v : vectors) most = std::max(most, v.dot(direction));
      const std::size_t found = blocks.argmax(direction);
      ASSERT_LT(found, count);
      EXPECT_NEAR(vectors[found].dot(direction), most, 3e-5F * direction.norm()) << count;
    }
  }
}
