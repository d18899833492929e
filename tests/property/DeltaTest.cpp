// Objects on the tips of delta robots against closed forms.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "smartsurf/scene/Delta.h"
#include "smartsurf/scene/KindRegistry.h"
#include "tests/property/PhysicsFixture.h"
#include "tests/property/Swing.h"

using namespace physics_fixture;
using namespace smartsurf;

namespace {

enum DeltaChannel { kX, kY, kZ };

// Deltas one pitch apart over a ground plane at z = 0; the one in the south-west is at the origin.
void set_deltas(PhysicsFixture& fixture, int rows, int columns, double pitch,
                const scene::ParameterValues& values) {
  scene::SurfaceSpec& surface = fixture.scene.surface;
  surface.rows = rows, surface.columns = columns;
  surface.pitch = pitch;
  scene::ActuatorSpec spec = scene::find_actuator_kind("delta")->default_spec();
  spec.values["top"] = {0.8 * pitch, 0.8 * pitch};
  spec.values["workspace.z"] = {0.5, 2.0};
  spec.values["length"] = {0.5};
  for (const auto& [name, value] : values) spec.values[name] = value;
  surface.actuators = {spec};
  derive_pin_spec(surface);
  ASSERT_EQ(scene::validate(surface), "");
}

void move_tips(PhysicsFixture& fixture, DeltaChannel channel, double value) {
  fixture.cells().set_targets(
      channel, std::vector<float>(fixture.cells().field().height.size(), static_cast<float>(value)));
}

Eigen::Vector3f tip_velocity(PhysicsFixture& fixture, std::size_t cell) {
  const surface::Field& field = fixture.cells().field();
  return {field.offset_rate[cell].x(), field.offset_rate[cell].y(), field.speed[cell]};
}

// Force on a tip in the last step.
Eigen::Vector3f tip_force(PhysicsFixture& fixture, std::size_t cell) {
  return fixture.cells().field().tip_impulse[cell] / static_cast<float>(fixture.scene.world.dt_s);
}

class Delta : public testing::TestWithParam<double> {
 protected:
  Delta() { fixture.scene.world.dt_s = GetParam(); }
  PhysicsFixture fixture;
};
// Tips that yield.
class YieldingDelta : public Delta {};
INSTANTIATE_TEST_SUITE_P(Steps, Delta, testing::Values(1.0 / 60, 1.0 / 240, 1.0 / 960));
INSTANTIATE_TEST_SUITE_P(Steps, YieldingDelta, testing::Values(1.0 / 60, 1.0 / 240, 1.0 / 960));

}  // namespace

TEST_P(Delta, SphereRestsBetweenFourTips) {
  const double radius = 1.0, tip = 0.3;
  set_deltas(fixture, 2, 2, 1.0, {{"tip.radius", {tip}}});
  const double d2 = 2 * 0.5 * 0.5, z = std::sqrt(std::pow(radius + tip, 2) - d2) - tip + 0.5;
  const auto id = fixture.add(sphere(radius, {0.5, 0.5, z + 0.05}));
  fixture.run(2.0);
  EXPECT_NEAR(fixture.position(id).z(), z, 3e-3);
  EXPECT_NEAR(fixture.position(id).x(), 0.5, 3e-3);
}

TEST_P(Delta, TipsLiftAndCarryBox) {
  for (const double shape : {0.0, 1.0}) {
    PhysicsFixture bench;
    bench.scene.world.dt_s = GetParam();
    set_deltas(bench, 4, 4, 1.0, {{"tip.shape", {shape}}, {"max_speed", {1}}, {"max_acceleration", {3}}});
    const auto id = bench.add(box({3.4, 3.4, 1}, {1.5, 1.5, 1.01}));
    bench.run(0.5);
    move_tips(bench, kZ, 1.5);
    bench.run(2.0);
    EXPECT_NEAR(bench.position(id).z(), 2.0, 4e-3);
    move_tips(bench, kX, 0.4);
    bench.run(2.0);
    EXPECT_NEAR(bench.position(id).x(), 1.9, 5e-3) << "friction carries it along";
  }
}

