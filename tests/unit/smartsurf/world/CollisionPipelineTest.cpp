#include "smartsurf/world/CollisionPipeline.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <vector>

#include "tests/unit/smartsurf/world/StepFixture.h"

using namespace smartsurf;
using namespace smartsurf::world;

namespace {

std::set<std::pair<int, int>> touching_pairs(const ContactList& contacts) {
  std::set<std::pair<int, int>> pairs;
  for (const Manifold& m : contacts.manifolds)
    if (std::any_of(contacts.contacts.begin() + m.first, contacts.contacts.begin() + m.first + m.count,
                    [](const Contact& c) { return c.separation < 0.0F; }))
      pairs.insert({m.a, m.b});
  return pairs;
}

TEST(CollisionPipeline, FindsExactlyTheOverlappingPairs) {
  StepFixture s(32);
  s.add(make_sphere(1.0), Vec3(5, 5, 6));
  s.add(make_sphere(1.0), Vec3(6.9F, 5, 6));
  s.add(make_sphere(1.0), Vec3(20, 20, 6));
  s.add(make_sphere(1.0), Vec3(6, 6.6F, 6));
  s.find_contacts();
  EXPECT_EQ(touching_pairs(s.pair_contacts), (std::set<std::pair<int, int>>{{0, 1}, {0, 3}, {1, 3}}));
  EXPECT_TRUE(s.static_contacts.manifolds.empty());
}

TEST(CollisionPipeline, LargeBodyTouchesSmallBodiesInDistantCells) {
  StepFixture s(64);
  scene::ObjectSpec plate;
  plate.shape = scene::ShapeKind::kBox;
  plate.size = {40, 40, 1};
  const int large = static_cast<int>(s.add(plate, Vec3(32, 32, 10)));
  std::set<std::pair<int, int>> expected;
  for (int k = 0; k < 6; ++k) {
    const auto x = 14.0F + 7.0F * static_cast<float>(k);
    expected.insert({large, static_cast<int>(s.add(make_sphere(0.5), Vec3(x, x, 10.9F)))});
  }
  s.find_contacts();
  EXPECT_EQ(touching_pairs(s.pair_contacts), expected);
}

TEST(CollisionPipeline, NormalsPointTowardsBodyA) {
  StepFixture s(32);
  const std::size_t a = s.add(make_sphere(1.0), Vec3(5, 5, 6)), b = s.add(make_sphere(1.0), Vec3(6.5F, 5, 6));
  s.find_contacts();
  ASSERT_EQ(s.pair_contacts.manifolds.size(), 1U);
  const Manifold& m = s.pair_contacts.manifolds[0];
  ASSERT_EQ(static_cast<std::size_t>(m.a), a);
  ASSERT_EQ(static_cast<std::size_t>(m.b), b);
  const Contact& c = s.pair_contacts.contacts[static_cast<std::size_t>(m.first)];
  EXPECT_NEAR(c.normal.x(), -1.0F, 1e-6F);
  EXPECT_NEAR(c.separation, -0.5F, 1e-5F);
}

TEST(CollisionPipeline, MatchesContactsOfThePreviousStep) {
  StepFixture s(32);
  s.add(make_sphere(1.0), Vec3(5, 5, 0.99F));
  s.add(make_sphere(1.0), Vec3(6.99F, 5, 0.99F));
  s.find_contacts();
  ASSERT_EQ(s.pair_contacts.contacts.size(), 1U);
  s.pair_contacts.contacts[0].normal_impulse = 3.0F;
  s.pair_contacts.contacts[0].friction_impulse = Vec3(0, 0.5F, 0);
  for (Contact& c : s.static_contacts.contacts) c.normal_impulse = 7.0F;
  s.bodies.position[0].x() += 0.005F;  // well below the matching tolerance
  s.find_contacts();
  ASSERT_EQ(s.pair_contacts.contacts.size(), 1U);
  EXPECT_EQ(s.pair_contacts.contacts[0].normal_impulse, 3.0F);
  EXPECT_EQ(s.pair_contacts.contacts[0].friction_impulse, Vec3(0, 0.5F, 0));
  for (const Contact& c : s.static_contacts.contacts) EXPECT_EQ(c.normal_impulse, 7.0F);
}

TEST(CollisionPipeline, NewContactsStartWithZeroImpulse) {
  StepFixture s(32);
  s.add(make_sphere(1.0), Vec3(5, 5, 0.99F));
  s.find_contacts();
  for (Contact& c : s.static_contacts.contacts) c.normal_impulse = 7.0F;
  s.bodies.position[0].z() += 3.0F;
  s.find_contacts();
  EXPECT_TRUE(s.static_contacts.contacts.empty());
  s.bodies.position[0].z() -= 3.0F;
  s.find_contacts();
  ASSERT_FALSE(s.static_contacts.contacts.empty());
  for (const Contact& c : s.static_contacts.contacts) EXPECT_EQ(c.normal_impulse, 0.0F);
}

}  // namespace
