// Objects on pins with tips of other shapes, and on tilted tiles, against closed forms.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include "smartsurf/scene/KindRegistry.h"
#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;

namespace {

enum TipShape { kFlat, kHemisphere, kCone, kRoundedSquare };  // as in pin.tip.shape

// A surface of one actuator model; top: edge of a cell's top, u.
void set_surface(PhysicsFixture& fixture, const std::string& model, int side, double pitch, double top,
                 const scene::ParameterValues& values) {
  scene::SurfaceSpec& surface = fixture.scene.surface;
  surface.rows = surface.columns = side;
  surface.pitch = pitch;
  scene::ActuatorSpec spec = scene::find_actuator_kind(model)->default_spec();
  spec.values["top"] = {top, top};
  for (const auto& [name, value] : values) spec.values[name] = value;
  surface.actuators = {spec};
  derive_pin_spec(surface);
  ASSERT_EQ(scene::validate(surface), "");
}

void set_tips(PhysicsFixture& fixture, TipShape shape, scene::ParameterValues values = {}) {
  values["tip.shape"] = {static_cast<double>(shape)};
  set_surface(fixture, "pin", 8, 1.0, 0.8, values);
}

void command(PhysicsFixture& fixture, int channel, double value) {
  fixture.cells().set_targets(
      channel, std::vector<float>(fixture.cells().field().height.size(), static_cast<float>(value)));
}

double load_of_cells(PhysicsFixture& fixture) {
  const std::vector<float>& impulse = fixture.cells().field().impulse;
  return std::accumulate(impulse.begin(), impulse.end(), 0.0) / fixture.scene.world.dt_s;
}

// One tile of 9.5 × 9.5 u at (0, 0), tilted about x and y, rad.
void tilt_tile(PhysicsFixture& fixture, double roll, double pitch) {
  set_surface(fixture, "tile", 1, 10.0, 9.5, {{"command", {1}}, {"max_tilt", {1.0}}});
  command(fixture, 1, roll);
  command(fixture, 2, pitch);
  fixture.run(2.0);
}

// Where a body touches whose underside is `height` below its centre, over the middle of a tile with that
// pitch.
Eigen::Vector3d on_slope(double pitch, double height) {
  return {height * std::sin(pitch), 0, height * std::cos(pitch)};
}

class Tips : public testing::TestWithParam<double> {
 protected:
  Tips() { fixture.scene.world.dt_s = GetParam(); }
  PhysicsFixture fixture;
};
class Tilt : public Tips {};
INSTANTIATE_TEST_SUITE_P(Steps, Tips, testing::Values(1.0 / 60, 1.0 / 240, 1.0 / 960));
INSTANTIATE_TEST_SUITE_P(Steps, Tilt, testing::Values(1.0 / 60, 1.0 / 240, 1.0 / 960));

const double kPocket = std::sqrt(0.5);  // from the middle of four cells to their centres, u

}  // namespace

// Plates with riders that fall on moving pins with a stiffness, enough of them for parallel steps, in one
// engine and in another that takes over its state every now and then.
TEST(PinStiffness, SavedStatesAndThreadsGiveTheSameBits) {
  const auto hash_after = [](int threads, bool takes_over) {
    PhysicsFixture fixture;
    fixture.threads = threads;
    fixture.scene.world.dt_s = 1.0 / 60;
    set_surface(fixture, "pin", 48, 1.0, 0.8, {{"stiffness", {3000}}, {"damping", {5}}});
    std::mt19937 random(11);
    const auto uniform = [&](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(random);
    };
    for (int i = 0; i < 225; ++i) {
      const Eigen::Vector3d at(2.0 + i % 15 * 3.0, 2.0 + i / 15 * 3.0, uniform(0.3, 1.0));
      const Eigen::Vector3d size(uniform(1.2, 2.6), uniform(1.2, 2.6), 0.4);
      fixture.add(box(size, at));
      fixture.add(box({0.6, 0.6, 0.4}, at + Eigen::Vector3d(uniform(-0.3, 0.3), uniform(-0.3, 0.3), 0.45)));
    }
    std::uint64_t sum = 0;
    for (int k = 0; k < 8; ++k) {
      fixture.run(0.2, [&] {
        fixture.cells().set_target(0, static_cast<int>(random() % 48), static_cast<int>(random() % 48),
                                   static_cast<float>(uniform(0, 0.02)));
      });
      sum = 31 * sum + fixture.snapshot().state_hash;
      if (takes_over) fixture.take_over();
    }
    return sum;
  };
  const std::uint64_t hash = hash_after(1, false);
  for (const int threads : {1, 2, 4}) EXPECT_EQ(hash_after(threads, true), hash) << threads;
}

