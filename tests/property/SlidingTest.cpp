#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;

TEST(Sliding, BoxComesToRestAfterTheFrictionDistance) {
  for (const double mu : {0.3, 0.6}) {
    PhysicsFixture fixture;
    fixture.scene.materials[0].friction = mu;
    auto object = box({3, 3, 1}, {6, 15.3, 0.5});
    object.velocity = {8, 0, 0};
    const auto id = fixture.add(object);
    fixture.run(5.0);
    const double distance = 8.0 * 8.0 / (2 * mu * 9.81);
    EXPECT_NEAR(fixture.position(id).x() - 6, distance, 0.02 * distance) << "mu " << mu;
    EXPECT_NEAR(fixture.position(id).y(), 15.3, 0.02);
    EXPECT_LT(fixture.velocity(id).norm(), 1e-3);
  }
}

TEST(Sliding, SameDistanceInEveryDirection) {
  for (int k = 0; k < 8; ++k) {
    const double angle = 0.1 + k * 0.7;
    PhysicsFixture fixture;
    auto object = box({2, 2, 1}, {15.5, 15.5, 0.5});
    object.velocity = {6 * std::cos(angle), 6 * std::sin(angle), 0};
    const auto id = fixture.add(object);
    fixture.run(4.0);
    const Eigen::Vector2d moved =
        (fixture.position(id).cast<double>() - Eigen::Vector3d(15.5, 15.5, 0)).head<2>();
    EXPECT_NEAR(moved.norm(), 36 / (2 * 0.5 * 9.81), 0.1) << angle;
    EXPECT_NEAR(std::remainder(std::atan2(moved.y(), moved.x()) - angle, 2 * M_PI), 0.0, 0.03) << angle;
  }
}

TEST(Sliding, BoxSlidesOnlyAboveFrictionAngle) {
  // Tilting gravity stands for tilting the surface. The box slides if tan(angle) > µ.
  for (const double tangent : {0.4, 0.6}) {
    PhysicsFixture fixture;
    const double angle = std::atan(tangent), mu = 0.5, g = 9.81;
    fixture.scene.world.gravity = {g * std::sin(angle), 0, -g * std::cos(angle)};
    const auto id = fixture.add(box({3, 3, 1}, {6, 15.3, 0.5}));
    fixture.run(2.0);
    const double expected = tangent < mu ? 0.0 : 0.5 * g * (std::sin(angle) - mu * std::cos(angle)) * 4.0;
    EXPECT_NEAR(fixture.position(id).x() - 6, expected, 0.03 + 0.03 * expected);
  }
}

// A box that slides over pins at height 1 with its middle from x = 5 on, towards the east; `height(column)`
// is that of a column's pins. Returns by how much it comes to rest before the friction distance, as a
// fraction of that.
template <class Height>
double shortfall(double dt_s, const Eigen::Vector3d& size, double yaw, double mu, double distance,
                 Height height) {
  PhysicsFixture fixture;
  fixture.scene.world.dt_s = dt_s;
  fixture.scene.surface.columns = 64;
  fixture.scene.surface.rows = 16;
  fixture.scene.materials[0].friction = mu;
  std::vector<float> heights(fixture.cells().field().height.size());
  for (std::size_t i = 0; i < heights.size(); ++i) heights[i] = height(static_cast<int>(i % 64));
  fixture.cells().set_targets(0, heights);
  fixture.run(1.0);
  auto object = box(size, {5, 7.5, 1 + 0.5 * size.z()});
  object.orientation = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ());
  object.velocity = {std::sqrt(2 * mu * kGravity * distance), 0, 0};
  const auto id = fixture.add(object);
  fixture.run(object.velocity.x() / (mu * kGravity) + 0.3);
  return 1.0 - (fixture.position(id).x() - 5.0) / distance;
}

