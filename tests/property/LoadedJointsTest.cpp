// Hinges, sliders and ball joints under load: of light bodies that bear heavy ones, and between them.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "tests/property/JointFixture.h"

using namespace physics_fixture;
using namespace smartsurf;

namespace {

class LoadedJoints : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Steps, LoadedJoints, testing::Values(1.0 / 60, 1.0 / 240, 1.0 / 960));

ObjectId add_box(PhysicsFixture& fixture, const Vector3d& size, const Vector3d& middle, double mass) {
  auto o = box(size, middle);
  o.mass = mass;
  return fixture.add(o);
}

Vector3d horizontal(double angle) { return {std::cos(angle), std::sin(angle), 0}; }

// A body of up to 1000 times the mass of that below it, with a lid that any joint connects with one of them.
TEST_P(LoadedJoints, HeavyBodiesStandOnLightOnes) {
  for_random_fixtures(81, 18, GetParam(), [&](PhysicsFixture& fixture, auto draw) {
    const double ratio = std::pow(10.0, draw(1.3, 3)), height = draw(0.5, 1.5), low = draw(0.5, 1.5);
    const Vector3d at(15.5 + draw(-0.2, 0.2), 15.5 + draw(-0.2, 0.2), 0);
    const auto below = add_box(fixture, {4, 4, low}, {15.5, 15.5, 0.5 * low}, 1.0);
    const Vector3d middle = at + Vector3d(0, 0, low + 0.5 * height);
    const auto heavy = add_box(fixture, {3, 3, height}, middle, ratio);
    const double top = low + height, mass = draw(0.5, 2);
    const auto lid = add_box(fixture, {1, 1, 0.2}, at + Vector3d(0, 0, top + 0.1), mass);
    const auto kind = static_cast<JointKind>(static_cast<int>(draw(0, 3)));
    const Vector3d axis = horizontal(draw(0, 2 * M_PI));
    fixture.world().add_joint({.kind = kind,
                               .a = lid,
                               .b = draw(0, 1) < 0.7 ? heavy : below,
                               .anchor = at + 0.4 * axis + Vector3d(0, 0, top),
                               .axis = kind == JointKind::kSlider ? Vector3d(0, 0, 1) : axis,
                               .collide = true});
    fixture.run(4.0);
    SCOPED_TRACE(testing::Message() << "ratio " << ratio << ", " << fixture.scene.world.iterations
                                    << " iterations, kind " << static_cast<int>(kind));
    EXPECT_NEAR(fixture.position(heavy).z(), middle.z(), 0.0042);
    EXPECT_GT(fixture.upright(heavy), std::cos(0.1 * M_PI / 180));
    EXPECT_NEAR(fixture.total_load(), (1.0 + ratio + mass) * kGravity, 0.01 * ratio * kGravity);
    EXPECT_NEAR(fixture.position(lid).z() - fixture.position(heavy).z(), 0.5 * height + 0.1, 0.0042);
  });
}

// A plate of up to 1000 times the mass of each of its four feet, which springs press to the table: they yield
// as Hooke's law demands, or not at all where limits stop them.
TEST_P(LoadedJoints, PlatesStandOnSprungFeet) {
  for_random_fixtures(82, 12, GetParam(), [&](PhysicsFixture& fixture, auto draw) {
    const double ratio = std::pow(10.0, draw(1, 3)), x = draw(2, 3), y = draw(2, 3), lean = draw(0, 0.3);
    const bool at_limits = draw(0, 1) < 0.4;
    const double off = at_limits ? lean : 0.0;
    const double weight = ratio * kGravity, stiffness = weight / draw(0.2, 0.8);
    const double damping = 0.7 * std::sqrt(ratio * stiffness);
    const Vector3d middle(15.5, 15.5, 2.0);
    const auto plate =
        add_box(fixture, {2 * x + 2, 2 * y + 2, 0.5}, middle + off * x * Vector3d::UnitX(), ratio);
    std::vector<JointId> springs;
    for (const double i : {-1.0, 1.0})
      for (const double j : {-1.0, 1.0}) {
        const Vector3d foot = middle + Vector3d(i * x, j * y, -1.5);
        auto ball = sphere(0.5, foot);
        ball.mass = 1.0;
        JointSpec joint{.kind = JointKind::kSlider,
                        .a = fixture.add(ball),
                        .b = plate,
                        .anchor = foot,
                        .axis = Vector3d::UnitZ()};
        if (at_limits)
          joint.limits = scene::JointLimits{-1, 0};
        else
          joint.spring = scene::JointSpring{.stiffness = stiffness, .damping = damping, .rest = -0.25};
        springs.push_back(fixture.world().add_joint(joint));
      }
    fixture.run(6.0);
    SCOPED_TRACE(testing::Message() << "ratio " << ratio << ", " << fixture.scene.world.iterations
                                    << " iterations, " << (at_limits ? "limits" : "springs"));
    EXPECT_NEAR(fixture.total_load(), (4.0 + ratio) * kGravity, 0.01 * weight);
    for (std::size_t k = 0; k < springs.size(); ++k) {
      // The plate's middle is off the feet's along x.
      const double share = 0.25 * (1.0 + (k < 2 ? -off : off));
      const scene::JointState state = fixture.world().joint_state(springs[k]);
      EXPECT_NEAR(state.effort, -share * weight, 0.02 * weight) << k;
      if (at_limits)
        EXPECT_NEAR(state.coordinate, 0.0, 1e-3) << k;
      else
        EXPECT_NEAR(state.coordinate, -0.25 + share * weight / stiffness, 0.02 * weight / stiffness) << k;
    }
  });
}

