#include "smartsurf/world/solver/RotationKernels.h"

#include <gtest/gtest.h>

#include <hwy/highway.h>

#include <random>
#include <vector>

#include "smartsurf/world/Vec.h"

using namespace smartsurf::world;

namespace {

constexpr float kStep = 1.0F / 60;

struct Body {
  Quat orientation;
  Mat3 inertia;
  Vec3 spin;
};

// Eight bodies of random inertia, orientation and spin; odd lanes are axisymmetric.
struct Bodies {
  std::mt19937 random{3};
  Body body[kLanes];
  RotationBatch turns{};

  float draw() { return std::uniform_real_distribution<float>(-1, 1)(random); }
  Vec3 draw3() { return {draw(), draw(), draw()}; }

  explicit Bodies(float rate) {
    for (int l = 0; l < kLanes; ++l) {
      const Mat3 tilt = Quat(draw(), draw(), draw(), draw()).normalized().toRotationMatrix();
      const Vec3 principal(1.0F, 1.6F + 0.5F * draw(), 2.0F);
      body[l] = {Quat(draw(), draw(), draw(), draw()).normalized(),
                 tilt * principal.asDiagonal() * tilt.transpose(), rate * draw3()};
      put(l, body[l]);
      turns.is_axisymmetric[l] = l % 2 == 1 ? 1.0F : 0.0F;
    }
  }
  void put(int l, const Body& b) {
    for (int k = 0; k < 4; ++k) turns.orientation[k][l] = b.orientation.coeffs()[k];
    symmetric(turns.inertia, l, b.inertia);
    symmetric(turns.inverse_inertia, l, b.inertia.inverse());
    for (int k = 0; k < 3; ++k)
      turns.angular_velocity[k][l] = b.spin[k], turns.previous_x_axis[k][l] = k == 0 ? 1.0F : 0.0F;
  }
  static void symmetric(float (&lanes)[6][kLanes], int l, const Mat3& m) {
    const float entries[] = {m(0, 0), m(1, 1), m(2, 2), m(0, 1), m(0, 2), m(1, 2)};
    for (int k = 0; k < 6; ++k) lanes[k][l] = entries[k];
  }
  Vec3 spin(int l) const {
    return {turns.angular_velocity[0][l], turns.angular_velocity[1][l], turns.angular_velocity[2][l]};
  }
  Mat3 axes(int l) const {
    Mat3 m;
    for (int c = 0; c < 3; ++c)
      for (int r = 0; r < 3; ++r) m(r, c) = turns.axes[c][r][l];
    return m;
  }
};

double energy(const Body& b, const Vec3& spin) {
  const Vec3 own = b.orientation.conjugate() * spin;
  return 0.5 * own.dot(b.inertia * own);
}

std::vector<float> results(const RotationBatch& t) {
  std::vector<float> all;
  auto add = [&all](const float(&lanes)[kLanes]) { all.insert(all.end(), lanes, lanes + kLanes); };
  for (const auto& lanes : t.angular_velocity) add(lanes);
  for (const auto& column : t.axes)
    for (const auto& lanes : column) add(lanes);
  for (const auto& lanes : t.world_inverse_inertia) add(lanes);
  return all;
}

}  // namespace

// Euler's equations without torque, in body axes: I·dω/dt = −ω × Iω.
TEST(RotationKernels, MatchesEulersEquations) {
  Bodies bodies(1.0F);
  constexpr float kShort = 1e-3F;
  integrate_gyroscopic(bodies.turns, kShort);
  for (int l = 0; l < kLanes; ++l) {
    const Body& b = bodies.body[l];
    const Vec3 own = b.orientation.conjugate() * b.spin;
    const Vec3 rate = -b.inertia.inverse() * own.cross(b.inertia * own);
    const Vec3 gained = b.orientation.conjugate() * (bodies.spin(l) - b.spin);
    EXPECT_LT((gained - kShort * rate).norm(), 2e-6F) << l;
  }
}

TEST(RotationKernels, NeverGainsEnergy) {
  for (const float rate : {1.0F, 30.0F, 1e3F, 1e6F}) {
    Bodies bodies(rate);
    integrate_gyroscopic(bodies.turns, kStep);
    for (int l = 0; l < kLanes; ++l) {
      const Body& b = bodies.body[l];
      EXPECT_LE(energy(b, bodies.spin(l)), energy(b, b.spin) * 1.00001) << rate << ", " << l;
    }
  }
}

TEST(RotationKernels, AxesFollowOrientationWithoutTwistIfAxisymmetric) {
  Bodies bodies(1.0F);
  integrate_gyroscopic(bodies.turns, kStep);
  for (int l = 0; l < kLanes; ++l) {
    const Mat3 now = bodies.body[l].orientation.toRotationMatrix(), axes = bodies.axes(l);
    EXPECT_LT((axes.transpose() * axes - Mat3::Identity()).norm(), 1e-5F) << l;
    EXPECT_NEAR(axes.determinant(), 1.0F, 1e-5F) << l;
    EXPECT_LT((axes.col(2) - now.col(2)).norm(), 1e-6F) << l;
    if (l % 2 == 0)
      EXPECT_LT((axes - now).norm(), 1e-6F) << l;
    else
      EXPECT_NEAR(axes.col(1).x(), 0.0F, 1e-5F)
          << "the x axis stays as close as possible to its previous direction, so y is normal to that";
    Mat3 expected = axes * bodies.body[l].inertia.inverse() * axes.transpose();
    float entries[6][kLanes];
    Bodies::symmetric(entries, l, expected);
    for (int k = 0; k < 6; ++k)
      EXPECT_NEAR(bodies.turns.world_inverse_inertia[k][l], entries[k][l], 1e-5F) << l;
  }
}

TEST(RotationKernels, BitIdenticalInAnyLaneAndOnEveryTarget) {
  Bodies first(5.0F);
  integrate_gyroscopic(first.turns, kStep);
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    Bodies again(5.0F);
    integrate_gyroscopic(again.turns, kStep);
    EXPECT_EQ(results(again.turns), results(first.turns)) << hwy::TargetName(target);
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  // The same bodies, shifted by two lanes.
  Bodies shifted(5.0F);
  for (int l = 0; l < kLanes; ++l) {
    shifted.put(l, first.body[(l + 2) % kLanes]);
    shifted.turns.is_axisymmetric[l] = (l + 2) % 2 == 1 ? 1.0F : 0.0F;
  }
  integrate_gyroscopic(shifted.turns, kStep);
  for (int l = 0; l < kLanes; ++l) EXPECT_EQ(shifted.spin(l), first.spin((l + 2) % kLanes)) << l;
}
