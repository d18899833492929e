#include "smartsurf/world/body/RotationKernels.h"

#include <gtest/gtest.h>

#include <hwy/highway.h>

#include <cmath>
#include <random>
#include <vector>

#include "smartsurf/world/body/Vec.h"

using namespace smartsurf::world;

namespace {

constexpr float kStep = 1.0F / 60;

struct Body {
  Quat orientation;
  Mat3 principal_axes;  // least, middle, greatest; body axes
  Vec3 moments;
  Vec3 spin;
  Mat3 inertia() const { return principal_axes * moments.asDiagonal() * principal_axes.transpose(); }
  Vec3 momentum(const Vec3& omega) const {
    return orientation * Vec3(inertia() * (orientation.conjugate() * omega));
  }
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
      body[l] = {Quat(draw(), draw(), draw(), draw()).normalized(),
                 Quat(draw(), draw(), draw(), draw()).normalized().toRotationMatrix(),
                 {1.0F, 1.5F + 0.4F * draw(), 2.0F},
                 rate * draw3()};
      if (l % 2 == 1) {  // about its z axis
        body[l].principal_axes = Mat3::Identity();
        body[l].moments = {1.5F, 1.5F, 2.0F};
      }
      put(l, body[l]);
      turns.is_axisymmetric[l] = l % 2 == 1 ? 1.0 : 0.0;
    }
  }
  void put(int l, const Body& b) {
    for (int k = 0; k < 4; ++k) turns.orientation[k][l] = b.orientation.coeffs()[k];
    turns.free_time[l] = kStep, turns.slenderness[l] = 0.0;
    const Vec3 momentum = b.momentum(b.spin);
    for (int k = 0; k < 3; ++k) {
      turns.least_axis[k][l] = b.principal_axes(k, 0), turns.greatest_axis[k][l] = b.principal_axes(k, 2);
      turns.moments[k][l] = b.moments[k], turns.rotation[k][l] = kStep * b.spin[k];
      turns.momentum[k][l] = momentum[k], turns.angular_velocity[k][l] = b.spin[k];
      turns.previous_x_axis[k][l] = k == 0 ? 1.0 : 0.0;
    }
  }
  static void symmetric(float (&lanes)[6][kLanes], int l, const Mat3& m) {
    const float entries[] = {m(0, 0), m(1, 1), m(2, 2), m(0, 1), m(0, 2), m(1, 2)};
    for (int k = 0; k < 6; ++k) lanes[k][l] = entries[k];
  }
  Vec3 spin(int l) const {
    Vec3 spin;
    for (int k = 0; k < 3; ++k) spin[k] = static_cast<float>(turns.angular_velocity[k][l]);
    return spin;
  }
  // After the kernel.
  Body body_now(int l) const {
    Body b = body[l];
    for (int k = 0; k < 4; ++k) b.orientation.coeffs()[k] = static_cast<float>(turns.orientation[k][l]);
    b.spin = spin(l);
    return b;
  }
  Mat3 axes(int l) const {
    Mat3 m;
    for (int c = 0; c < 3; ++c)
      for (int r = 0; r < 3; ++r) m(r, c) = static_cast<float>(turns.axes[c][r][l]);
    return m;
  }
};

float energy(const Body& b) { return 0.5F * b.spin.dot(b.momentum(b.spin)); }

std::vector<double> results(const RotationBatch& t) {
  std::vector<double> all;
  auto add = [&all](const double(&lanes)[kLanes]) { all.insert(all.end(), lanes, lanes + kLanes); };
  for (const auto& lanes : t.orientation) add(lanes);
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
  for (int l = 0; l < kLanes; ++l) {
    bodies.turns.free_time[l] = kShort;
    for (int k = 0; k < 3; ++k) bodies.turns.rotation[k][l] = kShort * bodies.body[l].spin[k];
  }
  integrate_rotation(bodies.turns);
  for (int l = 0; l < kLanes; ++l) {
    const Body &b = bodies.body[l], now = bodies.body_now(l);
    const Vec3 own = b.orientation.conjugate() * b.spin;
    const Vec3 rate = -b.inertia().inverse() * own.cross(b.inertia() * own);
    const Vec3 gained = now.orientation.conjugate() * now.spin - own;
    EXPECT_LT((gained - kShort * rate).norm(), 2e-6F) << l;
    const Vec3 turned = 2.0F * (now.orientation * b.orientation.conjugate()).vec();
    EXPECT_LT((turned - kShort * b.spin).norm(), 2e-6F) << l;
  }
}

