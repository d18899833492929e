// Force-limited pins against closed forms: a weight W on n pins rises if n·max_force > W and stalls
// otherwise.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <vector>

#include "smartsurf/scene/KindRegistry.h"
#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;

namespace {

constexpr double kMaxForce = 40;
constexpr float kRaisedHeight = 2.0F;  // commanded height of the pins, u

void use_force_limited_pins(PhysicsFixture& fixture) {
  scene::ActuatorSpec spec = scene::find_actuator_kind("pin")->default_spec();
  for (const auto& [name, value] : scene::ParameterValues{
           {"range", {0, 4}}, {"max_speed", {6}}, {"max_acceleration", {10}}, {"max_force", {kMaxForce}}})
    spec.values[name] = value;
  fixture.scene.surface.actuators = {spec};
  derive_pin_spec(fixture.scene.surface);
}

scene::ObjectSpec with_weight(scene::ObjectSpec o, double weight) {
  o.mass = weight / kGravity;
  return o;
}

// A box that covers exactly `columns` × `rows` cells; its south-western cell is at (10, 10).
scene::ObjectSpec box_over(int columns, int rows) {
  return box({columns - 0.2, rows - 0.2, 1.0}, {10 + 0.5 * (columns - 1), 10 + 0.5 * (rows - 1), 0.5});
}

// Rise of a box whose weight is `share_of_force` of what its pins can bear together.
double lift_height(int columns, int rows, double share_of_force) {
  PhysicsFixture fixture;
  use_force_limited_pins(fixture);
  const auto id =
      fixture.add(with_weight(box_over(columns, rows), share_of_force * kMaxForce * columns * rows));
  fixture.run(0.5);
  raise_all(fixture, kRaisedHeight);
  fixture.run(4.0);
  return fixture.position(id).z() - 0.5;
}

}  // namespace

TEST(ForceLimit, WeightRisesOnlyIfItsPinsCanBearIt) {
  for (const auto& [columns, rows] : {std::pair{1, 1}, {2, 2}, {3, 3}, {1, 4}, {5, 5}}) {
    EXPECT_NEAR(lift_height(columns, rows, 0.7), kRaisedHeight, 0.02) << columns << " by " << rows;
    EXPECT_NEAR(lift_height(columns, rows, 0.9), kRaisedHeight, 0.02) << columns << " by " << rows;
    EXPECT_NEAR(lift_height(columns, rows, 1.1), 0.0, 0.02) << columns << " by " << rows;
    EXPECT_NEAR(lift_height(columns, rows, 2.0), 0.0, 0.02) << columns << " by " << rows;
  }
}

// Whatever acceleration a pin may have without a load, its force alone decides if it leaves its lower stop.
TEST(ForceLimit, LoadRisesFromTheLowerStopByTheMotorsLine) {
  if (PhysicsFixture().scene.world.engine == "bullet")
    GTEST_SKIP() << "on Bullet a load leaves its lower stop 0.1 s late or more";
  constexpr double kMaxSpeed = 6.0, kDt_s = 1e-4, kRise = 1.0;
  for (const double max_acceleration : {10.0, 400.0})
    for (const double share : {0.3, 0.6, 0.95}) {
      SCOPED_TRACE(testing::Message() << max_acceleration << " u/s², " << share << " of the force");
      double right_s = 0.0;
      for (double z = 0.0, v = 0.0; z < kRise; z += v * kDt_s, right_s += kDt_s)
        v += kDt_s * std::min(max_acceleration, kGravity * ((1.0 - v / kMaxSpeed) / share - 1.0));
      PhysicsFixture fixture;
      fixture.scene.world.dt_s = 1.0 / 240;
      use_force_limited_pins(fixture);
      fixture.scene.surface.actuators[0].values["max_acceleration"] = {max_acceleration};
      const auto id = fixture.add(with_weight(box_over(1, 1), share * kMaxForce));
      fixture.run(1.0);
      std::vector<float> targets(fixture.cells().field().height.size(), 0.0F);
      targets[fixture.cells().field().index(21, 10)] = kRaisedHeight;
      fixture.cells().set_targets(0, targets);
      double taken_s = 0.0;
      fixture.run(right_s + 0.1, [&] {
        if (fixture.position(id).z() < 0.5 + kRise) taken_s += fixture.scene.world.dt_s;
      });
      EXPECT_NEAR(taken_s, right_s, 0.015 * right_s);
    }
}

