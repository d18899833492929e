// Bodies that roll on bodies, against closed forms and integrated equations of motion: what rolls without
// rolling friction neither gains nor loses energy.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "tests/property/PhysicsFixture.h"
#include "tests/property/Swing.h"

using namespace physics_fixture;
using Eigen::Vector3d;
using smartsurf::scene::ObjectId;
using smartsurf::scene::ObjectSpec;

namespace {

constexpr double kMiddle = 15.0;

// By the frequency of the steps.
class RollingOnBodies : public testing::TestWithParam<int> {
 protected:
  template <class Run>
  void draw_scenes(unsigned seed, int draws, Run run) const {
    for_random_fixtures(seed, draws, 1.0 / GetParam(), [&](PhysicsFixture& fixture, const auto& draw) {
      fixture.scene.materials[0].friction = 1.0, fixture.scene.materials[0].rolling_friction = 0.0;
      run(fixture, draw);
    });
  }
};
INSTANTIATE_TEST_SUITE_P(Steps, RollingOnBodies, testing::Values(60, 120, 240, 960));

// Turns the axis of a round body from z to y.
ObjectSpec lying(ObjectSpec body) {
  body.orientation = Eigen::AngleAxisd(M_PI / 2, Vector3d::UnitX());
  return body;
}

Vector3d z_axis_of(PhysicsFixture& fixture, std::size_t i) {
  const auto& q = fixture.snapshot().orientation[i];
  return Eigen::Quaterniond(q[3], q[0], q[1], q[2]) * Vector3d::UnitZ();
}

}  // namespace

// A plank of half thickness h at the angle a on a round body of radius r, on which it rolls:
// (h² + r² a² + i²) ä + r² a ȧ² = g (h sin a − r a cos a), with i² = (length² + (2 h)²) / 12.
TEST_P(RollingOnBodies, PlanksRockOnRoundBodies) {
  draw_scenes(31, 12, [](PhysicsFixture& scene, const auto& draw) {
    const double r = draw(1, 2.5), h = draw(0.1, 0.3), length = draw(3, 8), amplitude = draw(0.04, 0.15),
                 kind = draw(0, 3);
    const Vector3d middle(kMiddle, kMiddle, r + 1);
    ObjectSpec round = kind < 1   ? sphere(r, middle)
                       : kind < 2 ? lying(cylinder(r, 3, middle))
                                  : lying(capsule(r, 3 + 2 * r, middle));
    round.fixed = true;
    const Vector3d along(std::cos(amplitude), 0, -std::sin(amplitude)),
        normal(std::sin(amplitude), 0, std::cos(amplitude));
    ObjectSpec plank = box({length, draw(1, 2), 2 * h}, middle + (r + h) * normal - r * amplitude * along);
    plank.mass = draw(0.5, 5);
    plank.orientation = Eigen::AngleAxisd(amplitude, Vector3d::UnitY());
    const bool plank_first = draw(0, 1) < 0.5;
    if (plank_first) scene.add(plank), scene.add(round);
    if (!plank_first) scene.add(round), scene.add(plank);

    const double inertia = (length * length + 4 * h * h) / 12;
    const auto acceleration = [&](double a, double speed) {
      return (kGravity * (h * std::sin(a) - r * a * std::cos(a)) - r * r * a * speed * speed) /
             (h * h + r * r * a * a + inertia);
    };
    double a = amplitude, speed = 0, quarter_s = 0;
    for (; a > 0; quarter_s += 1e-5) speed += 1e-5 * acceleration(a, speed), a += 1e-5 * speed;

    const double dt_s = 1.0 / GetParam();
    Swing swing(dt_s);
    scene.run(8.0, [&] { swing.add(z_axis_of(scene, plank_first ? 0 : 1).x()); });
    const auto about = [&] {
      return testing::Message() << "kind " << kind << ", radius " << r << ", length " << length
                                << ", thickness " << 2 * h << ", amplitude " << amplitude;
    };
    EXPECT_NEAR(swing.period_s() / (4 * quarter_s), 1.0, 0.002) << about();
    EXPECT_LT(std::abs(swing.decrement() / swing.period_s()), 0.003) << "a second; " << about();
  });
}

// A plank carried by two rollers moves at twice their speed.
TEST_P(RollingOnBodies, PlanksRollOnRollers) {
  draw_scenes(32, 6, [](PhysicsFixture& scene, const auto& draw) {
    const double radius = draw(0.4, 1.2), speed = draw(0.5, 2) * (draw(0, 1) < 0.5 ? -1 : 1),
                 gap = draw(3, 5), start = kMiddle - 2 * speed;
    ObjectSpec plank = box({12, draw(1, 3), draw(0.2, 0.6)}, {start, kMiddle, 0});
    plank.position.z() = 2 * radius + 0.5 * plank.size.z();
    plank.mass = draw(0.3, 10);
    plank.velocity = {2 * speed, 0, 0};
    const ObjectId id = scene.add(plank);
    std::vector<ObjectId> rollers;
    for (const double side : {-0.5, 0.5}) {
      ObjectSpec roller = lying(cylinder(radius, draw(1, 3), {start + side * gap, kMiddle, radius}));
      roller.velocity = {speed, 0, 0}, roller.angular_velocity = {0, speed / radius, 0};
      rollers.push_back(scene.add(roller));
    }
    scene.run(2.0);
    EXPECT_NEAR(scene.position(id).x(), start + 4 * speed, 0.003 * std::abs(4 * speed)) << radius;
    for (std::size_t i = 0; i < 2; ++i)
      EXPECT_NEAR(scene.position(rollers[i]).x(), start + (i == 0 ? -0.5 : 0.5) * gap + 2 * speed,
                  0.003 * std::abs(4 * speed))
          << radius;
  });
}

// A round body of mass m and moment c m r² on a slab of mass M that slides without friction at v: it takes
// the roller along until that rolls, when the slab moves at u = v M / (M + m c / (1 + c)), the roller at u c
// / (1 + c).
TEST_P(RollingOnBodies, SlabsTakeRollersAlong) {
  draw_scenes(33, 12, [](PhysicsFixture& scene, const auto& draw) {
    scene.scene.materials[0].friction = 0.0;
    const bool is_ball = draw(0, 1) < 0.5, roller_first = draw(0, 1) < 0.5;
    const double radius = draw(0.4, 1.2), v = draw(1, 3), c = is_ball ? 0.4 : 0.5, friction = draw(0.4, 1),
                 start = 9;
    ObjectSpec slab = box({14, 8, 1}, {start, kMiddle, 0.5});
    const Vector3d at(start, kMiddle, 1 + radius);
    ObjectSpec roller = is_ball ? sphere(radius, at) : lying(cylinder(radius, draw(1, 3), at));
    slab.mass = draw(1, 20), roller.mass = draw(0.5, 4);
    slab.velocity = {v, 0, 0};
    slab.friction = roller.friction = friction;
    const ObjectId first = scene.add(roller_first ? roller : slab),
                   second = scene.add(roller_first ? slab : roller);
    scene.run(2.5);
    const double u = v * *slab.mass / (*slab.mass + *roller.mass * c / (1 + c));
    EXPECT_NEAR(static_cast<double>(scene.velocity(roller_first ? second : first).x()), u, 0.003 * u)
        << (is_ball ? "ball " : "cylinder ") << radius;
    EXPECT_NEAR(static_cast<double>(scene.velocity(roller_first ? first : second).x()), u * c / (1 + c),
                0.003 * u)
        << (is_ball ? "ball " : "cylinder ") << radius;
  });
}
