#include "smartsurf/world/Sleep.h"

#include <gtest/gtest.h>

#include "tests/unit/smartsurf/world/StepFixture.h"

using namespace smartsurf;
using namespace smartsurf::world;

namespace {

constexpr float kDt = StepFixture::kDt;

void add_contact_of(ContactList& list, int a, int b) {
  list.manifolds.push_back({a, b, static_cast<std::int32_t>(list.contacts.size()), 1});
  list.contacts.emplace_back().partner = b < 0 ? Partner::kCell : Partner{};
}

int pair_count(const Sleep& sleep) {
  int count = 0;
  sleep.contacts().for_each_pair([&](const Manifold&, std::span<const Contact>) { ++count; });
  return count;
}
std::vector<std::int32_t> bodies_on_field(const Sleep& sleep) {
  std::vector<std::int32_t> out;
  sleep.contacts().for_each_static([&](const Manifold& m, std::span<const Contact>) { out.push_back(m.a); });
  return out;
}

// A row of spheres, each in contact with the next and with the field.
struct Row {
  surface::Field field = make_flat_field(32);
  BodyStore bodies;
  ContactList pairs, statics;
  Sleep sleep{field, {.gravity = Vec3(0, 0, -9.81F), .dt_s = kDt}};
  std::vector<std::int32_t> active;

  explicit Row(int n) {
    for (int i = 0; i < n; ++i) {
      bodies.add(static_cast<scene::ObjectId>(i), make_sphere(1.0), {});
      scene::ObjectStateUpdate update;
      update.position = Eigen::Vector3d(2.0 * i + 2, 16, 1);
      bodies.set_state(static_cast<std::size_t>(i), update);
      if (i > 0) add_contact_of(pairs, i - 1, i);
      add_contact_of(statics, i, Manifold::kStatic);
      active.push_back(i);
    }
  }
  // Lets the bodies rest for that long, then updates the sleeping set once.
  void rest(float seconds) {
    for (float t = 0.0F; t < seconds; t += kDt)
      for (const std::int32_t i : active) sleep.update_sleep_timer(bodies, static_cast<std::size_t>(i));
    sleep.update_sleeping_set(bodies, active, pairs, statics);
  }
};

TEST(Sleep, BodiesFallAsleepAfterHalfASecondOfRest) {
  Row row(3);
  row.rest(0.45F);
  EXPECT_EQ(row.sleep.sleeping_count(), 0);
  row.rest(0.1F);
  EXPECT_EQ(row.sleep.sleeping_count(), 3);
  EXPECT_EQ(row.bodies.body_velocity[0].inverse_mass, 0.0F);
  EXPECT_EQ(pair_count(row.sleep), 2);
  EXPECT_EQ(bodies_on_field(row.sleep).size(), 3U);
}

TEST(Sleep, MovingNeighbourKeepsBodyAwake) {
  Row row(3);
  scene::ObjectStateUpdate update;
  update.velocity = Eigen::Vector3d(1, 0, 0);
  row.bodies.set_state(2, update);
  row.rest(0.6F);
  EXPECT_TRUE(row.bodies.asleep[0]);
  EXPECT_FALSE(row.bodies.asleep[1]);  // touches the moving body
  EXPECT_FALSE(row.bodies.asleep[2]);
}

TEST(Sleep, SlowAcceleratingBodyStaysAwake) {
  Row row(1);
  for (int i = 0; i < 240; ++i) {
    row.bodies.body_velocity[0].velocity[0] = 0.02F * kDt * static_cast<float>(i);  // below 0.02 u/s
    row.sleep.update_sleep_timer(row.bodies, 0);
    row.sleep.update_sleeping_set(row.bodies, row.active, row.pairs, row.statics);
  }
  EXPECT_EQ(row.sleep.sleeping_count(), 0);
  row.rest(1.1F);
  EXPECT_EQ(row.sleep.sleeping_count(), 1) << "at constant velocity it falls asleep";
}

TEST(Sleep, NoBodyFallsAsleepIfDisabled) {
  Row row(2);
  Sleep sleep(row.field, {.gravity = Vec3(0, 0, -9.81F), .dt_s = kDt}, false);
  for (int i = 0; i < 240; ++i)
    for (const std::int32_t k : row.active) sleep.update_sleep_timer(row.bodies, static_cast<std::size_t>(k));
  sleep.update_sleeping_set(row.bodies, row.active, row.pairs, row.statics);
  EXPECT_EQ(sleep.sleeping_count(), 0);
}

TEST(Sleep, UnsupportedBodyStaysAwake) {
  Row row(1);
  row.statics.clear();
  row.rest(0.6F);
  EXPECT_EQ(row.sleep.sleeping_count(), 0);
}

TEST(Sleep, WakingAnIslandReachesAllConnectedBodies) {
  Row row(5);
  row.rest(0.6F);
  ASSERT_EQ(row.sleep.sleeping_count(), 5);
  row.sleep.wake_island(row.bodies, 0);
  EXPECT_EQ(row.sleep.sleeping_count(), 0);
  for (std::size_t i = 0; i < 5; ++i) EXPECT_GT(row.bodies.body_velocity[i].inverse_mass, 0.0F);
  ContactList pairs, statics;
  SupportPatches supports;
  row.sleep.restore_contacts(pairs, statics, supports);
  EXPECT_EQ(pairs.manifolds.size(), 4U);
  EXPECT_EQ(statics.manifolds.size(), 5U);
  EXPECT_EQ(pair_count(row.sleep), 0);
}

TEST(Sleep, ForceWakesItsIsland) {
  Row row(3);
  row.rest(0.6F);
  row.bodies.wrench[1].force = Vec3(1, 0, 0);
  row.sleep.wake_forced(row.bodies);
  for (const int i : {0, 1, 2}) EXPECT_FALSE(row.bodies.asleep[i]);
}

TEST(Sleep, MovingCellWakesBodyAbove) {
  Row row(5);
  row.rest(0.6F);
  const auto cell = static_cast<std::size_t>(row.field.index(31 - 16, 10));  // under the last body, at x = 10
  row.field.speed[cell] = 0.5F;
  row.field.max_speed = 0.5F;
  row.sleep.wake_on_moving_cells(row.bodies);
  EXPECT_FALSE(row.bodies.asleep[4]);
  EXPECT_TRUE(row.bodies.asleep[0]);
}

TEST(Sleep, RemovedBodyLeavesNoContacts) {
  Row row(3);
  row.rest(0.6F);
  row.sleep.on_body_removed(1);
  EXPECT_EQ(pair_count(row.sleep), 0);
  EXPECT_EQ(bodies_on_field(row.sleep), (std::vector<std::int32_t>{0, 1})) << "1 was 2";
}

}  // namespace