TEST_P(YieldingDelta, CellsBearTheWeight) {
  for (const scene::ParameterValues& values :
       {scene::ParameterValues{{"stiffness", {300}}}, scene::ParameterValues{{"max_force", {50}}},
        scene::ParameterValues{{"stiffness", {300}}, {"max_force", {50}}}}) {
    PhysicsFixture bench;
    bench.scene.world.dt_s = GetParam();
    set_deltas(bench, 4, 4, 1.0, values);
    auto load = box({3.4, 3.4, 1}, {1.5, 1.5, 1.01});
    load.mass = 5;
    bench.add(load);
    bench.run(3.0);
    const std::vector<float>& impulse = bench.cells().field().impulse;
    EXPECT_NEAR(std::accumulate(impulse.begin(), impulse.end(), 0.0) / GetParam(), 5 * kGravity, 0.05);
  }
}

TEST_P(Delta, TipPushesBoxSidewaysAtItsSpeed) {
  for (const double shape : {0.0, 1.0}) {
    PhysicsFixture bench;
    bench.scene.world.dt_s = GetParam();
    set_deltas(bench, 1, 1, 4.0,
               {{"tip.shape", {shape}},
                {"workspace.radius", {1.5}},
                {"max_speed", {0.8}},
                {"max_acceleration", {2}},
                {"tip.radius", {0.2}}});
    move_tips(bench, kX, -1.5);
    bench.run(3.0);
    const auto id = bench.add(box({1, 1, 0.5}, {-0.7, 0, 0.25}));
    move_tips(bench, kX, 1.0);
    bench.run(1.5);
    EXPECT_NEAR(bench.velocity(id).x(), 0.8, 5e-3);
    bench.run(2.0);
    EXPECT_NEAR(bench.position(id).x(), 1.0 + 0.2 + 0.5, 5e-3);
    EXPECT_NEAR(bench.position(id).z(), 0.25, 0.01);
  }
}

TEST_P(Delta, SameInAnyUnitOfLength) {
  const double scale = 25.0;
  fixture.scene.world.gravity *= scale;
  set_deltas(fixture, 1, 1, 4 * scale,
             {{"workspace.radius", {1.5 * scale}},
              {"max_speed", {0.8 * scale}},
              {"max_acceleration", {2 * scale}},
              {"tip.radius", {0.2 * scale}},
              {"workspace.z", {0.5 * scale, 2 * scale}},
              {"length", {0.5 * scale}}});
  move_tips(fixture, kX, -1.5 * scale);
  fixture.run(3.0);
  const auto id =
      fixture.add(box(scale * Eigen::Vector3d(1, 1, 0.5), scale * Eigen::Vector3d(-0.7, 0, 0.25)));
  move_tips(fixture, kX, 1.0 * scale);
  fixture.run(3.5);
  EXPECT_NEAR(static_cast<double>(fixture.position(id).x()) / scale, 1.7, 5e-3);
}

TEST_P(Delta, TipKeepsItsLimitsWithinItsWorkspace) {
  set_deltas(fixture, 1, 1, 4.0,
             {{"workspace.radius", {1.0}}, {"max_speed", {2.0}}, {"max_acceleration", {20.0}}});
  move_tips(fixture, kX, 3.0);
  move_tips(fixture, kY, 1.0);
  move_tips(fixture, kZ, 9.0);
  Eigen::Vector3f last = Eigen::Vector3f::Zero(), fastest = last;
  const auto dt = static_cast<float>(GetParam());
  fixture.run(2.0, [&] {
    const Eigen::Vector3f v = tip_velocity(fixture, 0);
    EXPECT_LE((v - last).cwiseAbs().maxCoeff(), 20.0F * dt * 1.001F);
    fastest = fastest.cwiseMax(v);
    last = v;
  });
  EXPECT_EQ(fastest.z(), 2.0F);
  EXPECT_LE(fastest.maxCoeff(), 2.0F);
  const surface::Field& field = fixture.cells().field();
  EXPECT_NEAR(field.offset[0].x(), std::sqrt(0.9F), 1e-6F);
  EXPECT_NEAR(field.offset[0].y(), std::sqrt(0.1F), 1e-6F);
  EXPECT_EQ(field.height[0], 2.0F);
  EXPECT_TRUE(last.isZero(0.0F)) << "stops on its target";
}

