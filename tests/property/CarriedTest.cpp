// The field lifts, carries and catches objects without losing them or letting them penetrate.
#include <gtest/gtest.h>

#include <cmath>

#include "smartsurf/scene/KindRegistry.h"
#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;

namespace {

std::vector<scene::ObjectSpec> make_all_shapes() {
  return {sphere(1, {0, 0, 1}), box({2, 2, 2}, {0, 0, 1}), cylinder(1, 2, {0, 0, 1}),
          capsule(0.8, 2, {0, 0, 1}), cube({0, 0, 1})};
}

}  // namespace

TEST(Carried, ByTravellingWaveAtItsSpeed) {
  // A sphere in a trough of z = 1.6 + 1.2·sin(kx − ωt) travels at ω/k.
  for (const double speed : {0.75, 1.5}) {
    PhysicsFixture fixture;
    fixture.scene.surface.columns = 64;
    fixture.scene.materials[0].rolling_friction = 0.02;
    const double k = 2 * M_PI / 12;
    auto follow = [&](double t) {
      std::vector<float> heights;
      for (int r = 0; r < 32; ++r)
        for (int c = 0; c < 64; ++c)
          heights.push_back(static_cast<float>(1.6 + 1.2 * std::sin(k * (c - 9 - speed * t) - M_PI / 2)));
      fixture.cells().set_targets(0, heights);
    };
    follow(0);
    fixture.run(1.0);
    auto object = sphere(1.5, {9, 15.3, 2.2});
    object.velocity = {speed, 0, 0};
    const auto id = fixture.add(object);
    double t = 0, begin_x = 0, begin_t = 0;
    auto next = [&] { follow(t += fixture.scene.world.dt_s); };
    fixture.run(4.0, next);
    begin_x = fixture.position(id).x(), begin_t = t;
    fixture.run(24 / speed, next);  // two wavelengths
    const double carried = static_cast<double>(fixture.position(id).x()) - begin_x;
    // The sphere still oscillates slightly in its trough.
    EXPECT_NEAR(carried / (t - begin_t), speed, 0.03 * speed);
    EXPECT_NEAR(fixture.position(id).y(), 15.3, 0.1);
  }
}

TEST(Carried, ByWheelsAtSpinTimesRadius) {
  for (const double angle : {0.0, 0.5}) {
    PhysicsFixture fixture;
    scene::ActuatorSpec wheels = scene::find_actuator_kind("wheels")->default_spec();
    wheels.values["radius"] = {0.25};
    wheels.values["angle"] = {angle};
    fixture.scene.surface.actuators = {wheels};
    derive_pin_spec(fixture.scene.surface);
    const auto id = fixture.add(box({2, 2, 1}, {6, 6, 0.5}));
    const std::vector<float> spin(fixture.cells().field().height.size(), 12.0F);
    fixture.cells().set_targets(0, spin);
    fixture.run(2.0);
    const Eigen::Vector3d v = fixture.velocity(id).cast<double>(),
                          expected_velocity(3 * std::cos(angle), 3 * std::sin(angle), 0);
    EXPECT_LT((v - expected_velocity).norm(), 2e-3) << v.transpose();
    const Eigen::Vector3d from = fixture.position(id).cast<double>();
    fixture.run(2.0);
    EXPECT_LT((fixture.position(id).cast<double>() - from - 2 * expected_velocity).norm(), 0.02);
  }
}

TEST(Carried, NoPenetrationOfRisingField) {
  for (const auto& shape : make_all_shapes())
    for (const double speed : {2.0, 20.0})
      for (const double dt_s : {1.0 / 60, 1.0 / 240}) {
        PhysicsFixture fixture;
        fixture.scene.world.dt_s = dt_s;
        fixture.scene.surface.pin.max_speed = speed;
        fixture.scene.surface.pin.max_acceleration = 1e5;
        auto object = shape;
        object.position += Eigen::Vector3d(15.3, 15.2, 0);
        const auto id = fixture.add(object);
        fixture.run(0.2);
        fixture.cells().set_targets(0, std::vector<float>(fixture.cells().field().height.size(), 5.0F));
        double max_penetration = 0;
        fixture.run(3.0, [&] {
          const double top = static_cast<double>(fixture.cells().field().height[0]);
          max_penetration =
              std::max(max_penetration, top + 1.0 - static_cast<double>(fixture.position(id).z()));
        });
        EXPECT_LT(max_penetration, 0.01)
            << static_cast<int>(shape.shape) << " at " << speed << " u/s, dt " << dt_s;
        // At 20 u/s the object is thrown and still in flight.
        if (speed < 5) {
          EXPECT_NEAR(fixture.position(id).z(), 6.0, 0.01) << static_cast<int>(shape.shape);
        }
      }
}