// Heights to which a load rises within a second, a quarter of a second apart: the motor accelerates it by
// what its line leaves of the weight, at most as its profile does.
std::array<double, 4> rise_by_the_motors_line(double share, double max_speed, double max_acceleration) {
  constexpr int kStepsPerQuarter = 25000;
  constexpr double kDt_s = 0.25 / kStepsPerQuarter;
  std::array<double, 4> rise{};
  double z = 0.0, v = 0.0;
  for (double& at_quarter : rise) {
    for (int i = 0; i < kStepsPerQuarter; ++i) {
      v += kDt_s * std::min(max_acceleration, kGravity * ((1.0 - v / max_speed) / share - 1.0));
      z += kDt_s * v;
    }
    at_quarter = z;
  }
  return rise;
}

// The step, the profile's acceleration, the mass, the restitution and where the pins start do not matter. The
// unloaded pins around the load run ahead of it.
TEST(ForceLimit, AnyLoadRisesByTheMotorsLine) {
  if (PhysicsFixture().scene.world.engine == "bullet")
    GTEST_SKIP() << "on Bullet a load leaves its lower stop 0.1 s late or more";
  for (const int steps_per_s : {60, 120, 240, 960}) {
    const double dt_s = 1.0 / steps_per_s;
    for_random_fixtures(71, 24, dt_s, [&](PhysicsFixture& fixture, auto draw) {
      const double share = draw(0.05, 0.95), max_speed = std::pow(10.0, draw(0.0, 0.9)),
                   max_acceleration = std::pow(10.0, draw(1.0, 3.0)), mass = std::pow(10.0, draw(-2.0, 2.0)),
                   start = std::max(0.0, draw(-2.0, 2.0));
      const int columns = static_cast<int>(draw(1.0, 5.0)), rows = static_cast<int>(draw(1.0, 5.0));
      fixture.scene.materials[0].restitution = std::max(0.0, draw(-0.5, 0.9));
      SCOPED_TRACE(testing::Message() << "1/" << steps_per_s << " s, " << columns << " by " << rows
                                      << ", share " << share << ", " << max_speed << " u/s, "
                                      << max_acceleration << " u/s², mass " << mass << ", from " << start);
      use_force_limited_pins(fixture);
      auto& values = fixture.scene.surface.actuators[0].values;
      values["range"] = {0, 20}, values["max_speed"] = {max_speed};
      values["max_acceleration"] = {max_acceleration};
      values["max_force"] = {mass * kGravity / (share * columns * rows)};
      raise_all(fixture, static_cast<float>(start));
      fixture.run(start / max_speed + max_speed / max_acceleration + 0.3);
      scene::ObjectSpec load = with_weight(box_over(columns, rows), mass * kGravity);
      load.position.z() += start;
      const auto id = fixture.add(load);
      if (draw(0.0, 1.0) < 0.5) fixture.run(0.3);  // else its pins have borne nothing before they move
      const float before = fixture.position(id).z();
      EXPECT_NEAR(before, start + 0.5, 1e-3);
      raise_all(fixture, 20.0F);
      const auto right = rise_by_the_motors_line(share, max_speed, max_acceleration);
      for (const double rise : right) {
        fixture.run(0.25);
        EXPECT_NEAR(fixture.position(id).z() - before, rise, 0.02 * right.back() + max_speed * dt_s + 3e-3);
      }
    });
  }
}

