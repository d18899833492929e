// The motion of bodies with joints within a step, and back.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "smartsurf/world/body/RotationKernels.h"
#include "smartsurf/world/solver/JointSolver.h"

namespace smartsurf::world {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

Quaterniond rotation_by(const Vector3d& vector) {
  const double angle = vector.norm();
  if (!(angle > 0.0)) return Quaterniond::Identity();
  Quaterniond q;
  q.w() = std::cos(0.5 * angle);
  q.vec() = vector * (std::sin(0.5 * angle) / angle);
  return q;
}

// The rotation must be less than half a turn.
Vector3d rotation_vector_of(const Quaterniond& q) {
  const double sign = q.w() < 0.0 ? -1.0 : 1.0, sine = q.vec().norm();
  if (!(sine > 0.0)) return Vector3d::Zero();
  return q.vec() * (sign * 2.0 * std::atan2(sine, std::abs(q.w())) / sine);
}

}  // namespace

// Where the present velocities lead the bodies of open trees.
void JointSolver::predict(IndexRange trees) {
  RotationBatch batch;
  std::array<Body*, kLanes> in_batch;
  std::array<double, kLanes> time;
  int count = 0;
  auto rotate_batch = [&] {
    if (count == 0) return;
    for (int lane = 0; lane < kLanes; ++lane) {
      const int source = std::min(lane, count - 1);
      const Body& b = *in_batch[source];
      auto store_lane = [lane](auto& to, const auto& from) {
        for (int k = 0; k < std::ssize(to); ++k) to[k][lane] = from[k];
      };
      store_lane(batch.least_axis, b.principal.least_axis);
      store_lane(batch.greatest_axis, b.principal.greatest_axis);
      store_lane(batch.moments, b.principal.moments);
      store_lane(batch.rotation, Vec3d(b.angular_velocity * time[source]));
      store_lane(batch.angular_velocity_change, Vec3d(Vec3d::Zero()));
      store_lane(batch.previous_x_axis, Vec3d(Vec3d::UnitX()));
      store_lane(batch.orientation, b.now.orientation.coeffs());
      store_lane(batch.momentum, b.momentum);
      store_lane(batch.angular_velocity, b.angular_velocity);
      batch.free_time[lane] = time[source];
      batch.is_axisymmetric[lane] = batch.slenderness[lane] = 0.0;
    }
    integrate_rotation(batch);
    for (int lane = 0; lane < count; ++lane) {
      Body& b = *in_batch[lane];
      for (int k = 0; k < 4; ++k) b.next.orientation.coeffs()[k] = batch.orientation[k][lane];
      auto entry = [&](int k) { return batch.world_inverse_inertia[k][lane]; };
      b.next_inverse_inertia << entry(0), entry(3), entry(4), entry(3), entry(1), entry(5), entry(4),
          entry(5), entry(2);
    }
    count = 0;
  };
  for (int t = trees.begin; t < trees.end; ++t) {
    if (!tree_states_[t].is_open()) continue;
    const double h_s = tree_states_[t].h_s;
    for (const std::int32_t i : bodies_of(equations_.trees()[t])) {
      Body& b = bodies_[i];
      if (!b.is_active) continue;
      b.next.position = b.now.position + h_s * b.velocity;
      if (b.is_sphere) {
        b.next.orientation = (rotation_by(h_s * b.angular_velocity) * b.now.orientation).normalized();
        b.next_inverse_inertia = b.inverse_inertia;
        continue;
      }
      in_batch[count] = &b, time[count++] = h_s;
      if (count == kLanes) rotate_batch();
    }
  }
  rotate_batch();
}

// Moves the bodies along their velocities.
void JointSolver::move_bodies(const Rows& rows, IndexRange trees) {
  for (TreeState& s : states_of(trees)) s.open();
  predict(trees);
  for (int t = trees.begin; t < trees.end; ++t) {
    TreeState& s = tree_states_[t];
    if (!s.is_selected()) continue;
    s.is_factored = s.is_factored_for_blows = false;
    for (const std::int32_t i : bodies_of(equations_.trees()[t])) {
      Body& b = bodies_[i];
      if (!b.is_active) continue;
      b.now = b.next;
      b.inverse_inertia = b.next_inverse_inertia;
      b.angular_velocity = b.inverse_inertia * b.momentum;
      store_motion(b.start, b.now, rows.delta_pose[b.row]);
    }
  }
}