// A cart of up to 1000 times the mass of each of its wheels, which motors turn.
TEST_P(LoadedJoints, CartsRollOnLightWheels) {
  for_random_fixtures(83, 12, GetParam(), [&](PhysicsFixture& fixture, auto draw) {
    const double ratio = std::pow(10.0, draw(0.5, 3)), radius = draw(0.6, 1), speed = draw(0.3, 3),
                 wheelbase = draw(1.5, 2.5);
    const Vector3d middle(6, 15.5, radius + 0.2);
    const auto chassis = add_box(fixture, {2 * wheelbase, 2, 0.6}, middle, ratio);
    for (const double i : {-1.0, 1.0})
      for (const double j : {-1.0, 1.0}) {
        auto wheel = cylinder(radius, 0.8, {middle.x() + i * wheelbase, middle.y() + 1.6 * j, radius});
        wheel.mass = 1.0, wheel.orientation = Eigen::AngleAxisd(0.5 * M_PI, Vector3d::UnitX());
        fixture.world().add_joint({.kind = JointKind::kHinge,
                                   .a = fixture.add(wheel),
                                   .b = chassis,
                                   .anchor = wheel.position,
                                   .axis = Vector3d::UnitY(),
                                   .motor = scene::JointMotor{speed / radius, 20 * ratio}});
      }
    fixture.run(2.0);
    SCOPED_TRACE(testing::Message() << "ratio " << ratio << ", " << fixture.scene.world.iterations
                                    << " iterations, speed " << speed);
    const double x = fixture.position(chassis).x();
    double load = 0.0, lowest = 1e9, highest = -1e9;
    int steps = 0;
    fixture.run(2.0, [&] {
      load += fixture.total_load(), ++steps;
      const double z = fixture.position(chassis).z();
      lowest = std::min(lowest, z), highest = std::max(highest, z);
    });
    EXPECT_NEAR(fixture.position(chassis).x() - x, 2.0 * speed, 0.01 * speed);
    EXPECT_NEAR(fixture.position(chassis).y(), 15.5, 0.06 * speed);
    EXPECT_NEAR(load / steps, (4.0 + ratio) * kGravity, 0.01 * (4.0 + ratio) * kGravity);
    EXPECT_GT(lowest, middle.z() - 0.0042);
    EXPECT_LT(highest, middle.z() + 0.0042);
  });
}

// A light plank between two fixed posts, under a heavy body: with the posts its hinges make a loop, whether
// these were declared before it or after.
TEST_P(LoadedJoints, PlanksHangBetweenFixedPostsInAnyOrder) {
  for_random_fixtures(84, 8, GetParam(), [&](PhysicsFixture& fixture, auto draw) {
    const double ratio = std::pow(10.0, draw(1.3, 3)), half = draw(1, 2), off = draw(-0.5, 0.5);
    const auto kind = draw(0, 1) < 0.5 ? JointKind::kHinge : JointKind::kBall;
    std::vector<double> heights;
    for (const bool posts_first : {true, false}) {
      PhysicsFixture of_order;
      of_order.scene.world = fixture.scene.world;
      const Vector3d middle(15.5, 15.5, 2);
      ObjectId posts[2], plank{};
      const auto add_posts = [&] {
        for (const int i : {0, 1}) {
          auto post = box({0.4, 0.4, 2}, middle + Vector3d((2 * i - 1) * (half + 0.4), 0, -1));
          post.fixed = true;
          posts[i] = of_order.add(post);
        }
      };
      if (posts_first) add_posts();
      plank = add_box(of_order, {2 * half, 1, 0.2}, middle, 1.0);
      if (!posts_first) add_posts();
      for (const int i : {0, 1})
        of_order.world().add_joint({.kind = kind,
                                    .a = plank,
                                    .b = posts[i],
                                    .anchor = middle + Vector3d((2 * i - 1) * half, 0, 0),
                                    .axis = Vector3d::UnitY()});
      const auto load = add_box(of_order, {1, 1, 1}, middle + Vector3d(off, 0, 0.6), ratio);
      of_order.run(3.0);
      heights.push_back(of_order.position(load).z());
      EXPECT_NEAR(of_order.position(plank).z(), middle.z(), 0.001) << ratio;
    }
    EXPECT_NEAR(heights[0], heights[1], 1e-4) << ratio;
  });
}

}  // namespace