TEST(Carried, FlatShapesDoNotSnagAtGaps) {
  for (const auto& shape : {cylinder(1, 1, {0, 0, 0.5}), box({1.4, 1.4, 1}, {0, 0, 0.5}), cube({0, 0, 1})})
    for (const double course : {0.0, 0.35, 0.7854}) {
      PhysicsFixture fixture;
      auto object = shape;
      object.position += Eigen::Vector3d(6.13, 6.27, 0);
      const Eigen::Vector3d along(std::cos(course), std::sin(course), 0);
      object.velocity = 9 * along;
      const auto id = fixture.add(object);
      double tilt = 0;
      fixture.run(2.5, [&] { tilt = std::max(tilt, fixture.angular_velocity(id).cast<double>().norm()); });
      const Eigen::Vector3d travel = fixture.position(id).cast<double>() - object.position;
      EXPECT_NEAR(travel.dot(along), 81 / (2 * 0.5 * 9.81), 0.1)
          << static_cast<int>(shape.shape) << ' ' << course;
      EXPECT_LT((travel - travel.dot(along) * along).norm(), 0.02)
          << static_cast<int>(shape.shape) << ' ' << course;
      EXPECT_LT(tilt, 0.05) << static_cast<int>(shape.shape) << ' ' << course;
    }
}

TEST(Carried, LyingCylinderDoesNotSnagAlongItsAxis) {
  PhysicsFixture fixture;
  auto object = cylinder(0.9, 3, {5, 15.3, 0.9});
  object.orientation = Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitY());
  object.velocity = {9, 0, 0};
  const auto id = fixture.add(object);
  fixture.run(2.5);
  EXPECT_NEAR(fixture.position(id).x() - 5, 81 / (2 * 0.5 * 9.81), 0.1);
  EXPECT_NEAR(fixture.position(id).y(), 15.3, 0.02);
}

TEST(Caught, SmallFastBodies) {
  struct Thing {
    scene::ObjectSpec object;
    double inner;  // radius of the inscribed ball about the centre of mass
  };
  const Eigen::Vector3d origin(0, 0, 0);
  std::vector<Thing> things;
  for (const double s : {0.3, 0.6})
    for (const Thing& t : {Thing{sphere(s / 2, origin), s / 2},
                           {box({s, s, s}, origin), s / 2},
                           {cylinder(s / 2, s, origin), s / 2},
                           {capsule(s / 2, 1.5 * s, origin), s / 2},
                           {cone(0.7 * s, 1.4 * s, origin), 0.3 * s},
                           {cube(origin, static_cast<float>(s)), s / 2}})
      things.push_back(t);
  things.push_back({box({0.8, 0.8, 0.22}, origin), 0.11});
  things.push_back({cylinder(0.5, 0.22, origin), 0.11});
  for (const Eigen::Vector3d& velocity : {Eigen::Vector3d(0, 0, -300), Eigen::Vector3d(150, 30, -130)})
    for (const Thing& thing : things)
      for (int i = 0; i < 6; ++i) {
        PhysicsFixture fixture;
        auto object = thing.object;
        object.position = {15.0 + 0.1 * i, 15.0 + 0.07 * i, 10};
        object.orientation = Eigen::AngleAxisd(0.4 * i, Eigen::Vector3d(1, 2, 3).normalized());
        object.velocity = velocity;
        const auto id = fixture.add(object);
        double lowest = 1e9;
        fixture.run(0.3, [&] {
          const Eigen::Vector3d p = fixture.position(id).cast<double>();
          if (p.head<2>().minCoeff() > 0 && p.head<2>().maxCoeff() < 31) lowest = std::min(lowest, p.z());
        });
        EXPECT_GT(lowest, 0.8 * thing.inner) << "shape " << static_cast<int>(object.shape) << " of "
                                             << thing.inner << ", case " << i << ", " << velocity.transpose();
      }
}

