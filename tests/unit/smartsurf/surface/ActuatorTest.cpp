// Tests cell motion and forces of each actuator model against the closed forms of docs/actuators.md.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/surface/ActuatorArray.h"
#include "smartsurf/surface/actuators/MotionProfile.h"

using namespace smartsurf;

namespace {

constexpr double kDt = 1.0 / 240;
constexpr auto kPi = static_cast<float>(std::numbers::pi);

scene::ActuatorSpec actuator(const std::string& model, const scene::ParameterValues& values = {}) {
  scene::ActuatorSpec spec = scene::find_actuator_kind(model)->default_spec();
  for (const auto& [name, value] : values) spec.values[name] = value;
  EXPECT_EQ(scene::find_actuator_kind(model)->validate(spec), "");
  return spec;
}

scene::SurfaceSpec surface_of(std::vector<scene::ActuatorSpec> actuators, int rows = 4, int columns = 6) {
  scene::SurfaceSpec s;
  s.rows = rows;
  s.columns = columns;
  s.actuators = std::move(actuators);
  derive_pin_spec(s);
  return s;
}

// An actuator array with the same command in all cells.
class Cells {
 public:
  explicit Cells(const scene::SurfaceSpec& s) : array(s) {}
  void command(int channel, float value) {
    array.set_targets(channel, std::vector<float>(array.field().height.size(), value));
  }
  void run(double seconds) {
    for (long i = 0; i < std::lround(seconds / kDt); ++i) {
      array.plan(kDt);
      array.commit(kDt);
    }
  }
  // The wrench on one body at `at`, with identity orientation and no angular velocity.
  surface::Wrench wrench(const scene::ObjectSpec& object, const Eigen::Vector3f& at,
                         const Eigen::Vector3f& velocity = Eigen::Vector3f::Zero(), float mass = 1.0F) {
    const scene::ObjectId id = 0;
    const Eigen::Quaternionf vertical = Eigen::Quaternionf::Identity();
    const Eigen::Vector3f still = Eigen::Vector3f::Zero();
    const surface::BodyView bodies{{&id, 1},       {&at, 1},    {&vertical, 1},
                                   {&velocity, 1}, {&still, 1}, {&mass, 1}};
    surface::Wrench w;
    array.add_forces(kDt, bodies, {&object, 1}, {&w, 1});
    return w;
  }
  const surface::Field& field() const { return array.field(); }

  surface::ActuatorArray array;
};

scene::ObjectSpec box(double x, double y, double z) {
  scene::ObjectSpec o;
  o.shape = scene::ShapeKind::kBox;
  o.size = {x, y, z};
  return o;
}

// Drives a wave under uneven loads. Returns all heights and the maximum speed after each step.
std::vector<float> wave_of_pins(const scene::ParameterValues& drive, int threads) {
  scene::SurfaceSpec s = surface_of({actuator("pin", drive)}, 19, 37);
  s.border_height = 3.0;
  common::ThreadPool pool(threads, 0.0);  // always runs in parallel
  surface::ActuatorArray array(s, {}, 1, &pool);
  std::vector<float> seen, targets(19 * 37);
  for (int step = 0; step < 60; ++step) {
    for (std::size_t i = 0; i < targets.size(); ++i) {
      targets[i] = 1.0F + std::sin(0.3F * static_cast<float>(i % 37) + 0.02F * static_cast<float>(step));
      array.field().impulse[i] = static_cast<float>(kDt) * static_cast<float>(i % 5);
    }
    array.set_targets(0, targets);
    array.plan(kDt);
    array.commit(kDt);
    seen.insert(seen.end(), array.field().height.begin(), array.field().height.end());
    seen.push_back(array.field().max_speed);
  }
  return seen;
}

}  // namespace

TEST(Pin, BitIdenticalForAnyThreadCount) {
  for (const double max_force : {0.0, 2.0}) {
    const scene::ParameterValues drive =
        max_force > 0.0 ? scene::ParameterValues{{"max_force", {max_force}}} : scene::ParameterValues{};
    const std::vector<float> alone = wave_of_pins(drive, 1);
    EXPECT_GT(alone.back(), 0.0F) << "still moving";
    EXPECT_EQ(wave_of_pins(drive, 2), alone);
    EXPECT_EQ(wave_of_pins(drive, 3), alone);
  }
}

