#include "smartsurf/world/narrowphase/ConvexPair.h"

#include <gtest/gtest.h>

#include <random>

#include "smartsurf/world/field/ColumnSat.h"
#include "tests/unit/smartsurf/world/PlacedBody.h"

using namespace smartsurf;
using namespace smartsurf::world;

namespace {

std::shared_ptr<const scene::Solid> make_block(const Vec3& half) {
  std::vector<Vec3> corners;
  for (int i = 0; i < 8; ++i)
    corners.push_back(
        half.cwiseProduct(Vec3(i & 1 ? 1.0F : -1.0F, i & 2 ? 1.0F : -1.0F, i & 4 ? 1.0F : -1.0F)));
  auto solid = std::make_shared<scene::Solid>();
  const std::uint32_t sizes[] = {4, 4, 4, 4, 4, 4};
  solid->hulls = {scene::make_convex_hull(
      corners, {0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5}, sizes)};
  solid->vertices = corners;
  scene::compute_bounds(*solid);
  return solid;
}

const Vec3 kHalf(0.5F, 0.7F, 0.4F);

PlacedBody body(scene::ShapeKind kind, std::mt19937& random, const Vec3& centre) {
  scene::ObjectSpec o;
  o.shape = kind;
  o.radius = 0.6;
  o.height = 1.2;
  o.size = 2 * kHalf.cast<double>();
  if (kind == scene::ShapeKind::kSolid) o.solid = make_block(kHalf);
  return {o, centre, random_rotation(random)};
}

}  // namespace

TEST(ConvexPair, CachedNormalDoesNotChangeResult) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> u(-1, 1);
  const scene::ShapeKind kinds[] = {scene::ShapeKind::kBox, scene::ShapeKind::kCylinder,
                                    scene::ShapeKind::kSolid};
  constexpr float kMargin = 0.05F;
  int compared = 0;
  for (int i = 0; i < 3000; ++i) {
    const PlacedBody a = body(kinds[i % 3], random, {0, 0, 0});
    const Vec3 away = Vec3(u(random), u(random), u(random)).normalized();
    PlacedBody b = body(kinds[i / 3 % 3], random, away * (1.0F + 0.4F * std::abs(u(random))));
    std::vector<Contact> before, with, without;
    collide_convex(a.placed(), b.placed(), kMargin, nullptr, before);
    if (before.empty() || min_separation(before) < -0.03F) continue;
    b.centre += 0.02F * Vec3(u(random), u(random), u(random));
    b.axes = Eigen::AngleAxisf(0.03F * u(random), Vec3::UnitX()).toRotationMatrix() * b.axes;
    collide_convex(a.placed(), b.placed(), kMargin, &before[0].normal, with);
    collide_convex(a.placed(), b.placed(), kMargin, nullptr, without);
    if (std::min(min_separation(with), min_separation(without)) > kMargin - 2e-3F)
      continue;  // too close to the margin: either may report contacts or none
    ASSERT_FALSE(with.empty() || without.empty()) << i;
    if (min_separation(without) < -0.04F) continue;  // deep: the least penetration is ambiguous
    EXPECT_NEAR(min_separation(with), min_separation(without), 0.025F) << i;  // GJK rounds corners
    ++compared;
  }
  EXPECT_GT(compared, 150);
}

TEST(ConvexPair, SeparationOfSmallBodyFromHugeBox) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> u(-1, 1);
  const scene::ShapeKind kinds[] = {scene::ShapeKind::kBox, scene::ShapeKind::kCylinder,
                                    scene::ShapeKind::kSolid};
  scene::ObjectSpec o;
  o.shape = scene::ShapeKind::kBox;
  o.size = {100, 80, 4};
  constexpr float kMargin = 0.05F;
  for (int i = 0; i < 600; ++i) {
    const PlacedBody huge(o, {u(random), u(random), u(random)}, random_rotation(random));
    PlacedBody small = body(kinds[i % 3], random, {0, 0, 0});
    const Vec3 up = huge.axes.col(2), in_small = small.axes.transpose() * up;
    const float reach = kinds[i % 3] == scene::ShapeKind::kCylinder
                            ? 0.6F * std::abs(in_small.z()) + 0.6F * in_small.head<2>().norm()
                            : in_small.cwiseAbs().dot(kHalf);
    const float separation = 0.01F + 0.015F * u(random);
    small.centre = huge.centre + huge.axes * Vec3(48 * u(random), 38 * u(random), 2 + reach + separation);
    for (const bool huge_first : {true, false}) {
      std::vector<Contact> found;
      const PlacedBody &a = huge_first ? huge : small, &b = huge_first ? small : huge;
      collide_convex(a.placed(), b.placed(), kMargin, nullptr, found);
      ASSERT_FALSE(found.empty()) << i;
      EXPECT_NEAR(min_separation(found), separation, 5e-3F) << i;
      for (const Contact& c : found) EXPECT_GT(std::abs(c.normal.dot(up)), 0.99F) << i;
    }
  }
}

