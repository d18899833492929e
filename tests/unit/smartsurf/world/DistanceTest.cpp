#include "smartsurf/world/narrowphase/Distance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

using namespace smartsurf;
using namespace smartsurf::world;

namespace {

// Flat and skewed: near its edges, the face plane of largest separation is often not that of the nearest
// face.
std::shared_ptr<const scene::Solid> make_skew_tetrahedron() {
  const std::vector<Vec3> corners{{-2, 0.4F, 0}, {2, -0.3F, 0.1F}, {0.2F, -0.6F, 0.35F}, {-0.4F, 0.7F, 0.3F}};
  std::vector<std::uint16_t> loops;
  // One face per omitted corner, wound counter-clockwise as seen from outside.
  for (std::uint16_t left_out = 0; left_out < 4; ++left_out) {
    std::uint16_t loop[3];
    for (std::uint16_t i = 0, k = 0; i < 4; ++i)
      if (i != left_out) loop[k++] = i;
    const Vec3 &a = corners[loop[0]], &b = corners[loop[1]], &c = corners[loop[2]];
    if ((b - a).cross(c - a).dot(corners[left_out] - a) > 0.0F) std::swap(loop[1], loop[2]);
    loops.insert(loops.end(), loop, loop + 3);
  }
  auto solid = std::make_shared<scene::Solid>();
  const std::uint32_t sizes[] = {3, 3, 3, 3};
  solid->hulls = {scene::make_convex_hull(corners, loops, sizes)};
  solid->vertices = corners;
  scene::compute_bounds(*solid);
  return solid;
}

}  // namespace

// The hull lies entirely behind the plane through its closest point, so no point of it is nearer.
TEST(Distance, HullDistanceIsPlaneSeparation) {
  scene::ObjectSpec spec;
  spec.shape = scene::ShapeKind::kSolid;
  spec.solid = make_skew_tetrahedron();
  const Shape shape = make_shape(spec);
  const auto& corners = spec.solid->hulls[0].vertices;
  std::mt19937 random(17);
  std::uniform_real_distribution<float> u(-1, 1);
  int outside = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vec3 p(3.0F * u(random), 1.5F * u(random), 1.5F * u(random));
    const SignedDistance o = signed_distance({shape, shape.hulls.data()}, p);
    if (o.distance <= 0.0F) continue;
    ++outside;
    float highest = -1e9F;
    for (const Vec3& corner : corners) highest = std::max(highest, o.normal.dot(corner));
    EXPECT_NEAR(o.normal.dot(p) - highest, o.distance, 1e-4F) << p.transpose();
  }
  EXPECT_GT(outside, 1000);
}
