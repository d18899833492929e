#include "smartsurf/world/BulletShapes.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace smartsurf::world {
namespace {

btScalar friction(const btCollisionObject* a, const btCollisionObject* b) {
  return std::sqrt(a->getFriction() * b->getFriction());
}
btScalar restitution(const btCollisionObject* a, const btCollisionObject* b) {
  return std::max(a->getRestitution(), b->getRestitution());
}
btScalar rolling_friction(const btCollisionObject* a, const btCollisionObject* b) {
  return std::sqrt(a->getRollingFriction() * b->getRollingFriction());
}

}  // namespace

std::unique_ptr<btConvexShape> make_shape(const scene::ObjectSpec& o) {
  const btVector3 half = to_bullet(o.half_extents());
  std::unique_ptr<btConvexShape> shape;
  switch (o.shape) {
    case scene::ShapeKind::kSphere: return std::make_unique<btSphereShape>(half.x());
    case scene::ShapeKind::kBox: shape = std::make_unique<btBoxShape>(half); break;
    case scene::ShapeKind::kCylinder: shape = std::make_unique<btCylinderShapeZ>(half); break;
    default: throw scene::InputError("the physics has no collision for capsules, cones, hulls and meshes");
  }
  // GJK rounds edges by the margin: small against the body, whatever its size.
  shape->setMargin(std::min(0.02F, 0.05F * std::min({half.x(), half.y(), half.z()})));
  return shape;
}

double mass_of(const scene::ObjectSpec& o, const scene::Material& m) {
  return o.fixed ? 0.0 : o.mass.value_or(m.density * o.volume());
}

btVector3 inertia_of(const scene::ObjectSpec& o, double mass) {
  const double r2 = o.radius * o.radius;
  switch (o.shape) {
    case scene::ShapeKind::kSphere: return to_bullet(Eigen::Vector3d::Constant(0.4 * mass * r2));
    case scene::ShapeKind::kBox: {
      const Eigen::Vector3d s = o.size.cwiseAbs2();
      return to_bullet(mass / 12.0 * Eigen::Vector3d(s.y() + s.z(), s.x() + s.z(), s.x() + s.y()));
    }
    case scene::ShapeKind::kCylinder: {
      const double across = mass * (3.0 * r2 + o.height * o.height) / 12.0;
      return to_bullet(Eigen::Vector3d(across, across, 0.5 * mass * r2));
    }
    default: break;
  }
  return {0, 0, 0};
}

void set_material(btRigidBody& body, const scene::Material& m, bool rolls) {
  body.setFriction(static_cast<btScalar>(m.friction));
  body.setRestitution(static_cast<btScalar>(m.restitution));
  const auto lever = static_cast<btScalar>(rolls ? m.rolling_friction : 0.0);
  body.setRollingFriction(lever);
  body.setSpinningFriction(lever);
}

CombinedMaterial combine(const btCollisionObject& a, const btCollisionObject& b) {
  return {friction(&a, &b), restitution(&a, &b), rolling_friction(&a, &b)};
}

void install_material_rule() {
  gCalculateCombinedFrictionCallback = friction;
  gCalculateCombinedRestitutionCallback = restitution;
  gCalculateCombinedRollingFrictionCallback = rolling_friction;
  gCalculateCombinedSpinningFrictionCallback = rolling_friction;
}

}  // namespace smartsurf::world
