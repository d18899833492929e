// Bullet's sequential-impulse solver, taught that the field moves under each contact at its own cell's velocity.
#pragma once

#include <btBulletDynamicsCommon.h>

#include "smartsurf/surface/PinField.h"

namespace smartsurf::world {

class SurfaceVelocitySolver final : public btSequentialImpulseConstraintSolver {
 public:
  explicit SurfaceVelocitySolver(const surface::PinField& field) : field_(field) {}

 protected:
  void convertContacts(btPersistentManifold** manifolds, int count, const btContactSolverInfo&) override;

 private:
  void move_with_surface(btSolverConstraint& contact, const btManifoldPoint&, const btVector3& surface_velocity,
                         const btContactSolverInfo&);

  const surface::PinField& field_;
};

}  // namespace smartsurf::world