TEST(Caught, PinRowStopsFastBodyFromTheSide) {
  for (const double speed : {50.0, 300.0})
    for (const bool round : {true, false}) {
      PhysicsFixture fixture;
      for (int r = 0; r < 32; ++r) fixture.cells().set_target(0, r, 22, 5.0F);
      fixture.run(1.0);
      auto object = round ? sphere(0.4, {8, 15.3, 3}) : box({0.7, 0.7, 0.7}, {8, 15.3, 3});
      object.velocity = {speed, 0, 0};
      const auto id = fixture.add(object);
      float farthest = 0;
      fixture.run(0.5, [&] { farthest = std::max(farthest, fixture.position(id).x()); });
      EXPECT_LT(farthest, 21.6F - 0.25F) << (round ? "sphere" : "box") << " at " << speed;
      EXPECT_GT(farthest, 21.0F);
    }
}

TEST(Caught, SphereRestsOnPocketRim) {
  // With 3 × 3 pins lowered, the rim is 1.6 from the middle and the sphere's centre √(R² − 1.6²) above the
  // rim.
  for (const double radius : {1.8, 2.0, 2.6}) {
    PhysicsFixture fixture;
    fixture.scene.materials[0].friction = 0.0;
    for (int r = 0; r < 32; ++r)
      for (int c = 0; c < 32; ++c)
        fixture.cells().set_target(0, r, c, std::abs(c - 15) <= 1 && std::abs(r - 16) <= 1 ? 0.0F : 4.0F);
    fixture.run(1.0);
    const auto id = fixture.add(sphere(radius, {15.1, 14.95, 4 + radius}));
    fixture.run(3.0);
    EXPECT_NEAR(fixture.position(id).z(), 4 + std::sqrt(radius * radius - 1.6 * 1.6), 0.005) << radius;
    EXPECT_NEAR(fixture.position(id).x(), 15, 0.01) << radius;
    EXPECT_NEAR(fixture.position(id).y(), 15, 0.01) << radius;
    EXPECT_LT(fixture.velocity(id).norm(), 0.01) << radius;
  }
}

TEST(Tipping, BoxTipsWithinTwoPercentOfCriticalSlope) {
  for (const double slenderness : {2.0, 3.0})
    for (const double share : {0.98, 1.02}) {
      PhysicsFixture fixture;
      fixture.scene.materials[0].friction = 2.0;
      const double angle = std::atan(share / slenderness), g = 9.81;
      fixture.scene.world.gravity = {g * std::sin(angle), 0, -g * std::cos(angle)};
      const auto id = fixture.add(box({1, 1, slenderness}, {15.0, 15.0, 0.5 * slenderness}));
      fixture.run(5.0);
      if (share < 1)
        EXPECT_NEAR(fixture.position(id).z(), 0.5 * slenderness, 0.01) << slenderness;
      else
        EXPECT_LT(fixture.position(id).z(), 0.6) << slenderness;
    }
}

namespace {

// A rider on a heavy body that moves over the frictionless field.
class OnBody : public testing::TestWithParam<int> {
 protected:
  static constexpr double kMiddle = 15.5, kWidth = 14;

