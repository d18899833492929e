#include "smartsurf/world/solver/ContactKernels.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include "smartsurf/world/body/Vec.h"

using namespace smartsurf::world;

namespace {

// Sixteen bodies of random mass, inertia and motion. Lane l is a one-point contact of bodies l and 8 + l.
struct Lanes {
  std::mt19937 random{5};
  std::vector<BodyVelocity> motion{16};
  std::vector<DeltaPose> shift{16};
  std::vector<InverseInertia> inertia{16};
  std::vector<Mat3> inverse{16};
  ContactBatch batch;
  BatchPoint point{};
  BatchPointDetail detail{};
  SubstepParams pass{.h_s = 1.0F / 300,
                     .inverse_h = 300.0F,
                     .bias_rate = 20.0F,
                     .mass_scale = 0.9F,
                     .impulse_scale = 0.1F,
                     .steady_share = 0.5F,
                     .steady_gain = 0.25F,
                     .max_bias_velocity = 4.0F,
                     .substep_fraction = 0.2F};

  float draw() { return std::uniform_real_distribution<float>(-1, 1)(random); }
  Vec3 draw3() { return {draw(), draw(), draw()}; }

  Lanes() {
    for (std::size_t i = 0; i < 16; ++i) {
      const Mat3 turn = Quat(draw(), draw(), draw(), draw()).normalized().toRotationMatrix();
      inverse[i] = turn * Vec3(0.1F, 0.5F, 1.7F).asDiagonal() * turn.transpose();
      const Mat3& m = inverse[i];
      inertia[i] = {m(0, 0), m(1, 1), m(2, 2), m(0, 1), m(0, 2), m(1, 2), {}};
      motion[i].inverse_mass = 0.6F + 0.5F * draw();
      for (int k = 0; k < 3; ++k) motion[i].velocity[k] = draw(), motion[i].angular_velocity[k] = draw();
    }
    batch.point_count = 1;
    batch.lane_count = kLanes;
    for (int l = 0; l < kLanes; ++l) {
      batch.a[l] = l;
      batch.b[l] = 8 + l;
      const Vec3 n = draw3().normalized(), a = draw3(), b = draw3();
      for (int k = 0; k < 3; ++k)
        point.normal[k][l] = n[k], detail.anchor_a[k][l] = a[k], detail.anchor_b[k][l] = b[k];
      point.separation[l] = -0.01F;
      point.friction[l] = 0.5F;
    }
  }
  void run(const ContactKernel (&kernel)[kContactKindCount]) {
    kernel[kGeneralPair](&batch, 1, {&point, &detail, nullptr}, {motion.data(), shift.data(), inertia.data()},
                         pass);
  }
  Vec3 of(const float (&lanes)[3][kLanes], int l) const { return {lanes[0][l], lanes[1][l], lanes[2][l]}; }
  // Inverse effective mass along the normal.
  float yielding(int l) const {
    const auto a = static_cast<std::size_t>(l), b = a + 8;
    const Vec3 n = of(point.normal, l), ta = of(detail.anchor_a, l).cross(n),
               tb = of(detail.anchor_b, l).cross(n);
    return motion[a].inverse_mass + motion[b].inverse_mass + ta.dot(inverse[a] * ta) +
           tb.dot(inverse[b] * tb);
  }
  // Velocity of a relative to b at the contact point.
  Vec3 relative(int l) const {
    const auto a = static_cast<std::size_t>(l), b = a + 8;
    const Vec3 va = Vec3(motion[a].velocity) + Vec3(motion[a].angular_velocity).cross(of(detail.anchor_a, l));
    const Vec3 vb = Vec3(motion[b].velocity) + Vec3(motion[b].angular_velocity).cross(of(detail.anchor_b, l));
    return va - vb;
  }
  float closing(int l) const { return of(point.normal, l).dot(relative(l)); }
  Vec3 slip(int l) const { return relative(l) - of(point.normal, l) * closing(l); }
};

}  // namespace

