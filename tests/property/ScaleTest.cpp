// A scene described in another unit of length behaves alike: lengths, speeds, gravity and forces scale with
// the unit, times and masses do not.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "smartsurf/mesh/SolidBuilder.h"
#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/scene/Solid.h"
#include "smartsurf/world/Substeps.h"
#include "smartsurf/world/bullet/EngineFactory.h"
#include "tests/property/PhysicsFixture.h"
#include "tests/unit/smartsurf/mesh/TestMeshes.h"

using namespace physics_fixture;
using namespace smartsurf;

namespace {

constexpr int kCells = 32;

using DrawUniform = std::function<double(double low, double high)>;

scene::ObjectSpec scaled(scene::ObjectSpec o, double unit) {
  if (o.shape == scene::ShapeKind::kSolid) {
    o = cube(o.position * unit, static_cast<float>(2.0 * unit));
  } else {
    o.position *= unit, o.size *= unit;
    o.radius *= unit, o.height *= unit;
  }
  o.velocity = Eigen::Vector3d(0.7, 0.4, 0) * unit;
  o.angular_velocity = {0.3, 0.2, 0.1};
  o.mass = 3.0;
  return o;
}

// Every length of the scene times `unit`, u.
void scale_scene(PhysicsFixture& fixture, double unit) {
  scene::SceneSpec& s = fixture.scene;
  s.world.gravity = {0, 0, -kGravity * unit};
  s.materials[0].rolling_friction = 0.02 * unit;
  s.materials[0].restitution = 0.3;
  s.surface.pitch = unit;
  scene::ActuatorSpec pin = scene::find_actuator_kind("pin")->default_spec();
  pin.values["top"] = {0.8 * unit, 0.8 * unit};
  pin.values["length"] = {2 * unit};
  pin.values["range"] = {0, 4 * unit};
  pin.values["max_speed"] = {3 * unit};
  pin.values["max_acceleration"] = {50 * unit};
  s.surface.actuators = {pin};
  derive_pin_spec(s.surface);
}

struct Track {
  std::vector<Eigen::Vector3f> position, velocity;  // of all objects after each step, divided by the unit
  std::size_t level_states = 0;                     // of these, those before the table tilts
  double load = 0.0;                                // of all cells at the end, divided by the unit
  int sleeping = 0;                                 // at the end
};

// One object of each shape, apart from each other, thrown onto a table that tilts into a ramp, pushed, and
// put elsewhere.
Track run_scene(double unit) {
  PhysicsFixture fixture;
  scale_scene(fixture, unit);
  std::vector<scene::ObjectId> ids;
  const std::vector<scene::ObjectSpec> shapes{
      sphere(0.6, {5.17, 6.31, 2}),       box({2, 1.6, 1.2}, {13.23, 6.37, 2}),
      cylinder(1, 1.5, {21.29, 6.13, 2}), capsule(0.8, 2.4, {5.37, 16.19, 2.4}),
      cone(1, 2, {13.11, 16.27, 2}),      cube({21.33, 16.17, 2}),
  };
  for (const scene::ObjectSpec& o : shapes) ids.push_back(fixture.add(scaled(o, unit)));
  std::vector<float> heights;
  for (int r = 0; r < kCells; ++r)
    for (int c = 0; c < kCells; ++c) heights.push_back(static_cast<float>(unit * 0.05 * c));
  Track track;
  auto record = [&] {
    for (const scene::ObjectId id : ids) {
      const scene::ObjectState state = fixture.world().state(id);
      track.position.emplace_back((state.position / unit).cast<float>());
      track.velocity.emplace_back((state.velocity / unit).cast<float>());
      EXPECT_LE((fixture.position(id) - state.position.cast<float>()).norm(), 1e-5 * unit);
      const auto& settings = fixture.scene.world;
      const float lead_s =
          world::mean_substep_start(static_cast<float>(settings.dt_s), (settings.iterations + 1) / 2);
      const Eigen::Vector3f ahead = (state.position + lead_s * state.velocity).cast<float>();
      EXPECT_LE((fixture.world().bodies().position[id] - ahead).norm(), 1e-5 * unit);
    }
  };
  fixture.run(0.8, record);
  track.level_states = track.position.size();
  fixture.cells().set_targets(0, heights);
  fixture.run(0.4, record);
  const Eigen::Vector3d push(4 * unit, 0, 0);
  fixture.world().apply_force(ids[0], push, std::nullopt, 0.2);
  fixture.world().apply_force(ids[1], push, fixture.world().state(ids[1]).position, 0.2);
  fixture.run(0.2, record);
  fixture.cells().set_targets(0, std::vector<float>(heights.size(), 0.0F));
  for (const scene::ObjectId id : ids) {
    scene::ObjectStateUpdate lifted;
    lifted.position = fixture.world().state(id).position + Eigen::Vector3d(0, 2 * unit, 0);
    lifted.velocity = Eigen::Vector3d(0, 0, 0);
    fixture.world().set_state(id, lifted);
  }
  fixture.run(0.2, record);
  fixture.run(4.0);
  for (const float impulse : fixture.cells().field().impulse)
    track.load += static_cast<double>(impulse) / (fixture.scene.world.dt_s * unit);
  track.sleeping = fixture.world().sleeping_count();
  return track;
}

}  // namespace

