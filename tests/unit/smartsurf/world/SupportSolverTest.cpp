// The friction under several bodies at once is that under each alone, to the bit.
#include "smartsurf/world/solver/SupportSolver.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "tests/unit/smartsurf/world/SupportSubstep.h"

namespace smartsurf::world {
namespace {

// A contact batch whose bodies lie on belts or on cells with velocities of their own; some have no patch.
struct Bodies {
  static constexpr int kPoints = 4;
  std::vector<BatchPoint> points{kPoints};
  std::vector<BatchPointDetail> details{kPoints};
  BodyVelocity velocity[kLanes];
  InverseInertia inverse_inertia[kLanes];
  SupportPatches list[kLanes];

  explicit Bodies(std::mt19937& random) {
    const auto draw = [&random](float low, float high) {
      return std::uniform_real_distribution<float>(low, high)(random);
    };
    for (int lane = 0; lane < kLanes; ++lane) {
      for (int i = 0; i < 3; ++i) {
        velocity[lane].velocity[i] = draw(-1, 1);
        velocity[lane].angular_velocity[i] = draw(-0.3F, 0.3F);
      }
      velocity[lane].inverse_mass = draw(0.1F, 1.0F);
      inverse_inertia[lane] = {draw(1, 2), draw(1, 2), draw(1, 2), 0.1F, -0.2F, 0.1F};
      for (int k = 0; k < kPoints; ++k) {
        points[k].normal_impulse[lane] = draw(0, 1) < 0.2F ? 0.0F : draw(0, 2);
        points[k].normal_mass[lane] = draw(0.1F, 1.0F);
        for (int axis = 0; axis < 2; ++axis) details[k].anchor_a[axis][lane] = draw(-1, 1);
      }
      if (draw(0, 1) < 0.1F) continue;
      SupportPatch& p = list[lane].patches.emplace_back();
      p.row = p.lane = lane, p.count = static_cast<int>(draw(1, 20)), p.point_count = kPoints, p.z = -0.5F;
      p.is_one_belt = draw(0, 1) < 0.5F, p.belt_x = draw(-1, 1), p.has_friction = true;
      list[lane].points = {0, 1, 2, 3};
      SupportSamples& s = list[lane].samples;
      s.resize((p.count + kLanes - 1) / kLanes * kLanes, false);
      for (int i = 0; i < p.count; ++i) {
        s.x[i] = draw(-1, 1), s.y[i] = draw(-1, 1), s.arm[i] = 0.4F, s.weight[i] = draw(0.1F, 1);
        s.velocity_x[i] = p.is_one_belt ? p.belt_x : draw(-1, 1);
        s.velocity_y[i] = p.is_one_belt ? 0.0F : draw(-1, 1);
        for (auto& of_axis : s.friction[0]) of_axis[i] = draw(-0.05F, 0.05F);
      }
    }
  }
  BatchPoints batch_points() { return {points.data(), details.data(), nullptr}; }
  // all_in_lanes: of all patches, not of half of them.
  SupportBatch batch(bool all_in_lanes = false) {
    SupportBatch b;
    b.lanes.point_count = kPoints, b.lanes.lane_count = kLanes;
    for (int lane = 0; lane < kLanes; ++lane) {
      b.lanes.row[lane] = lane;
      if (list[lane].patches.empty()) continue;
      b.list[lane] = &list[lane], b.patch[lane] = list[lane].patches.data();
      b.lanes.points[lane] = b.friction.points[lane] = all_in_lanes || lane % 2 == 0 ? 0xFU : 0U;
      prepare_support(b, lane, velocity[lane], inverse_inertia[lane], 0.5F, 0.25F);
    }
    return b;
  }
};

TEST(SupportSolver, FrictionIsTheSameInLanesAsAlone) {
  std::mt19937 random(20261127);
  int lumped = 0, rubbing = 0;
  for (int draw = 0; draw < 1000; ++draw) {
    Bodies together(random);
    Bodies alone = together;
    SupportBatch of_all = together.batch(), of_each = alone.batch();
    for (const bool is_soft : {true, false}) {
      solve_supports(of_all, kAllLanes, together.batch_points(), is_soft, together.velocity,
                     together.inverse_inertia);
      for (int lane = 0; lane < kLanes; ++lane)
        solve_supports(of_each, 1U << static_cast<unsigned>(lane), alone.batch_points(), is_soft,
                       alone.velocity, alone.inverse_inertia);
    }
    for (int lane = 0; lane < kLanes; ++lane) {
      for (int i = 0; i < 3; ++i) {
        ASSERT_EQ(together.velocity[lane].velocity[i], alone.velocity[lane].velocity[i]) << draw;
        ASSERT_EQ(together.velocity[lane].angular_velocity[i], alone.velocity[lane].angular_velocity[i])
            << draw;
      }
      if (together.list[lane].patches.empty()) continue;
      const SupportPatch &a = together.list[lane].patches[0], &b = alone.list[lane].patches[0];
      for (int i = 0; i < 3; ++i) ASSERT_EQ(a.friction_sum[i], b.friction_sum[i]) << draw;
      ASSERT_EQ(a.is_lumped, b.is_lumped) << draw;
      ASSERT_EQ(together.list[lane].samples.friction, alone.list[lane].samples.friction) << draw;
      ++(a.is_lumped ? lumped : rubbing);
    }
  }
  EXPECT_GT(lumped, 100);
  EXPECT_GT(rubbing, 1000);
}

TEST(SupportSolver, PointsAndFrictionAreTheSameTogetherAsOneAfterTheOther) {
  const DeltaPose at_rest[kLanes] = {};
  std::mt19937 random(20261128);
  int solved = 0, all_stick = 0;
  for (int draw = 0; draw < 4000; ++draw) {
    Bodies together(random);
    // Slow bodies whose faces are belts all stick.
    for (int lane = 0; draw % 2 == 0 && lane < kLanes; ++lane) {
      for (float& v : together.velocity[lane].velocity) v *= 0.01F;
      for (float& v : together.velocity[lane].angular_velocity) v *= 0.01F;
      for (SupportPatch& p : together.list[lane].patches) p.is_one_belt = true, p.belt_x = 0.0F;
    }
    Bodies apart = together;
    const Bodies before = together;
    SupportBatch one = together.batch(true), three = apart.batch(true);
    for (const bool is_soft : {true, false}) {
      solve_points_and_friction(one, together.batch_points(), kSupportSubstep, is_soft, together.velocity,
                                at_rest, together.inverse_inertia);
      const auto solve_points = [&] {
        support_kernels().solve_points(three.lanes, apart.batch_points(), kSupportSubstep, is_soft,
                                       apart.velocity, at_rest, apart.inverse_inertia);
      };
      solve_points();
      solve_supports(three, kAllLanes, apart.batch_points(), is_soft, apart.velocity, apart.inverse_inertia);
      if (!is_soft) solve_points();
    }
    bool sticks = true;
    for (int lane = 0; lane < kLanes; ++lane) {
      for (int i = 0; i < 3; ++i) {
        ASSERT_EQ(together.velocity[lane].velocity[i], apart.velocity[lane].velocity[i]) << draw;
        ASSERT_EQ(together.velocity[lane].angular_velocity[i], apart.velocity[lane].angular_velocity[i])
            << draw;
      }
      for (int k = 0; k < Bodies::kPoints; ++k)
        ASSERT_EQ(together.points[k].normal_impulse[lane], apart.points[k].normal_impulse[lane]) << draw;
      solved += together.velocity[lane].velocity[2] != before.velocity[lane].velocity[2] ? 1 : 0;
      if (together.list[lane].patches.empty()) continue;
      sticks &= together.list[lane].patches[0].is_lumped;
      ASSERT_EQ(together.list[lane].samples.friction, apart.list[lane].samples.friction) << draw;
    }
    all_stick += sticks ? 1 : 0;
  }
  EXPECT_GT(solved, 1000);
  EXPECT_GT(all_stick, 20);
}

}  // namespace
}  // namespace smartsurf::world
