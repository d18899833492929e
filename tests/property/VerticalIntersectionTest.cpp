// VerticalIntersector compared with points sampled along the line.
#include "smartsurf/surface/actuators/VerticalIntersection.h"

#include <gtest/gtest.h>

#include <limits>

#include "RayOracle.h"

using namespace smartsurf;
using scene::ShapeKind;

namespace {

constexpr double kStep = 2e-3;

bool contains(const scene::ObjectSpec& o, const Eigen::Vector3d& from_centre) {
  const Eigen::Vector3d p = o.orientation.inverse() * from_centre;
  const std::size_t pieces = o.shape == ShapeKind::kSolid ? o.solid->hulls.size() : 1;
  for (std::size_t i = 0; i < pieces; ++i)
    if (oracle::signed_distance(o, i, p) <= 0.0) return true;
  return false;
}

struct SampledInterval {
  double low = std::numeric_limits<double>::infinity(), high = -low;
};
SampledInterval sample_along_line(const scene::ObjectSpec& o, double dx, double dy) {
  SampledInterval t;
  for (double z = -6.0; z <= 6.0; z += kStep)
    if (contains(o, {dx, dy, z})) t.low = std::min(t.low, z), t.high = z;
  return t;
}

}  // namespace

TEST(VerticalIntersection, MatchesSampledLine) {
  std::mt19937 random(17);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int kind = 0; kind < scene::kShapeKindCount; ++kind) {
    int crossed = 0, missed = 0;
    for (int i = 0; i < 120; ++i) {
      const scene::ObjectSpec o = oracle::random_object(random, static_cast<ShapeKind>(kind), 8, 8);
      const surface::VerticalIntersector object(o, o.orientation.cast<float>());
      const double spread = (i % 2 ? 1.2 : 0.5) * object.horizontal_reach(), dx = spread * u(random),
                   dy = spread * u(random);
      const surface::VerticalIntersection line =
          object.intersect(static_cast<float>(dx), static_cast<float>(dy));
      const SampledInterval sampled = sample_along_line(o, dx, dy);
      const std::string what = "kind " + std::to_string(kind) + ", object " + std::to_string(i);
      if (sampled.low > sampled.high) {
        ++missed;
        EXPECT_LT(line.high - line.low, 2 * kStep) << what;
        continue;
      }
      ++crossed;
      EXPECT_LT(std::max(std::abs(dx), std::abs(dy)), object.horizontal_reach() + 1e-5) << what;
      EXPECT_NEAR(line.low, sampled.low, 2 * kStep) << what;
      EXPECT_NEAR(line.high, sampled.high, 2 * kStep) << what;
    }
    EXPECT_GT(crossed, 10) << kind;
    EXPECT_GT(missed, 5) << kind;
  }
}