TEST(Sliding, EdgeThatSankALittleIntoAGapRidesUp) {
  std::mt19937 random(3);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int draw = 0; draw < 6; ++draw) {
    SCOPED_TRACE(draw);
    const Eigen::Vector3d size(uniform(4.6, 7), uniform(1.5, 5), uniform(0.3, 1));
    const double yaw = draw % 2 == 0 ? 0.0 : uniform(-3, 3), mu = uniform(0.15, 0.4),
                 distance = uniform(10, 30);
    const int every = 4 + draw % 3;
    const double dt_s = draw < 3 ? 1.0 / 60 : 1.0 / 240;
    EXPECT_NEAR(shortfall(dt_s, size, yaw, mu, distance,
                          [&](int column) { return column > 9 && column % every == 0 ? 0.5F : 1.0F; }),
                0.0, 0.005);
  }
}

TEST(Sliding, SmallStepsAreRiddenUp) {
  std::mt19937 random(7);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int draw = 0; draw < 6; ++draw) {
    const double step = uniform(0.0005, 0.003), mu = uniform(0.15, 0.4);
    SCOPED_TRACE(testing::Message() << step << " u");
    const Eigen::Vector3d size(uniform(2.2, 5), uniform(2.2, 5), uniform(0.3, 0.8));
    EXPECT_NEAR(shortfall(draw % 2 == 0 ? 1.0 / 60 : 1.0 / 240, size, 0.0, mu, uniform(16, 25),
                          [&](int column) { return static_cast<float>(column < 20 ? 1.0 : 1.0 + step); }),
                0.0, 0.005);
  }
}

TEST(Sliding, RealStepsStopABox) {
  std::mt19937 random(5);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int draw = 0; draw < 12; ++draw) {
    const double step = 0.006 * std::pow(10.0, uniform(0, 1)), speed = uniform(1, 4), mu = uniform(0.15, 0.4);
    const double dt_s = 1.0 / (draw % 2 == 0 ? 60 : 240);
    SCOPED_TRACE(testing::Message() << step << " u, " << speed << " u/s, " << dt_s << " s");
    const Eigen::Vector3d size(uniform(2.2, 5), uniform(2.2, 5), uniform(0.3, 0.8));
    // The side of column 20 is at 19.6; the box begins at 5 with its middle, and has `speed` at the step.
    const double reach = 19.6 - 0.5 * size.x() - 5.0;
    const double distance = reach + speed * speed / (2 * mu * kGravity);
    EXPECT_NEAR(shortfall(dt_s, size, 0.0, mu, distance,
                          [&](int column) { return static_cast<float>(column < 20 ? 1.0 : 1.0 + step); }),
                1.0 - reach / distance, 0.02 / distance);
  }
}

// The rim of a disc passes over the edges of narrow tops at any angle.
TEST(Sliding, DiscsSlideOverNarrowTops) {
  std::mt19937 random(9);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int draw = 0; draw < 24; ++draw) {
    SCOPED_TRACE(draw);
    PhysicsFixture fixture;
    fixture.scene.world.dt_s = 1.0 / (draw % 2 == 0 ? 60 : 240);
    fixture.scene.world.iterations = draw % 3 == 0 ? 40 : 10;
    fixture.scene.surface.pin.top_x = fixture.scene.surface.pin.top_y = 0.5;
    const double slope = uniform(0.1, 0.5), heading = uniform(-3, 3), radius = uniform(0.9, 1.5),
                 start = uniform(0, 2), mu = uniform(0, 0.7) * std::tan(slope), seconds = 1.0;
    const Eigen::Vector3d along(std::cos(heading), std::sin(heading), 0);
    fixture.scene.materials[0].friction = mu;
    fixture.scene.world.gravity =
        kGravity * (std::sin(slope) * along - std::cos(slope) * Eigen::Vector3d::UnitZ());
    auto disc = cylinder(radius, 0.4, {15.5, 15.5, 0.2});
    disc.velocity = start * along;
    const auto id = fixture.add(disc);
    fixture.run(seconds);
    const Eigen::Vector3d moved = fixture.position(id).cast<double>() - Eigen::Vector3d(15.5, 15.5, 0.2);
    const double acceleration = kGravity * (std::sin(slope) - mu * std::cos(slope)),
                 way = start * seconds + 0.5 * acceleration * seconds * seconds;
    EXPECT_LT((moved - way * along).norm(),
              0.01 * way + (start + acceleration) * fixture.scene.world.dt_s + 0.003);
  }
}