// Flat faces sink by their weight over the stiffness of what they cover, and bear on it alone, at any depth.
TEST(PinStiffness, FlatFacesRestAtTheirDepth) {
  constexpr int kSide = 12, kSamples = 50;
  std::mt19937 random(23);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int i = 0; i < 36; ++i) {
    SCOPED_TRACE(i);
    const double top = std::array{0.1, 0.3, 0.5, 0.8}[i % 4], depth = std::pow(10.0, uniform(-3.5, -0.6));
    const double radius = uniform(1.0, 1.8), middle = i % 3 == 0 ? 5.0 : 5.5;
    const bool is_centred = i % 2 == 0;
    enum class Shape { kBox, kCone, kCylinder, kHull };
    const auto shape = static_cast<Shape>(i / 4 % 4);
    const auto covers = [&](double x, double y) {
      return shape == Shape::kBox || shape == Shape::kHull ? std::max(std::abs(x), std::abs(y)) < radius
                                                           : std::hypot(x, y) < radius;
    };
    Eigen::Vector3d at(middle, middle, 0);
    if (!is_centred) at += Eigen::Vector3d(uniform(-0.5, 0.5), uniform(-0.5, 0.5), 0);
    double covered = 0.0;  // tops
    for (int cell = 0; cell < kSide * kSide; ++cell)
      for (int k = 0; k < kSamples * kSamples; ++k)
        covered += covers(cell % kSide + top * ((k % kSamples + 0.5) / kSamples - 0.5) - at.x(),
                          cell / kSide + top * ((k / kSamples + 0.5) / kSamples - 0.5) - at.y());
    covered /= kSamples * kSamples;
    PhysicsFixture fixture;
    set_surface(fixture, "pin", kSide, 1.0, top, {{"stiffness", {kGravity / (depth * covered)}}});
    const double below_centre = shape == Shape::kHull ? radius : 0.5;
    at.z() = below_centre - depth + uniform(0, 0.02);
    scene::ObjectSpec o = shape == Shape::kBox    ? box({2 * radius, 2 * radius, 1}, at)
                          : shape == Shape::kCone ? cone(radius, 2, at)
                          : shape == Shape::kHull ? cube(at, static_cast<float>(2 * radius))
                                                  : cylinder(radius, 1, at);
    o.mass = 1.0;
    const auto id = fixture.add(o);
    fixture.run(12.0);
    const double z = static_cast<double>(fixture.position(id).z());
    fixture.run(0.5, [&] {
      EXPECT_NEAR(load_of_cells(fixture), kGravity, 0.01 * kGravity) << depth << ' ' << radius << ' ' << top;
    });
    EXPECT_NEAR(static_cast<double>(fixture.position(id).z()), z, 1e-4 + 0.01 * depth);
    if (is_centred) {
      EXPECT_NEAR(below_centre - z, depth, 1e-4 + 0.02 * depth);
    }
  }
}

