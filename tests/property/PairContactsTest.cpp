// The narrow phase of two bodies reports every penetration: bodies that overlap have a contact as deep as that.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <string>
#include <tuple>
#include <vector>

#include "smartsurf/mesh/SolidBuilder.h"
#include "smartsurf/world/narrowphase/ConvexPair.h"
#include "tests/property/FieldPenetration.h"
#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;

namespace {

enum class Pairing { kBox, kCylinder, kCapsule, kCone, kHull };
constexpr std::array kPairingNames{"boxes", "cylinders", "capsules", "cones", "hulls"};

class PairContactsTest : public testing::TestWithParam<std::tuple<Pairing, Pairing>> {
 protected:
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random_); }
  Eigen::Vector3d random_direction() {
    Eigen::Vector3d v;
    for (double& along : v) along = normal_(random_);
    return v.normalized();
  }
  scene::ObjectSpec random_object(Pairing shape) {
    const Eigen::Vector3d origin(0, 0, 0);
    switch (shape) {
      case Pairing::kBox:
        return box({uniform(1.5, 2.6), uniform(1.5, 2.6), uniform(1.2, 2.4)}, origin);
      case Pairing::kCylinder:
        return cylinder(uniform(0.8, 1.3), uniform(1.2, 2.4), origin);
      case Pairing::kCapsule:
        return capsule(uniform(0.6, 0.9), uniform(2.0, 2.8), origin);
      case Pairing::kCone:
        return cone(uniform(0.8, 1.3), uniform(1.2, 2.4), origin);
      case Pairing::kHull:
        break;
    }
    std::vector<Eigen::Vector3d> corners(12);
    for (auto& corner : corners) corner = 1.4 * random_direction();
    scene::ObjectSpec o;
    o.shape = scene::ShapeKind::kSolid;
    o.solid = std::make_shared<scene::Solid>(mesh::build_hull_solid(corners));
    return o;
  }

  std::mt19937 random_{1};
  std::normal_distribution<double> normal_;
};

}  // namespace

TEST_P(PairContactsTest, ReportEveryOverlap) {
  constexpr int kPoses = 150;
  constexpr double kMinDepth = 0.004, kMaxDepth = 0.04, kTolerance = 0.003;  // u
  const auto [kind_a, kind_b] = GetParam();
  for (int i = 0; i < kPoses; ++i) {
    const world::Shape a = world::make_shape(random_object(kind_a)),
                       b = world::make_shape(random_object(kind_b));
    scene::Snapshot snapshot;
    snapshot.position.resize(2);
    std::array<world::Quat, 2> rotation;
    for (auto& q : rotation) {
      // A third of them upright, so that faces and edges are parallel.
      const Eigen::Vector3d axis = i % 3 == 0 ? Eigen::Vector3d::UnitZ() : random_direction();
      q = world::Quat(Eigen::AngleAxisf(static_cast<float>(uniform(0, 3.1)), axis.cast<float>()));
      snapshot.orientation.push_back({q.x(), q.y(), q.z(), q.w()});
    }
    const Eigen::Vector3f direction = random_direction().cast<float>();
    const auto depth_at = [&](float distance) {
      for (int k = 0; k < 3; ++k) snapshot.position[1][static_cast<std::size_t>(k)] = distance * direction[k];
      return overlap(a, b, snapshot, 0, 1);
    };
    const double wanted = uniform(kMinDepth, kMaxDepth);
    float low = 0.0F, high = a.bounding_radius + b.bounding_radius;
    for (int k = 0; k < 20; ++k) {
      const float middle = 0.5F * (low + high);
      (depth_at(middle) > wanted ? low : high) = middle;
    }
    const double depth = depth_at(high);
    if (depth < kMinDepth) continue;  // it jumps where a sample point comes to lie in the other body
    std::vector<world::Contact> contacts;
    world::collide_convex({a, world::Vec3::Zero(), rotation[0].toRotationMatrix()},
                          {b, high * direction, rotation[1].toRotationMatrix()}, 0.02F, nullptr, contacts,
                          0.2F, nullptr);
    double deepest = -1.0;
    for (const world::Contact& c : contacts) deepest = std::max(deepest, static_cast<double>(-c.separation));
    EXPECT_GT(deepest, depth - kTolerance) << "pose " << i << ", " << contacts.size() << " contacts";
  }
}

INSTANTIATE_TEST_SUITE_P(
    Shapes, PairContactsTest,
    testing::Combine(testing::Values(Pairing::kBox, Pairing::kCylinder, Pairing::kCapsule, Pairing::kCone,
                                     Pairing::kHull),
                     testing::Values(Pairing::kBox, Pairing::kCylinder, Pairing::kCapsule, Pairing::kHull)),
    [](const auto& of) {
      return std::string(kPairingNames[static_cast<std::size_t>(std::get<0>(of.param))]) + "_" +
             kPairingNames[static_cast<std::size_t>(std::get<1>(of.param))];
    });