class Rolling : public testing::TestWithParam<double> {};

TEST_P(Rolling, SphereAcceleratesAtFiveSeventhsOfGSine) {
  PhysicsFixture fixture;
  const double angle = GetParam(), g = 9.81;
  fixture.scene.world.gravity = {g * std::sin(angle), 0, -g * std::cos(angle)};
  const auto id = fixture.add(sphere(1.5, {3, 15.3, 1.5}));
  double highest = 0;
  fixture.run(2.0, [&] { highest = std::max(highest, static_cast<double>(fixture.position(id).z())); });
  const double a = 5.0 / 7.0 * g * std::sin(angle);
  EXPECT_NEAR(fixture.position(id).x() - 3, 0.5 * a * 4.0, 0.01 * 0.5 * a * 4.0 + 0.01);
  EXPECT_NEAR(fixture.angular_velocity(id).y() * 1.5, fixture.velocity(id).x(), 0.02);
  EXPECT_LT(highest, 1.51) << "no hopping at the gaps";
}
INSTANTIATE_TEST_SUITE_P(Angles, Rolling, testing::Values(0.05, 0.15, 0.3));

TEST(Rolling, SphereKeepsSpeedOnLevelField) {
  PhysicsFixture fixture;
  fixture.scene.surface.columns = 96;
  auto object = sphere(1.5, {3, 15.3, 1.5});
  object.velocity = {8, 0, 0};
  object.angular_velocity = {0, 8 / 1.5, 0};
  const auto id = fixture.add(object);
  fixture.run(6.0);
  EXPECT_NEAR(fixture.velocity(id).x(), 8.0, 0.01);
  EXPECT_NEAR(fixture.position(id).x(), 3 + 48, 0.1);
  EXPECT_NEAR(fixture.position(id).y(), 15.3, 0.01);
}

// Rolling resistance: a torque of at most b·N against the relative angular velocity, with the lever arm b in
// u. A sphere of radius r that rolls without slipping slows by b·g·r / (r² + 2r²/5) = 5/7·g·b/r.
TEST(Rolling, LeverArmSlowsSphereByFiveSeventhsOfGTimesLeverOverRadius) {
  struct Case {
    double lever, radius, density;
  };
  for (const double rate : {60.0, 240.0, 960.0})
    for (const auto& [lever, radius, density] :
         {Case{0.05, 1.5, 1.0}, Case{0.05, 0.75, 1.0}, Case{0.1, 1.5, 50.0}}) {
      PhysicsFixture fixture;
      fixture.scene.world.dt_s = 1 / rate;
      fixture.scene.surface.columns = 64;
      fixture.scene.surface.pin.top_x = fixture.scene.surface.pin.top_y = 1.0;
      fixture.scene.materials[0].rolling_friction = lever;
      fixture.scene.materials[0].density = density;
      auto object = sphere(radius, {3, 15.3, radius});
      object.velocity = {3, 0, 0};
      object.angular_velocity = {0, 3 / radius, 0};
      const auto id = fixture.add(object);
      fixture.run(2.0);
      const double slowed = 2.0 * 5.0 / 7.0 * 9.81 * lever / radius;
      EXPECT_NEAR(3 - fixture.velocity(id).x(), slowed, 0.005 * slowed)
          << rate << ", " << lever << ", " << radius;
      EXPECT_NEAR(fixture.angular_velocity(id).y() * radius, fixture.velocity(id).x(), 2e-3);
    }
}