// A swing without damping has a mean velocity of 0; as long as it lasts, boxes stay awake.
TEST(PinStiffness, SleepersLieOnTopsThatBearTheirWeight) {
  std::mt19937 random(29);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  int asleep = 0;
  for (const double dt_s : {1.0 / 60, 1.0 / 240})
    for (int i = 0; i < 40; ++i) {
      SCOPED_TRACE(i);
      PhysicsFixture fixture;
      fixture.scene.world.dt_s = dt_s;
      const bool is_damped = i % 4 == 0;
      scene::ParameterValues values{{"stiffness", {std::pow(10.0, uniform(3, 5))}}};
      if (!is_damped) values["damping"] = {0};
      set_surface(fixture, "pin", 12, 1.0, uniform(0.6, 1.0), values);
      const Eigen::Vector3d size(uniform(1.5, 5), uniform(1.5, 5), uniform(1.5, 5));
      scene::ObjectSpec o = box(size, {uniform(5, 6), uniform(5, 6), size.z() / 2 + 0.002});
      const double mass = uniform(1, 10);
      o.mass = mass;
      fixture.add(o);
      fixture.run(6.0);
      const bool sleeps = fixture.world().sleeping_count() == 1;
      EXPECT_TRUE(sleeps || !is_damped);
      if (!sleeps) continue;
      ++asleep;
      EXPECT_NEAR(load_of_cells(fixture), mass * kGravity, 0.001 * mass * kGravity);
    }
  EXPECT_GE(asleep, 30);
}

// Boxes that rock on tops without damping, by less than 8°: their energy above that at the start, relative to
// their weight, u.
TEST(PinStiffness, RockingBoxesGainNoEnergy) {
  std::mt19937 random(31);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int i = 0; i < 12; ++i) {
    SCOPED_TRACE(i);
    PhysicsFixture fixture;
    fixture.scene.world.sleep = false;
    const double stiffness = std::pow(10.0, uniform(2.7, 3.2)), tilt = uniform(0.03, 0.05);
    set_surface(fixture, "pin", 12, 1.0, 1.0, {{"stiffness", {stiffness}}, {"damping", {0}}});
    const Eigen::Vector3d size(uniform(2.4, 3.2), uniform(1.5, 1.8), uniform(2, 2.5));
    const double low = size.z() / 2 * std::cos(tilt) + size.y() / 2 * std::sin(tilt) + 0.002;
    scene::ObjectSpec o = box(size, {uniform(5, 5.5), uniform(5, 5.5), low});
    o.orientation = Eigen::AngleAxisd(tilt, Eigen::Vector3d::UnitX());
    o.mass = 3.0;
    const auto id = fixture.add(o);
    const Eigen::Vector3d squares = size.cwiseAbs2(),
                          inertia = (Eigen::Vector3d::Constant(squares.sum()) - squares) / 12;
    double greatest = 0;
    fixture.run(12.0, [&] {
      const std::array<float, 4>& q = fixture.snapshot().orientation[0];
      const Eigen::Quaterniond orientation = Eigen::Quaternionf(q[3], q[0], q[1], q[2]).cast<double>();
      const Eigen::Vector3d v = fixture.velocity(id).cast<double>(),
                            w = orientation.conjugate() * fixture.angular_velocity(id).cast<double>();
      const double kinetic = 0.5 * v.squaredNorm() + 0.5 * w.dot(inertia.cwiseProduct(w));
      greatest = std::max(greatest, static_cast<double>(fixture.position(id).z()) - low + kinetic / kGravity);
    });
    EXPECT_LT(greatest, 0.002);
  }
}

TEST_P(Tips, SphereRestsOnFourHemispheres) {
  const double radius = 1.5, tip = 0.4;
  set_tips(fixture, kHemisphere, {{"tip.radius", {tip}}});
  const double z = std::sqrt(std::pow(radius + tip, 2) - kPocket * kPocket) - tip;
  const auto id = fixture.add(sphere(radius, {3.5, 3.5, z + 0.05}));
  fixture.run(2.0);
  EXPECT_NEAR(fixture.position(id).z(), z, 3e-3);
  EXPECT_NEAR(fixture.position(id).x(), 3.5, 3e-3);
}

