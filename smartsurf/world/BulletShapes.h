// The scene's shapes as Bullet's, and the rule by which two materials combine.
#pragma once

#include <btBulletDynamicsCommon.h>

#include <memory>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::world {

inline btVector3 to_bullet(const Eigen::Vector3d& v) {
  return {static_cast<btScalar>(v.x()), static_cast<btScalar>(v.y()), static_cast<btScalar>(v.z())};
}
inline btQuaternion to_bullet(const Eigen::Quaterniond& q) {
  return btQuaternion(static_cast<btScalar>(q.x()), static_cast<btScalar>(q.y()), static_cast<btScalar>(q.z()),
                      static_cast<btScalar>(q.w()))
      .normalized();
}

std::unique_ptr<btConvexShape> make_shape(const scene::ObjectSpec&);
double mass_of(const scene::ObjectSpec&, const scene::Material&);
// Principal moments of inertia about the centre of mass, in closed form.
btVector3 inertia_of(const scene::ObjectSpec&, double mass);
// Friction, restitution and rolling friction of a body made of that material.
void set_material(btRigidBody&, const scene::Material&, bool rolls);

// Geometric mean of the frictions, the larger of the restitutions: the scene's contract.
struct CombinedMaterial {
  float friction, restitution, rolling_friction;
};
CombinedMaterial combine(const btCollisionObject&, const btCollisionObject&);
// Makes Bullet's own contacts combine by the same rule (process-wide in Bullet, the same for every world).
void install_material_rule();

}  // namespace smartsurf::world