  // Calls run(fixture, carrier, draw) for random carriers at rest; draw(low, high) is uniform.
  template <class Run>
  void on_random_bodies(unsigned seed, int draws, Run run) const {
    for_random_fixtures(seed, draws, 1.0 / GetParam(), [&](PhysicsFixture& fixture, const auto& draw) {
      fixture.scene.materials[0].friction = fixture.scene.materials[0].rolling_friction = 0;
      scene::ObjectSpec carrier = draw(0, 1) < 0.5 ? cylinder(0.5 * kWidth, 1, {kMiddle, kMiddle, 0.5})
                                                   : box({kWidth, kWidth, 1}, {kMiddle, kMiddle, 0.5});
      carrier.mass = 1e5, carrier.friction = draw(0.2, 1.0);
      const scene::ObjectId id = fixture.add(carrier);
      fixture.run(1.0);
      run(fixture, id, *carrier.friction, draw);
    });
  }
  static void turn(PhysicsFixture& fixture, scene::ObjectId carrier, double rate) {
    scene::ObjectStateUpdate turning;
    turning.angular_velocity = Eigen::Vector3d(0, 0, rate);
    fixture.world().set_state(carrier, turning);
  }
  // The mean distance of a rectangle's points from its middle.
  static double mean_radius_of(double length, double width) {
    double sum = 0;
    constexpr int kParts = 200;
    for (int i = 0; i < kParts; ++i)
      for (int k = 0; k < kParts; ++k)
        sum += std::hypot(((i + 0.5) / kParts - 0.5) * length, ((k + 0.5) / kParts - 0.5) * width);
    return sum / (kParts * kParts);
  }
  // A box or disc that lies on the carrier, and the mean radius and the squared radius of gyration of its
  // face.
  struct Face {
    scene::ObjectSpec object;
    const char* kind;
    double mean_radius, gyration_squared;
  };
  template <class Draw>
  static Face draw_face(PhysicsFixture& fixture, scene::ObjectId carrier, double friction,
                        double greatest_height, const Draw& draw) {
    const bool is_disc = draw(0, 1) < 0.4;
    const Eigen::Vector3d size(draw(1, 3), draw(1, 3), draw(0.3, greatest_height)),
        at(kMiddle + draw(-3, 3), kMiddle + draw(-3, 3), top(fixture, carrier) + 0.5 * size.z());
    Face face =
        is_disc ? Face{cylinder(0.5 * size.x(), size.z(), at), "disc", size.x() / 3, size.x() * size.x() / 8}
                : Face{box(size, at), "box", mean_radius_of(size.x(), size.y()),
                       size.head<2>().squaredNorm() / 12};
    face.object.friction = friction;
    return face;
  }
  static double top(PhysicsFixture& fixture, scene::ObjectId carrier) {
    return static_cast<double>(fixture.position(carrier).z()) + 0.5;
  }
};

}  // namespace

TEST_P(OnBody, RidersOfSpinningBodiesMoveOnCircles) {
  on_random_bodies(3, 12, [](PhysicsFixture& fixture, scene::ObjectId carrier, double friction, auto draw) {
    const double rate = draw(0.3, 2.0) * (draw(0, 1) < 0.5 ? -1 : 1), start = draw(-3.1, 3.1);
    const double distance = std::min(5.0, draw(0.2, 0.7) * friction * kGravity / (rate * rate));
    const Eigen::Vector3d at(kMiddle + distance * std::cos(start), kMiddle + distance * std::sin(start),
                             top(fixture, carrier) + 0.2);
    scene::ObjectSpec rider =
        draw(0, 1) < 0.5 ? box({draw(1.5, 3), draw(1.5, 3), 0.4}, at) : cylinder(draw(1, 1.7), 0.4, at);
    rider.friction = friction;
    rider.velocity = rate * Eigen::Vector3d(kMiddle - at.y(), at.x() - kMiddle, 0);
    rider.angular_velocity = {0, 0, rate};
    turn(fixture, carrier, rate);
    const scene::ObjectId id = fixture.add(rider);
    fixture.run(4.0);
    const double angle = start + rate * 4.0;
    const Eigen::Vector2d expected(kMiddle + distance * std::cos(angle),
                                   kMiddle + distance * std::sin(angle));
    EXPECT_LT((fixture.position(id).cast<double>().head<2>() - expected).norm(), 0.003 * distance)
        << "rate " << rate << ", distance " << distance;
  });
}

// As on a turntable: on a circle of its own, at 2/7 of the body's rate.
TEST_P(OnBody, BallsOnSpinningBodiesRoll) {
  on_random_bodies(4, 6, [](PhysicsFixture& fixture, scene::ObjectId carrier, double friction, auto draw) {
    const double rate = draw(0.3, 3.0), radius = draw(0.4, 1.5), k = 2.0 / 7.0 * rate, seconds = 3.0;
    const Eigen::Vector2d from(draw(-2, 2), draw(-2, 2)), velocity(draw(-0.6, 0.6), draw(-0.6, 0.6));
    scene::ObjectSpec ball =
        sphere(radius, {kMiddle + from.x(), kMiddle + from.y(), top(fixture, carrier) + radius});
    ball.friction = friction;
    ball.velocity = {velocity.x(), velocity.y(), 0};
    ball.angular_velocity = {(rate * from.x() - velocity.y()) / radius,
                             (rate * from.y() + velocity.x()) / radius, 0};
    turn(fixture, carrier, rate);
    const scene::ObjectId id = fixture.add(ball);
    fixture.run(seconds);
    const double s = std::sin(k * seconds) / k, c = (1 - std::cos(k * seconds)) / k;
    const Eigen::Vector2d way(s * velocity.x() - c * velocity.y(), s * velocity.y() + c * velocity.x());
    const Eigen::Vector2d moved =
        fixture.position(id).cast<double>().head<2>() - Eigen::Vector2d(kMiddle, kMiddle) - from;
    EXPECT_LT((moved - way).norm(), (0.005 * velocity.norm() + 0.0005 * rate * from.norm()) * seconds)
        << "rate " << rate;
  });
}

