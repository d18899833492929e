#include "smartsurf/world/solver/JointSolver.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <ranges>
#include <span>
#include <utility>

#include "smartsurf/world/body/RotationKernels.h"
#include "smartsurf/world/solver/ContactLaw-inl.h"

namespace smartsurf::world {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr int kMaxSweeps = 8;
// The sweeps end when none changes a velocity by more than this, u/s.
constexpr double kConverged = 1e-7;
// Baumgarte factor and its speed limit, u/s: joints in loops, and joints and contacts together, can be
// over-constrained.
constexpr double kErrorReduction = 0.5, kMaxJointBiasSpeed = 4.0;

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

// The world tensor of the moments about the least, middle and greatest principal axis, or of their inverses.
Matrix3d tensor_of(const PrincipalInertia& p, const Quaterniond& orientation, const Vector3d& moments) {
  const Vector3d u = orientation * Vector3d(p.least_axis), v = orientation * Vector3d(p.greatest_axis);
  return moments[1] * Matrix3d::Identity() + (moments[0] - moments[1]) * u * u.transpose() +
         (moments[2] - moments[1]) * v * v.transpose();
}

// The first rows of a joint are the linear ones; see rigid_error().
int linear_rows(scene::JointKind kind) { return kind == scene::JointKind::kSlider ? 2 : 3; }

template <class Bodies>
auto active_bodies(Bodies& bodies) {
  return std::views::filter(bodies, [](const auto& b) { return b.is_active; });
}

}  // namespace

// ---- poses and errors

double JointSolver::coordinate_of(const Joint& j, const Pose& a, const Pose& b) {
  const Quatd frame_b = b.orientation * j.frame_b;
  if (j.kind == scene::JointKind::kSlider)
    return (frame_b * Vec3d::UnitZ())
        .dot(a.position + a.orientation * j.anchor_a - b.position - b.orientation * j.anchor_b);
  // The turns so far come from the last known angle.
  const Quatd q = frame_b.conjugate() * (a.orientation * j.frame_a);
  return j.coordinate + std::remainder(2.0 * std::atan2(q.z(), q.w()) - j.coordinate, 2.0 * std::numbers::pi);
}

// Linear rows first: along the world's axes, for a slider across its axis; then angular ones.
JointSolver::RowVector JointSolver::rigid_error(const Joint& j, const Pose& a, const Pose& b) {
  using scene::JointKind;
  const Vec3d d = a.position + a.orientation * j.anchor_a - b.position - b.orientation * j.anchor_b;
  const Quatd frame_a = a.orientation * j.frame_a, frame_b = b.orientation * j.frame_b;
  const Vec3d x = frame_b * Vec3d::UnitX(), y = frame_b * Vec3d::UnitY();
  auto turn = [&]() -> Vec3d {
    const Quatd q = frame_a * frame_b.conjugate();
    return q.vec() * (q.w() < 0.0 ? -2.0 : 2.0);
  };
  switch (j.kind) {
    case JointKind::kHinge: {
      const Vec3d tilt = (frame_b * Vec3d::UnitZ()).cross(frame_a * Vec3d::UnitZ());
      return (RowVector(5) << d, x.dot(tilt), y.dot(tilt)).finished();
    }
    case JointKind::kSlider:
      return (RowVector(5) << x.dot(d), y.dot(d), turn()).finished();
    case JointKind::kFixed:
      return (RowVector(6) << d, turn()).finished();
    case JointKind::kBall:
      break;
  }
  return d;
}

// The pose after `h_s` of free motion, to second order.
JointSolver::Pose JointSolver::predict(const Body& b, double h_s) {
  if (!b.is_active) return {b.position, b.orientation};
  const Vec3d acceleration = b.inverse_inertia * b.momentum.cross(b.angular_velocity);
  return {b.position + h_s * b.velocity,
          rotation_by(h_s * (b.angular_velocity + 0.5 * h_s * acceleration)) * b.orientation};
}