// Only on its lower stop is a pin without a force limit, in any unit of length.
TEST(Pins, LowerStopIsAsNearInAnyUnitOfLength) {
  for (const double unit : {0.002, 1.0, 100.0}) {
    scene::SurfaceSpec s = surface_of({actuator("pin", {{"range", {0, 4 * unit}},
                                                        {"top", {0.8 * unit, 0.8 * unit}},
                                                        {"max_speed", {20 * unit}},
                                                        {"max_acceleration", {400 * unit}},
                                                        {"max_force", {unit}}})});
    s.pitch = unit;
    Cells cells(s);
    cells.command(0, static_cast<float>(0.04 * unit));
    cells.run(1.0);
    EXPECT_EQ(cells.field().force_limit[7], static_cast<float>(unit));
    cells.command(0, 0.0F);
    cells.run(1.0);
    EXPECT_EQ(cells.field().force_limit[7], std::numeric_limits<float>::infinity());
  }
}

// Short rows of pins move together, with the fixed cells or the other models' cells between them.
TEST(Pins, ShortRowsFollowTheMotionProfile) {
  constexpr int kRows = 11, kColumns = 7;
  for (const bool has_two_models : {false, true}) {
    scene::SurfaceSpec s = surface_of({actuator("pin", {{"max_speed", {2.0}}, {"max_acceleration", {30.0}}}),
                                       actuator("pin", {{"max_speed", {1.0}}, {"max_acceleration", {9.0}}})},
                                      kRows, kColumns);
    s.border_height = 3.0;
    for (int i = 0; has_two_models && i < kRows * kColumns; ++i)
      s.actuator_of_cell.push_back(static_cast<std::int8_t>(i % 2));
    if (!has_two_models) s.actuators.pop_back();
    Cells cells(s);
    std::vector<float> targets(kRows * kColumns), height(targets.size(), 0.0F), speed(height);
    for (std::size_t i = 0; i < targets.size(); ++i) targets[i] = 0.1F * static_cast<float>(i % 19);
    cells.array.set_targets(0, targets);
    const surface::MotionProfile profiles[] = {{2.0F, 30.0F, static_cast<float>(kDt)},
                                               {1.0F, 9.0F, static_cast<float>(kDt)}};
    for (int step = 0; step < 100; ++step) {
      cells.run(kDt);
      for (std::size_t i = 0; i < targets.size(); ++i) {
        const int row = static_cast<int>(i) / kColumns, column = static_cast<int>(i) % kColumns;
        if (s.is_border(row, column)) {
          height[i] = 3.0F;
          continue;
        }
        speed[i] = profiles[has_two_models ? i % 2 : 0](targets[i] - height[i], speed[i]);
        height[i] = surface::MotionProfile::advance(height[i], speed[i], targets[i], static_cast<float>(kDt));
      }
      ASSERT_EQ(cells.field().height, height) << "step " << step;
    }
    EXPECT_EQ(cells.field().speed, speed);
  }
}

TEST(Ball, TopMovesAtSpinCrossRadius) {
  Cells cells(surface_of({actuator("ball", {{"radius", {0.25}}, {"max_acceleration", {1e6}}})}));
  cells.command(0, 8);
  cells.command(1, -4);
  cells.run(0.1);
  // ω × r·ẑ = (ω_y·r, −ω_x·r)
  EXPECT_FLOAT_EQ(cells.field().surface_velocity_x[9], -1.0F);
  EXPECT_FLOAT_EQ(cells.field().surface_velocity_y[9], -2.0F);
  EXPECT_EQ(cells.field().speed[9], 0.0F);
}

TEST(Ball, SpinUpObeysAccelerationAndLag) {
  Cells limited(surface_of({actuator("ball", {{"max_acceleration", {100}}, {"radius", {1}}})}));
  limited.command(1, 50);
  limited.run(0.25);
  EXPECT_NEAR(limited.field().surface_velocity_x[0], 25.0F, 0.01F);
  Cells lagging(
      surface_of({actuator("ball", {{"max_acceleration", {1e6}}, {"lag", {0.1}}, {"radius", {1}}})}));
  lagging.command(1, 50);
  lagging.run(0.2);
  EXPECT_NEAR(lagging.field().surface_velocity_x[0], 50 * (1 - std::exp(-2.0)), 0.02);
}