TEST(Scale, TrajectoriesAreAlikeInAnyUnitOfLength) {
  const Track reference = run_scene(1.0);
  EXPECT_GE(reference.sleeping, 4);
  for (const double unit : {0.01, 100.0}) {
    const Track track = run_scene(unit);
    ASSERT_EQ(track.position.size(), reference.position.size());
    float worst_level = 0, worst_position = 0, velocity_error = 0;
    for (std::size_t i = 0; i < track.position.size(); ++i) {
      worst_position = std::max(worst_position, (track.position[i] - reference.position[i]).norm());
      velocity_error += (track.velocity[i] - reference.velocity[i]).norm();
      if (i < track.level_states) worst_level = worst_position;
    }
    // Impacts of corners, and the steps of the ramp, amplify rounding: one may come a step earlier.
    EXPECT_LT(worst_level, 4e-3F) << unit;
    EXPECT_LT(worst_position, 0.03F) << unit;
    EXPECT_LT(velocity_error / static_cast<float>(track.velocity.size()), 5e-3F) << unit;
    EXPECT_EQ(track.sleeping, reference.sleeping) << unit;
    EXPECT_NEAR(track.load, 6 * 3.0 * kGravity, 0.01 * 6 * 3.0 * kGravity) << unit;
    EXPECT_NEAR(track.load, reference.load, 1e-3 * reference.load) << unit;
  }
}

namespace {

// Objects of random shapes at random poses: hulls, compounds of two, decomposed meshes and primitives.
scene::ObjectSpec random_object(const DrawUniform& draw, double unit) {
  const auto vector = [&](double half) {
    return Eigen::Vector3d(draw(-half, half), draw(-half, half), draw(-half, half));
  };
  const auto corners = [&] {
    std::vector<Eigen::Vector3d> points(10);
    const Eigen::Vector3d centre = vector(0.4);
    for (Eigen::Vector3d& p : points) p = (centre + vector(1.0).normalized()) * unit;
    return points;
  };
  scene::ObjectSpec o;
  const int shape = static_cast<int>(draw(0, 8));
  o.shape = shape < scene::kShapeKindCount ? static_cast<scene::ShapeKind>(shape) : scene::ShapeKind::kSolid;
  o.radius = draw(0.3, 0.7) * unit, o.height = draw(1.4, 2.0) * unit;
  o.size = Eigen::Vector3d(draw(0.6, 1.6), draw(0.6, 1.6), draw(0.6, 1.6)) * unit;
  if (shape == 5) {
    o.solid = std::make_shared<scene::Solid>(mesh::build_hull_solid(corners()));
  } else if (shape == 6) {
    const std::vector parts{corners(), corners()};
    o.solid = std::make_shared<scene::Solid>(mesh::build_compound(parts));
  } else if (shape == 7) {
    mesh::TriangleMesh l = mesh::l_mesh();
    for (Eigen::Vector3d& p : l.points) p *= 0.7 * unit;
    std::vector<std::string> notes;
    o.solid = std::make_shared<scene::Solid>(mesh::build_solid(std::move(l), {}, notes));
  }
  o.orientation.coeffs() << vector(1.0), draw(-1, 1);
  o.orientation.normalize();
  o.velocity = vector(3.0) * unit;
  o.angular_velocity = vector(4.0);
  if (draw(0, 1) < 0.5) o.mass = draw(0.5, 4.0);
  if (draw(0, 1) < 0.3) o.centre_of_mass = vector(0.1) * unit;
  return o;
}

class UnitsOfLength : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    if (on_bullet() && !world::has_bullet()) GTEST_SKIP() << "this build has no Bullet";
  }
  static bool on_bullet() { return GetParam() == std::string("bullet"); }
  static std::vector<float> random_track(unsigned seed, double unit);
};

