#include "smartsurf/world/contact/PreviousContacts.h"

#include <gtest/gtest.h>

using namespace smartsurf::world;

namespace {

void add_manifold(ContactList& list, int a, int b, Partner partner = {}) {
  list.manifolds.push_back({a, b, static_cast<std::int32_t>(list.contacts.size()), 1});
  Contact& c = list.contacts.emplace_back();
  c.partner = partner;
  c.normal = Vec3(0, 0, 1);
}

// The contacts of a step with two members; member 0 found the first half of each list.
struct Fixture {
  static constexpr std::size_t kBodies = 8;
  PreviousContacts previous;
  Barrier barrier{2};

  Fixture() {
    ContactList pairs, statics;
    for (const auto& [a, b] : {std::pair{0, 1}, {0, 5}, {2, 3}, {2, 7}}) add_manifold(pairs, a, b);
    for (const int a : {0, 3}) add_manifold(statics, a, Manifold::kStatic, Partner::kCell);
    add_manifold(statics, 4, Manifold::kStatic, Partner{6});
    add_manifold(statics, 7, Manifold::kStatic, Partner::kGround);
    previous.swap_lists(pairs, statics, 2);
    EXPECT_TRUE(pairs.manifolds.empty());
    for (int i = 0; i < 2; ++i) previous.build_index(kBodies, {}, {}, Member{i, 2, barrier});
  }
};

int find_pair(const Fixture& f, std::size_t a, std::size_t b, int member, int expected = 0) {
  return f.previous.find_pair(a, b, member, expected);
}

TEST(PreviousContacts, FindsPairsForAnyMember) {
  const Fixture f;
  for (const int member : {0, 1}) {
    EXPECT_EQ(find_pair(f, 0, 1, member), 0);
    EXPECT_EQ(find_pair(f, 0, 5, member), 1);
    EXPECT_EQ(find_pair(f, 2, 3, member), 2);
    EXPECT_EQ(find_pair(f, 2, 7, member), 3);
  }
}

TEST(PreviousContacts, FindsPairsWhereverTheyAreExpected) {
  const Fixture f;
  for (int expected = 0; expected <= 4; ++expected) EXPECT_EQ(find_pair(f, 2, 3, 0, expected), 2) << expected;
  int expected = 3;
  EXPECT_EQ(f.previous.find_pair(0, 1, 0, expected), 0);
  EXPECT_EQ(expected, 1);
  EXPECT_EQ(f.previous.find_pair(0, 5, 0, expected), 1);
  EXPECT_EQ(expected, 2);
  EXPECT_EQ(f.previous.find_pair(1, 2, 0, expected), -1);
  EXPECT_EQ(expected, 2);
}

TEST(PreviousContacts, ReturnsMinusOneForAbsentPair) {
  const Fixture f;
  EXPECT_EQ(find_pair(f, 1, 2, 0), -1);
  EXPECT_EQ(find_pair(f, 0, 7, 1), -1);
  EXPECT_EQ(f.previous.find_static(1, 0), -1);
}

TEST(PreviousContacts, FindsStaticContactsAndTheirNormals) {
  const Fixture f;
  for (const int member : {0, 1}) {
    EXPECT_EQ(f.previous.find_static(0, member), 0);
    EXPECT_EQ(f.previous.find_static(7, member), 3);
    const Vec3* normal = f.previous.find_static_normal(4, 6, member);
    ASSERT_NE(normal, nullptr);
    EXPECT_EQ(*normal, Vec3(0, 0, 1));
    EXPECT_EQ(f.previous.find_static_normal(4, 5, member), nullptr);
  }
}

TEST(PreviousContacts, SwapReplacesPreviousStep) {
  Fixture f;
  ContactList pairs, statics;
  add_manifold(pairs, 5, 6);
  add_manifold(statics, 1, Manifold::kStatic, Partner::kCell);
  f.previous.swap_lists(pairs, statics, 2);
  for (int i = 0; i < 2; ++i) f.previous.build_index(Fixture::kBodies, {}, {}, Member{i, 2, f.barrier});
  EXPECT_EQ(find_pair(f, 5, 6, 0), 0);
  EXPECT_EQ(find_pair(f, 0, 1, 0), -1);
  EXPECT_EQ(f.previous.find_static(0, 0), -1);
}

}  // namespace