void JointSolver::build_rows(Block& block) {
  using scene::JointKind;
  Joint& j = joints_[block.joint];
  const Body &a = bodies_[block.a], &b = bodies_[block.b];
  const Pose pose_a{a.position, a.orientation}, pose_b{b.position, b.orientation};
  const Quatd frame_b = b.orientation * j.frame_b;
  const Vec3d x = frame_b * Vec3d::UnitX(), y = frame_b * Vec3d::UnitY(), z = frame_b * Vec3d::UnitZ();
  // Both bodies get their impulses at one point, so that the angular momentum is kept.
  const Vec3d arm_a = a.orientation * j.anchor_a, arm_b = a.position + arm_a - b.position;
  int count = 0;
  auto add_linear = [&](const Vec3d& n) { block.row[count++] = {n, arm_a.cross(n), arm_b.cross(n)}; };
  auto add_angular = [&](const Vec3d& n) { block.row[count++] = {Vec3d::Zero(), n, n}; };
  if (j.kind == JointKind::kSlider)
    add_linear(x), add_linear(y);
  else
    for (int i = 0; i < 3; ++i) add_linear(Vec3d::Unit(i));
  if (j.kind == JointKind::kHinge) add_angular(x), add_angular(y);
  if (j.kind == JointKind::kSlider || j.kind == JointKind::kFixed)
    for (int i = 0; i < 3; ++i) add_angular(Vec3d::Unit(i));
  block.row_count = count;
  block.axis =
      j.kind == JointKind::kSlider ? Row{z, arm_a.cross(z), arm_b.cross(z)} : Row{Vec3d::Zero(), z, z};

  auto coupling = [&](const Row& p, const Row& q) {
    return p.linear.dot(q.linear) * (a.inverse_mass + b.inverse_mass) +
           p.angular_a.dot(a.inverse_inertia * q.angular_a) +
           p.angular_b.dot(b.inverse_inertia * q.angular_b);
  };
  block.inverse_mass.resize(count, count);
  for (int r = 0; r < count; ++r)
    for (int c = 0; c <= r; ++c)
      block.inverse_mass(r, c) = block.inverse_mass(c, r) = coupling(block.row[r], block.row[c]);
  Eigen::LLT<Eigen::Ref<RowMatrix>> factor(block.inverse_mass);  // in place
  block.error = rigid_error(j, pose_a, pose_b);
  block.axis_mass = 0.0;
  if (j.kind != JointKind::kHinge && j.kind != JointKind::kSlider) return;
  RowVector across(count);
  for (int r = 0; r < count; ++r) across[r] = coupling(block.row[r], block.axis);
  block.axis_response = -factor.solve(across);
  block.axis_mass = 1.0 / (coupling(block.axis, block.axis) + across.dot(block.axis_response));
  j.coordinate = coordinate_of(j, pose_a, pose_b);
}

// ---- velocities

double JointSolver::velocity_along(const Row& row, const Block& block) const {
  const Body &a = bodies_[block.a], &b = bodies_[block.b];
  return row.linear.dot(a.velocity - b.velocity) + row.angular_a.dot(a.angular_velocity) -
         row.angular_b.dot(b.angular_velocity);
}

void JointSolver::apply(const Block& block, const Row& row, double impulse) {
  auto change = [](Body& body, const Vec3d& linear, const Vec3d& angular) {
    if (!body.is_active) return;
    const Vec3d velocity = body.inverse_mass * linear;
    body.velocity += velocity;
    body.velocity_change += velocity;
    body.momentum += angular;
    body.momentum_change += angular;
    body.angular_velocity += body.inverse_inertia * angular;
  };
  change(bodies_[block.a], impulse * row.linear, impulse * row.angular_a);
  change(bodies_[block.b], -impulse * row.linear, -impulse * row.angular_b);
}

void JointSolver::apply_rigid(const Block& block, Joint& j, const RowVector& impulse) {
  for (int r = 0; r < block.row_count; ++r) {
    j.rigid_impulse[r] += impulse[r];
    apply(block, block.row[r], impulse[r]);
  }
}

void JointSolver::apply_axis(const Block& block, Joint& j, double impulse, double& total) {
  total += impulse;
  apply(block, block.axis, impulse);
  apply_rigid(block, j, impulse * block.axis_response);
}

void JointSolver::load_velocities(const Rows& rows) {
  for (Body& b : active_bodies(bodies_)) {
    const BodyVelocity& row = rows.velocity[b.row];
    b.velocity = Vec3(row.velocity).cast<double>();
    b.momentum = b.start_inertia * Vec3(row.angular_velocity).cast<double>();
    b.angular_velocity = b.inverse_inertia * b.momentum;
    b.velocity_change = b.momentum_change = Vec3d::Zero();
  }
}

// The change is added to the start velocity as well, because the next substep repeats only what contacts add
// to that.
void JointSolver::store_velocities(const Rows& rows) {
  for (const Body& b : active_bodies(bodies_)) {
    const Vec3d angular = b.start_inverse_inertia * b.momentum_change;
    for (BodyVelocity* const v : {&rows.velocity[b.row], &rows.start_velocity[b.row]}) {
      Eigen::Map<Vec3>(v->velocity) += b.velocity_change.cast<float>();
      Eigen::Map<Vec3>(v->angular_velocity) += angular.cast<float>();
    }
  }
}

