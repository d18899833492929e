#include "smartsurf/world/solver/Solver.h"

#include <gtest/gtest.h>

#include "tests/unit/smartsurf/world/StepFixture.h"

using namespace smartsurf;
using namespace smartsurf::world;

namespace {

TEST(Solver, RestingContactCarriesTheWeight) {
  StepFixture s(16);
  const std::size_t ball = s.add(make_sphere(1.0), Vec3(7, 7, 1));
  for (int i = 0; i < 240; ++i) s.step();
  const float weight = s.bodies.mass[ball] * StepFixture::kGravity * StepFixture::kDt;
  EXPECT_NEAR(s.static_impulse(ball), weight, 1e-3F * weight);
  EXPECT_NEAR(s.bodies.velocity(ball).norm(), 0.0F, 1e-4F);
  EXPECT_NEAR(s.bodies.position[ball].z(), 1.0F, 2e-3F);
}

TEST(Solver, SlidingDeceleratesByCoulombFriction) {
  constexpr float kFriction = 0.3F, kSpeed = 6.0F;
  StepFixture s(48, kFriction);
  scene::ObjectSpec plank;
  plank.shape = scene::ShapeKind::kBox;
  plank.size = {3, 3, 0.4};
  const std::size_t box = s.add(plank, Vec3(8, 24, 0.2F), Vec3(kSpeed, 0, 0));
  constexpr int kSteps = 120;
  for (int i = 0; i < kSteps; ++i) s.step();
  const float expected = kSpeed - kFriction * StepFixture::kGravity * kSteps * StepFixture::kDt;
  EXPECT_NEAR(s.bodies.velocity(box).x(), expected, 0.01F * kSpeed);
}

TEST(Solver, CollisionConservesMomentum) {
  StepFixture s(32, 0.0F, 1.0F, 0.0F);
  const std::size_t a = s.add(make_sphere(1.0), Vec3(8, 16, 5), Vec3(4, 0, 0));
  const std::size_t b = s.add(make_sphere(1.0), Vec3(12, 16, 5));
  for (int i = 0; i < 240; ++i) s.step();
  EXPECT_NEAR(s.bodies.velocity(a).x(), 0.0F, 0.05F);  // equal masses at e = 1 exchange velocities
  EXPECT_NEAR(s.bodies.velocity(b).x(), 4.0F, 0.05F);
  EXPECT_NEAR(s.bodies.velocity(a).x() + s.bodies.velocity(b).x(), 4.0F, 1e-4F);
}

TEST(Solver, CarriesImpulsesOverForWarmStart) {
  StepFixture s(16);
  const std::size_t ball = s.add(make_sphere(1.0), Vec3(7, 7, 1));
  for (int i = 0; i < 120; ++i) s.step();
  s.find_contacts();
  ASSERT_EQ(s.static_contacts.manifolds.size(), 1U);
  float carried_over = 0.0F;
  for (const Contact& c : s.static_contacts.contacts) carried_over += c.normal_impulse;
  const float substep_weight = s.bodies.mass[ball] * StepFixture::kGravity * StepFixture::kDt /
                               static_cast<float>(s.settings.substeps);
  EXPECT_NEAR(carried_over, substep_weight, 0.02F * substep_weight);
}

}  // namespace