void JointSolver::store_motion(const Pose& from, const Pose& to, DeltaPose& delta) {
  Eigen::Map<Vec3>(delta.translation) = Vec3d(to.position - from.position).cast<float>();
  Eigen::Map<Vec3>(delta.rotation) =
      rotation_vector_of(to.orientation * from.orientation.conjugate()).cast<float>();
}

void JointSolver::end_early(std::int32_t body, float fraction) {
  TreeState& s = tree_states_[bodies_[index_of(body)].tree];
  s.kept = std::min(s.kept, static_cast<std::int32_t>(fraction * static_cast<float>(s.substep)));
}

void JointSolver::end_motion(const BodyStore& bodies, const Rows& rows, const Substep& substep) {
  for (std::size_t t = 0; t < tree_states_.size(); ++t) {
    const TreeState& s = tree_states_[t];
    if (!s.is_active) continue;
    const bool stands = s.kept == 0;
    bool stood = false;
    for (const std::int32_t k : joints_of(equations_.trees()[t]))
      stood |= std::exchange(joints_[k].stood, stands);
    load_velocities(rows, {static_cast<int>(t), static_cast<int>(t) + 1});
    const auto members = bodies_of(equations_.trees()[t]);
    const auto end_of = [&](std::int32_t i) -> const Pose& {
      if (s.kept == 0 || !bodies_[i].is_active) return bodies_[i].start;
      return path_[(s.kept - 1) * bodies_.size() + i];
    };
    double work = 0.0, energy = 0.0;  // of forces on the rest of the way; of the motion
    for (const std::int32_t i : members) {
      const Body& b = bodies_[i];
      if (!b.is_active) continue;
      const surface::Wrench& w = bodies.wrench[b.body];
      const Vec3d force = substep.gravity.cast<double>() / b.inverse_mass + w.force.cast<double>();
      work += force.dot(b.now.position - end_of(i).position);
      work += w.torque.cast<double>().dot(
          rotation_vector_of(b.now.orientation * end_of(i).orientation.conjugate()));
      energy += 0.5 * (b.velocity.squaredNorm() / b.inverse_mass + b.momentum.dot(b.angular_velocity));
    }
    for (const std::int32_t k : joints_of(equations_.trees()[t])) {
      Joint& j = joints_[k];
      const Block& block = blocks_[k];
      if (!block.is_active || !j.has_coordinate()) continue;
      const double after = j.coordinate - j.spring.rest;
      j.coordinate = coordinate_of(j, end_of(block.a), end_of(block.b));
      const double before = j.coordinate - j.spring.rest;
      if (j.has_spring) work += 0.5 * j.spring.stiffness * (before * before - after * after);
    }
    // Contacts and joints that leave a tree a velocity with which it cannot move are at odds: it would hang
    // in the air for ever.
    constexpr double kBrake = 0.5;
    const double scale =
        (work > 0.0 ? std::sqrt(std::max(0.0, 1.0 - work / energy)) : 1.0) * (stands && stood ? kBrake : 1.0);
    for (const std::int32_t i : members) {
      const Body& b = bodies_[i];
      if (!b.is_active) continue;
      const Quatd back = end_of(i).orientation * b.now.orientation.conjugate();
      BodyVelocity& row = rows.velocity[b.row];
      Eigen::Map<Vec3>(row.velocity) = Vec3d(scale * b.velocity).cast<float>();
      Eigen::Map<Vec3>(row.angular_velocity) =
          Vec3d(scale * (b.start_inverse_inertia * (back * b.momentum))).cast<float>();
      store_motion(b.start, end_of(i), rows.delta_pose[b.row]);
    }
  }
}

}  // namespace smartsurf::world