TEST(DeltaCommands, MoveToTheNearestPointOfTheWorkspace) {
  std::mt19937 random(5);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int i = 0; i < 20; ++i) {
    const double radius = uniform(0.1, 1.0);
    const auto latency = static_cast<double>(i % 3);
    PhysicsFixture bench;
    set_deltas(bench, 3, 3, 4.0,
               {{"workspace.radius", {radius}},
                {"max_speed", {1e3}},
                {"max_acceleration", {1e6}},
                {"latency", {latency}}});
    std::array<std::vector<float>, 2> commands;
    for (auto& channel : commands)
      for (int cell = 0; cell < 9; ++cell)
        channel.push_back(static_cast<float>(std::pow(10.0, uniform(-1.5, 1.5)) * uniform(-radius, radius)));
    commands[0][4] = std::numeric_limits<float>::infinity();
    surface::ActuatorArray& cells = bench.cells();
    // In any order, also of single cells.
    if (i % 2 == 0) {
      for (int cell = 8; cell >= 0; --cell)
        for (const int channel : {kY, kX})
          cells.set_target(channel, cell / 3, cell % 3, commands[channel][cell]);
    } else {
      for (const int channel : {kX, kY}) cells.set_targets(channel, commands[channel]);
    }
    for (int tick = 0; tick < 4; ++tick) {
      cells.begin_tick();
      bench.run(0.1);
      for (const int channel : {kX, kY}) {  // as clients do that send back what they read
        const auto read = cells.targets(channel);
        cells.set_targets(channel, std::vector<float>(read.begin(), read.end()));
      }
    }
    for (int cell = 0; cell < 9; ++cell) {
      const double x = std::min(1e30, static_cast<double>(commands[0][cell])), y = commands[1][cell];
      const double scale = std::min(1.0, radius / std::hypot(x, y));
      EXPECT_NEAR(static_cast<double>(cells.targets(kX)[cell]), scale * x, 1e-6);
      EXPECT_NEAR(static_cast<double>(cells.targets(kY)[cell]), scale * y, 1e-6);
      EXPECT_NEAR(static_cast<double>(cells.field().offset[cell].x()), scale * x, 1e-5);
      EXPECT_NEAR(static_cast<double>(cells.field().offset[cell].y()), scale * y, 1e-5);
    }
  }
}

TEST(DeltaSleep, MovingTipWakesWhatItPushes) {
  PhysicsFixture fixture;
  set_deltas(
      fixture, 1, 1, 4.0,
      {{"workspace.radius", {1.5}}, {"max_speed", {0.5}}, {"max_acceleration", {2}}, {"tip.radius", {0.2}}});
  const auto id = fixture.add(box({1, 1, 0.5}, {0.9, 0, 0.25}));
  fixture.run(2.0);
  move_tips(fixture, kX, 1.0);
  fixture.run(3.0);
  EXPECT_NEAR(fixture.position(id).x(), 1.7, 5e-3);
}

TEST(DeltaJoints, PositionsAreThoseOfTheArms) {
  scene::ActuatorSpec spec = scene::find_actuator_kind("delta")->default_spec();
  spec.values["arms.length"] = {3.0};
  spec.values["arms.radius"] = {1.0};
  const scene::Delta delta(spec);
  for (const double q : delta.joint_positions({0, 0, 1.25})) EXPECT_DOUBLE_EQ(q, 1.25);
  const Eigen::Vector3d tip(0.3, -0.2, 0.7);
  const auto q = delta.joint_positions(tip);
  const double rest = std::sqrt(9.0 - 1.0);
  for (std::size_t i = 0; i < 3; ++i) {
    const double a = scene::Delta::kJointDirections[i];
    const Eigen::Vector3d joint(std::cos(a), std::sin(a), q[i] - rest);
    EXPECT_NEAR((tip - joint).norm(), 3.0, 1e-12) << "the arm has its length";
  }
}

TEST_P(YieldingDelta, SpringsDeflectByTheirLoad) {
  const double stiffness = 200.0, mass = 2.0;
  set_deltas(fixture, 2, 2, 1.0, {{"stiffness", {stiffness}}, {"max_force", {100}}});
  auto o = box({1.6, 1.6, 1}, {0.5, 0.5, 1.01});
  o.mass = mass;
  const auto id = fixture.add(o);
  fixture.run(3.0);
  const double load = mass * kGravity / 4;
  EXPECT_NEAR(fixture.position(id).z(), 1.0 - load / stiffness, 1.5e-3);
  for (std::size_t cell = 0; cell < 4; ++cell) {
    EXPECT_NEAR(tip_force(fixture, cell).z(), -load, 0.01 * load);
    EXPECT_NEAR(fixture.cells().field().height[cell], 0.5 - load / stiffness, 2e-4);
  }
}

