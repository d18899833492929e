// A free layout whose cells stand on a rectangular grid gives the same contacts as the grid.
#include "smartsurf/world/field/FreeLayoutField.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "smartsurf/world/field/ConvexOnField.h"
#include "smartsurf/world/field/SphereOnField.h"
#include "tests/unit/smartsurf/world/PlacedBody.h"
#include "tests/unit/smartsurf/world/StepFixture.h"

using namespace smartsurf;
using namespace smartsurf::world;

namespace {

constexpr int kLayoutSide = 12;
constexpr float kLayoutMargin = 0.05F;

surface::Field make_random_field(std::mt19937& random, bool level) {
  surface::Field field = make_flat_field(kLayoutSide);
  std::uniform_real_distribution<float> height(-1.0F, 1.0F);
  if (!level)
    for (float& h : field.height) h = height(random);
  field.max_height = *std::max_element(field.height.begin(), field.height.end());
  return field;
}

surface::Field with_positions(surface::Field field) {
  for (int i = 0; i < field.cells(); ++i) {
    const Eigen::Vector2f centre(static_cast<float>(i % kLayoutSide),
                                 static_cast<float>(kLayoutSide - 1 - i / kLayoutSide));
    field.x.push_back(centre.x());
    field.y.push_back(centre.y());
    field.angle.push_back(0.0F);
  }
  return field;
}

class FreeLayout : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Field, FreeLayout, testing::Bool(),
                         [](const auto& instance) { return instance.param ? "Level" : "Rough"; });

TEST_P(FreeLayout, SphereContactsMatchGrid) {
  std::mt19937 random(3);
  const surface::Field grid = make_random_field(random, GetParam()), free_layout = with_positions(grid);
  const FreeLayoutField field(free_layout);
  std::uniform_real_distribution<float> horizontal(3.0F, 8.0F), vertical(0.9F, 1.6F);
  int touching = 0;
  for (int i = 0; i < 300; ++i) {
    const Vec3 centre(horizontal(random), horizontal(random), vertical(random));
    std::vector<Contact> expected, found;
    collide_sphere_with_field(grid, centre, 1.3F, kLayoutMargin, expected);
    field.collide_sphere(centre, 1.3F, kLayoutMargin, {}, found);
    ASSERT_EQ(found.empty(), expected.empty()) << i;
    if (expected.empty()) continue;
    ++touching;
    ASSERT_NEAR(min_separation(found), min_separation(expected), 2e-5F) << i;
  }
  EXPECT_GT(touching, 100);
}

TEST_P(FreeLayout, BoxPenetrationMatchesGrid) {
  std::mt19937 random(4);
  const surface::Field grid = make_random_field(random, GetParam()), free_layout = with_positions(grid);
  const FreeLayoutField field(free_layout);
  scene::ObjectSpec object;
  object.shape = scene::ShapeKind::kBox;
  object.size = {2.2, 1.7, 1.0};
  const Shape box = make_shape(object);
  std::uniform_real_distribution<float> horizontal(3.0F, 8.0F), vertical(0.45F, 0.55F);
  const float top = grid.max_height;
  for (int i = 0; i < 200; ++i) {
    const Vec3 centre(horizontal(random), horizontal(random), top + vertical(random));
    std::vector<Contact> expected, found;
    collide_shape_with_field(grid, box, centre, Mat3::Identity(), kLayoutMargin, expected);
    field.collide(box, centre, Mat3::Identity(), kLayoutMargin, found);
    ASSERT_EQ(found.empty(), expected.empty()) << i;
    if (expected.empty()) continue;
    ASSERT_NEAR(min_separation(found), min_separation(expected), 1e-4F) << i;
  }
}

TEST(FreeLayoutField, RotatedCellUsesItsOwnFrame) {
  surface::Field field = make_flat_field(1);
  field.x = {4.0F};
  field.y = {5.0F};
  field.angle = {0.7853982F};  // 45°: a corner of the top lies 0.4·√2 east of the centre
  const FreeLayoutField free_layout(field);
  std::vector<Contact> inside, outside;
  free_layout.collide_sphere(Vec3(4.5F, 5, 0.09F), 0.1F, 0.0F, {}, inside);
  free_layout.collide_sphere(Vec3(4.7F, 5, 0.09F), 0.1F, 0.0F, {}, outside);
  ASSERT_FALSE(inside.empty());
  EXPECT_NEAR(inside[0].separation, -0.01F, 1e-5F);
  EXPECT_EQ(inside[0].feature_id, 0);
  EXPECT_TRUE(outside.empty());
}

}  // namespace
