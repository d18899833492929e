// Bullet's sequential-impulse solver, taught that the field moves under each contact at its own cell's velocity.
#pragma once

#include <btBulletDynamicsCommon.h>

#include "smartsurf/surface/Field.h"

namespace smartsurf::world {

class SurfaceVelocitySolver final : public btSequentialImpulseConstraintSolver {
 public:
  explicit SurfaceVelocitySolver(const surface::Field& field) : field_(field) {}

 protected:
  void convertContacts(btPersistentManifold** manifolds, int count, const btContactSolverInfo&) override;

 private:
  // Velocity of a cell's surface along the field at that point.
  btVector3 drag_at(std::size_t cell, const btVector3& point) const;
  void move_with_surface(btSolverConstraint& contact, const btManifoldPoint&, const btVector3& surface_velocity,
                         const btContactSolverInfo&);

  const surface::Field& field_;
};

}  // namespace smartsurf::world