DrawUniform uniform_of(std::mt19937_64& random) {
  return [&random](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 0x1p64);
  };
}

// A joint of the object with the next one, or with the table.
scene::JointSpec random_joint(const DrawUniform& draw, scene::ObjectId a, const Eigen::Vector3d& position,
                              double unit) {
  scene::JointSpec j;
  j.kind = static_cast<scene::JointKind>(static_cast<int>(draw(0, 4)));
  j.a = a;
  if (draw(0, 1) < 0.7) j.b = a + 1;
  j.anchor = position + unit * Eigen::Vector3d(draw(-1, 1), draw(-1, 1), draw(-1, 1));
  j.axis = {draw(-1, 1), draw(-1, 1), draw(0.1, 1)};
  if (!j.has_coordinate()) return j;
  const bool is_slider = j.kind == scene::JointKind::kSlider;
  const double length = is_slider ? unit : 1.0, effort = is_slider ? unit : unit * unit;
  j.limits = {-0.5 * length, 0.7 * length};
  j.friction = draw(0, 0.5) * effort;
  if (draw(0, 1) < 0.5)
    j.spring = {draw(1, 20) * effort / length, draw(0, 1) * effort / length, draw(-0.3, 0.3) * length};
  else
    j.motor = {draw(-2, 2) * length, draw(1, 10) * effort};
  return j;
}