// ---- one step

void JointSolver::index_bodies() {
  bodies_.assign(1, Body());
  bodies_[0].start_inertia = bodies_[0].start_inverse_inertia = bodies_[0].inverse_inertia = Matrix3d::Zero();
  bodies_of_joint_.clear();
  std::vector<std::int32_t> jointed;
  for (const Joint& j : joints_)
    for (const std::int32_t body : {j.a, j.b})
      if (body >= 0) jointed.push_back(body);
  std::ranges::sort(jointed);
  jointed.erase(std::unique(jointed.begin(), jointed.end()), jointed.end());
  for (const std::int32_t body : jointed) {
    bodies_.push_back(bodies_[0]);
    bodies_.back().body = body;
  }
  auto index_of = [&](std::int32_t body) {
    if (body < 0) return 0;
    return static_cast<std::int32_t>(std::ranges::lower_bound(jointed, body) - jointed.begin()) + 1;
  };
  for (const Joint& j : joints_) bodies_of_joint_.push_back({index_of(j.a), index_of(j.b)});
  blocks_.reserve(joints_.size());
  indexed_ = true;
}

void JointSolver::begin_step(const BodyStore& bodies, const SpatialPartition& partition, const Rows& rows) {
  if (!indexed_) index_bodies();
  for (Body& b : std::span(bodies_).subspan(1)) {
    const std::int32_t i = b.body;
    b.row = partition.row(b.body);
    b.is_active = bodies.is_active(i);
    b.is_sphere = bodies.is_sphere[i];
    const Pose pose = pose_of(bodies, b.body);
    b.start_position = b.position = pose.position;
    b.start_orientation = b.orientation = pose.orientation;
    b.velocity = b.angular_velocity = b.momentum = Vec3d::Zero();
    b.inverse_mass = 0.0;
    b.inverse_inertia.setZero();
    if (!b.is_active) continue;
    b.inverse_mass = static_cast<double>(bodies.body_velocity[i].inverse_mass);
    b.principal = bodies.inertia[i];
    const Vec3d moments(b.principal.moments);
    b.start_inertia = tensor_of(b.principal, b.orientation, moments);
    b.inverse_inertia = b.start_inverse_inertia =
        tensor_of(b.principal, b.orientation, moments.cwiseInverse());
  }
  blocks_.clear();
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    const auto [a, b] = bodies_of_joint_[k];
    if (!bodies_[a].is_active && !bodies_[b].is_active) continue;
    Block& block = blocks_.emplace_back();
    block.joint = static_cast<std::int32_t>(k), block.a = a, block.b = b;
    joints_[k].force_impulse.setZero();
    joints_[k].effort_impulse = 0.0;
  }
  load_velocities(rows);
  for (Block& block : blocks_) build_rows(block);
}

// Calls visit(block) for the joints in order, then in reverse order, and so on, until the greatest change of
// a velocity that it returns is small for all.
template <class Visit>
void JointSolver::sweep(Visit visit) {
  for (int s = 0; s < kMaxSweeps; ++s) {
    double change = 0.0;
    for (std::size_t k = 0; k < blocks_.size(); ++k)
      change = std::max(change, visit(blocks_[s % 2 == 0 ? k : blocks_.size() - 1 - k]));
    if (!(change > kConverged)) return;
  }
}

// The coordinate's speed at the end of the last substep.
double JointSolver::speed_before(const Block& block, const BodyStore& bodies, const Rows& rows,
                                 const Substep& substep) const {
  auto velocity_of = [&](std::int32_t index) -> std::pair<Vec3d, Vec3d> {
    const Body& b = bodies_[index];
    if (!b.is_active) return {Vec3d::Zero(), Vec3d::Zero()};
    const surface::Wrench& w = bodies.wrench[b.body];
    const BodyVelocity& start = rows.start_velocity[b.row];
    const auto h = static_cast<double>(substep.h_s);
    const Vec3d momentum = b.start_inertia * Vec3(start.angular_velocity).cast<double>();
    return {Vec3(start.velocity).cast<double>() -
                h * (substep.gravity.cast<double>() + b.inverse_mass * w.force.cast<double>()),
            b.inverse_inertia * (momentum - h * w.torque.cast<double>())};
  };
  const auto [va, wa] = velocity_of(block.a);
  const auto [vb, wb] = velocity_of(block.b);
  return block.axis.linear.dot(va - vb) + block.axis.angular_a.dot(wa) - block.axis.angular_b.dot(wb);
}