TEST(Wheels, SurfaceVelocitiesAddUp) {
  Cells cells(surface_of({actuator(
      "wheels", {{"radius", {0.5}}, {"angle", {std::numbers::pi / 4}}, {"max_acceleration", {1e6}}})}));
  cells.command(0, 4);
  cells.run(0.1);
  EXPECT_NEAR(cells.field().surface_velocity_x[5], std::sqrt(2.0F), 1e-5F);  // north-east at 2 u/s
  EXPECT_NEAR(cells.field().surface_velocity_y[5], std::sqrt(2.0F), 1e-5F);
  cells.command(1, 4);  // plus north-west: the sum points north
  cells.run(0.1);
  EXPECT_NEAR(cells.field().surface_velocity_x[5], 0.0F, 1e-5F);
  EXPECT_NEAR(cells.field().surface_velocity_y[5], 2.0F * std::sqrt(2.0F), 1e-5F);
}

// Whether or not anybody looks at the angles, they are the spins' integrals.
TEST(Wheels, AnglesAreTheIntegralsOfTheSpins) {
  std::mt19937 random(5);
  for (const bool is_watched : {false, true}) {
    Cells cells(
        surface_of({actuator("wheels", {{"radius", {1}}, {"angle", {0}}, {"max_acceleration", {200}}})}));
    const std::size_t n = cells.field().height.size();
    std::vector<std::array<double, 2>> expected(n, {0.0, 0.0});
    std::vector<scene::ActuatorState> motion;
    std::vector<float> targets(n, 0.0F);
    for (int step = 0; step < 3000; ++step) {
      if (random() % 40 == 0) {
        targets[random() % n] = std::uniform_real_distribution<float>(-30.0F, 30.0F)(random);
        cells.array.set_targets(static_cast<int>(random() % 2), targets);
      }
      cells.array.plan(kDt);
      cells.array.commit(kDt);
      for (std::size_t i = 0; i < n; ++i) {
        expected[i][0] += kDt * static_cast<double>(cells.field().surface_velocity_x[i]);
        expected[i][1] += kDt * static_cast<double>(cells.field().surface_velocity_y[i]);
      }
      if (!is_watched && step % 1000 != 999) continue;
      cells.array.write_cell_motion(motion);
      for (std::size_t i = 0; i < n; ++i) {
        const auto error = [](float is, double should) {
          return std::remainder(static_cast<double>(is) - should, 2 * std::numbers::pi);
        };
        ASSERT_NEAR(error(motion[i].a, expected[i][0]), 0.0, 1e-4) << step << ' ' << i;
        ASSERT_NEAR(error(motion[i].b, expected[i][1]), 0.0, 1e-4) << step << ' ' << i;
        ASSERT_LE(std::abs(motion[i].a), std::numbers::pi_v<float>);
      }
    }
  }
}

TEST(Wheels, RotateWithTheirCell) {
  scene::SurfaceSpec s =
      surface_of({actuator("wheels", {{"radius", {0.5}}, {"max_acceleration", {1e6}}})}, 1, 2);
  s.cell_poses = {{0, 0, 0}, {3, 0, std::numbers::pi / 2}};
  Cells cells(s);
  cells.command(0, 2);
  cells.run(0.1);
  EXPECT_NEAR(cells.field().surface_velocity_x[0], 1.0F, 1e-6F);
  EXPECT_NEAR(cells.field().surface_velocity_x[1], 0.0F, 1e-6F);
  EXPECT_NEAR(cells.field().surface_velocity_y[1], 1.0F, 1e-6F);
}

