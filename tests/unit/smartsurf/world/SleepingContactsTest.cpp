#include "smartsurf/world/SleepingContacts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <set>
#include <string>
#include <tuple>
#include <vector>

using namespace smartsurf::world;

namespace {

constexpr int kBodies = 40;

// A manifold and its contacts, or a patch and its samples, as the bits that the store must return.
using Entry = std::tuple<std::int32_t, std::int32_t, std::string>;

std::string bits_of(std::span<const Contact> contacts) {
  std::string bits;
  for (const Contact& c : contacts) {
    const float values[] = {c.normal.x(),           c.normal.y(),           c.normal.z(),
                            c.anchor.x(),           c.anchor.y(),           c.anchor.z(),
                            c.separation,           c.normal_impulse,       c.friction_impulse.x(),
                            c.friction_impulse.y(), c.friction_impulse.z(), c.rolling_impulse.x(),
                            c.rolling_impulse.y(),  c.rolling_impulse.z(),  c.total_normal_impulse};
    bits.append(reinterpret_cast<const char*>(values), sizeof values);
  }
  return bits;
}
std::string bits_of(const SupportPatches& list, const SupportPatch& p) {
  std::string bits(reinterpret_cast<const char*>(&p.z), sizeof p.z);
  for (int i = p.first; i < p.first + p.count; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const SupportSamples& s = list.samples;
    for (const float v : {s.x[at], s.y[at], s.load[at], s.friction[0][1][at], s.friction[1][2][at],
                          static_cast<float>(s.cell[at])})
      bits.append(reinterpret_cast<const char*>(&v), sizeof v);
  }
  return bits;
}

struct Lists {
  ContactList pairs, statics;
  SupportPatches supports;

  std::multiset<Entry> entries() const {
    std::multiset<Entry> out;
    for (const ContactList* list : {&pairs, &statics})
      for (const Manifold& m : list->manifolds) out.insert({m.a, m.b, bits_of(list->contacts_of(m))});
    for (const SupportPatch& p : supports.patches) out.insert({p.body, -2, bits_of(supports, p)});
    return out;
  }
};

struct Stored {
  std::mt19937 random{17};
  SleepingContacts store;
  std::vector<Entry> expected;  // in the order in which they were added

  float uniform() { return std::uniform_real_distribution<float>(-1, 1)(random); }
  int below(int n) { return std::uniform_int_distribution<int>(0, n - 1)(random); }
  Vec3 vector() { return {uniform(), uniform(), uniform()}; }

  void add_manifold(std::int32_t a, std::int32_t b) {
    ContactList list;
    list.contacts.resize(3);  // not at the beginning of its list
    list.manifolds.push_back({a, b, 3, 1 + below(6)});
    for (int k = 0; k < list.manifolds[0].count; ++k) {
      Contact& c = list.contacts.emplace_back();
      c.normal = vector(), c.anchor = vector(), c.separation = uniform(), c.normal_impulse = uniform();
      c.friction_impulse = vector(), c.rolling_impulse = vector(), c.total_normal_impulse = uniform();
    }
    store.add(list, list.manifolds[0], kBodies);
    expected.emplace_back(a, b, bits_of(list.contacts_of(list.manifolds[0])));
  }
  void add_patch(std::int32_t body) {
    SupportPatches list;
    list.samples.resize(24, false);
    for (auto* values : {&list.samples.x, &list.samples.y, &list.samples.load, &list.samples.friction[0][1],
                         &list.samples.friction[1][2]})
      for (float& v : *values) v = uniform();
    for (std::int32_t& cell : list.samples.cell) cell = below(1000);
    SupportPatch& p = list.patches.emplace_back();
    p.body = body, p.first = 5, p.count = 1 + below(19), p.z = uniform();
    store.add(list, p, kBodies);
    expected.emplace_back(body, -2, bits_of(list, p));
  }
  // All contacts of a body that fell asleep with some neighbours.
  void put_to_sleep(std::int32_t body) {
    add_manifold(body, Manifold::kStatic);
    if (below(2) == 0) add_patch(body);
    std::set<std::int32_t> neighbours;
    for (int k = below(5); k > 0; --k) neighbours.insert(below(kBodies));
    for (const std::int32_t other : neighbours)
      if (other != body && !has_pair(body, other)) add_manifold(std::min(body, other), std::max(body, other));
  }
  bool has_pair(std::int32_t one, std::int32_t other) const {
    return std::ranges::any_of(expected, [&](const Entry& e) {
      return std::get<0>(e) == std::min(one, other) && std::get<1>(e) == std::max(one, other);
    });
  }
  std::multiset<Entry> take_out(std::int32_t body) {
    Lists out;
    store.take_out(body, out.pairs, out.statics, out.supports);
    return out.entries();
  }
  std::multiset<Entry> expect_out(std::int32_t body) {
    std::multiset<Entry> out;
    std::erase_if(expected, [&](const Entry& e) {
      const bool is_of_body = std::get<0>(e) == body || std::get<1>(e) == body;
      if (is_of_body) out.insert(e);
      return is_of_body;
    });
    return out;
  }
  // What the store holds, in its order.
  std::vector<Entry> pairs() const {
    std::vector<Entry> out;
    store.for_each_pair([&](const Manifold& m, std::span<const Contact> contacts) {
      out.emplace_back(m.a, m.b, bits_of(contacts));
    });
    return out;
  }
  std::vector<Entry> expected_pairs() const {
    std::vector<Entry> out;
    std::ranges::copy_if(expected, std::back_inserter(out),
                         [](const Entry& e) { return std::get<1>(e) >= 0; });
    return out;
  }
  void save_and_restore() {
    std::string bytes;
    common::StateArchive out(bytes);
    store.archive(out);
    store = {};
    common::StateArchive in{std::string_view(bytes)};
    store.archive(in);
  }
};

}  // namespace

TEST(SleepingContacts, ReturnTheBitsOfRandomBodies) {
  Stored s;
  std::vector<char> asleep(kBodies, 0);
  std::size_t returned = 0;
  for (int i = 0; i < 3000; ++i) {
    const std::int32_t body = s.below(kBodies);
    char& is_asleep = asleep[static_cast<std::size_t>(body)];
    if (is_asleep) {
      const std::multiset<Entry> expected = s.expect_out(body);
      ASSERT_EQ(s.take_out(body), expected) << i;
      returned += expected.size();
    } else {
      s.put_to_sleep(body);
    }
    is_asleep = !is_asleep;
    ASSERT_EQ(s.pairs(), s.expected_pairs()) << i;
    if (i % 100 == 50) s.save_and_restore();
  }
  EXPECT_GT(returned, 3000U);
}

TEST(SleepingContacts, NeighboursAreThoseOfManifolds) {
  Stored s;
  s.add_manifold(3, 7);
  s.add_manifold(7, 20);
  s.add_manifold(7, Manifold::kStatic);
  s.add_manifold(1, 3);
  const auto neighbours = [&](std::int32_t body) {
    std::set<std::int32_t> out;
    s.store.for_each_neighbour(body, [&](std::int32_t other) { out.insert(other); });
    return out;
  };
  EXPECT_EQ(neighbours(7), (std::set<std::int32_t>{3, 20}));
  EXPECT_EQ(neighbours(3), (std::set<std::int32_t>{1, 7}));
  EXPECT_EQ(neighbours(5), std::set<std::int32_t>{});
  s.take_out(3);
  EXPECT_EQ(neighbours(7), std::set<std::int32_t>{20});
  s.store.on_body_removed(2);  // 7 becomes 6
  EXPECT_EQ(neighbours(6), std::set<std::int32_t>{19});
}