void JointSolver::warm_start(Block& block) {
  Joint& j = joints_[block.joint];
  for (int r = 0; r < block.row_count; ++r) apply(block, block.row[r], j.rigid_impulse[r]);
  if (!(block.axis_mass > 0.0)) return;
  apply(block, block.axis, j.axis_impulse());
}

void JointSolver::solve(const BodyStore& bodies, const Rows& rows, const Substep& substep) {
  const auto h_s = static_cast<double>(substep.h_s);
  load_velocities(rows);
  for (Block& block : blocks_) {
    if (joints_[block.joint].has_spring) block.previous_speed = speed_before(block, bodies, rows, substep);
    block.target_error = block.error;
    const int linear = linear_rows(joints_[block.joint].kind);
    for (const auto& [first, count] : {std::pair{0, linear}, std::pair{linear, block.row_count - linear}}) {
      Vec3d correction = Vec3d::Zero();
      correction.head(count) = kErrorReduction * block.error.segment(first, count);
      block.target_error.segment(first, count) -=
          law::clamp_length(correction, kMaxJointBiasSpeed * h_s).head(count);
    }
  }
  for (Block& block : blocks_) warm_start(block);
  sweep([&](const Block& block) {
    const Joint& j = joints_[block.joint];
    const RowVector velocity =
        (rigid_error(j, predict(bodies_[block.a], h_s), predict(bodies_[block.b], h_s)) -
         block.target_error) /
        h_s;
    solve_rigid(block, velocity);
    double change = velocity.cwiseAbs().maxCoeff();
    if (block.axis_mass > 0.0) {
      const double before = velocity_along(block.axis, block);
      solve_spring(block, h_s);
      solve_motor_and_friction(block, h_s);
      solve_limits(block, h_s, true);
      change = std::max(change, std::abs(velocity_along(block.axis, block) - before));
    }
    return change;
  });
  store_velocities(rows);
}

void JointSolver::relax(const Rows& rows, const Substep& substep) {
  const auto h_s = static_cast<double>(substep.h_s);
  load_velocities(rows);
  rotate_bodies(rows, h_s);
  for (Block& block : blocks_) build_rows(block);
  sweep([&](const Block& block) {
    RowVector velocity(block.row_count);
    for (int r = 0; r < block.row_count; ++r) velocity[r] = velocity_along(block.row[r], block);
    solve_rigid(block, velocity);
    double change = velocity.cwiseAbs().maxCoeff();
    if (block.axis_mass > 0.0) {
      const double before = velocity_along(block.axis, block);
      solve_motor_and_friction(block, h_s);
      solve_limits(block, h_s, false);
      change = std::max(change, std::abs(velocity_along(block.axis, block) - before));
    }
    return change;
  });
  store_velocities(rows);
  for (const Block& block : blocks_) {
    Joint& j = joints_[block.joint];
    for (int r = 0; r < block.row_count; ++r) j.force_impulse += j.rigid_impulse[r] * block.row[r].linear;
    j.effort_impulse += j.axis_impulse();
  }
}

void JointSolver::find_strained(const BodyStore& bodies, float min_depth,
                                std::vector<DeepContact>& out) const {
  if (joints_.empty()) return;  // then blocks_ are those of an earlier step
  for (const Block& block : blocks_) {
    const Joint& j = joints_[block.joint];
    // An angular error is converted to a length at the body's bounding radius.
    const auto reach = static_cast<double>(bodies.bounding_radius[j.a]);
    const int linear = linear_rows(j.kind);
    double strain =
        std::max(block.error.head(linear).norm(), reach * block.error.tail(block.row_count - linear).norm());
    if (block.axis_mass > 0.0)
      strain = std::max(strain, (j.kind == scene::JointKind::kHinge ? reach : 1.0) *
                                    std::max(j.lower - j.coordinate, j.coordinate - j.upper));
    if (!(strain >= static_cast<double>(min_depth))) continue;
    for (const std::int32_t body : {j.a, j.b})
      if (body >= 0 && bodies.is_active(body)) out.push_back({body, static_cast<float>(strain), false});
  }
}

void JointSolver::solve_rigid(const Block& block, const RowVector& velocity) {
  RowVector impulse = -velocity;
  const auto lower = block.inverse_mass.triangularView<Eigen::Lower>();
  lower.solveInPlace(impulse);
  lower.transpose().solveInPlace(impulse);
  apply_rigid(block, joints_[block.joint], impulse);
}