TEST_P(Tips, SphereRestsBetweenFourCones) {
  const double radius = 0.6, angle = std::numbers::pi / 4;
  set_tips(fixture, kCone, {{"tip.half_angle", {angle}}});
  const double z = (radius - kPocket * std::cos(angle)) / std::sin(angle);
  const auto id = fixture.add(sphere(radius, {3.5, 3.5, z + 0.05}));
  fixture.run(2.0);
  EXPECT_NEAR(fixture.position(id).z(), z, 3e-3);
}

TEST_P(Tips, SphereRestsOnRoundedCorners) {
  // The arcs of the four corners come as near to the middle as √2·(gap/2 + r) − r.
  const double radius = 0.5, corner = 0.3, near = std::sqrt(2.0) * (0.1 + corner) - corner;
  set_tips(fixture, kRoundedSquare, {{"tip.corner_radius", {corner}}});
  const double z = std::sqrt(radius * radius - near * near);
  const auto id = fixture.add(sphere(radius, {3.5, 3.5, z + 0.05}));
  fixture.run(2.0);
  EXPECT_NEAR(fixture.position(id).z(), z, 4e-3);
}

TEST_P(Tips, SphereRollsDownConeAtSlopeOfItsFlank) {
  const double radius = 0.5, angle = 1.2, slope = std::numbers::pi / 2 - angle, start = 1.5;
  set_surface(fixture, "pin", 1, 10.0, 9.5, {{"tip.shape", {kCone}}, {"tip.half_angle", {angle}}});
  const auto id = fixture.add(sphere(radius, {start * std::sin(angle) + radius * std::cos(angle), 0,
                                              -start * std::cos(angle) + radius * std::sin(angle)}));
  fixture.run(0.5);
  const double a = 5.0 / 7 * kGravity * std::sin(slope);
  EXPECT_NEAR(fixture.velocity(id).norm(), a * 0.5, 0.02 * a * 0.5);
  EXPECT_NEAR(-fixture.velocity(id).z() / fixture.velocity(id).x(), std::tan(slope), 0.01);
}

TEST_P(Tips, PinsBearBoxOnTheirApexes) {
  for (const TipShape shape : {kHemisphere, kCone, kRoundedSquare}) {
    PhysicsFixture bench;
    bench.scene.world.dt_s = GetParam();
    bench.scene.world.sleep = false;  // a sleeper keeps the loads of its last step
    set_tips(bench, shape, {{"max_speed", {1}}});
    command(bench, 0, 2.0);
    const auto id = bench.add(box({3.2, 3.2, 1}, {3, 3, 0.51}));
    bench.run(3.0);
    EXPECT_NEAR(bench.position(id).z(), 2.5, 3e-3) << shape;
    double impulse = 0.0;
    bench.run(0.5, [&] {
      for (const float on_cell : bench.cells().field().impulse) impulse += static_cast<double>(on_cell);
    });
    EXPECT_NEAR(impulse / 0.5, 3.2 * 3.2 * kGravity, 0.01 * 3.2 * 3.2 * kGravity) << shape;
  }
}

TEST_P(Tips, SameInAnyUnitOfLength) {
  const double scale = 25.0;
  fixture.scene.world.gravity *= scale;
  set_surface(fixture, "pin", 8, scale, 0.8 * scale, {{"tip.shape", {kHemisphere}}, {"length", {2 * scale}}});
  const double z = std::sqrt(1.9 * 1.9 - 0.5) - 0.4;
  const auto id = fixture.add(sphere(1.5 * scale, {3.5 * scale, 3.5 * scale, (z + 0.05) * scale}));
  fixture.run(2.0);
  EXPECT_NEAR(static_cast<double>(fixture.position(id).z()) / scale, z, 3e-3);
}

