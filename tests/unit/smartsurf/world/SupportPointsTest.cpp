// The normal impulses under several bodies at once are those under each alone, to the bit.
#include "smartsurf/world/solver/SupportPoints.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "tests/unit/smartsurf/world/SupportSubstep.h"

namespace smartsurf::world {
namespace {

// A contact batch whose lanes have bodies on a few points each; some points are not of the patch, some do not
// bear, and some bodies cannot move.
struct Batch {
  static constexpr int kPoints = 6;
  std::vector<BatchPoint> points{kPoints};
  std::vector<BatchPointDetail> details{kPoints};
  BodyVelocity velocity[kLanes];
  DeltaPose delta_pose[kLanes];
  InverseInertia inverse_inertia[kLanes];
  SupportPatches list[kLanes];
  SupportLanes lanes;

  explicit Batch(std::mt19937& random) {
    const auto draw = [&random](float low, float high) {
      return std::uniform_real_distribution<float>(low, high)(random);
    };
    lanes.point_count = kPoints, lanes.lane_count = kLanes;
    for (int lane = 0; lane < kLanes; ++lane) {
      lanes.row[lane] = lane;
      for (int i = 0; i < 3; ++i) {
        velocity[lane].velocity[i] = draw(-0.1F, 0.1F);
        velocity[lane].angular_velocity[i] = draw(-0.1F, 0.1F);
        delta_pose[lane].translation[i] = draw(-1e-3F, 1e-3F);
        delta_pose[lane].rotation[i] = draw(-1e-3F, 1e-3F);
      }
      velocity[lane].inverse_mass = draw(0, 1) < 0.1F ? 0.0F : draw(0.1F, 10.0F);
      inverse_inertia[lane] = {draw(1, 2),        draw(1, 2),        draw(1, 2),
                               draw(-0.3F, 0.3F), draw(-0.3F, 0.3F), draw(-0.3F, 0.3F)};
      SupportPatch p;
      p.row = p.lane = lane;
      for (int k = 0; k < kPoints; ++k) {
        BatchPoint& q = points[k];
        BatchPointDetail& d = details[k];
        for (int axis = 0; axis < 2; ++axis) d.anchor_a[axis][lane] = draw(-1, 1);
        d.surface_velocity[2][lane] = draw(0, 1) < 0.7F ? 0.0F : draw(-0.2F, 0.2F);
        d.steady_impulse[lane] = draw(0, 1);
        q.normal_impulse[lane] = draw(0, 1) < 0.2F ? 0.0F : draw(0, 2);
        q.total_normal_impulse[lane] = draw(0, 2);
        q.normal_mass[lane] = draw(0, 1) < 0.1F ? 0.0F : draw(0.1F, 1.0F);
        q.separation[lane] = draw(-2e-3F, 1e-3F);
        q.relax_target_speed[lane] = draw(-0.01F, 0.01F);
        if (draw(0, 1) < 0.2F) continue;
        list[lane].points.push_back(k);
        lanes.points[lane] |= 1U << static_cast<unsigned>(k);
        ++p.point_count;
      }
      lanes.set_body(lane, velocity[lane].inverse_mass, inverse_inertia[lane]);
      list[lane].patches.push_back(p);
    }
  }
  BatchPoints batch_points() { return {points.data(), details.data(), nullptr}; }
};

TEST(SupportPoints, AreTheSameInLanesAsAlone) {
  std::mt19937 random(20261127);
  int changed = 0;
  for (int draw = 0; draw < 2000; ++draw) {
    Batch together(random);
    Batch alone = together;
    const Batch before = together;
    const bool is_soft = draw % 2 == 0;
    support_kernels().solve_points(together.lanes, together.batch_points(), kSupportSubstep, is_soft,
                                   together.velocity, together.delta_pose, together.inverse_inertia);
    for (int lane = 0; lane < kLanes; ++lane)
      solve_support_points(alone.list[lane], alone.list[lane].patches[0], alone.batch_points(),
                           kSupportSubstep, is_soft, alone.velocity[lane], alone.delta_pose[lane],
                           alone.inverse_inertia[lane]);
    for (int lane = 0; lane < kLanes; ++lane) {
      for (int i = 0; i < 3; ++i) {
        ASSERT_EQ(together.velocity[lane].velocity[i], alone.velocity[lane].velocity[i]) << draw;
        ASSERT_EQ(together.velocity[lane].angular_velocity[i], alone.velocity[lane].angular_velocity[i])
            << draw;
      }
      for (int k = 0; k < Batch::kPoints; ++k) {
        ASSERT_EQ(together.points[k].normal_impulse[lane], alone.points[k].normal_impulse[lane]) << draw;
        ASSERT_EQ(together.points[k].total_normal_impulse[lane], alone.points[k].total_normal_impulse[lane])
            << draw;
      }
      changed += together.velocity[lane].velocity[2] != before.velocity[lane].velocity[2];
    }
  }
  EXPECT_GT(changed, 2000);  // of 16 000 bodies: most draws have a point that would have to pull
}

}  // namespace
}  // namespace smartsurf::world
