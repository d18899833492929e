// How bodies with joints respond to the blows of impacts.
#include "smartsurf/world/solver/JointSolver.h"

namespace smartsurf::world {

std::int32_t JointSolver::tree_of_moving(std::int32_t body) const {
  if (!indexed_) return -1;
  const auto i = static_cast<std::size_t>(index_of(body));
  if (i == bodies_.size() || bodies_[i].body != body || !bodies_[i].is_active) return -1;
  const std::int32_t tree = bodies_[i].tree;
  return tree_states_[tree].is_active ? tree : -1;
}

void JointSolver::respond(std::int32_t tree, std::span<const Blow> blows, std::vector<RowChange>& changes) {
  solve_blows(tree, blows);
  for (const std::int32_t i : bodies_of(equations_.trees()[tree])) {
    const Body& b = bodies_[i];
    if (!b.is_active) continue;
    const RowVector& change = equations_.of_body(i);
    const Vec3d momentum =
        tensor_of(b.principal, b.now.orientation, Vec3d(b.principal.moments)) * change.tail<3>();
    changes.push_back({b.body, b.row, change.head<3>().cast<float>(),
                       (b.start_inverse_inertia * (b.row_frame.conjugate() * momentum)).cast<float>()});
  }
}

void JointSolver::add_blows(std::int32_t tree, std::span<const Blow> blows) {
  solve_blows(tree, blows);
  for (const std::int32_t k : joints_of(equations_.trees()[tree])) {
    if (!blocks_[k].is_active) continue;
    Joint& j = joints_[k];
    const RowVector& impulse = equations_.of_joint(k);
    for (int r = 0; r < blocks_[k].rigid_rows; ++r)
      j.force_impulse += impulse[r] * blocks_[k].jacobian_a.row(r).head<3>().transpose();
    if (j.has_coordinate()) j.effort_impulse += impulse[kAxis];
  }
}

// For the responses of bodies and joints, in the equations.
void JointSolver::solve_blows(std::int32_t tree, std::span<const Blow> blows) {
  if (!tree_states_[tree].is_factored_for_blows) factor(tree, Axes::kLocked);
  const JointEquations::Tree& t = equations_.trees()[tree];
  for (const std::int32_t i : bodies_of(t)) equations_.of_body(i).setZero();
  for (const std::int32_t k : joints_of(t)) equations_.of_joint(k).setZero();
  for (const Blow& blow : blows) {
    const std::int32_t i = index_of(blow.body);
    const Vec3d impulse = blow.impulse.cast<double>();
    equations_.of_body(i).head<3>() += impulse;
    equations_.of_body(i).tail<3>() += bodies_[i].row_frame * blow.anchor.cast<double>().cross(impulse);
  }
  equations_.solve(tree);
}

}  // namespace smartsurf::world