TEST_P(YieldingDelta, HeavyLoadOnSoftTipOscillatesAtItsFrequency) {
  const double stiffness = 50.0, mass = 2.0;  // of four tips together
  set_deltas(fixture, 2, 2, 1.0, {{"stiffness", {stiffness / 4}}, {"damping", {0}}, {"max_force", {1000}}});
  move_tips(fixture, kZ, 1.9);
  fixture.run(1.0);
  auto o = box({1.6, 1.6, 1}, {0.5, 0.5, 2.4});
  o.mass = mass;
  const auto id = fixture.add(o);
  // Released at the length of the unloaded springs, it turns half a period later, at twice the static
  // deflection.
  double lowest = 10.0, at_s = 0.0, t_s = 0.0;
  fixture.run(1.0, [&] {
    t_s += GetParam();
    const double z = static_cast<double>(fixture.position(id).z());
    if (z < lowest) lowest = z, at_s = t_s;
  });
  const double frequency = std::sqrt(stiffness / mass);
  EXPECT_NEAR(at_s, M_PI / frequency, 0.02 + GetParam());
  EXPECT_NEAR(2.4 - lowest, 2 * mass * kGravity / stiffness, 0.05 + 4 * GetParam());
}

TEST_P(YieldingDelta, LoadSwingsAsDampedOscillator) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const auto uniform = [&](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(random);
    };
    const double mass = uniform(0.5, 5), frequency = uniform(8, 25), share = uniform(0.003, 0.03);
    const double stiffness = mass * frequency * frequency, damping = 2 * share * mass * frequency;
    fixture = PhysicsFixture();
    fixture.scene.world.dt_s = GetParam();
    set_deltas(fixture, 2, 2, 1.0,
               {{"stiffness", {stiffness / 4}}, {"damping", {damping / 4}}, {"max_force", {1000}}});
    auto o = box({1.6, 1.6, 1}, {0.5, 0.5, 1.0});
    o.mass = mass;
    const auto id = fixture.add(o);
    // In finer steps the positions' last bits would look like extremes.
    const int every = std::max(1, static_cast<int>(std::lround(1.0 / 240 / GetParam())));
    Swing swing(every * GetParam());
    int step = 0;
    fixture.run(3.0, [&] {
      if (++step % every == 0) swing.add(static_cast<double>(fixture.position(id).z()));
    });
    const double root = std::sqrt(1 - share * share);
    EXPECT_NEAR(swing.decrement(), 2 * M_PI * share / root, 0.05 * share * 2 * M_PI + 1e-3);
    EXPECT_NEAR(swing.period_s(), 2 * M_PI / frequency / root, 0.01 * 2 * M_PI / frequency);
  }
}

