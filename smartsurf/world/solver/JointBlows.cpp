// How bodies with joints respond to the blows of impacts.
#include <cmath>
#include <utility>

#include "smartsurf/world/solver/JointSolver.h"

namespace smartsurf::world {

std::int32_t JointSolver::tree_of_moving(std::int32_t body) const {
  if (!indexed_) return -1;
  const auto i = static_cast<std::size_t>(index_of(body));
  if (i == bodies_.size() || bodies_[i].body != body || !bodies_[i].is_active) return -1;
  const std::int32_t tree = bodies_[i].tree;
  return tree_states_[tree].is_active ? tree : -1;
}

JointSolver::Blow JointSolver::blow_at(std::int32_t body, const Vec3& anchor, const Vec3& impulse) const {
  const Vec3d vector = impulse.cast<double>();
  return {body, vector, bodies_[index_of(body)].row_frame * anchor.cast<double>().cross(vector)};
}

std::span<const JointSolver::Blow> JointSolver::blows_of(const Stop& stop, float impulse) {
  const Block& block = blocks_[stop.joint];
  const double along = way_off_limit(joints_[stop.joint]) * static_cast<double>(impulse);
  blows_.clear();
  for (const auto& [i, jacobian] :
       {std::pair(block.a, &block.jacobian_a), std::pair(block.b, &block.jacobian_b)})
    if (bodies_[i].is_active)
      blows_.push_back(
          {bodies_[i].body, along * jacobian->row(kAxis).head<3>(), along * jacobian->row(kAxis).tail<3>()});
  return blows_;
}

void JointSolver::find_stops(std::int32_t tree, std::vector<Stop>& stops) const {
  for (const std::int32_t k : joints_of(equations_.trees()[tree])) {
    const Joint& j = joints_[k];
    const Block& block = blocks_[k];
    if (!block.is_active || !j.has_coordinate() || j.is_locked() || !std::isfinite(room_of(j))) continue;
    Stop stop{k, tree, -1, -1, {}, {}, Vec3::Zero(), static_cast<float>(room_of(j))};
    for (const auto& [i, jacobian] :
         {std::pair(block.a, &block.jacobian_a), std::pair(block.b, &block.jacobian_b)}) {
      const Body& body = bodies_[i];
      if (!body.is_active) continue;
      const RowVector row = way_off_limit(j) * jacobian->row(kAxis).transpose();
      const Vec3 turn =
          (body.start_inertia * (body.row_frame.conjugate() * (body.inverse_inertia * row.tail<3>())))
              .cast<float>();
      if (stop.a < 0)
        stop.a = body.body, stop.linear = row.head<3>().cast<float>(), stop.turn_a = turn;
      else
        stop.b = body.body, stop.turn_b = -turn;
    }
    stops.push_back(stop);
  }
}

void JointSolver::add_stop(const Stop& stop, float impulse) {
  add_blows(stop.tree, blows_of(stop, impulse));
  Joint& j = joints_[stop.joint];
  j.effort_impulse += way_off_limit(j) * static_cast<double>(impulse);
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
    RowVector& on_body = equations_.of_body(index_of(blow.body));
    on_body.head<3>() += blow.impulse;
    on_body.tail<3>() += blow.moment;
  }
  equations_.solve(tree);
}

}  // namespace smartsurf::world