TEST_P(Tilt, BallRollsAtFiveSeventhsOfTheSlope) {
  const double angle = 0.3, radius = 1.0;
  tilt_tile(fixture, 0.0, angle);
  const auto id = fixture.add(sphere(radius, on_slope(angle, radius)));
  fixture.run(0.6);
  const double v = 5.0 / 7 * kGravity * std::sin(angle) * 0.6;
  EXPECT_NEAR(fixture.velocity(id).x(), v * std::cos(angle), 0.01 * v);
  EXPECT_NEAR(fixture.velocity(id).z(), -v * std::sin(angle), 0.01 * v);
  EXPECT_NEAR(fixture.angular_velocity(id).y(), v / radius, 0.01 * v);
}

TEST_P(Tilt, BoxSlidesWithFriction) {
  for (const double angle : {0.3, 0.6}) {
    PhysicsFixture bench;
    bench.scene.world.dt_s = GetParam();
    bench.scene.materials[0].friction = 0.4;  // holds up to atan(0.4) = 0.381
    tilt_tile(bench, 0.0, angle);
    auto o = box({2, 2, 1}, on_slope(angle, 0.5));
    o.orientation = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY());
    const auto id = bench.add(o);
    bench.run(0.5);
    const double a = kGravity * (std::sin(angle) - 0.4 * std::cos(angle));
    if (a < 0.0)
      EXPECT_LT(bench.velocity(id).norm(), 0.01);
    else
      EXPECT_NEAR(bench.velocity(id).norm(), a * 0.5, 0.02 * a * 0.5);
  }
}

TEST_P(Tilt, RollLowersTheSouthAndHeaveLifts) {
  tilt_tile(fixture, 0.3, 0.0);
  const auto id = fixture.add(sphere(1.0, {0, -std::sin(0.3), std::cos(0.3)}));
  fixture.run(0.3);
  EXPECT_LT(fixture.velocity(id).y(), -0.3);
  command(fixture, 1, 0.0);
  fixture.run(1.0);
  scene::ObjectStateUpdate middle;
  middle.position = {0, 0, 1};
  middle.velocity = middle.angular_velocity = Eigen::Vector3d::Zero();
  fixture.world().set_state(id, middle);
  command(fixture, 0, 1.0);
  fixture.run(2.0);
  EXPECT_NEAR(fixture.position(id).z(), 2.0, 3e-3);
}

TEST_P(Tilt, TurningTileCarriesBoxAboutItsCentre) {
  set_surface(fixture, "tile", 1, 10.0, 9.5, {{"command", {1}}, {"max_tilt_rate", {0.2}}});
  fixture.scene.materials[0].friction = 1.0;
  const auto id = fixture.add(box({2, 2, 1}, {3, 0, 0.5}));
  fixture.run(1.0);
  command(fixture, 2, 0.2);
  fixture.run(2.0);
  // The box keeps its place on the plate.
  EXPECT_NEAR(fixture.position(id).x(), 3 * std::cos(0.2) + 0.5 * std::sin(0.2), 0.02);
  EXPECT_NEAR(fixture.position(id).z(), -3 * std::sin(0.2) + 0.5 * std::cos(0.2), 0.02);
}

TEST(TiltLimits, RateAndAccelerationHold) {
  PhysicsFixture fixture;
  set_surface(fixture, "tile", 2, 1.0, 0.8,
              {{"command", {1}}, {"max_tilt_rate", {2}}, {"max_tilt_acceleration", {20}}});
  command(fixture, 1, 9.0);  // clamped to max_tilt
  float rate = 0.0F, highest = 0.0F;
  fixture.run(1.0, [&] {
    const surface::TopTilt& now = fixture.cells().field().tilt_rate[0];
    EXPECT_LE(std::abs(now.roll - rate), 20.0F * static_cast<float>(fixture.scene.world.dt_s) * 1.001F);
    rate = now.roll;
    highest = std::max(highest, rate);
  });
  EXPECT_EQ(highest, 2.0F);
  EXPECT_EQ(fixture.cells().field().tilt[0].roll, 0.35F);
  EXPECT_EQ(rate, 0.0F);
}