// The mean of the spring's efforts at both ends of the substep, of which the later one depends on the new
// speed. The displacement is that of the start; see "Joints" in docs/engines.md.
void JointSolver::solve_spring(const Block& block, double h_s) {
  Joint& j = joints_[block.joint];
  if (!j.has_spring) return;
  const double speed = velocity_along(block.axis, block), before = block.previous_speed;
  const double elastic = 0.25 * h_s * h_s * j.spring.stiffness, viscous = 0.5 * h_s * j.spring.damping;
  const double wanted = -h_s * j.spring.stiffness * (j.coordinate - j.spring.rest) -
                        elastic * (speed - before) - viscous * (speed + before);
  apply_axis(block, j, (wanted - j.spring_impulse) / (1.0 + (elastic + viscous) / block.axis_mass),
             j.spring_impulse);
}

void JointSolver::solve_motor_and_friction(const Block& block, double h_s) {
  Joint& j = joints_[block.joint];
  auto drive = [&](double speed, double max_effort, double& total) {
    const double wanted = total + block.axis_mass * (speed - velocity_along(block.axis, block));
    apply_axis(block, j, std::clamp(wanted, -h_s * max_effort, h_s * max_effort) - total, total);
  };
  if (j.friction > 0.0) drive(0.0, j.friction, j.friction_impulse);
  if (j.has_motor) drive(j.motor.speed, j.motor.max_effort, j.motor_impulse);
}

void JointSolver::solve_limits(const Block& block, double h_s, bool with_bias) {
  Joint& j = joints_[block.joint];
  // `sign` is that of the direction in which the limit pushes.
  auto stop = [&](double room, double sign, double& total) {
    const double bias = with_bias ? std::min(-kErrorReduction * room / h_s, kMaxJointBiasSpeed) : 0.0;
    const double target = room > 0.0 ? -room / h_s : bias;
    const double speed = sign * velocity_along(block.axis, block);
    const double added = law::normal_impulse(total, block.axis_mass, speed, target) - total;
    total += added;
    double ignored = 0.0;
    apply_axis(block, j, sign * added, ignored);
  };
  if (std::isfinite(j.lower)) stop(j.coordinate - j.lower, 1.0, j.lower_impulse);
  if (std::isfinite(j.upper)) stop(j.upper - j.coordinate, -1.0, j.upper_impulse);
}

void JointSolver::rotate_bodies(const Rows& rows, double h_s) {
  RotationBatch batch;
  std::array<Body*, kLanes> in_batch;
  int count = 0;
  auto rotate_batch = [&] {
    if (count == 0) return;
    for (int lane = 0; lane < kLanes; ++lane) {
      const Body& b = *in_batch[std::min(lane, count - 1)];
      auto store_lane = [lane](auto& to, const auto& from) {
        for (int k = 0; k < std::ssize(to); ++k) to[k][lane] = from[k];
      };
      store_lane(batch.least_axis, b.principal.least_axis);
      store_lane(batch.greatest_axis, b.principal.greatest_axis);
      store_lane(batch.moments, b.principal.moments);
      store_lane(batch.rotation, Vec3d(b.angular_velocity * h_s));
      store_lane(batch.angular_velocity_change, Vec3d(Vec3d::Zero()));
      store_lane(batch.previous_x_axis, Vec3d(Vec3d::UnitX()));
      store_lane(batch.orientation, b.orientation.coeffs());
      store_lane(batch.momentum, b.momentum);
      store_lane(batch.angular_velocity, b.angular_velocity);
      batch.free_time[lane] = h_s;
      batch.is_axisymmetric[lane] = 0.0;
    }
    integrate_rotation(batch);
    for (int lane = 0; lane < count; ++lane) {
      Body& b = *in_batch[lane];
      for (int k = 0; k < 4; ++k) b.orientation.coeffs()[k] = batch.orientation[k][lane];
      auto entry = [&](int k) { return batch.world_inverse_inertia[k][lane]; };
      b.inverse_inertia << entry(0), entry(3), entry(4), entry(3), entry(1), entry(5), entry(4), entry(5),
          entry(2);
    }
    count = 0;
  };
  for (Body& b : active_bodies(bodies_)) {
    if (b.is_sphere) {
      b.orientation = (rotation_by(h_s * b.angular_velocity) * b.orientation).normalized();
      continue;
    }
    in_batch[count++] = &b;
    if (count == kLanes) rotate_batch();
  }
  rotate_batch();
  for (Body& b : active_bodies(bodies_)) {
    DeltaPose& delta = rows.delta_pose[b.row];
    Eigen::Map<Vec3>(delta.rotation) =
        rotation_vector_of(b.orientation * b.start_orientation.conjugate()).cast<float>();
    b.position = b.start_position + Vec3(delta.translation).cast<double>();
    b.angular_velocity = b.inverse_inertia * b.momentum;
  }
}

}  // namespace smartsurf::world