// The states of all objects and joints after each step, and the loads of the cells, divided by the unit.
std::vector<float> UnitsOfLength::random_track(unsigned seed, double unit) {
  std::mt19937_64 random(seed);
  const DrawUniform draw = uniform_of(random);
  PhysicsFixture fixture;
  fixture.scene.world.engine = GetParam();
  scale_scene(fixture, unit);
  scene::SurfaceSpec& surface = fixture.scene.surface;
  surface.rows = surface.columns = 10;
  surface.border_height = 3 * unit;
  fixture.scene.materials[0].density = 1.0 / (unit * unit * unit);
  if (seed % 3 == 1) surface.actuators[0].values["max_force"] = {20 * unit};
  if (seed % 3 == 2) {
    scene::ActuatorSpec delta = scene::find_actuator_kind("delta")->default_spec();
    for (const auto& [name, value] : {std::pair{"tip.radius", 0.3},
                                      {"workspace.radius", 0.1},
                                      {"max_speed", 3.0},
                                      {"max_acceleration", 50.0},
                                      {"length", 2.0}})
      delta.values[name] = {value * unit};
    if (!on_bullet()) delta.values["max_force"] = {20 * unit};
    delta.values["workspace.z"] = {0, 2 * unit};
    delta.values["top"] = {0.8 * unit, 0.8 * unit};
    surface.actuators = {delta};
  }
  derive_pin_spec(surface);
  std::vector<scene::ObjectId> ids;
  for (int i = 0; i < 9; ++i) {
    scene::ObjectSpec o = random_object(draw, unit);
    o.position = Eigen::Vector3d(1.8 + 2.7 * (i % 3), 1.8 + 2.7 * (i / 3), draw(2.5, 5.0)) * unit;
    ids.push_back(fixture.add(o));
  }
  std::vector<scene::JointSpec> joints;
  for (const scene::ObjectId a : {0, 4, 7}) {
    joints.push_back(random_joint(draw, a, fixture.world().state(a).position, unit));
    EXPECT_EQ(fixture.world().add_joint(joints.back()), joints.size() - 1);
  }
  std::vector<float> track;
  const auto add = [&track](double value) { track.push_back(static_cast<float>(value)); };
  int step = 0;
  const int channels = static_cast<int>(fixture.cells().channels().size());
  fixture.run(0.8, [&] {
    if (++step % 24 == 0)
      for (int channel = 0; channel < channels; ++channel) {
        std::vector<float> targets;
        const double most = channel + 1 == channels ? 1.5 : 0.05;
        for (int i = 0; i < surface.cell_count(); ++i)
          targets.push_back(static_cast<float>(draw(0, most) * unit));
        fixture.cells().set_targets(channel, targets);
      }
    if (step == 30) {
      fixture.world().apply_force(ids[2], Eigen::Vector3d(9, 3, 5) * unit, std::nullopt, 0.1);
      fixture.world().apply_force(ids[3], Eigen::Vector3d(9, 3, 5) * unit,
                                  fixture.world().state(ids[3]).position, 0.1);
      fixture.world().wrenches()[5] = {Eigen::Vector3f(90, 30, 50) * static_cast<float>(unit),
                                       Eigen::Vector3f(9, 8, 7) * static_cast<float>(unit * unit)};
    }
    for (const scene::ObjectId id : ids) {
      const scene::ObjectState state = fixture.world().state(id);
      for (const Eigen::Vector3d& v : {Eigen::Vector3d(state.position / unit),
                                       Eigen::Vector3d(state.velocity / unit), state.angular_velocity})
        for (const double x : v) add(x);
    }
    for (std::size_t i = 0; i < joints.size(); ++i) {
      const scene::JointState state = fixture.world().joint_state(static_cast<scene::JointId>(i));
      const bool is_slider = joints[i].kind == scene::JointKind::kSlider;
      const double length = is_slider ? unit : 1.0;
      add(state.coordinate / length), add(state.speed / length);
      add(state.effort / (is_slider ? unit : unit * unit));
      for (const double x : state.force) add(x / unit);
    }
    for (const world::ContactPoint& contact : fixture.world().contacts()) {
      for (const float x : contact.point) add(static_cast<double>(x) / unit);
      add(static_cast<double>(contact.impulse) / unit);
    }
    for (const float impulse : fixture.cells().field().impulse) add(static_cast<double>(impulse) / unit);
  });
  return track;
}

}  // namespace

INSTANTIATE_TEST_SUITE_P(Each, UnitsOfLength, testing::Values("native", "bullet"),
                         [](const auto& engine) { return std::string(engine.param); });

// Powers of two scale without rounding: no absolute length, speed or force decides anything.
TEST_P(UnitsOfLength, PowersOfTwoKeepTheBits) {
  for (unsigned seed = 0; seed < 9; ++seed) {
    const std::vector<float> reference = random_track(seed, 1.0);
    for (const double unit : {0x1p-7, 0x1p-3, 0x1p3, 0x1p10})
      EXPECT_TRUE(random_track(seed, unit) == reference) << seed << " " << unit;
  }
}

// Balls that meet at more than 0.2 pitches/s part with the restitution, slower ones hardly at all.
TEST_P(UnitsOfLength, RestitutionThresholdIsInPitches) {
  std::mt19937_64 random(17);
  const DrawUniform draw = uniform_of(random);
  for (int i = 0; i < 60; ++i) {
    const double unit = std::array{0.125, 1.0, 8.0}[i % 3];
    const double restitution = draw(0.1, 1.0), speed = i % 2 == 0 ? draw(0.05, 0.19) : draw(0.21, 2.0);
    SCOPED_TRACE(testing::Message() << unit << ": restitution " << restitution << ", speed " << speed);
    PhysicsFixture fixture;
    fixture.scene.world.engine = GetParam();
    scale_scene(fixture, unit);
    fixture.scene.world.gravity.setZero();
    fixture.scene.materials[0].restitution = restitution;
    scene::ObjectSpec a = sphere(0.5 * unit, Eigen::Vector3d(10, 10, 20) * unit), b = a;
    b.position.x() += 1.02 * unit;
    a.velocity.x() = speed * unit;
    fixture.add(a), fixture.add(b);
    fixture.run(0.02 / speed + 0.1);
    const auto parting = static_cast<double>(fixture.velocity(1).x() - fixture.velocity(0).x()) / unit;
    if (speed > 0.2)
      EXPECT_NEAR(parting, restitution * speed, 1e-3 * speed);
    else
      EXPECT_NEAR(parting, 0.0, 0.05 * speed);
  }
}