TEST(Rotor, EllipseFollowsSupportFunction) {
  const double a = 0.5, c = 0.3;
  Cells cells(surface_of({actuator(
      "rotor",
      {{"half_axes", {a, 0.4, c}}, {"axle", {-0.2}}, {"max_rate", {3}}, {"max_acceleration", {1e6}}})}));
  cells.command(0, 3);
  for (int i = 1; i <= 100; ++i) {
    cells.run(kDt);
    const double angle = 3 * i * kDt;
    const double support =
        std::sqrt(a * a * std::pow(std::sin(angle), 2) + c * c * std::pow(std::cos(angle), 2));
    ASSERT_NEAR(cells.field().height[0], -0.2 + support, 1e-5) << i;
    ASSERT_NEAR(cells.field().surface_velocity_x[0], 3 * support, 1e-4) << i;
    ASSERT_NEAR(cells.field().surface_velocity_y[0], 0.0, 1e-6);
  }
}

TEST(Rotor, SquareCamStopsAtCommandedAngle) {
  // The top of a square of half edge h, rotated by φ ≤ 45°, is at h·(cos φ + sin φ).
  const std::vector<double> square{-0.3, 0, -0.3, 0.3, 0, -0.3, 0.3, 0, 0.3, -0.3, 0, 0.3};
  Cells cells(surface_of({actuator("rotor", {{"command", {1}}, {"points", square}, {"axle", {0}}})}));
  EXPECT_NEAR(cells.field().height[0], 0.3F, 1e-6F);
  cells.command(0, kPi / 4);
  cells.run(1.0);
  EXPECT_NEAR(cells.field().height[0], 0.3F * std::sqrt(2.0F), 1e-5F);
  EXPECT_EQ(cells.field().speed[0], 0.0F);
  EXPECT_EQ(cells.field().surface_velocity_x[0], 0.0F);
}

TEST(Rotor, CommandedAngleOfSeveralTurnsIsShownWrapped) {
  Cells cells(surface_of({actuator("rotor", {{"command", {1}}})}));
  std::vector<scene::ActuatorState> motion;
  for (const float angle : {10.0F, -10.0F, 1.0F}) {
    cells.command(0, angle);
    cells.run(3.0);
    cells.array.write_cell_motion(motion);
    EXPECT_NEAR(motion[7].a, std::remainder(angle, 2 * kPi), 1e-5F);
  }
}

TEST(Rotor, VerticalAxleIsTurntable) {
  Cells cells(surface_of({actuator("rotor", {{"axis", {0, 0, 1}}, {"max_acceleration", {1e6}}})}));
  cells.command(0, 5);
  cells.run(0.1);
  EXPECT_FLOAT_EQ(cells.field().surface_spin[7], 5.0F);
  EXPECT_NEAR(cells.field().surface_velocity_x[7], 0.0F, 1e-6F);
  EXPECT_NEAR(cells.field().speed[7], 0.0F, 1e-6F);
}

TEST(ForceField, ForceScalesWithCoveredAreaAndGap) {
  Cells cells(surface_of({actuator("force_field", {{"reach", {0.5}}})}, 8, 8));
  cells.command(0, 2);
  cells.command(2, 1);
  cells.run(0.1);
  // The box covers 3 × 2 cells at a gap of half the reach.
  const surface::Wrench w = cells.wrench(box(3, 2, 1), {3, 3.5F, 0.75F});
  EXPECT_NEAR(w.force.x(), 6 * 2 * 0.5F, 1e-4F);
  EXPECT_NEAR(w.force.y(), 0.0F, 1e-6F);
  EXPECT_NEAR(w.force.z(), 6 * 1 * 0.5F, 1e-4F);
  EXPECT_NEAR(w.torque.y(), -0.5F * w.force.x(), 1e-4F);  // the force acts on the underside
  EXPECT_EQ(cells.wrench(box(3, 2, 1), {3, 3.5F, 1.1F}).force.norm(), 0.0F);
}

TEST(ForceField, NonuniformFieldExertsTorque) {
  Cells cells(surface_of({actuator("force_field", {{"fall_off", {1}}})}, 8, 8));
  std::vector<float> fy(64, 0.0F);
  for (std::size_t i = 0; i < 64; ++i) fy[i] = i % 8 < 4 ? -1.0F : 1.0F;
  cells.array.set_targets(1, fy);
  cells.run(0.1);
  // Centred between columns 3 and 4: two rows of four cells at ±0.5 and ±1.5.
  const surface::Wrench w = cells.wrench(box(4, 2, 1), {3.5F, 3.5F, 0.5F});
  EXPECT_NEAR(w.torque.z(), 2 * 2 * (0.5F + 1.5F), 1e-4F);
  EXPECT_NEAR(w.force.norm(), 0.0F, 1e-5F);
}