TEST(ContactKernels, PrepareSetsEffectiveMassAndApproachSpeed) {
  Lanes lanes;
  lanes.run(contact_kernels().prepare);
  for (int l = 0; l < kLanes; ++l) {
    EXPECT_NEAR(lanes.point.normal_mass[l] * lanes.yielding(l), 1.0F, 1e-4F) << l;
    EXPECT_NEAR(lanes.point.approach_speed[l], lanes.closing(l), 1e-4F) << l;
  }
}

TEST(ContactKernels, PrepareSetsSlipPerImpulse) {
  Lanes lanes;
  lanes.run(contact_kernels().prepare);
  const Lanes before = lanes;
  std::fill_n(lanes.point.normal_impulse, kLanes, 0.5F);
  lanes.run(contact_kernels().warm_start);
  for (int l = 0; l < kLanes; ++l)
    EXPECT_LT((lanes.slip(l) - before.slip(l) - 0.5F * lanes.of(lanes.detail.slip_per_impulse, l)).norm(),
              1e-5F)
        << l;
}

TEST(ContactKernels, RelaxStopsClosingMotion) {
  Lanes lanes;
  lanes.run(contact_kernels().prepare);
  std::fill_n(lanes.point.friction, kLanes, 0.0F);
  lanes.run(contact_kernels().relax);
  for (int l = 0; l < kLanes; ++l) {
    if (lanes.point.approach_speed[l] < 0.0F) {
      EXPECT_NEAR(lanes.closing(l), 0.0F, 1e-4F) << l;
      EXPECT_NEAR(lanes.point.normal_impulse[l], -lanes.point.approach_speed[l] * lanes.point.normal_mass[l],
                  1e-3F)
          << l;
    } else {
      EXPECT_EQ(lanes.point.normal_impulse[l], 0.0F) << l;
    }
  }
}

TEST(ContactKernels, ConservesMomentumAndSkipsUnusedLanes) {
  Lanes lanes;
  lanes.batch.lane_count = 5;
  for (int l = 5; l < kLanes; ++l) lanes.batch.a[l] = 0, lanes.batch.b[l] = 8;
  const auto before = lanes.motion;
  lanes.run(contact_kernels().prepare);
  lanes.run(contact_kernels().solve);
  for (std::size_t l = 0; l < 8; ++l) {
    auto momentum = [l](const std::vector<BodyVelocity>& m) {
      return Vec3(Vec3(m[l].velocity) / m[l].inverse_mass + Vec3(m[l + 8].velocity) / m[l + 8].inverse_mass);
    };
    EXPECT_LT((momentum(lanes.motion) - momentum(before)).norm(), 1e-4F) << l;
    if (l >= 5) {
      EXPECT_EQ(Vec3(lanes.motion[l].velocity), Vec3(before[l].velocity));
    }
  }
}

// Body 1 of three keeps what contacts have changed since the last substep, 1 u/s, beside the external
// change; the rows before and after are left alone.
TEST(ContactKernels, IntegratesVelocitiesOfTheRowsGiven) {
  std::vector<BodyVelocity> velocity(3, {{2, 3, 4}, 0.5F, {5, 6, 7}, 0.25F});
  std::vector<BodyVelocity> start(3, {{1, 2, 3}, 9, {4, 5, 6}, 9});
  const BodyVelocity change{{0, 0, -10}, 8, {0, 20, 0}, 8};
  contact_kernels().integrate_velocities(1, 2, change, false, velocity.data(), start.data());
  EXPECT_EQ(Vec3(start[1].velocity), Vec3(2, 3, -6));
  EXPECT_EQ(Vec3(start[1].angular_velocity), Vec3(5, 26, 7));
  EXPECT_EQ(Vec3(velocity[1].velocity), Vec3(3, 4, -5));
  EXPECT_EQ(Vec3(velocity[1].angular_velocity), Vec3(6, 27, 8));
  EXPECT_EQ(velocity[1].inverse_mass, 0.5F);
  EXPECT_EQ(velocity[1].inverse_inertia, 0.25F);
  for (const std::size_t other : {0U, 2U}) EXPECT_EQ(Vec3(velocity[other].velocity), Vec3(2, 3, 4)) << other;
  contact_kernels().integrate_velocities(0, 1, change, true, velocity.data(), start.data());
  EXPECT_EQ(Vec3(velocity[0].velocity), Vec3(2, 3, -6)) << "the first substep knows no change by contacts";
  velocity[2] = {{3e7F, -3e7F, 0}, 0.5F, {0, 0, 0}, 0.25F};
  contact_kernels().integrate_velocities(2, 3, change, true, velocity.data(), start.data());
  EXPECT_EQ(Vec3(velocity[2].velocity), Vec3(kMaxSpeed, -kMaxSpeed, -10));
}

