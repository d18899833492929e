// The error against the closed form shrinks with the time step.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;

namespace {

// Mean of |error(dt_s, i)| over eight variants i, because the phase of an event within its step is arbitrary.
double mean_error(double dt_s, const std::function<double(double, int)>& error) {
  double sum = 0;
  for (int i = 0; i < 8; ++i) sum += std::abs(error(dt_s, i));
  return sum / 8;
}

// Requires that a sixteenth of the step leaves at most `share` of the error.
void expect_convergence(const std::function<double(double, int)>& error, double share) {
  const double coarse = mean_error(1.0 / 60, error), fine = mean_error(1.0 / 960, error);
  EXPECT_LT(fine, share * coarse) << "coarse " << coarse;
}

}  // namespace

TEST(Convergence, BounceHeight) {
  for (const double e : {0.2, 0.6, 0.9}) {
    auto error = [e](double dt_s, int i) {
      PhysicsFixture fixture;
      fixture.scene.world.dt_s = dt_s;
      fixture.scene.materials[0].restitution = e;
      const double drop = 3.0 + 0.17 * i;
      const auto id = fixture.add(sphere(1.0, {15.3, 15.2, 1.0 + drop}));
      double apex = 0;
      bool rises = false;
      fixture.run(1.0 + e, [&] {
        rises |= fixture.velocity(id).z() > 0;
        if (rises) apex = std::max(apex, static_cast<double>(fixture.position(id).z()) - 1.0);
      });
      return apex / drop - e * e;
    };
    expect_convergence(error, 0.2);
    EXPECT_LT(mean_error(1.0 / 960, error), 0.004) << e;
  }
}

TEST(Convergence, SlidingDistance) {
  auto error = [](double dt_s, int i) {
    PhysicsFixture fixture;
    fixture.scene.world.dt_s = dt_s;
    const double speed = 5.0 + 0.3 * i;
    auto object = box({3, 3, 1}, {6, 15.3, 0.5});
    object.velocity = {speed, 0, 0};
    const auto id = fixture.add(object);
    fixture.run(2.0);
    return (static_cast<double>(fixture.position(id).x()) - 6) / (speed * speed / (2 * 0.5 * kGravity)) - 1;
  };
  expect_convergence(error, 0.2);
  EXPECT_LT(mean_error(1.0 / 960, error), 0.002);
}

TEST(Convergence, RollingDistance) {
  auto error = [](double dt_s, int i) {
    PhysicsFixture fixture;
    fixture.scene.world.dt_s = dt_s;
    const double angle = 0.1 + 0.02 * i;
    fixture.scene.world.gravity = {kGravity * std::sin(angle), 0, -kGravity * std::cos(angle)};
    const auto id = fixture.add(sphere(1.5, {3, 15.3, 1.5}));
    fixture.run(2.0);
    const double travel = 0.5 * 5.0 / 7.0 * kGravity * std::sin(angle) * 4.0;
    return (static_cast<double>(fixture.position(id).x()) - 3) / travel - 1;
  };
  expect_convergence(error, 0.2);
  EXPECT_LT(mean_error(1.0 / 960, error), 0.002);
}

TEST(Convergence, ThrowHeight) {
  for (const bool angular : {false, true}) {
    auto error = [angular](double dt_s, int i) {
      PhysicsFixture fixture;
      fixture.scene.world.dt_s = dt_s;
      const double speed = 4.0 + 0.7 * i;
      fixture.scene.surface.pin.max_speed = speed;
      fixture.scene.surface.pin.max_acceleration = 1e5;
      const auto id = fixture.add(angular ? box({2, 2, 2}, {15.3, 15.2, 1}) : sphere(1, {15.3, 15.2, 1}));
      fixture.run(0.1);
      fixture.cells().set_targets(0, std::vector<float>(fixture.cells().field().height.size(), 3.0F));
      double apex = 0;
      fixture.run(1.9, [&] { apex = std::max(apex, static_cast<double>(fixture.position(id).z()) - 4.0); });
      return apex / (speed * speed / (2 * kGravity)) - 1;
    };
    expect_convergence(error, 0.3);
    EXPECT_LT(mean_error(1.0 / 960, error), 0.01);
  }
}