TEST(ForceLimit, RaisedPinNeverExceedsItsForce) {
  PhysicsFixture fixture;
  use_force_limited_pins(fixture);
  fixture.add(with_weight(box_over(4, 4), 12 * kMaxForce));
  auto ball = with_weight(sphere(1.5, {11.5, 11.5, 8}), 3 * kMaxForce);
  fixture.add(ball);
  // The limit applies along the pin's axis; a slightly inclined contact carries slightly more.
  const float max_impulse = static_cast<float>(kMaxForce / 240) * 1.02F;
  double largest_impulse = 0;
  int gave_way = 0;
  auto check_impulses = [&] {
    const surface::Field& f = fixture.cells().field();
    for (std::size_t i = 0; i < f.impulse.size(); ++i)
      if (f.height[i] > 0.01F) {
        ASSERT_LE(f.impulse[i], max_impulse);
        largest_impulse = std::max(largest_impulse, static_cast<double>(f.impulse[i]));
        gave_way += f.speed[i] < -0.1F;
      }
  };
  raise_all(fixture, kRaisedHeight);
  fixture.run(3.0, check_impulses);
  EXPECT_GT(largest_impulse, 0.9F * max_impulse);
  EXPECT_GT(gave_way, 0) << "the ball's impact pushes pins back";
}

// Height after 3 s of the lower of two boxes, each with one edge on the pin between them.
float lift_two_boxes(double share, double offset) {
  PhysicsFixture fixture;
  use_force_limited_pins(fixture);
  const double weight = 1.5 * share * kMaxForce;
  const auto west = fixture.add(with_weight(box({1.45, 0.8, 1}, {10.325 + offset, 10, 0.5}), weight));
  const auto east = fixture.add(with_weight(box({1.45, 0.8, 1}, {11.825 + offset, 10, 0.5}), weight));
  fixture.run(0.5);
  raise_all(fixture, kRaisedHeight);
  fixture.run(3.0);
  return std::min(fixture.position(west).z(), fixture.position(east).z());
}

TEST(ForceLimit, TwoBodiesOnOnePinShareItsForce) {
  // The outer pin and half of the middle pin can just lift one box at share 1. The boxes rock against each
  // other, which makes the height after a given time chaotic, so the test takes the median of several runs.
  for (const double share : {0.8, 1.2}) {
    std::array<float, 5> heights;
    for (std::size_t i = 0; i < heights.size(); ++i)
      heights[i] = lift_two_boxes(share, 1e-3 * static_cast<double>(i));
    const auto middle = heights.begin() + heights.size() / 2;
    std::nth_element(heights.begin(), middle, heights.end());
    if (share < 1)
      EXPECT_GT(*middle, 1.0F);
    else
      EXPECT_LT(*middle, 1.0F);
  }
}

TEST(ForceLimit, UnevenLoadStallsOnlyOverloadedPins) {
  PhysicsFixture fixture;
  use_force_limited_pins(fixture);
  const auto plank = fixture.add(with_weight(box_over(12, 1), 0.5 * kMaxForce));
  // On the eastern end, heavier than the pins under it can bear.
  const auto load = fixture.add(with_weight(box({1.8, 0.8, 1}, {20.5, 10, 1.5}), 12 * kMaxForce));
  fixture.run(0.5);
  raise_all(fixture, 1);
  fixture.run(3.0);
  const auto& f = fixture.cells().field();
  const int row = 31 - 10;
  EXPECT_GT(f.height[static_cast<std::size_t>(f.index(row, 10))], 0.9F) << "the light end rises";
  EXPECT_LT(f.height[static_cast<std::size_t>(f.index(row, 21))], 0.1F) << "the heavy end does not";
  EXPECT_LT(fixture.position(load).z(), 1.7F);
  EXPECT_GT(fixture.position(plank).z(), 0.7F);
}

// Loads of the columns of cells, linear in x and within the limit, that bear `total` with the moment `moment`
// about the middle: least squares.
std::array<double, 5> bounded_loads(double total, double moment, double limit) {
  std::array<double, 5> load{};
  auto sum = [&](double a, double b) {
    std::array<double, 2> sums{};
    for (int c = 0; c < 5; ++c) {
      load[static_cast<std::size_t>(c)] = std::clamp(a + b * (c - 2), 0.0, limit);
      sums[0] += load[static_cast<std::size_t>(c)], sums[1] += load[static_cast<std::size_t>(c)] * (c - 2);
    }
    return sums;
  };
  auto bisect = [](double low, double high, auto is_below) {
    for (int i = 0; i < 80; ++i) (is_below(0.5 * (low + high)) ? low : high) = 0.5 * (low + high);
    return low;
  };
  double a = 0.0;
  const double b = bisect(0.0, 2 * limit, [&](double slope) {
    a = bisect(-10 * limit, 10 * limit, [&](double level) { return sum(level, slope)[0] < total; });
    return sum(a, slope)[1] < moment;
  });
  sum(a, b);
  return load;
}