// A cylinder on its side slides until it rolls, at two thirds of its speed, and goes on at that.
TEST_P(OnBody, CylindersRollAtTwoThirdsOfTheirSpeed) {
  on_random_bodies(5, 12, [](PhysicsFixture& fixture, scene::ObjectId carrier, double friction, auto draw) {
    const double radius = draw(0.4, 1.2), speed = draw(0.4, 2.5);
    scene::ObjectSpec roller = cylinder(radius, draw(1, 2), {10, kMiddle, top(fixture, carrier) + radius});
    roller.friction = friction;
    roller.orientation = Eigen::Quaterniond(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitX()));
    roller.velocity = {speed, 0, 0};
    const scene::ObjectId id = fixture.add(roller);
    fixture.run(3.0);
    EXPECT_NEAR(static_cast<double>(fixture.velocity(id).x()), 2.0 / 3.0 * speed, 0.002 * speed);
    EXPECT_NEAR(fixture.position(id).y(), kMiddle, 0.01);
  });
}

// A face that spins on another is slowed by Σ µ·p·r over its area.
TEST_P(OnBody, FacesSlowATwistAsTheirAreaDoes) {
  on_random_bodies(6, 12, [](PhysicsFixture& fixture, scene::ObjectId carrier, double friction, auto draw) {
    Face face = draw_face(fixture, carrier, friction, 1, draw);
    const double spin = draw(8, 20);
    face.object.angular_velocity = {0, 0, spin};
    const double slows = friction * kGravity * face.mean_radius / face.gyration_squared,
                 seconds = 0.6 * spin / slows;
    const scene::ObjectId id = fixture.add(face.object);
    fixture.run(seconds);
    EXPECT_NEAR(static_cast<double>(fixture.angular_velocity(id).z()), 0.4 * spin,
                0.6 * spin * (0.01 + 1.0 / (seconds * GetParam())))
        << face.kind << ", spin " << spin << ", friction " << friction;
    EXPECT_LT((fixture.position(id).cast<double>() - face.object.position).head<2>().norm(), 0.02);
  });
}

// A face at rest on another bears a torque up to Σ µ·p·r over its area, and with a force beside it what the
// ellipse of both leaves.
TEST_P(OnBody, FacesBearATwistAsTheirAreaDoes) {
  on_random_bodies(7, 24, [](PhysicsFixture& fixture, scene::ObjectId carrier, double friction, auto draw) {
    Face face = draw_face(fixture, carrier, friction, 0.6, draw);
    face.object.mass = draw(0.5, 3);
    const double force = draw(0, 1) < 0.5 ? 0.0 : draw(0.2, 0.8), share = draw(0, 1) < 0.5 ? 0.9 : 1.1,
                 limit = friction * *face.object.mass * kGravity, direction = draw(-3.1, 3.1);
    const scene::ObjectId id = fixture.add(face.object);
    fixture.run(0.5);
    const double push = share * force * limit,
                 torque = share * std::sqrt(1 - force * force) * limit * face.mean_radius;
    const auto drive = [&] {
      surface::Wrench& wrench = fixture.world().wrenches()[fixture.world().bodies().size() - 1];
      wrench.force = (push * Eigen::Vector3d(std::cos(direction), std::sin(direction), 0)).cast<float>();
      wrench.torque = Eigen::Vector3f(0, 0, static_cast<float>(torque));
    };
    drive();
    fixture.run(2.0, drive);
    const double spin = fixture.angular_velocity(id).z(), speed = fixture.velocity(id).head<2>().norm(),
                 moves = std::abs(spin) * face.mean_radius + speed;
    if (share < 1)
      EXPECT_LT(moves, 0.005) << face.kind << ", force " << force;
    else
      EXPECT_GT(moves, 0.05) << face.kind << ", force " << force;
  });
}

INSTANTIATE_TEST_SUITE_P(Steps, OnBody, testing::Values(60, 120, 240, 960));
