#include "smartsurf/world/ContactKernels.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "smartsurf/world/Vec.h"

using namespace smartsurf::world;

namespace {

// Sixteen bodies of random mass, inertia and motion; eight lanes, lane l joins body l and body 8 + l at one
// point.
struct Lanes {
  std::mt19937 random{5};
  std::vector<Motion> motion{16};
  std::vector<Shift> shift{16};
  std::vector<Inertia> inertia{16};
  std::vector<Mat3> inverse{16};
  Octet octet;
  Point point{};
  PointDetail detail{};
  Pass pass{1.0F / 300, 300.0F, 0.0F, 20.0F, 0.9F, 0.1F, 4.0F, 0.2F};

  float draw() { return std::uniform_real_distribution<float>(-1, 1)(random); }
  Vec3 draw3() { return {draw(), draw(), draw()}; }

  Lanes() {
    for (std::size_t i = 0; i < 16; ++i) {
      const Mat3 turn = Quat(draw(), draw(), draw(), draw()).normalized().toRotationMatrix();
      inverse[i] = turn * Vec3(0.1F, 0.5F, 1.7F).asDiagonal() * turn.transpose();
      const Mat3& m = inverse[i];
      inertia[i] = {m(0, 0), m(1, 1), m(2, 2), m(0, 1), m(0, 2), m(1, 2), {}};
      motion[i].inverse_mass = 0.6F + 0.5F * draw();
      for (int k = 0; k < 3; ++k) motion[i].velocity[k] = draw(), motion[i].spin[k] = draw();
    }
    octet.points = 1;
    octet.count = kLanes;
    for (int l = 0; l < kLanes; ++l) {
      octet.a[l] = l;
      octet.b[l] = 8 + l;
      const Vec3 n = draw3().normalized(), a = draw3(), b = draw3();
      for (int k = 0; k < 3; ++k)
        point.normal[k][l] = n[k], detail.arm_a[k][l] = a[k], detail.arm_b[k][l] = b[k];
      point.gap[l] = -0.01F;
      point.friction[l] = 0.5F;
    }
  }
  void run(const Kernel (&kernel)[kContactKinds]) {
    kernel[kAnyPair](&octet, 1, {&point, &detail}, {motion.data(), shift.data(), inertia.data()}, pass);
  }
  Vec3 of(const float (&lanes)[3][kLanes], int l) const { return {lanes[0][l], lanes[1][l], lanes[2][l]}; }
  float yielding(int l) const {
    const auto a = static_cast<std::size_t>(l), b = a + 8;
    const Vec3 n = of(point.normal, l), ta = of(detail.arm_a, l).cross(n), tb = of(detail.arm_b, l).cross(n);
    return motion[a].inverse_mass + motion[b].inverse_mass + ta.dot(inverse[a] * ta) +
           tb.dot(inverse[b] * tb);
  }
  // Of a's surface over b's.
  Vec3 relative(int l) const {
    const auto a = static_cast<std::size_t>(l), b = a + 8;
    const Vec3 va = Vec3(motion[a].velocity) + Vec3(motion[a].spin).cross(of(detail.arm_a, l));
    const Vec3 vb = Vec3(motion[b].velocity) + Vec3(motion[b].spin).cross(of(detail.arm_b, l));
    return va - vb;
  }
  float closing(int l) const { return of(point.normal, l).dot(relative(l)); }
  Vec3 slip(int l) const { return relative(l) - of(point.normal, l) * closing(l); }
};

}  // namespace

TEST(ContactKernels, EffectiveMassAndApproachOfEveryLane) {
  Lanes lanes;
  lanes.run(contact_kernels().prepare);
  for (int l = 0; l < kLanes; ++l) {
    EXPECT_NEAR(lanes.point.normal_mass[l] * lanes.yielding(l), 1.0F, 1e-4F) << l;
    EXPECT_NEAR(lanes.point.approach[l], lanes.closing(l), 1e-4F) << l;
  }
}

TEST(ContactKernels, WhatAPushAddsToTheSlipIsToldAhead) {
  Lanes lanes;
  lanes.run(contact_kernels().prepare);
  const Lanes before = lanes;
  std::fill_n(lanes.point.push, kLanes, 0.5F);
  lanes.run(contact_kernels().warm);
  for (int l = 0; l < kLanes; ++l)
    EXPECT_LT((lanes.slip(l) - before.slip(l) - 0.5F * lanes.of(lanes.detail.slip, l)).norm(), 1e-5F) << l;
}

TEST(ContactKernels, ARelaxedContactNoLongerCloses) {
  Lanes lanes;
  lanes.run(contact_kernels().prepare);
  std::fill_n(lanes.point.friction, kLanes, 0.0F);
  lanes.run(contact_kernels().relax);
  for (int l = 0; l < kLanes; ++l) {
    if (lanes.point.approach[l] < 0.0F) {
      EXPECT_NEAR(lanes.closing(l), 0.0F, 1e-4F) << l;
      EXPECT_NEAR(lanes.point.push[l], -lanes.point.approach[l] * lanes.point.normal_mass[l], 1e-3F) << l;
    } else {
      EXPECT_EQ(lanes.point.push[l], 0.0F) << l;
    }
  }
}

TEST(ContactKernels, MomentumIsKeptAndUnusedLanesAreLeftAlone) {
  Lanes lanes;
  lanes.octet.count = 5;
  for (int l = 5; l < kLanes; ++l) lanes.octet.a[l] = 0, lanes.octet.b[l] = 8;
  const auto before = lanes.motion;
  lanes.run(contact_kernels().prepare);
  lanes.run(contact_kernels().solve);
  for (std::size_t l = 0; l < 8; ++l) {
    auto momentum = [l](const std::vector<Motion>& m) {
      return Vec3(Vec3(m[l].velocity) / m[l].inverse_mass + Vec3(m[l + 8].velocity) / m[l + 8].inverse_mass);
    };
    EXPECT_LT((momentum(lanes.motion) - momentum(before)).norm(), 1e-4F) << l;
    if (l >= 5) {
      EXPECT_EQ(Vec3(lanes.motion[l].velocity), Vec3(before[l].velocity));
    }
  }
}