// Flat on a wide body, with the search beginning along the faces' normal: rounding decides among the
// simplices.
TEST(ConvexPair, FindsContactsOfParallelFacesAtAnyTurn) {
  std::mt19937 random(14);
  std::uniform_real_distribution<float> unit(0, 1);
  const auto lying = [&](double width, const Vec3& centre) {
    scene::ObjectSpec o;
    o.shape = unit(random) < 0.5F ? scene::ShapeKind::kBox : scene::ShapeKind::kCylinder;
    o.radius = 0.5 * width, o.height = 0.4;
    o.size = {width, width * (0.5 + 0.5 * static_cast<double>(unit(random))), 0.4};
    const Eigen::AngleAxisf turn(6.3F * unit(random), Vec3::UnitZ()),
        tilt(2e-4F * (unit(random) - 0.5F), Vec3::UnitX());
    return PlacedBody(o, centre, Quat(turn * tilt));
  };
  for (int i = 0; i < 20000; ++i) {
    const float separation = 0.006F * unit(random) - 0.004F;
    const PlacedBody wide = lying(4.0 + 12.0 * static_cast<double>(unit(random)), {15.5F, 15.5F, 0.2F});
    const Vec3 at(15.5F + unit(random) - 0.5F, 15.5F + unit(random) - 0.5F, 0.6F + separation);
    const PlacedBody rider = lying(1.0 + static_cast<double>(unit(random)), at);
    for (const bool wide_first : {true, false}) {
      std::vector<Contact> found;
      const PlacedBody &a = wide_first ? wide : rider, &b = wide_first ? rider : wide;
      collide_convex(a.placed(), b.placed(), 0.02F, nullptr, found);
      ASSERT_FALSE(found.empty()) << i;
      ASSERT_NEAR(min_separation(found), separation, 1.5e-3F) << i;
      for (const Contact& c : found) ASSERT_GT(std::abs(c.normal.z()), 0.99F) << i;
    }
  }
}

TEST(ColumnSat, BoxAndItsHullAgree) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> u(-1, 1);
  const Column column{-0.4F, 0.4F, -0.4F, 0.4F, 0.0F, false, false, false, false};
  int near = 0;
  for (int i = 0; i < 2000; ++i) {
    PlacedBody box =
        body(scene::ShapeKind::kBox, random, Vec3(u(random), u(random), 0.3F + 0.6F * u(random)));
    PlacedBody hull = body(scene::ShapeKind::kSolid, random, box.centre);
    hull.axes = box.axes;
    const Vec3 reach = box.axes.cwiseAbs() * kHalf;
    ColumnSat::BestAxis by_box, by_hull;
    auto find_axis = [&](const PlacedBody& b, ColumnSat::BestAxis& out) {
      ColumnSat axes;
      const ConvexHullShape* piece = b.shape.hulls.empty() ? nullptr : &b.shape.hulls[0];
      axes.set(ConvexProxy({b.shape, piece}, b.centre, b.axes), b.centre - reach, b.centre + reach);
      return axes.find_best_axis(column, 0.1F, false, out);
    };
    const bool box_near = find_axis(box, by_box), hull_near = find_axis(hull, by_hull);
    if (box_near != hull_near) {
      EXPECT_NEAR(box_near ? by_box.separation : by_hull.separation, 0.1F, 1e-4F) << i;
      continue;
    }
    if (!box_near) continue;
    ++near;
    EXPECT_NEAR(by_box.separation, by_hull.separation, 3e-3F) << i;  // edge-edge axes must win by 0.002
  }
  EXPECT_GT(near, 300);
}
