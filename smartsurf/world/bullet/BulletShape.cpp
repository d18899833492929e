#include "smartsurf/world/bullet/BulletShape.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartsurf/scene/Axes.h"
#include "smartsurf/world/body/Shape.h"
#include "smartsurf/world/field/TipsOnField.h"

namespace smartsurf::world {
namespace {

using scene::ShapeKind;

// GJK works on shapes shrunk by their margin, and rounds their edges with it.
constexpr double kRelativeMargin = 1e-3;  // of the smallest half extent

// btConeShape grows by its margin: the cone is inset so that the grown one has the right faces.
std::unique_ptr<btCollisionShape> make_cone(const scene::ObjectSpec& o, btTransform& pose) {
  const double margin = kRelativeMargin * std::min(o.radius, 0.5 * o.height);
  const double core_height = o.height - margin - margin * std::hypot(o.radius, o.height) / o.radius;
  auto cone = std::make_unique<btConeShapeZ>(core_height * o.radius / o.height, core_height);
  cone->setMargin(margin);
  pose.setOrigin({0, 0, -0.25 * o.height + margin + 0.5 * core_height});
  return cone;
}

std::unique_ptr<btCollisionShape> make_hull(const scene::ConvexHull& hull) {
  auto shape = std::make_unique<btConvexHullShape>();
  for (const Eigen::Vector3f& corner : hull.vertices) shape->addPoint(to_bt(corner), false);
  shape->recalcLocalAabb();
  shape->setMargin(1e-4 * static_cast<double>((hull.bounds_max - hull.bounds_min).minCoeff()));
  shape->initializePolyhedralFeatures();
  return shape;
}

void add_child(BulletShape& out, std::unique_ptr<btCollisionShape> child, const btTransform& pose) {
  if (!out.shape) {
    out.parts.push_back(std::make_unique<btCompoundShape>());
    out.shape = out.parts.back().get();
  }
  static_cast<btCompoundShape*>(out.shape)->addChildShape(pose, child.get());
  out.parts.push_back(std::move(child));
}

void set_inertia(BulletShape& out, const scene::ObjectSpec& o, double mass) {
  if (mass == 0.0) return;
  const Eigen::Matrix3d inertia = inertia_of(o, static_cast<float>(mass)).cast<double>();
  if (inertia.isDiagonal(1e-6)) {
    out.inertia = to_bt(Eigen::Vector3d(inertia.diagonal()));
    return;
  }
  auto [moments, axes] = scene::principal_axes(inertia);
  if (axes.determinant() < 0.0) axes.col(2) = -axes.col(2);
  out.inertia = to_bt(moments);
  out.principal_axes = Eigen::Quaterniond(axes).normalized();
}

}  // namespace

std::unique_ptr<btBoxShape> make_box(const btVector3& half_extents) {
  auto box = std::make_unique<btBoxShape>(half_extents);
  box->setMargin(kRelativeMargin * half_extents[half_extents.minAxis()]);
  box->initializePolyhedralFeatures();
  return box;
}

BulletShape make_tip_shape(const surface::Field& field, const surface::CellTip& tip, double depth) {
  const TipParts parts(field, tip, static_cast<float>(depth));
  BulletShape out;
  for (int i = 0; i < parts.count; ++i) {
    const auto& [shape, centre] = parts.part[i];
    scene::ObjectSpec o;
    o.shape = shape.kind;
    o.radius = static_cast<double>(shape.radius);
    o.height = static_cast<double>(shape.high - shape.low);
    o.size = 2.0 * shape.half_extents.cast<double>();
    btTransform pose = btTransform::getIdentity();
    std::unique_ptr<btCollisionShape> child;
    if (shape.kind == ShapeKind::kCone)
      child = make_cone(o, pose);
    else
      child = std::move(make_bullet_shape(o, 0.0).parts.front());
    pose.setOrigin(pose.getOrigin() + to_bt(centre));
    add_child(out, std::move(child), pose);
  }
  return out;
}

BulletShape make_bullet_shape(const scene::ObjectSpec& o, double mass) {
  BulletShape out;
  set_inertia(out, o, mass);
  out.centre_of_mass = o.centre_of_mass;
  const btTransform to_body = btTransform(to_bt(out.principal_axes), to_bt(out.centre_of_mass)).inverse();
  const bool is_body_frame = out.centre_of_mass.isZero(0.0) && out.principal_axes.vec().isZero(0.0);
  auto set_simple = [&](std::unique_ptr<btCollisionShape> shape) {
    if (!is_body_frame) return add_child(out, std::move(shape), to_body);
    out.shape = shape.get();
    out.parts.push_back(std::move(shape));
  };
  const btVector3 half = to_bt(o.half_extents());
  btTransform pose = btTransform::getIdentity();
  switch (o.shape) {
    case ShapeKind::kSphere:
      set_simple(std::make_unique<btSphereShape>(o.radius));
      break;
    case ShapeKind::kBox:
      set_simple(make_box(half));
      break;
    case ShapeKind::kCylinder: {
      auto cylinder = std::make_unique<btCylinderShapeZ>(half);
      cylinder->setMargin(kRelativeMargin * half[half.minAxis()]);
      set_simple(std::move(cylinder));
      break;
    }
    case ShapeKind::kCapsule:
      set_simple(std::make_unique<btCapsuleShapeZ>(o.radius, std::max(0.0, o.height - 2.0 * o.radius)));
      break;
    case ShapeKind::kCone: {
      auto cone = make_cone(o, pose);
      add_child(out, std::move(cone), to_body * pose);
      break;
    }
    case ShapeKind::kSolid:
      for (const scene::ConvexHull& hull : o.solid->hulls) add_child(out, make_hull(hull), to_body);
      break;
  }
  return out;
}

}  // namespace smartsurf::world
