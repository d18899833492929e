#include "smartsurf/world/SurfaceVelocitySolver.h"

#include <cmath>

#include "smartsurf/world/FieldCollision.h"

namespace smartsurf::world {
namespace {

// Newton's rule, as Bullet applies it: nothing rebounds from slower than the threshold.
float rebound(float relative_speed, float restitution, float threshold) {
  return relative_speed < 0.0F && -relative_speed >= threshold ? -restitution * relative_speed : 0.0F;
}

}  // namespace

void SurfaceVelocitySolver::convertContacts(btPersistentManifold** manifolds, int count,
                                            const btContactSolverInfo& info) {
  btSequentialImpulseConstraintSolver::convertContacts(manifolds, count, info);
  const int friction_rows = info.m_solverMode & SOLVER_USE_2_FRICTION_DIRECTIONS ? 2 : 1;
  for (int i = 0; i < m_tmpSolverContactConstraintPool.size(); ++i) {
    btSolverConstraint& contact = m_tmpSolverContactConstraintPool[i];
    const auto& point = *static_cast<const btManifoldPoint*>(contact.m_originalContactPoint);
    if (point.m_partId1 != kFieldPart) continue;
    const auto cell = static_cast<std::size_t>(point.m_index1);
    const btVector3 rise(0, 0, field_.speed[cell]);
    move_with_surface(contact, point, rise, info);
    const btVector3 surface_velocity = rise + drag_at(cell, point.m_positionWorldOnB);
    for (int k = 0; k < friction_rows; ++k) {
      btSolverConstraint& friction = m_tmpSolverContactFrictionConstraintPool[contact.m_frictionIndex + k];
      friction.m_rhs += friction.m_contactNormal1.dot(surface_velocity) * friction.m_jacDiagABInv;
    }
  }
}

btVector3 SurfaceVelocitySolver::drag_at(std::size_t cell, const btVector3& point) const {
  if (!field_.drags()) return {0, 0, 0};
  const Eigen::Vector2f arm = Eigen::Vector2f(point.x(), point.y()) - field_.centre(static_cast<int>(cell));
  const float spin = field_.spin[cell];
  return {field_.drag_x[cell] - spin * arm.y(), field_.drag_y[cell] + spin * arm.x(), 0};
}

// Bullet set the row up for a field at rest: target velocity = rebound − relative speed − gap/dt. Two things change.
// The relative speed is against the moving surface. And a body that reaches the surface within this step rebounds
// in it, at full restitution: subtracting the gap as well would eat the bounce of every speculative contact.
void SurfaceVelocitySolver::move_with_surface(btSolverConstraint& contact, const btManifoldPoint& point,
                                              const btVector3& surface_velocity, const btContactSolverInfo& info) {
  const float along_normal = point.m_normalWorldOnB.dot(surface_velocity);
  float change = along_normal;
  if (point.m_combinedRestitution > 0.0F) {
    const btRigidBody* body = m_tmpSolverBodyPool[contact.m_solverBodyIdA].m_originalBody;
    const btVector3 arm = point.m_positionWorldOnA - body->getWorldTransform().getOrigin();
    const float at_rest = point.m_normalWorldOnB.dot(body->getVelocityInLocalPoint(arm));
    const float relative = at_rest - along_normal;
    const float gap = point.getDistance();
    const bool arrives = gap <= 0.0F || -relative * info.m_timeStep >= gap;
    const float bounce =
        arrives ? rebound(relative, point.m_combinedRestitution, info.m_restitutionVelocityThreshold) : 0.0F;
    change += bounce - rebound(at_rest, point.m_combinedRestitution, info.m_restitutionVelocityThreshold);
    if (bounce > 0.0F && gap > 0.0F) change += gap / info.m_timeStep;
  }
  contact.m_rhs += change * contact.m_jacDiagABInv;
}

}  // namespace smartsurf::world
