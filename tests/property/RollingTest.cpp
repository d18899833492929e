// Bodies that roll on bodies and on cells, against closed forms and integrated equations of motion: what
// rolls without rolling friction neither gains nor loses energy.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "smartsurf/scene/Axes.h"
#include "tests/property/PhysicsFixture.h"
#include "tests/property/Swing.h"

using namespace physics_fixture;
using Eigen::Vector3d;
using smartsurf::scene::ObjectId;
using smartsurf::scene::ObjectSpec;

namespace {

constexpr double kMiddle = 15.0;

// By the frequency of the steps.
class RollingScenes : public testing::TestWithParam<int> {
 protected:
  template <class Run>
  void draw_scenes(unsigned seed, int draws, Run run) const {
    for_random_fixtures(seed, draws, 1.0 / GetParam(), [&](PhysicsFixture& fixture, const auto& draw) {
      fixture.scene.materials[0].friction = 1.0, fixture.scene.materials[0].rolling_friction = 0.0;
      run(fixture, draw);
    });
  }
};
class RollingOnBodies : public RollingScenes {};
INSTANTIATE_TEST_SUITE_P(Steps, RollingOnBodies, testing::Values(60, 120, 240, 960));
class RollingOnCells : public RollingScenes {};
INSTANTIATE_TEST_SUITE_P(Steps, RollingOnCells, testing::Values(60, 120, 240, 960));

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

// A cone that lies on its side rolls about its apex at a constant rate.
TEST_P(RollingOnCells, ConesRollAboutTheirApex) {
  draw_scenes(34, 9, [](PhysicsFixture& scene, const auto& draw) {
    const double height = draw(1, 3), radius = draw(0.3, 1) * height, rate = draw(-0.7, 0.7),
                 towards = draw(0, 2 * M_PI), half_angle = std::atan2(radius, height);
    const Vector3d line(std::cos(towards), std::sin(towards), 0),
        axis = -std::cos(half_angle) * line - std::sin(half_angle) * Vector3d::UnitZ();
    ObjectSpec body = cone(radius, height, Vector3d(kMiddle, kMiddle, 0) - 0.75 * height * axis);
    body.orientation = smartsurf::scene::rotation_between(Vector3d::UnitZ(), axis);
    body.velocity = -0.75 * height * rate * Vector3d::UnitZ().cross(axis);
    body.angular_velocity = -rate / std::tan(half_angle) * line;
    scene.add(body);
    scene.run(6.0);
    const auto v = scene.velocity(0).cast<double>();
    const double arm = 0.75 * height * std::cos(half_angle);
    EXPECT_NEAR(v.head<2>().norm() / arm, std::abs(rate), 0.02 * std::abs(rate) + 0.002)
        << "height " << height << ", radius " << radius << ", rate " << rate;
  });
}

// A disc that leans rolls in a circle. Its axis, the vertical and the lever to the rim are in one plane, and
// the torque of the rim's force turns the angular momentum with that plane.
TEST_P(RollingOnCells, LeaningDiscsRollInCircles) {
  draw_scenes(35, 9, [](PhysicsFixture& scene, const auto& draw) {
    const double lean = draw(0.2, 0.45), rate = draw(1, 1.6), radius = draw(0.8, 1.5),
                 height = draw(0.25, 0.5);  // more than the gaps between tops
    const Vector3d up = Vector3d::UnitZ(), axis(std::cos(lean), 0, std::sin(lean)),
                   to_rim = radius * Vector3d(std::sin(lean), 0, -std::cos(lean)) - 0.5 * height * axis;
    const double along_axis = 0.5 * radius * radius,
                 across = 0.25 * radius * radius + height * height / 12;  // moments of inertia by mass
    const auto angular_velocity = [&](double spin) -> Vector3d { return rate * up + spin * axis; };
    const auto velocity = [&](double spin) -> Vector3d { return -angular_velocity(spin).cross(to_rim); };
    const auto unbalance = [&](double spin) {
      const Vector3d w = angular_velocity(spin), force(-rate * velocity(spin).y(), 0, kGravity);
      const Vector3d momentum = across * w + (along_axis - across) * w.dot(axis) * axis;
      return (to_rim.cross(force) - rate * up.cross(momentum)).y();
    };
    const double spin = unbalance(0) / (unbalance(0) - unbalance(1));  // it is linear
    ObjectSpec disc = cylinder(radius, height, {kMiddle + velocity(spin).y() / rate, kMiddle, -to_rim.z()});
    disc.orientation = smartsurf::scene::rotation_between(up, axis);
    disc.velocity = velocity(spin), disc.angular_velocity = angular_velocity(spin);
    scene.add(disc);
    scene.run(1.0);
    EXPECT_NEAR(std::asin(z_axis_of(scene, 0).z()), lean, 1.2 / GetParam())
        << "lean " << lean << ", rate " << rate << ", radius " << radius << ", height " << height;
  });
}

// A disc that leans rolls on its rim without its centre moving (Euler's disc): the rim's force is its weight,
// whose torque turns the angular momentum. The steady motion is kept, with its energy.
TEST_P(RollingOnCells, DiscsRollOnTheirRims) {
  draw_scenes(37, 12, [](PhysicsFixture& scene, const auto& draw) {
    scene.scene.surface.pin.top_x = scene.scene.surface.pin.top_y = 1.0;
    scene.scene.materials[0].friction = 2.0;
    scene.scene.world.sleep = false;
    const double tilt = draw(0.18, 1.4), radius = draw(0.6, 1.5), height = draw(0.01, 0.2) * radius,
                 sine = std::sin(tilt), cosine = std::cos(tilt);
    const double along_axis = 0.5 * radius * radius,
                 across = 0.25 * radius * radius + height * height / 12;  // moments of inertia by mass
    const double rate =
        std::sqrt(kGravity * (radius * cosine - 0.5 * height * sine) /
                  (across * sine * cosine - along_axis * sine * sine * height / (2 * radius)));
    const Vector3d axis(sine, 0, cosine), down(cosine, 0, -sine);
    ObjectSpec disc = cylinder(radius, height, {kMiddle, kMiddle, radius * sine + 0.5 * height * cosine});
    disc.mass = draw(0.1, 10);
    disc.orientation = Eigen::AngleAxisd(tilt, Vector3d::UnitY());
    disc.angular_velocity = rate * sine * (0.5 * height / radius * axis - down);
    scene.add(disc);
    const auto energy = [&] {
      const Vector3d v = scene.velocity(0).cast<double>(), w = scene.angular_velocity(0).cast<double>();
      const double spin = w.dot(z_axis_of(scene, 0));
      return kGravity * static_cast<double>(scene.position(0).z()) +
             0.5 * (v.squaredNorm() + across * (w.squaredNorm() - spin * spin) + along_axis * spin * spin);
    };
    const double energy_before = energy();
    double heading = 0, turned = 0;
    scene.run(4.0, [&] {
      const Vector3d now = z_axis_of(scene, 0);
      const double before = heading;
      heading = std::atan2(now.y(), now.x());
      turned += std::remainder(heading - before, 2 * M_PI);
    });
    const auto about = [&] {
      return testing::Message() << "tilt " << tilt << ", radius " << radius << ", height " << height
                                << ", rate " << rate;
    };
    EXPECT_NEAR(energy() / energy_before, 1.0, 0.005) << about();
    EXPECT_NEAR(turned / 4.0, rate, 0.005 * rate) << about();
  });
}

// Its velocity is that of its motion: a disc that touches is not held in the air.
TEST_P(RollingOnCells, ThrownDiscsMoveUntilTheyRest) {
  draw_scenes(36, 6, [](PhysicsFixture& scene, const auto& draw) {
    ObjectSpec disc = cylinder(1, draw(0.05, 0.3), {kMiddle, kMiddle, draw(2, 4)});
    for (Vector3d* vector : {&disc.velocity, &disc.angular_velocity})
      *vector = Vector3d(draw(-4, 4), draw(-4, 4), draw(-4, 4));
    disc.velocity.z() = 0;
    disc.orientation = Eigen::Quaterniond(draw(-1, 1), draw(-1, 1), draw(-1, 1), draw(-1, 1)).normalized();
    scene.add(disc);
    const double dt_s = scene.scene.world.dt_s;
    Eigen::Vector3f before = Eigen::Vector3f::Zero();
    double held_s = 0;
    scene.run(4.0, [&] {
      const Eigen::Vector3f at = scene.position(0);
      held_s =
          (at - before).norm() < 0.02F * scene.velocity(0).norm() * dt_s && scene.velocity(0).norm() > 0.5F
              ? held_s + dt_s
              : 0.0;
      before = at;
      EXPECT_LT(held_s, 0.05) << "at " << at.transpose() << " with " << scene.velocity(0).transpose();
    });
  });
}
