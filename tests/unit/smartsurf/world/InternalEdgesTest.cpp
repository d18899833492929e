#include "smartsurf/world/narrowphase/InternalEdges.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "tests/unit/smartsurf/world/PlacedBody.h"

using namespace smartsurf;
using namespace smartsurf::world;

namespace {

scene::ObjectSpec box(const Vec3& half) {
  scene::ObjectSpec spec;
  spec.shape = scene::ShapeKind::kBox;
  spec.size = 2.0 * half.cast<double>();
  return spec;
}

}  // namespace

// A box beyond the bound is left out before its faces are looked at.
TEST(InternalEdges, NoFaceContinuesBeyondTheBound) {
  std::mt19937 random(23);
  std::uniform_real_distribution<float> u(0, 1);
  int continued = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vec3 half(0.1F + u(random), 0.1F + u(random), 0.1F + u(random));
    const Shape shape = make_shape(box(half));
    // Around a corner, where the bound is reached.
    const Vec3 point = half + 0.15F * Vec3(u(random) - 0.3F, u(random) - 0.3F, u(random) - 0.3F);
    if (!may_continue(shape, point)) continue;
    ++continued;
    EXPECT_LE(point.norm(), greatest_continued_distance(shape)) << i;
  }
  EXPECT_GT(continued, 1000);
}

// Two boxes with level tops, side by side: a tilted contact as far from the seam as a probe reaches is turned
// upright, whatever lies elsewhere.
TEST(InternalEdges, TiltedContactsOnASeamBecomeUpright) {
  std::mt19937 random(41);
  std::uniform_real_distribution<float> u(0, 1);
  for (int i = 0; i < 2000; ++i) {
    const float half_y = 0.5F + u(random), half_z = 0.3F + u(random), far_z = 0.3F + u(random);
    const float half_x[2] = {0.5F + u(random), 0.5F + u(random)};
    const Mat3 axes = random_rotation(random).normalized().toRotationMatrix();
    const Vec3 seam(20.0F * u(random), 20.0F * u(random), 20.0F * u(random));
    const auto at = [&](float x, float y, float z) { return Vec3(seam + axes * Vec3(x, y, z)); };
    const Shape west = make_shape(box({half_x[0], half_y, half_z})),
                east = make_shape(box({half_x[1], half_y, far_z})), far = make_shape(box({1, 1, 1})),
                body = make_shape(box({0.2F, 0.2F, 0.2F}));
    const std::vector<Solid> solids{{far, at(0, 0, 9), axes},
                                    {west, at(-half_x[0], 0, -half_z), axes},
                                    {east, at(half_x[1], 0, -far_z), axes}};
    Contact c;
    const float tilt = 0.1F + 0.6F * u(random), distance = 0.045F * u(random);
    c.normal = axes * Vec3(std::sin(tilt), 0, std::cos(tilt));
    c.separation = 0.0F;
    c.anchor = at(-distance, half_y * (u(random) - 0.5F), -0.01F * u(random)) - seam;
    const std::vector<SeamContact> contacts{{&c, seam, at(0, 0, 0.2F)}};
    mark_internal_edges(solids, true, body, axes, contacts);
    EXPECT_GT(c.normal.dot(axes.col(2)), 0.9999F) << i << ": " << distance << " u from the seam";
  }
}