TEST(Magnet, DipoleAboveDipole) {
  // Coaxial dipoles attract with 6·k·I·m/r⁴.
  Cells cells(surface_of({actuator("magnet", {{"strength", {2}}, {"depth", {1}}, {"lag", {0}}})}, 1, 1));
  cells.command(0, 0.5);
  cells.run(kDt);
  scene::ObjectSpec magnet = box(1, 1, 1);
  magnet.magnetic_moment = {0, 0, 3};
  EXPECT_NEAR(cells.wrench(magnet, {0, 0, 1}).force.z(), -6 * 2 * 0.5 * 3 / 16.0, 1e-5);
  cells.command(0, -0.5);
  cells.run(kDt);
  EXPECT_NEAR(cells.wrench(magnet, {0, 0, 1}).force.z(), 6 * 2 * 0.5 * 3 / 16.0, 1e-5);
  // Beside the coil the field is vertical and exerts a torque on a horizontal moment: |m × B| = m·k·I/r³.
  magnet.magnetic_moment = {3, 0, 0};
  EXPECT_NEAR(std::abs(cells.wrench(magnet, {2, 0, -1}).torque.y()), 3 * 2 * 0.5 / 8.0, 1e-5);
}

TEST(Magnet, ForceIsTheGradientOfTheEnergy) {
  // F = ∇(m·B), checked by central differences of m·B. The force on a unit pole measures B.
  for (const double law : {0.0, 1.0}) {
    Cells cells(surface_of({actuator("magnet", {{"strength", {5}}, {"lag", {0}}, {"law", {law}}})}, 1, 1));
    cells.command(0, 1);
    cells.run(kDt);
    scene::ObjectSpec probe = box(1, 1, 1), magnet = probe;
    probe.magnetic_pole = 1;  // its force is B
    magnet.magnetic_moment = {0.3, -0.7, 1.1};
    const Eigen::Vector3f m = magnet.magnetic_moment.cast<float>(), at(0.8F, -0.5F, 0.9F);
    constexpr float kStep = 0.01F;
    const Eigen::Vector3f force = cells.wrench(magnet, at).force;
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3f d = kStep * Eigen::Vector3f::Unit(i);
      const float slope =
          (m.dot(cells.wrench(probe, at + d).force) - m.dot(cells.wrench(probe, at - d).force)) / (2 * kStep);
      EXPECT_NEAR(force[i], slope, 2e-3F * force.norm()) << "law " << law << " axis " << i;
    }
  }
}

TEST(Magnet, PolesAttractAndRepel) {
  Cells cells(surface_of({actuator("magnet", {{"law", {1}}, {"strength", {8}}, {"lag", {0}}})}, 1, 1));
  cells.command(0, 1);
  cells.run(kDt);
  scene::ObjectSpec object = box(1, 1, 1);
  EXPECT_EQ(cells.wrench(object, {0, 0, 1}).force.norm(), 0.0F);
  object.magnetic_pole = 1;
  EXPECT_NEAR(cells.wrench(object, {0, 0, 1}).force.z(), 8.0F / 4, 1e-5F);
  object.magnetic_pole = -1;
  EXPECT_NEAR(cells.wrench(object, {0, 0, 1}).force.z(), -8.0F / 4, 1e-5F);
  EXPECT_EQ(cells.wrench(object, {0, 0, 20}).force.norm(), 0.0F) << "beyond its reach";
}

