#include "smartsurf/world/bullet/ConeFrictionSolver.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartsurf/world/solver/ContactLaw-inl.h"

namespace smartsurf::world {
namespace {

const btManifoldPoint& point_of(const btSolverConstraint& row) {
  return *static_cast<const btManifoldPoint*>(row.m_originalContactPoint);
}

const ContactDetail& detail_of(const btSolverConstraint& row) {
  return *static_cast<const ContactDetail*>(point_of(row).m_userPersistentData);
}

btMatrix3x3 inverse_inertia(const btSolverBody& body) {
  if (body.m_originalBody && body.m_originalBody->getInvMass() > 0.0)
    return body.m_originalBody->getInvInertiaTensorWorld();
  return {0, 0, 0, 0, 0, 0, 0, 0, 0};
}

btVector3 angular_velocity(btSolverBody& body) {
  return body.m_angularVelocity + body.m_externalTorqueImpulse + body.internalGetDeltaAngularVelocity();
}

// An upper bound of the greatest eigenvalue.
double row_sum_norm(const btMatrix3x3& m) {
  double norm = 0.0;
  for (int i = 0; i < 3; ++i)
    norm = std::max(norm, std::abs(m[i][0]) + std::abs(m[i][1]) + std::abs(m[i][2]));
  return norm;
}

}  // namespace

btScalar ConeFrictionSolver::solveGroupCacheFriendlySetup(btCollisionObject** bodies, int body_count,
                                                          btPersistentManifold** manifolds,
                                                          int manifold_count, btTypedConstraint** constraints,
                                                          int constraint_count,
                                                          const btContactSolverInfo& info,
                                                          btIDebugDraw* draw) {
  const btScalar result = btSequentialImpulseConstraintSolver::solveGroupCacheFriendlySetup(
      bodies, body_count, manifolds, manifold_count, constraints, constraint_count, info, draw);
  rolling_impulses_.assign(m_tmpSolverContactConstraintPool.size(), btVector3(0, 0, 0));
  for (int i = 0; i < m_tmpSolverContactConstraintPool.size(); ++i) {
    const btSolverConstraint& row = m_tmpSolverContactConstraintPool[i];
    const int cell = detail_of(row).limited_cell;
    if (cell >= 0)
      cell_loads_[cell] += static_cast<double>(row.m_appliedImpulse) * std::abs(row.m_contactNormal1.z());
  }
  return result;
}

// Contacts on one limited cell share its limit: each may take what the others leave.
btScalar ConeFrictionSolver::solve_normal(const btSolverConstraint& row) {
  btSolverBody& a = m_tmpSolverBodyPool[row.m_solverBodyIdA];
  btSolverBody& b = m_tmpSolverBodyPool[row.m_solverBodyIdB];
  const int cell = detail_of(row).limited_cell;
  if (cell < 0) return m_resolveSingleConstraintRowGeneric(a, b, row);
  const double vertical = std::abs(row.m_contactNormal1.z());
  double& load = cell_loads_[cell];
  const double before = row.m_appliedImpulse;
  btSolverConstraint limited = row;
  limited.m_upperLimit = std::max(0.0, (cell_limits_[cell] - (load - before * vertical)) / vertical);
  const btScalar residual = m_resolveSingleConstraintRowGeneric(a, b, limited);
  row.m_appliedImpulse = limited.m_appliedImpulse;
  load += (static_cast<double>(row.m_appliedImpulse) - before) * vertical;
  return residual;
}

btScalar ConeFrictionSolver::solve_friction(const btSolverConstraint& contact) {
  const btSolverConstraint& u = m_tmpSolverContactFrictionConstraintPool[contact.m_frictionIndex];
  const btSolverConstraint& v = m_tmpSolverContactFrictionConstraintPool[contact.m_frictionIndex + 1];
  btSolverBody& a = m_tmpSolverBodyPool[contact.m_solverBodyIdA];
  btSolverBody& b = m_tmpSolverBodyPool[contact.m_solverBodyIdB];
  btScalar residual = 0.0;
  for (const btSolverConstraint* row : {&u, &v}) {
    btSolverConstraint free = *row;
    free.m_lowerLimit = -std::numeric_limits<btScalar>::max();
    free.m_upperLimit = std::numeric_limits<btScalar>::max();
    residual = std::max(residual, std::abs(m_resolveSingleConstraintRowGeneric(a, b, free)));
    row->m_appliedImpulse = free.m_appliedImpulse;
  }
  const double limit = u.m_friction * static_cast<double>(contact.m_appliedImpulse);
  const double length =
      std::hypot(static_cast<double>(u.m_appliedImpulse), static_cast<double>(v.m_appliedImpulse));
  if (length <= limit) return residual;
  const double scale = law::cone_scale(length, limit);
  for (const btSolverConstraint* row : {&u, &v}) {
    const double impulse = scale * static_cast<double>(row->m_appliedImpulse);
    const double change = impulse - static_cast<double>(row->m_appliedImpulse);
    a.internalApplyImpulse(row->m_contactNormal1 * a.internalGetInvMass(), row->m_angularComponentA, change);
    b.internalApplyImpulse(row->m_contactNormal2 * b.internalGetInvMass(), row->m_angularComponentB, change);
    row->m_appliedImpulse = impulse;
  }
  return 0.0;  // slides: the unbounded impulse says nothing about convergence
}

void ConeFrictionSolver::solve_rolling(int row_index, const btSolverConstraint& contact, double lever) {
  btSolverBody& a = m_tmpSolverBodyPool[contact.m_solverBodyIdA];
  btSolverBody& b = m_tmpSolverBodyPool[contact.m_solverBodyIdB];
  const btMatrix3x3 inverse_a = inverse_inertia(a), inverse_b = inverse_inertia(b);
  const double k = row_sum_norm(inverse_a + inverse_b);
  if (k == 0.0) return;
  btVector3& impulse = rolling_impulses_[row_index];
  const btVector3 old_impulse = impulse;
  impulse = law::friction_impulse(old_impulse, angular_velocity(a) - angular_velocity(b), 1.0 / k,
                                  lever * static_cast<double>(contact.m_appliedImpulse));
  const btVector3 change = impulse - old_impulse;
  a.internalGetDeltaAngularVelocity() += inverse_a * change;
  b.internalGetDeltaAngularVelocity() -= inverse_b * change;
}

btScalar ConeFrictionSolver::solveSingleIteration(int iteration, btCollisionObject**, int,
                                                  btPersistentManifold**, int, btTypedConstraint**, int,
                                                  const btContactSolverInfo&, btIDebugDraw*) {
  btScalar residual = 0.0;
  for (int i = 0; i < m_tmpSolverNonContactConstraintPool.size(); ++i) {
    const btSolverConstraint& row = m_tmpSolverNonContactConstraintPool[i];
    if (iteration >= row.m_overrideNumSolverIterations) continue;
    residual = std::max(residual, std::abs(m_resolveSingleConstraintRowGeneric(
                                      m_tmpSolverBodyPool[row.m_solverBodyIdA],
                                      m_tmpSolverBodyPool[row.m_solverBodyIdB], row)));
  }
  for (int i = 0; i < m_tmpSolverContactConstraintPool.size(); ++i) {
    const btSolverConstraint& row = m_tmpSolverContactConstraintPool[i];
    residual = std::max(residual, std::abs(solve_normal(row)));
    residual = std::max(residual, solve_friction(row));
    if (const double lever = detail_of(row).rolling_friction; lever > 0.0) solve_rolling(i, row, lever);
  }
  return residual * residual;
}

}  // namespace smartsurf::world