TEST(RotationKernels, KeepsMomentumAtAnyRate) {
  for (const float rate : {0.0F, 1.0F, 30.0F, 1e3F, 1e6F}) {
    Bodies bodies(rate);
    integrate_rotation(bodies.turns);
    for (int l = 0; l < kLanes; ++l) {
      const Body &b = bodies.body[l], now = bodies.body_now(l);
      const Vec3 momentum = b.momentum(b.spin);
      EXPECT_LE((now.momentum(now.spin) - momentum).norm(), 3e-6F * momentum.norm()) << rate << ", " << l;
      EXPECT_NEAR(now.orientation.norm(), 1.0F, 1e-6F);
      if (rate <= 30.0F) {
        EXPECT_NEAR(energy(now), energy(b), 0.02F * energy(b)) << rate << ", " << l;
      }
    }
  }
}

TEST(RotationKernels, AddsTheSolversChangeToTheMomentum) {
  Bodies bodies(1.0F);
  for (int l = 0; l < kLanes; ++l)
    for (int k = 0; k < 3; ++k) {
      bodies.turns.momentum[k][l] = 0.0;
      bodies.turns.angular_velocity_change[k][l] = bodies.body[l].spin[k];
    }
  integrate_rotation(bodies.turns);
  for (int l = 0; l < kLanes; ++l) {
    const Body& b = bodies.body[l];
    const Vec3 momentum = b.momentum(b.spin);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(bodies.turns.momentum[k][l], momentum[k], 2e-6) << l;
  }
}

// Without free time the body turns as the solver says, and keeps its momentum.
TEST(RotationKernels, AppliesTheRotationOfTheSolver) {
  Bodies bodies(30.0F);
  for (int l = 0; l < kLanes; ++l) bodies.turns.free_time[l] = 0.0;
  integrate_rotation(bodies.turns);
  for (int l = 0; l < kLanes; ++l) {
    const Body &b = bodies.body[l], now = bodies.body_now(l);
    const Vec3 turn = kStep * b.spin;
    const Quat expected = Quat(Eigen::AngleAxisf(turn.norm(), turn.normalized())) * b.orientation;
    EXPECT_NEAR(std::abs(expected.dot(now.orientation)), 1.0F, 1e-6F) << l;
    EXPECT_LE((now.momentum(now.spin) - b.momentum(b.spin)).norm(), 3e-6F * b.momentum(b.spin).norm()) << l;
  }
}

TEST(RotationKernels, AxesFollowOrientationWithoutTwistIfAxisymmetric) {
  Bodies bodies(1.0F);
  integrate_rotation(bodies.turns);
  for (int l = 0; l < kLanes; ++l) {
    const Mat3 now = bodies.body_now(l).orientation.toRotationMatrix(), axes = bodies.axes(l);
    EXPECT_LT((axes.transpose() * axes - Mat3::Identity()).norm(), 1e-5F) << l;
    EXPECT_NEAR(axes.determinant(), 1.0F, 1e-5F) << l;
    EXPECT_LT((axes.col(2) - now.col(2)).norm(), 1e-6F) << l;
    if (l % 2 == 0)
      EXPECT_LT((axes - now).norm(), 1e-6F) << l;
    else
      EXPECT_NEAR(axes.col(1).x(), 0.0F, 1e-5F)
          << "the x axis stays as close as possible to its previous direction, so y is normal to that";
    Mat3 expected = axes * bodies.body[l].inertia().inverse() * axes.transpose();
    float entries[6][kLanes];
    Bodies::symmetric(entries, l, expected);
    for (int k = 0; k < 6; ++k)
      EXPECT_NEAR(bodies.turns.world_inverse_inertia[k][l], entries[k][l], 1e-5F) << l;
  }
}

TEST(RotationKernels, BitIdenticalInAnyLaneAndOnEveryTarget) {
  Bodies first(5.0F);
  integrate_rotation(first.turns);
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    Bodies again(5.0F);
    integrate_rotation(again.turns);
    EXPECT_EQ(results(again.turns), results(first.turns)) << hwy::TargetName(target);
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  // The same bodies, shifted by two lanes.
  Bodies shifted(5.0F);
  for (int l = 0; l < kLanes; ++l) {
    shifted.put(l, first.body[(l + 2) % kLanes]);
    shifted.turns.is_axisymmetric[l] = (l + 2) % 2 == 1 ? 1.0 : 0.0;
  }
  integrate_rotation(shifted.turns);
  for (int l = 0; l < kLanes; ++l) EXPECT_EQ(shifted.spin(l), first.spin((l + 2) % kLanes)) << l;
}
