// Bullet's sequential-impulse solver with Coulomb's cone instead of a pyramid, a rolling resistance that is
// proportional to the load, and cells of limited force.
#pragma once

#include <btBulletDynamicsCommon.h>

#include <utility>
#include <vector>

namespace smartsurf::world {

// Referred to by a contact point's m_userPersistentData during a step.
struct ContactDetail {
  double rolling_friction = 0.0;  // lever arm, u
  int limited_cell = -1;          // index for set_cell_limits(); −1: no limit
};

ATTRIBUTE_ALIGNED16(class) ConeFrictionSolver final : public btSequentialImpulseConstraintSolver {
 public:
  BT_DECLARE_ALIGNED_ALLOCATOR();

  // The greatest vertical impulse on the cell in a step, mass·u/s: bounds the sum over all its contacts.
  void set_cell_limits(std::vector<double> limits) { cell_limits_ = std::move(limits); }
  // The vertical impulse on each limited cell in the last step.
  const std::vector<double>& cell_loads() const { return cell_loads_; }
  void clear_cell_loads() { cell_loads_.assign(cell_limits_.size(), 0.0); }

 protected:
  btScalar solveGroupCacheFriendlySetup(btCollisionObject * *bodies, int body_count,
                                        btPersistentManifold** manifolds, int manifold_count,
                                        btTypedConstraint** constraints, int constraint_count,
                                        const btContactSolverInfo& info, btIDebugDraw* draw) override;
  btScalar solveSingleIteration(int iteration, btCollisionObject** bodies, int body_count,
                                btPersistentManifold** manifolds, int manifold_count,
                                btTypedConstraint** constraints, int constraint_count,
                                const btContactSolverInfo& info, btIDebugDraw* draw) override;

 private:
  btScalar solve_normal(const btSolverConstraint& row);
  btScalar solve_friction(const btSolverConstraint& contact);
  void solve_rolling(int row_index, const btSolverConstraint& contact, double lever);

  std::vector<double> cell_limits_, cell_loads_;
  std::vector<btVector3> rolling_impulses_;  // one per contact row
};

}  // namespace smartsurf::world