// What is off its joint comes back at 4 pitches/s.
TEST_P(UnitsOfLength, JointsAreCorrectedAtASpeedInPitches) {
  std::mt19937_64 random(18);
  const DrawUniform draw = uniform_of(random);
  for (int i = 0; i < 12; ++i) {
    const double unit = std::array{0.125, 1.0, 8.0}[i % 3];
    PhysicsFixture fixture;
    fixture.scene.world.engine = GetParam();
    scale_scene(fixture, unit);
    fixture.scene.world.gravity.setZero();
    const Eigen::Vector3d centre = Eigen::Vector3d(15, 15, 40) * unit;
    scene::JointSpec joint;
    joint.kind = std::array{scene::JointKind::kBall, scene::JointKind::kHinge}[i % 2];
    joint.a = fixture.add(box(Eigen::Vector3d(1, 1, 1) * unit, centre));
    joint.anchor = centre;
    joint.axis = {0, 0, 1};
    fixture.world().add_joint(joint);
    fixture.run(0.1);
    const Eigen::Vector3d offset(draw(-9, 9), draw(-9, 9), draw(8, 12));
    scene::ObjectStateUpdate torn;
    torn.position = centre + offset * unit;
    fixture.world().set_state(joint.a, torn);
    fixture.run(1.0);
    const double distance = (fixture.world().state(joint.a).position - centre).norm() / unit;
    EXPECT_NEAR(distance, offset.norm() - 4.0, 0.1) << unit;
  }
}

// A ball of twice the pitch rests on level cells at its radius, to 0.1 % of it.
TEST(Scale, BallRestsOnTheSurfaceAtAnyUnitOfLength) {
  for (const double unit : {0.001, 0.01, 1.0, 1000.0})
    for (const double dt_s : {1.0 / 60, 1.0 / 240, 1.0 / 960}) {
      PhysicsFixture fixture;
      scale_scene(fixture, unit);
      fixture.scene.world.dt_s = dt_s;
      const double radius = 2 * unit;
      const auto id = fixture.add(sphere(radius, Eigen::Vector3d(15.3 * unit, 15.4 * unit, 1.05 * radius)));
      fixture.run(3.0);
      EXPECT_NEAR(static_cast<double>(fixture.position(id).z()), radius, 1e-3 * radius)
          << unit << " " << dt_s;
    }
}

// Pins that bear three quarters of a box's weight yield to it as slowly in any unit.
TEST(Scale, ForceLimitsFollowTheUnit) {
  double reference = 0.0;
  for (const double unit : {1.0, 0.01, 100.0}) {
    PhysicsFixture fixture;
    scale_scene(fixture, unit);
    const double weight = 3.0 * kGravity * unit;
    fixture.scene.surface.actuators[0].values["max_force"] = {0.75 * weight / 16};
    derive_pin_spec(fixture.scene.surface);
    fixture.cells().set_targets(0, std::vector<float>(kCells * kCells, static_cast<float>(2 * unit)));
    for (int i = 0; i < 480; ++i) {
      fixture.cells().plan(fixture.scene.world.dt_s);
      fixture.cells().commit(fixture.scene.world.dt_s);
    }
    scene::ObjectSpec o = box({3.8 * unit, 3.8 * unit, unit}, {11.5 * unit, 11.5 * unit, 2.5 * unit});
    o.mass = 3.0;
    const auto id = fixture.add(o);
    fixture.run(0.5);
    const double height = static_cast<double>(fixture.position(id).z()) / unit;
    if (unit == 1.0) reference = height;
    EXPECT_LT(height, 2.45);
    EXPECT_NEAR(height, reference, 0.01) << unit;
  }
}
