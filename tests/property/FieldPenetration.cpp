#include "tests/property/FieldPenetration.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "smartsurf/world/narrowphase/Distance.h"

namespace physics_fixture {

using namespace smartsurf;
using namespace smartsurf::world;

namespace {

struct Pose {
  Vec3 centre;
  Mat3 axes;
};

Pose pose_of(const scene::Snapshot& s, std::size_t i) {
  const auto& q = s.orientation[i];
  return {Vec3(s.position[i].data()), Quat(q[3], q[0], q[1], q[2]).toRotationMatrix()};
}

// Points of the shape's surface that can be deepest in a column, in body axes; `down` for round shapes.
std::vector<Vec3> surface_points(const Shape& shape, const Pose& pose) {
  using scene::ShapeKind;
  std::vector<Vec3> points;
  constexpr int kRimSamples = 32;
  switch (shape.kind) {
    case ShapeKind::kBox:
      for (int i = 0; i < 8; ++i)
        points.emplace_back(shape.half_extents.cwiseProduct(
            Vec3(i & 1 ? 1.0F : -1.0F, i & 2 ? 1.0F : -1.0F, i & 4 ? 1.0F : -1.0F)));
      break;
    case ShapeKind::kCylinder:
      for (int i = 0; i < 2 * kRimSamples; ++i) {
        const float angle = static_cast<float>(i) * std::numbers::pi_v<float> / kRimSamples;
        points.emplace_back(shape.radius * std::cos(angle), shape.radius * std::sin(angle),
                            i & 1 ? shape.low : shape.high);
      }
      break;
    case ShapeKind::kSphere:
    case ShapeKind::kCapsule: {
      const float end = shape.kind == ShapeKind::kSphere ? 0.0F : shape.high - shape.radius;
      const Vec3 directions[] = {{0, 0, -1}, {1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}};
      for (const Vec3& d : directions)
        for (const float z : {-end, end})
          points.emplace_back(Vec3(0, 0, z) + shape.radius * (pose.axes.transpose() * d));
      break;
    }
    default:
      for_each_part(shape, [&](const ConvexPart& part) {
        if (part.hull)
          points.insert(points.end(), part.hull->hull->vertices.begin(), part.hull->hull->vertices.end());
      });
  }
  return points;
}

float depth_of(const Shape& shape, const Pose& pose, const Vec3& p) {
  if ((p - pose.centre).squaredNorm() > shape.bounding_radius * shape.bounding_radius) return 0.0F;
  float deepest = 0.0F;
  for_each_part(shape, [&](const ConvexPart& part) {
    deepest = std::max(deepest, -signed_distance(part, pose.axes.transpose() * (p - pose.centre)).distance);
  });
  return deepest;
}

}  // namespace

double penetration_into_field(const surface::Field& f, const Shape& shape, const scene::Snapshot& snapshot,
                              std::size_t object) {
  const Pose pose = pose_of(snapshot, object);
  const std::vector<Vec3> points = surface_points(shape, pose);
  const float reach = shape.bounding_radius + f.half_top_x;
  float deepest = 0.0F;
  for (int i = 0; i < f.cells(); ++i) {
    const Eigen::Vector2f cell = f.centre(i);
    const float top = f.height[static_cast<std::size_t>(i)];
    if ((cell - pose.centre.head<2>()).norm() > reach + f.half_top_y || top < pose.centre.z() - reach)
      continue;
    const Mat3 turn = Eigen::AngleAxisf(f.angle_of(i), Vec3::UnitZ()).toRotationMatrix();
    const Vec3 origin(cell.x(), cell.y(), 0);
    for (const Vec3& local : points) {
      const Vec3 p = turn.transpose() * (pose.centre + pose.axes * local - origin);
      deepest = std::max(
          deepest, std::min({top - p.z(), f.half_top_x - std::abs(p.x()), f.half_top_y - std::abs(p.y())}));
    }
    constexpr int kEdgeSamples = 4;
    for (int k = -kEdgeSamples; k <= kEdgeSamples; ++k) {
      const float u = static_cast<float>(k) / kEdgeSamples;
      for (const float side : {-1.0F, 1.0F})
        for (const Vec3& at : {Vec3(side * f.half_top_x, u * f.half_top_y, top),
                               Vec3(u * f.half_top_x, side * f.half_top_y, top)})
          deepest = std::max(deepest, depth_of(shape, pose, turn * at + origin));
    }
  }
  return deepest;
}

double lower_into_field(const surface::Field& f, const Shape& shape, float low, float high, double wanted,
                        scene::Snapshot& snapshot, std::size_t object) {
  constexpr int kBisections = 20;
  float& z = snapshot.position[object][2];
  for (int k = 0; k < kBisections; ++k) {
    z = 0.5F * (low + high);
    (penetration_into_field(f, shape, snapshot, object) > wanted ? low : high) = z;
  }
  z = high;
  return penetration_into_field(f, shape, snapshot, object);
}

double distance_to_field(const surface::Field& f, const Shape& shape, const scene::Snapshot& snapshot,
                         std::size_t object) {
  constexpr int kSamples = 4;
  const Pose pose = pose_of(snapshot, object);
  const std::vector<Vec3> points = surface_points(shape, pose);
  float least = shape.bounding_radius;
  for (int i = 0; i < f.cells(); ++i) {
    const Eigen::Vector2f cell = f.centre(i);
    const Mat3 turn = Eigen::AngleAxisf(f.angle_of(i), Vec3::UnitZ()).toRotationMatrix();
    const Vec3 top_centre(cell.x(), cell.y(), f.height[static_cast<std::size_t>(i)]);
    if ((top_centre - pose.centre).norm() > 2.0F * (shape.bounding_radius + f.half_top_x + f.half_top_y))
      continue;
    for (const Vec3& local : points) {
      const Vec3 p = turn.transpose() * (pose.centre + pose.axes * local - top_centre);
      if (std::abs(p.x()) < f.half_top_x && std::abs(p.y()) < f.half_top_y) least = std::min(least, p.z());
    }
    for (int k = -kSamples; k <= kSamples; ++k)
      for (int m = -kSamples; m <= kSamples; ++m) {
        const Vec3 local(static_cast<float>(k) / kSamples * f.half_top_x,
                         static_cast<float>(m) / kSamples * f.half_top_y, 0);
        for_each_part(shape, [&](const ConvexPart& part) {
          const Vec3 p = pose.axes.transpose() * (top_centre + turn * local - pose.centre);
          least = std::min(least, signed_distance(part, p).distance);
        });
      }
  }
  return least;
}

double overlap(const Shape& a, const Shape& b, const scene::Snapshot& snapshot, std::size_t object_a,
               std::size_t object_b) {
  const Pose pose_a = pose_of(snapshot, object_a), pose_b = pose_of(snapshot, object_b);
  if ((pose_a.centre - pose_b.centre).norm() > a.bounding_radius + b.bounding_radius) return 0.0;
  float deepest = 0.0F;
  for (const Vec3& p : surface_points(a, pose_a))
    deepest = std::max(deepest, depth_of(b, pose_b, pose_a.centre + pose_a.axes * p));
  for (const Vec3& p : surface_points(b, pose_b))
    deepest = std::max(deepest, depth_of(a, pose_a, pose_b.centre + pose_b.axes * p));
  return deepest;
}

}  // namespace physics_fixture
