// Objects between rising pins and a lid that nothing lifts: the pins stall before they enter the object.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <tuple>
#include <vector>

#include "tests/property/FieldPenetration.h"
#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;

namespace {

constexpr double kCoarseBound = 0.06, kFineBound = 0.02;  // u, at 1/240 and 1/960 s

enum class Lid { kStatic, kFixedJoint, kStoppedHinge };
enum class Pressed { kSphere, kBox, kCylinder, kCapsule, kCube };

std::string name_of(Lid lid, Pressed shape) {
  constexpr std::array kLids{"static", "fixed", "hinge"};
  constexpr std::array kShapes{"Sphere", "Box", "Cylinder", "Capsule", "Cube"};
  return std::string(kLids[static_cast<std::size_t>(lid)]) + kShapes[static_cast<std::size_t>(shape)];
}

scene::ObjectSpec pressed_object(Pressed shape) {
  const Eigen::Vector3d at(4.13, 3.91, 1.0);
  switch (shape) {
    case Pressed::kSphere:
      return sphere(1.0, at);
    case Pressed::kBox:
      return box({2, 2, 2}, at);
    case Pressed::kCylinder:
      return cylinder(1.0, 2.0, at);
    case Pressed::kCapsule:
      return capsule(0.6, 2.0, at);
    case Pressed::kCube:
      break;
  }
  return cube(at);
}

class LidTest : public testing::TestWithParam<std::tuple<Lid, Pressed>> {
 protected:
  // The greatest depths within two seconds, u.
  struct Depths {
    double in_cells = 0.0, in_lid = 0.0, lid_moved = 0.0;
  };
  static Depths press(double dt_s, double speed) {
    const auto [lid_kind, shape] = GetParam();
    PhysicsFixture fixture;
    scene::SceneSpec& s = fixture.scene;
    s.world.dt_s = dt_s;
    s.surface.rows = s.surface.columns = 9;
    s.surface.pin.max_height = 20.0;
    s.surface.pin.max_speed = speed;
    s.surface.pin.max_acceleration = 400.0;
    const scene::ObjectSpec object = pressed_object(shape);
    scene::ObjectSpec lid = box({6, 6, 1}, {4, 4, 3});
    lid.fixed = lid_kind == Lid::kStatic;
    fixture.add(object);
    const scene::ObjectId lid_id = fixture.add(lid);
    if (lid_kind == Lid::kFixedJoint)
      fixture.world().add_joint({.kind = scene::JointKind::kFixed, .a = lid_id, .anchor = {1, 4, 3}});
    if (lid_kind == Lid::kStoppedHinge)
      fixture.world().add_joint({.kind = scene::JointKind::kHinge,
                                 .a = lid_id,
                                 .anchor = {1, 4, 3},
                                 .axis = {0, 1, 0},
                                 .limits = scene::JointLimits{}});
    const world::Shape shapes[] = {world::make_shape(object), world::make_shape(lid)};
    // The pins under the object.
    std::vector<float> targets(81, 0.0F);
    for (std::size_t row = 3; row < 6; ++row) std::fill_n(targets.begin() + 9 * row + 3, 3, 10.0F);
    fixture.cells().set_targets(0, targets);
    Depths deepest;
    const int every = std::max(1, static_cast<int>(std::lround(1.0 / 60 / dt_s)));
    int step = 0;
    fixture.run(2.0, [&] {
      if (++step % every != 0) return;
      const scene::Snapshot& now = fixture.snapshot();
      const surface::Field& field = fixture.cells().field();
      const std::size_t bodies = lid.fixed ? 1 : 2;  // nothing keeps pins out of a static body
      for (std::size_t i = 0; i < bodies; ++i)
        deepest.in_cells = std::max(deepest.in_cells, penetration_into_field(field, shapes[i], now, i));
      deepest.in_lid = std::max(deepest.in_lid, overlap(shapes[0], shapes[1], now, 0, 1));
      deepest.lid_moved =
          std::max(deepest.lid_moved, std::abs(static_cast<double>(now.position[1][2]) - 3.0));
    });
    return deepest;
  }
};

}  // namespace

TEST_P(LidTest, PinsStall) {
  for (const double speed : {1.0, 4.0}) {
    const Depths d = press(1.0 / 240, speed);
    EXPECT_LE(d.in_cells, kCoarseBound) << speed;
    EXPECT_LE(d.in_lid, kCoarseBound) << speed;
    EXPECT_LE(d.lid_moved, kCoarseBound) << speed;
  }
}

TEST_P(LidTest, PinsStallFineStep) {
  const Depths d = press(1.0 / 960, 4.0);
  EXPECT_LE(d.in_cells, kFineBound);
  EXPECT_LE(d.in_lid, kFineBound);
  EXPECT_LE(d.lid_moved, kFineBound);
}

INSTANTIATE_TEST_SUITE_P(Lids, LidTest,
                         testing::Combine(testing::Values(Lid::kStatic, Lid::kFixedJoint, Lid::kStoppedHinge),
                                          testing::Values(Pressed::kSphere, Pressed::kBox, Pressed::kCylinder,
                                                          Pressed::kCapsule, Pressed::kCube)),
                         [](const auto& of) {
                           return name_of(std::get<0>(of.param), std::get<1>(of.param));
                         });

// Nothing lies on what pins throw: they do not stall under it, however deep its parts press into each other.
TEST(Throw, AStackRisesAsHighAsItsSpeedTakesIt) {
  for (const double dt_s : {1.0 / 60, 1.0 / 240, 1.0 / 960})
    for (const double restitution : {0.0, 0.2}) {
      PhysicsFixture fixture;
      scene::SceneSpec& s = fixture.scene;
      s.world.dt_s = dt_s;
      s.surface.rows = s.surface.columns = 10;
      s.surface.pin.max_speed = 20.0;
      s.materials[0].restitution = restitution;
      const auto id = fixture.add(box({2, 2, 0.5}, {3.5, 4.5, 0.25}));
      fixture.add(box({1, 1, 1}, {3.5, 4.5, 1}));
      fixture.run(0.5);
      raise_all(fixture, 2.0F);
      double highest = 0.0;
      fixture.run(3.0, [&] { highest = std::max(highest, static_cast<double>(fixture.position(id).z())); });
      const double speed = s.surface.pin.max_speed;
      EXPECT_NEAR(highest, 2.25 + speed * speed / (2 * kGravity), 2.5) << dt_s << ", " << restitution;
    }
}