// The lever arm of two materials is the geometric mean of theirs.
TEST(Rolling, LeverArmsOfTwoMaterialsCombineAsGeometricMean) {
  for (const auto& [of_surface, of_sphere] :
       {std::pair(0.01, 0.16), std::pair(0.16, 0.01), std::pair(0.0, 0.16)}) {
    PhysicsFixture fixture;
    fixture.scene.surface.columns = 64;
    fixture.scene.surface.pin.top_x = fixture.scene.surface.pin.top_y = 1.0;
    fixture.scene.materials[0].rolling_friction = of_surface;
    fixture.scene.materials.push_back(fixture.scene.materials[0]);
    fixture.scene.materials[1].rolling_friction = of_sphere;
    auto object = sphere(1.0, {3, 15.3, 1});
    object.material = 1;
    object.velocity = {3, 0, 0};
    object.angular_velocity = {0, 3, 0};
    const auto id = fixture.add(object);
    fixture.run(2.0);
    const double slowed = 2.0 * 5.0 / 7.0 * 9.81 * std::sqrt(of_surface * of_sphere);
    EXPECT_NEAR(3 - fixture.velocity(id).x(), slowed, 0.005 * slowed + 1e-3)
        << of_surface << ", " << of_sphere;
  }
}

// The same torque slows a sphere that spins about the normal: by b·g / (2r²/5).
TEST(Rolling, LeverArmSlowsSpinAboutTheNormal) {
  for (const double rate : {60.0, 240.0, 960.0}) {
    PhysicsFixture fixture;
    fixture.scene.world.dt_s = 1 / rate;
    fixture.scene.materials[0].rolling_friction = 0.05;
    auto object = sphere(1.0, {15, 15, 1});
    object.angular_velocity = {0, 0, 4};
    const auto id = fixture.add(object);
    fixture.run(2.0);
    const double slowed = 2.0 * 2.5 * 9.81 * 0.05;
    EXPECT_NEAR(4 - fixture.angular_velocity(id).z(), slowed, 0.005 * slowed) << rate;
  }
}

// On a slope, a sphere starts to roll at tan α = b/r; below, it rests.
TEST(Rolling, SphereRollsFromSlopeOfLeverOverRadius) {
  for (const double factor : {0.97, 1.03}) {
    PhysicsFixture fixture;
    const double lever = 0.05, angle = std::atan(factor * lever / 1.0), g = 9.81;
    fixture.scene.world.gravity = {g * std::sin(angle), 0, -g * std::cos(angle)};
    fixture.scene.surface.pin.top_x = fixture.scene.surface.pin.top_y = 1.0;
    fixture.scene.materials[0].rolling_friction = lever;
    const auto id = fixture.add(sphere(1.0, {3, 15, 1}));
    fixture.run(3.0);
    const double a = 5.0 / 7.0 * g * (std::sin(angle) - lever * std::cos(angle));
    const double way = std::max(0.0, 0.5 * a * 9.0);
    EXPECT_NEAR(fixture.position(id).x() - 3, way, 0.02 * way + 1e-3) << factor;
  }
}

// Boxes and solids have no rolling resistance: their edges resist.
TEST(Rolling, LeverArmDoesNotActOnBoxes) {
  double left[2];
  for (const bool resists : {false, true}) {
    PhysicsFixture fixture;
    fixture.scene.materials[0].rolling_friction = resists ? 0.2 : 0.0;
    auto object = box({4, 4, 1}, {15, 15, 0.5});
    object.angular_velocity = {0, 0, 3};
    const auto id = fixture.add(object);
    fixture.run(0.25);
    left[resists] = fixture.angular_velocity(id).z();
  }
  EXPECT_EQ(left[0], left[1]);
}

TEST(Rolling, CylinderAcceleratesAtTwoThirdsOfGSine) {
  PhysicsFixture fixture;
  const double angle = 0.1, g = 9.81;
  fixture.scene.world.gravity = {g * std::sin(angle), 0, -g * std::cos(angle)};
  auto object = cylinder(1.5, 4, {3, 15.3, 1.5});
  object.orientation = Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitX());
  const auto id = fixture.add(object);
  fixture.run(2.0);
  const double a = 2.0 / 3.0 * g * std::sin(angle);
  EXPECT_NEAR(fixture.position(id).x() - 3, 0.5 * a * 4.0, 0.03 * 0.5 * a * 4.0);
}
