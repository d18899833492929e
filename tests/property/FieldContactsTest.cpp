// The narrow phase of the field reports every penetration: a body that is in a cell has a contact as deep as
// that.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <string>
#include <vector>

#include "smartsurf/mesh/SolidBuilder.h"
#include "smartsurf/world/field/ConvexOnField.h"
#include "tests/property/FieldPenetration.h"
#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;

namespace {

enum class Contacting { kBox, kCylinder, kCapsule, kCone, kHull };

class FieldContactsTest : public testing::TestWithParam<Contacting> {
 protected:
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random_); }

  scene::ObjectSpec random_object(const Eigen::Vector3d& at) {
    switch (GetParam()) {
      case Contacting::kBox:
        return box({uniform(1.5, 2.6), uniform(1.5, 2.6), uniform(1.2, 2.4)}, at);
      case Contacting::kCylinder:
        return cylinder(uniform(0.8, 1.3), uniform(1.2, 2.4), at);
      case Contacting::kCapsule:
        return capsule(uniform(0.6, 0.9), uniform(2.0, 2.8), at);
      case Contacting::kCone:
        return cone(uniform(0.8, 1.3), uniform(1.2, 2.4), at);
      case Contacting::kHull:
        break;
    }
    std::vector<Eigen::Vector3d> corners(12);
    for (auto& corner : corners) corner = 1.4 * random_direction();
    scene::ObjectSpec o;
    o.shape = scene::ShapeKind::kSolid;
    o.solid = std::make_shared<scene::Solid>(mesh::build_hull_solid(corners));
    o.position = at;
    return o;
  }

  Eigen::Vector3d random_direction() {
    Eigen::Vector3d v;
    for (double& along : v) along = normal_(random_);
    return v.normalized();
  }

  // Two heights at random, a staircase along the diagonal, or pillars among cells of any height.
  void set_heights(int pattern, surface::Field& field) {
    const double low = uniform(0, 2.5), high = uniform(0, 2.5), wall = 4.0;
    for (int i = 0; i < field.cells(); ++i) {
      const int row = i / field.columns, column = i % field.columns;
      const double height = pattern == 0   ? (uniform(0, 1) < 0.5 ? low : high)
                            : pattern == 1 ? (row + column >= field.rows ? wall : low)
                                           : (uniform(0, 1) < 0.3 ? wall : uniform(0, 2.5));
      field.height[static_cast<std::size_t>(i)] = static_cast<float>(height);
    }
    field.max_height = *std::max_element(field.height.begin(), field.height.end());
    field.update_column_height();
  }

  std::mt19937 random_{1};
  std::normal_distribution<double> normal_;
};

}  // namespace

TEST_P(FieldContactsTest, ReportEveryPenetration) {
  constexpr int kPoses = 600;
  constexpr float kMargin = 0.02F;
  constexpr double kMinDepth = 0.004, kMaxDepth = 0.04, kTolerance = 0.004;  // u
  scene::SceneSpec scene;
  scene.surface.rows = scene.surface.columns = 9;
  scene.surface.pin.max_height = 6.0;
  surface::ActuatorArray cells(scene.surface);
  surface::Field& field = cells.field();
  for (int i = 0; i < kPoses; ++i) {
    set_heights(i % 3, field);
    const Eigen::Vector3d at(4.0 + uniform(-0.5, 0.5), 4.0 + uniform(-0.5, 0.5), 0.0);
    const world::Shape shape = world::make_shape(random_object(at));
    const Eigen::Quaternionf rotation(
        Eigen::AngleAxisf(static_cast<float>(uniform(0, 3.1)), random_direction().cast<float>()));
    scene::Snapshot snapshot;
    snapshot.position.push_back({static_cast<float>(at.x()), static_cast<float>(at.y()), 0.0F});
    snapshot.orientation.push_back({rotation.x(), rotation.y(), rotation.z(), rotation.w()});
    const double depth =
        lower_into_field(field, shape, 0.5F, 8.0F, uniform(kMinDepth, kMaxDepth), snapshot, 0);
    if (depth < kMinDepth) continue;  // it jumps where an upright side meets a top
    std::vector<world::Contact> contacts;
    world::collide_shape_with_field(field, shape, world::Vec3(snapshot.position[0].data()),
                                    rotation.toRotationMatrix(), kMargin, contacts);
    double deepest = -kMargin;
    for (const world::Contact& c : contacts) deepest = std::max(deepest, static_cast<double>(-c.separation));
    EXPECT_GT(deepest, depth - kTolerance) << "pose " << i << ", " << contacts.size() << " contacts";
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, FieldContactsTest,
                         testing::Values(Contacting::kBox, Contacting::kCylinder, Contacting::kCapsule,
                                         Contacting::kCone, Contacting::kHull),
                         [](const auto& shape) {
                           return std::string(std::array{"boxes", "cylinders", "capsules", "cones",
                                                         "hulls"}[static_cast<std::size_t>(shape.param)]);
                         });
