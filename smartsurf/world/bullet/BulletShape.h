// A body's collision shape for Bullet.
#pragma once

#include <btBulletCollisionCommon.h>

#include <Eigen/Geometry>
#include <memory>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/surface/Field.h"

namespace smartsurf::world {

inline btVector3 to_bt(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
inline btVector3 to_bt(const Eigen::Vector3f& v) { return to_bt(Eigen::Vector3d(v.cast<double>())); }
inline btQuaternion to_bt(const Eigen::Quaterniond& q) { return {q.x(), q.y(), q.z(), q.w()}; }
inline Eigen::Vector3d to_eigen(const btVector3& v) { return {v.x(), v.y(), v.z()}; }
inline Eigen::Quaterniond to_eigen(const btQuaternion& q) { return {q.w(), q.x(), q.y(), q.z()}; }

// Bullet's bodies have diagonal inertia about their origin: that is the object's centre of mass, and their
// axes are its principal axes.
struct BulletShape {
  std::vector<std::unique_ptr<btCollisionShape>> parts;  // what `shape` refers to
  btCollisionShape* shape = nullptr;
  btVector3 inertia{0, 0, 0};  // about the principal axes, mass·u²; 0 for a fixed object
  Eigen::Quaterniond principal_axes{1.0, 0.0, 0.0, 0.0};  // in the object's frame
  Eigen::Vector3d centre_of_mass{0.0, 0.0, 0.0};          // in the object's frame, u
};

// mass 0: fixed.
BulletShape make_bullet_shape(const scene::ObjectSpec&, double mass);

// The tip of a cell about its origin, fixed. `depth`: as for TipParts.
BulletShape make_tip_shape(const surface::Field&, const surface::CellTip&, double depth);

// A box with sharp edges and the faces that the clipping of polyhedra needs.
std::unique_ptr<btBoxShape> make_box(const btVector3& half_extents);

}  // namespace smartsurf::world