// A coil acts as near to it, in pitches, in any unit of length.
TEST(Magnet, ActsAlikeInAnyUnitOfLength) {
  for (const double unit : {0.02, 1.0, 100.0}) {
    scene::SurfaceSpec s = surface_of({actuator("magnet", {{"law", {1}},
                                                           {"strength", {unit * unit * unit}},
                                                           {"depth", {0.5 * unit}},
                                                           {"reach", {6 * unit}},
                                                           {"top", {0.8 * unit, 0.8 * unit}},
                                                           {"lag", {0}}})},
                                      1, 1);
    s.pitch = unit;
    Cells cells(s);
    cells.command(0, 1);
    cells.run(kDt);
    scene::ObjectSpec object = box(unit, unit, unit);
    object.magnetic_pole = 1;
    const auto force = [&](float distance) {
      const auto u = static_cast<float>(unit);
      return cells.wrench(object, {0, 0, (distance - 0.5F) * u}).force.z() / u;
    };
    EXPECT_NEAR(force(1.0F), 1.0F, 1e-4F) << unit;
    EXPECT_NEAR(force(0.1F), 100.0F, 1e-2F) << unit;
    EXPECT_EQ(force(0.04F), 0.0F) << unit;
  }
}

TEST(AirJet, LiftIsDragOfDecayedFlow) {
  Cells cells(surface_of(
      {actuator("air_jet",
                {{"density", {0.01}}, {"drag", {1}}, {"area", {0.5}}, {"decay", {2}}, {"lag", {0}}})},
      8, 8));
  cells.command(0, 30);
  cells.run(kDt);
  const float k = 0.5F * 0.01F * 0.5F, air = 30.0F / (1 + 1.0F / 2);
  const surface::Wrench w = cells.wrench(box(2, 2, 0.2), {3.5F, 3.5F, 1.1F}, Eigen::Vector3f::Zero(), 1e6F);
  EXPECT_NEAR(w.force.z(), 4 * k * air * air, 1e-3F);
  EXPECT_NEAR(w.force.head<2>().norm(), 0.0F, 1e-6F);
  // A body that moves with the air experiences no force.
  EXPECT_NEAR(cells.wrench(box(2, 2, 0.2), {3.5F, 3.5F, 1.1F}, {0, 0, air}).force.norm(), 0.0F, 1e-4F);
}

TEST(AirJet, NeverAcceleratesBodyBeyondAirSpeed) {
  Cells cells(surface_of({actuator("air_jet", {{"density", {1}}, {"lag", {0}}})}, 8, 8));
  cells.command(0, 100);
  cells.run(kDt);
  const float mass = 1e-3F,
              gained =
                  cells.wrench(box(2, 2, 0.2), {3.5F, 3.5F, 0.1F}, Eigen::Vector3f::Zero(), mass).force.z() *
                  static_cast<float>(kDt) / mass;
  EXPECT_GT(gained, 90.0F);
  EXPECT_LE(gained, 100.0F);
}

TEST(Tile, TravellingWaveCrestsMoveBackwards) {
  const double amplitude = 0.1, frequency = 4, skin = 0.3, thickness = 2, k = 2 * std::numbers::pi / 8;
  scene::SurfaceSpec s = surface_of(
      {actuator("tile",
                {{"frequency", {frequency}}, {"skin", {skin}}, {"thickness", {thickness}}, {"lag", {0}}})},
      6, 64);
  Cells cells(s);
  std::vector<float> phase(6 * 64);
  for (std::size_t i = 0; i < phase.size(); ++i)
    phase[i] = static_cast<float>(k * static_cast<double>(i % 64));
  cells.array.set_targets(0, phase);
  cells.command(1, static_cast<float>(amplitude));
  cells.run(0.5);
  // The skin averages neighbours along the wave; those across it are in phase.
  const double smoothed = amplitude * ((1 - skin) + skin * (1 + std::cos(k)) / 2);
  const double omega = 2 * std::numbers::pi * frequency;
  const double slope = std::sin(k);  // the central difference gives sin k instead of k
  float top = 0, fastest = 0;
  for (int c = 8; c < 56; ++c) {
    const auto i = static_cast<std::size_t>(2 * 64 + c);
    const double z = smoothed * std::sin(omega * 0.5 - k * c);
    EXPECT_NEAR(cells.field().height[i], z, 2e-4);
    if (cells.field().height[i] > top)
      top = cells.field().height[i], fastest = cells.field().surface_velocity_x[i];
  }
  EXPECT_NEAR(fastest, -thickness / 2 * smoothed * omega * slope, 0.1);
}