// Whatever slides, rolls or bounces over springs of any stiffness, without damping or with any.
TEST_P(YieldingDelta, LoadsGainNoEnergy) {
  std::mt19937 random(17);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  constexpr double kHeight = 1.0;
  for (int i = 0; i < 36; ++i) {
    SCOPED_TRACE(i);
    const double stiffness = std::pow(10.0, uniform(1.5, 4.5));  // of a mass of 1
    const double share = std::array{0.0, 0.0, 0.001, std::pow(10.0, uniform(-3, 0))}[i % 4];
    fixture = PhysicsFixture();
    fixture.scene.world.dt_s = GetParam();
    fixture.scene.materials[0].friction = std::array{0.0, 0.02, uniform(0, 1)}[i % 3];
    scene::ParameterValues values{{"tip.shape", {static_cast<double>(i / 3 % 2)}},
                                  {"stiffness", {stiffness}},
                                  {"damping", {2 * share * std::sqrt(stiffness)}}};
    set_deltas(fixture, 9, 9, 1.0, values);
    const Eigen::Vector3d at(uniform(3, 5), uniform(3, 5), 0.5 + kHeight + uniform(0.02, 0.7));
    auto o = i % 4 == 0   ? sphere(kHeight, at)
             : i % 4 == 1 ? box({uniform(2, 4), uniform(2, 4), 2 * kHeight}, at)
             : i % 4 == 2 ? cylinder(uniform(1, 2), 2 * kHeight, at)
                          : capsule(0.8, 2 * kHeight, at);
    o.mass = 1.0;
    o.orientation = Eigen::Quaterniond(Eigen::AngleAxisd(uniform(0, 3), Eigen::Vector3d::UnitZ()));
    o.velocity = {uniform(-1, 1), uniform(-1, 1), 0};
    const auto id = fixture.add(o);
    const double given = o.velocity.squaredNorm() / 2 + kGravity * at.z();
    double greatest = 0.0;
    fixture.run(3.0, [&] {
      // A lower bound: without the spin.
      const Eigen::Vector3d v = fixture.velocity(id).cast<double>();
      greatest =
          std::max(greatest, v.squaredNorm() / 2 + kGravity * static_cast<double>(fixture.position(id).z()));
    });
    EXPECT_LT(greatest, given + 0.02 * kGravity + 0.5 * kGravity * GetParam()) << stiffness << ' ' << share;
  }
}

TEST_P(YieldingDelta, UnloadedTipReturnsExponentially) {
  const double stiffness = 100.0, damping = 20.0;
  set_deltas(fixture, 2, 2, 1.0, {{"stiffness", {stiffness}}, {"damping", {damping}}, {"max_force", {100}}});
  auto o = box({1.6, 1.6, 1}, {0.5, 0.5, 1.0});
  o.mass = 12.0;
  const auto id = fixture.add(o);
  fixture.run(4.0);
  const double deflection = 0.5 - static_cast<double>(fixture.cells().field().height[0]);
  EXPECT_NEAR(deflection, 3.0 * kGravity / stiffness, 1e-3);
  fixture.world().remove(id);
  fixture.run(0.1);
  EXPECT_NEAR(0.5 - static_cast<double>(fixture.cells().field().height[0]),
              deflection * std::exp(-stiffness / damping * 0.1), 0.01 * deflection);
  fixture.run(4.0);
  EXPECT_EQ(fixture.cells().field().height[0], 0.5F);
  EXPECT_EQ(fixture.cells().field().speed[0], 0.0F);
}

// Two tips squeeze a box with N and lift it: friction holds it if 2·µ·N ≥ m·g.
TEST_P(YieldingDelta, PinchHoldsWithinTheFrictionCone) {
  const double friction = 0.5, mass = 1.0;
  for (const double compliant : {0.0, 1.0})
    for (const double factor : {0.9, 1.2}) {
      PhysicsFixture bench;
      bench.scene.world.dt_s = GetParam();
      bench.scene.materials[0].friction = friction;
      const double weight = mass * kGravity, stiffness = 100.0;
      const double force = factor * weight / (2 * friction);
      scene::ParameterValues values{{"workspace.radius", {1.5}},
                                    {"max_speed", {0.5}},
                                    {"max_acceleration", {0.5}},
                                    {"max_force", {force}}};
      if (compliant != 0.0) values["stiffness"] = {stiffness}, values["max_force"] = {100.0};
      set_deltas(bench, 1, 2, 3.0, values);
      move_tips(bench, kZ, 0.9);
      bench.run(3.0);
      auto o = box({1, 1, 1}, {1.5, 0, 0.5});
      o.mass = mass;
      const auto id = bench.add(o);
      // A compliant tip is commanded as far into the box as its spring is to be pressed.
      const auto inward = static_cast<float>(compliant != 0.0 ? 0.75 + force / stiffness : 1.4);
      bench.cells().set_targets(kX, std::vector<float>{inward, -inward});
      bench.run(5.0);
      EXPECT_NEAR(tip_force(bench, 0).x(), -force, 0.02 * force);
      move_tips(bench, kZ, 1.5);
      bench.run(4.0);
      const double lifted = static_cast<double>(bench.position(id).z()) - 0.5;
      if (factor > 1.0)
        EXPECT_NEAR(lifted, compliant != 0.0 ? 0.6 - weight / (2 * stiffness) : 0.6, 0.02) << compliant;
      else
        EXPECT_LT(lifted, 0.05) << compliant;
    }
}