TEST(ContactKernels, IntegratesPositionsOfTheRowsGiven) {
  const std::vector<BodyVelocity> velocity(2, {{2, 3, 4}, 0.5F, {5, 6, 7}, 0.25F});
  std::vector<DeltaPose> pose(2, {{1, 1, 1}, 0, {2, 2, 2}, 0});
  contact_kernels().integrate_positions(1, 2, 0.5F, velocity.data(), pose.data());
  EXPECT_EQ(Vec3(pose[0].translation), Vec3(1, 1, 1));
  EXPECT_EQ(Vec3(pose[1].translation), Vec3(2, 2.5F, 3));
  EXPECT_EQ(Vec3(pose[1].rotation), Vec3(4.5F, 5, 5.5F));
  EXPECT_EQ(pose[1].unused, 0.0F);
}

// Random rows, some of them at rest, too fast or not finite, some steps without gravity.
TEST(ContactKernels, FreeFlightHasTheBitsOfItsSubsteps) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> u(-20, 20);
  const auto draw = [&] {
    const auto kind = random() % 12;
    return kind == 0                        ? 0.0F
           : kind == 1                      ? -0.0F
           : kind == 2                      ? 1e6F * u(random)
           : kind == 3 && random() % 8 == 0 ? std::numeric_limits<float>::quiet_NaN()
                                            : u(random);
  };
  for (int repetition = 0; repetition < 500; ++repetition) {
    const int rows = 1 + static_cast<int>(random() % 9), substeps = 1 + static_cast<int>(random() % 8);
    const float h_s = 1.0F / static_cast<float>(200 + random() % 2000);
    std::vector<BodyVelocity> velocity(static_cast<std::size_t>(rows));
    std::vector<DeltaPose> pose(velocity.size());
    for (BodyVelocity& v : velocity)
      v = {{draw(), draw(), draw()}, std::abs(draw()), {draw(), draw(), draw()}, std::abs(draw())};
    BodyVelocity change{{0, 0, -0.0F}, 0, {-0.0F, -0.0F, -0.0F}, 0};
    if (repetition % 4 != 0)
      for (float& component : change.velocity) component = h_s * draw();
    std::vector<BodyVelocity> expected = velocity, start(velocity.size());
    std::vector<DeltaPose> expected_pose = pose;
    for (int s = 0; s < substeps; ++s) {
      contact_kernels().integrate_velocities(0, rows, change, s == 0, expected.data(), start.data());
      contact_kernels().integrate_positions(0, rows, h_s, expected.data(), expected_pose.data());
    }
    contact_kernels().integrate_free(0, rows, substeps, h_s, change, velocity.data(), pose.data());
    ASSERT_EQ(std::memcmp(velocity.data(), expected.data(), velocity.size() * sizeof(BodyVelocity)), 0);
    ASSERT_EQ(std::memcmp(pose.data(), expected_pose.data(), pose.size() * sizeof(DeltaPose)), 0);
  }
}