TEST(Tile, ReturnsToFlatAtZeroAmplitude) {
  Cells cells(surface_of({actuator("tile", {{"lag", {0}}})}, 6, 6));
  cells.command(1, 0.3F);
  cells.run(0.3);
  EXPECT_GT(cells.field().max_speed, 0.0F);
  cells.command(1, 0);
  cells.run(0.1);
  for (std::size_t i = 0; i < 36; ++i) {
    EXPECT_EQ(cells.field().height[i], 0.0F);
    EXPECT_EQ(cells.field().speed[i], 0.0F);
    EXPECT_EQ(cells.field().surface_velocity_x[i], 0.0F);
  }
}

TEST(ActuatorArray, SupportsMixedModelsAndEmptyCells) {
  scene::SurfaceSpec s = surface_of({actuator("pin"), actuator("ball", {{"height", {1}}})}, 1, 4);
  s.actuator_of_cell = {0, 1, scene::kEmptyCell, 0};
  s.base_heights = {0, 0, 0, 0.5F};
  Cells cells(s);
  ASSERT_EQ(cells.array.channels().size(), 3u);
  for (int k = 0; k < 3; ++k) cells.command(k, 2);
  cells.run(1);
  EXPECT_EQ(cells.field().height, (std::vector<float>{2.0F, 1.0F, surface::kNoCellHeight, 2.5F}));
  EXPECT_EQ(cells.field().surface_velocity_x[0], 0.0F);
  EXPECT_GT(cells.field().surface_velocity_x[1], 0.0F);
  EXPECT_EQ(cells.field().max_height, 2.5F);
  EXPECT_EQ(cells.array.targets(0)[1], 0.0F) << "the ball cell must ignore pin commands";
}

// Force fields with a lag, from rest and from another force: the exponential, in any unit of force with the
// same bits, and the command itself in the end.
TEST(ForceFields, LagIsThatOfAnyUnitOfForce) {
  std::mt19937 random(3);
  const auto draw = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  scene::ObjectSpec box;
  box.shape = scene::ShapeKind::kBox;
  for (int round = 0; round < 60; ++round) {
    const double lag = std::exp(draw(-5.0, 1.5));
    const auto first = static_cast<float>(draw(-1.0, 1.0)),
               second = round % 3 == 0 ? 0.0F : static_cast<float>(draw(-1.0, 1.0));
    const auto track = [&](double unit) {
      Cells cells(surface_of({actuator("force_field", {{"lag", {lag}}, {"max_force", {1e6}}})}, 1, 1));
      std::vector<double> forces;
      for (const float command : {first, second}) {
        cells.command(0, static_cast<float>(command * unit));
        for (int step = 0; step < 40; ++step) {
          cells.run(kDt);
          forces.push_back(static_cast<double>(cells.wrench(box, {0, 0, 0.5F}).force.x()) / unit);
        }
      }
      cells.run(25.0 * lag);
      forces.push_back(static_cast<double>(cells.wrench(box, {0, 0, 0.5F}).force.x()) / unit);
      return forces;
    };
    const std::vector<double> forces = track(1.0);
    const double share = -std::expm1(-40.0 * kDt / lag);
    EXPECT_NEAR(forces[39], static_cast<double>(first) * share, 3e-6);
    EXPECT_NEAR(forces[79], forces[39] + (static_cast<double>(second) - forces[39]) * share, 3e-6);
    EXPECT_EQ(forces.back(), static_cast<double>(second)) << lag;
    for (const double unit : {0x1p-40, 0x1p-20, 0x1p18}) EXPECT_EQ(track(unit), forces) << lag << " " << unit;
  }
}

TEST(ActuatorArray, PinsOfASurfaceWithoutActuatorsStandOnTheirBase) {
  scene::SurfaceSpec s;
  s.rows = 1, s.columns = 3;
  s.base_heights = {2, -1, 0.5F};
  derive_pin_spec(s);
  Cells cells(s);
  EXPECT_EQ(cells.field().height, s.base_heights);
  cells.run(1);
  EXPECT_EQ(cells.field().height, s.base_heights);
  cells.command(0, 4);
  cells.run(2);
  EXPECT_EQ(cells.field().height, (std::vector<float>{6, 3, 4.5F}));
}