TEST_P(YieldingDelta, PushAcceleratesByForceOverMass) {
  const double force = 8.0, mass = 2.0;
  fixture.scene.materials[0].friction = 0.0;
  set_deltas(fixture, 1, 1, 6.0,
             {{"workspace.radius", {2.5}},
              {"max_force", {force}},
              {"max_speed", {10}},
              {"max_acceleration", {400}}});
  move_tips(fixture, kX, -2.0);
  move_tips(fixture, kZ, 0.75);  // the tip's centre at the height of the box's
  fixture.run(2.0);
  auto o = box({1, 1, 1}, {-1.2, 0, 0.5});
  o.mass = mass;
  const auto id = fixture.add(o);
  move_tips(fixture, kX, 2.5);
  fixture.run(0.2);  // touches
  const auto before = static_cast<double>(fixture.velocity(id).x());
  fixture.run(0.3);
  EXPECT_NEAR(static_cast<double>(fixture.velocity(id).x()) - before, force / mass * 0.3,
              0.02 * force / mass * 0.3);
  EXPECT_NEAR(tip_force(fixture, 0).x(), -force, 0.01 * force);
}

TEST_P(YieldingDelta, JointsLiftUpToTheirForceAndStandOnTheirStops) {
  for (const double factor : {0.95, 1.05}) {
    PhysicsFixture bench;
    bench.scene.world.dt_s = GetParam();
    set_deltas(bench, 2, 2, 1.0, {{"max_force", {5.0}}, {"max_speed", {1}}, {"max_acceleration", {0.3}}});
    auto o = box({1.6, 1.6, 1}, {0.5, 0.5, 1.0});
    o.mass = factor * 4 * 5.0 / kGravity;
    const auto id = bench.add(o);
    move_tips(bench, kZ, 1.0);
    bench.run(6.0);
    EXPECT_NEAR(bench.position(id).z(), factor < 1.0 ? 1.5 : 1.0, 5e-3) << "the workspace begins at 0.5";
  }
}

TEST_P(YieldingDelta, SameInAnyUnitOfLength) {
  const double scale = 25.0, stiffness = 200.0, mass = 2.0;
  fixture.scene.world.gravity *= scale;
  set_deltas(fixture, 2, 2, scale,
             {{"stiffness", {stiffness}},
              {"max_force", {100 * scale}},
              {"tip.radius", {0.25 * scale}},
              {"workspace.radius", {0.5 * scale}},
              {"workspace.z", {0.5 * scale, 2 * scale}},
              {"length", {0.5 * scale}}});
  auto o = box(scale * Eigen::Vector3d(1.6, 1.6, 1), scale * Eigen::Vector3d(0.5, 0.5, 1.01));
  o.mass = mass;
  const auto id = fixture.add(o);
  fixture.run(3.0);
  EXPECT_NEAR(static_cast<double>(fixture.position(id).z()) / scale, 1.0 - mass * kGravity / 4 / stiffness,
              1.5e-3);
  EXPECT_NEAR(static_cast<double>(tip_force(fixture, 0).z()) / scale, -mass * kGravity / 4, 0.05);
}

TEST(DeltaThreads, SameBits) {
  const auto hash = [](int threads) {
    PhysicsFixture fixture;
    fixture.threads = threads;
    set_deltas(fixture, 24, 24, 1.0, {{"stiffness", {300}}, {"max_speed", {2}}});
    for (int i = 0; i < 600; ++i) {
      const Eigen::Vector3d at(1.0 + i % 20, 1.0 + i / 20 % 20, 1.3 + 1.2 * (i / 400));
      fixture.add(i % 3 == 0 ? box({0.8, 0.7, 0.6}, at) : sphere(0.4, at));
    }
    std::vector<float> wave(24 * 24);
    for (std::size_t i = 0; i < wave.size(); ++i)
      wave[i] = 0.5F + 0.4F * std::sin(0.7F * static_cast<float>(i));
    fixture.cells().set_targets(kZ, wave);
    fixture.cells().set_targets(kX, wave);
    fixture.run(0.5);
    return fixture.snapshot().state_hash;
  };
  const auto one = hash(1);
  EXPECT_EQ(hash(2), one);
  EXPECT_EQ(hash(5), one);
}