TEST(ForceLimit, LoadsAreTheLeastSquaresWithinTheLimits) {
  // A force at `lever` east of the middle of a box on 5 × 5 raised pins: no pin, one column, two columns give
  // all.
  constexpr double kWeight = 25 * kGravity;
  for (const auto& [force, lever, full] :
       {std::tuple{0.0, 0.0, 0}, {300.0, 1.0, 0}, {400.0, 1.0, 1}, {400.0, 1.3, 2}}) {
    PhysicsFixture fixture;
    use_force_limited_pins(fixture);
    const auto id = fixture.add(with_weight(box({5, 5, 1}, {15, 15, 0.5}), kWeight));
    raise_all(fixture, 1.0F);
    fixture.run(2.0);
    for (int i = 1; i <= 10; ++i) {
      fixture.world().apply_force(id, {0, 0, -0.1 * i * force}, Eigen::Vector3d(15 + lever, 15, 2), 0.05);
      fixture.run(0.05);
    }
    fixture.world().apply_force(id, {0, 0, -force}, Eigen::Vector3d(15 + lever, 15, 2), 10.0);
    fixture.run(0.5);
    const auto expected = bounded_loads((kWeight + force) / 5, force * lever / 5, kMaxForce);
    EXPECT_EQ(std::count_if(expected.begin(), expected.end(), [](double n) { return n > 0.999 * kMaxForce; }),
              full);
    const auto& field = fixture.cells().field();
    for (int r = 0; r < 32; ++r)
      for (int c = 0; c < 32; ++c) {
        const bool is_covered = std::abs(c - 15) <= 2 && std::abs(31 - r - 15) <= 2;
        const double load =
            static_cast<double>(field.impulse[static_cast<std::size_t>(field.index(r, c))]) * 240;
        EXPECT_NEAR(load, is_covered ? expected[static_cast<std::size_t>(c - 13)] : 0.0, 0.01 * kMaxForce)
            << force << " at " << lever << ", " << c << ' ' << 31 - r;
      }
    EXPECT_NEAR(fixture.position(id).z(), 1.5, 0.003);
  }
}

TEST(ForceLimit, PinsOfAllLimitsRubAlike) {
  // Each pin rubs with its own load: a spinning box slows as on pins without a limit, near their limit too.
  std::array<float, 3> spin;
  const double limits[] = {0.0, 1e5, 1.2 * kGravity};
  for (std::size_t i = 0; i < spin.size(); ++i) {
    PhysicsFixture fixture;
    fixture.cell_force_limit = limits[i];
    auto object = box({5, 5, 1}, {15, 15, 0.5});
    object.angular_velocity = {0, 0, 10};
    const auto id = fixture.add(object);
    fixture.run(2.0);
    spin[i] = fixture.angular_velocity(id).z();
  }
  EXPECT_NEAR(spin[0], 10 - 2.0 * 2.25, 0.15);
  EXPECT_NEAR(spin[1], spin[0], 0.05);
  EXPECT_NEAR(spin[2], spin[0], 0.05);
}

TEST(ForceLimit, RaisedPinsSinkUnderOverload) {
  // An overload falls under the part of its weight that the pins do not hold: s = ½·(1 − 1/share)·g·t².
  for (const double share : {0.9, 1.25}) {
    PhysicsFixture fixture;
    use_force_limited_pins(fixture);
    raise_all(fixture, 4);
    fixture.run(3.0);
    auto o = with_weight(box_over(3, 3), share * 9 * kMaxForce);
    o.position.z() = 4.5;
    const auto id = fixture.add(o);
    fixture.run(0.5);
    const double sunk = share < 1 ? 0.0 : 0.5 * (1 - 1 / share) * kGravity * 0.5 * 0.5;
    EXPECT_NEAR(4.5 - fixture.position(id).z(), sunk, 0.02);
  }
}