TEST(ActuatorArray, DelaysCommandsByLatency) {
  scene::SurfaceSpec s =
      surface_of({actuator("ball", {{"latency", {3}}, {"max_acceleration", {1e6}}, {"radius", {1}}})}, 1, 1);
  Cells cells(s);
  std::vector<float> seen;
  for (int tick = 0; tick < 6; ++tick) {
    cells.command(1, tick == 0 ? 7.0F : 0.0F);
    cells.array.begin_tick();
    cells.run(kDt);
    seen.push_back(cells.field().surface_velocity_x[0]);
  }
  EXPECT_EQ(seen, (std::vector<float>{0, 0, 0, 7, 0, 0}));
}

TEST(ActuatorArray, ClampsCommandsAndReplacesNanWithSafeValue) {
  Cells cells(surface_of({actuator("pin", {{"range", {1, 3}}})}, 1, 2));
  const float safe = cells.array.targets(0)[0];
  EXPECT_EQ(cells.array.set_targets(0, std::vector<float>{9.0F, 2.0F}), 1U);
  EXPECT_EQ(cells.array.targets(0)[0], 3.0F);
  EXPECT_EQ(cells.array.targets(0)[1], 2.0F);
  EXPECT_EQ(cells.array.set_targets(0, std::vector<float>{std::nanf(""), -1.0F}), 2U);
  EXPECT_EQ(cells.array.nan_targets(), 1U);
  EXPECT_EQ(cells.array.targets(0)[0], safe);
  EXPECT_EQ(cells.array.targets(0)[1], 1.0F);
}

TEST(ActuatorArray, AcceptsCommandsInParts) {
  Cells whole(surface_of({actuator("pin", {{"range", {1, 3}}})}, 3, 5));
  Cells parts(surface_of({actuator("pin", {{"range", {1, 3}}})}, 3, 5));
  std::vector<float> targets(15);
  for (std::size_t i = 0; i < targets.size(); ++i) targets[i] = 0.5F + 0.25F * static_cast<float>(i);
  const std::uint64_t replaced = whole.array.set_targets(0, targets);
  std::uint64_t replaced_in_parts = 0;
  for (std::size_t at = 0; at < targets.size(); at += 4)
    replaced_in_parts += parts.array.set_targets(
        0, std::span(targets).subspan(at, std::min<std::size_t>(4, targets.size() - at)),
        static_cast<int>(at));
  EXPECT_EQ(replaced_in_parts, replaced);
  EXPECT_TRUE(std::ranges::equal(parts.array.targets(0), whole.array.targets(0)));
}

TEST(Pin, ForceLimitIsInfiniteOnStop) {
  Cells cells(surface_of(
      {actuator("pin", {{"max_force", {10}}, {"max_speed", {2}}, {"max_acceleration", {60}}})}, 1, 3));
  EXPECT_TRUE(std::isinf(cells.field().force_limit[0])) << "on the stop";
  cells.command(0, 4);
  for (int i = 0; i < 6; ++i) {
    cells.array.plan(kDt);
    EXPECT_EQ(cells.field().force_limit[0], 10.0F) << "at any speed; the physics applies the characteristic";
    EXPECT_EQ(cells.field().no_load_speed[0], 2.0F);
    cells.array.commit(kDt);
  }
  EXPECT_GT(cells.field().speed[0], 1.0F);
}

TEST(Pin, RestartsFromRestAfterPushBack) {
  Cells cells(surface_of({actuator("pin", {{"max_force", {10}}, {"max_acceleration", {12}}})}, 1, 3));
  cells.command(0, 4);
  for (int i = 0; i < 60; ++i) {
    cells.array.plan(kDt);
    cells.array.commit(kDt);
  }
  const float height = cells.field().height[1];
  cells.array.plan(kDt);
  cells.array.field().speed[1] = -3.0F;  // as the physics does under a load
  cells.array.commit(kDt);
  EXPECT_NEAR(cells.field().height[1], height - 3 * kDt, 1e-5);
  cells.array.plan(kDt);
  EXPECT_NEAR(cells.field().speed[1], 12 * kDt, 1e-5) << "from rest";
  EXPECT_GT(cells.field().speed[0], 2.0F) << "its neighbour keeps its speed";
}
