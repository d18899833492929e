#include "smartsurf/world/solver/JointSolver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

#include "smartsurf/scene/Axes.h"
#include "smartsurf/world/solver/ContactLaw-inl.h"
#include "smartsurf/world/solver/SpeedLimits.h"

namespace smartsurf::world {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

// A part of a substep is halved, down to kMinPart of the substep, when joints and contacts change how far a
// body turns in it by more than kMaxTurnChange_rad, or when a body turns by more than kMaxUnsolvedTurn_rad
// and a speed is off by more than kMaxResidual_ups: the whip of a chain's end.
constexpr double kMaxTurnChange_rad = 0.003, kMaxUnsolvedTurn_rad = 0.05, kMaxResidual_ups = 1e-6,
                 kMinPart = 1.0 / 64;
// Rounds of Newton's method in a stage; the first kFreeRounds may change the segments of all axes, later ones
// of one. A stage ends when no speed is off by more than kConverged, u/s, or when a round reduces the
// residual by less than a tenth: a loop can contradict itself.
constexpr int kMaxRounds = 24, kFreeRounds = 16;
constexpr double kConverged = 1e-8, kStagnation = 0.9;
// Compliance of a held row, relative to what its two bodies give way by. The rows of a loop can depend on
// each other; the rounds take out what it lets through.
constexpr double kCompliance = 1e-12, kLoopCompliance = 1e-6;
// Baumgarte factor. Its speed has a limit because joints in loops, and joints and contacts together, can be
// over-constrained.
constexpr double kErrorReduction = 0.5;
// Corrections up to this speed, u/s, are solved together with the motion. Where a loop is stretched out, a
// small error takes a great speed, which must not remain.
constexpr double kSlowCorrection = 1e-3;

// The first rows of a joint are the linear ones; see rigid_error().
int linear_rows(scene::JointKind kind) { return kind == scene::JointKind::kSlider ? 2 : 3; }

// The speed at which a coordinate returns to a limit that it has passed.
double correction_speed(double room, double h_s) {
  return std::min(-kErrorReduction * room / h_s, kMaxJointCorrectionSpeed);
}

double compliance_of(const JointEquations::Tree& tree) {
  return tree.has_loop ? kLoopCompliance : kCompliance;
}

}  // namespace

Matrix3d JointSolver::tensor_of(const PrincipalInertia& p, const Quatd& orientation, const Vec3d& moments) {
  const Vec3d u = orientation * Vec3d(p.least_axis), v = orientation * Vec3d(p.greatest_axis);
  return moments[1] * Matrix3d::Identity() + (moments[0] - moments[1]) * u * u.transpose() +
         (moments[2] - moments[1]) * v * v.transpose();
}

// ---- poses and errors

double JointSolver::coordinate_of(const Joint& j, const Pose& a, const Pose& b, double turn) {
  const Quatd frame_b = b.orientation * j.frame_b;
  if (j.kind == scene::JointKind::kSlider)
    return (frame_b * Vec3d::UnitZ())
        .dot(a.position + a.orientation * j.anchor_a - b.position - b.orientation * j.anchor_b);
  // The turns so far come from the last known angle and, where that is too far away, from the speed.
  constexpr double kFastTurn_rad = 0.5 * std::numbers::pi;
  const double expected = std::abs(turn) < kFastTurn_rad ? j.coordinate : j.coordinate + turn;
  const Quatd q = frame_b.conjugate() * (a.orientation * j.frame_a);
  return expected + std::remainder(2.0 * std::atan2(q.z(), q.w()) - expected, 2.0 * std::numbers::pi);
}

// Linear rows first: along the world's axes, for a slider across its axis; then angular ones.
JointSolver::RowVector JointSolver::rigid_error(const Joint& j, const Quatd& own_frame_a,
                                                const Vec3d& anchor_b, const Pose& a, const Pose& b) {
  using scene::JointKind;
  const Vec3d d = a.position + a.orientation * j.anchor_a - b.position - b.orientation * anchor_b;
  const Quatd frame_a = a.orientation * own_frame_a, frame_b = b.orientation * j.frame_b;
  const Vec3d x = frame_b * Vec3d::UnitX(), y = frame_b * Vec3d::UnitY();
  auto turn = [&]() -> Vec3d {
    const Quatd q = frame_a * frame_b.conjugate();
    return q.vec() * (q.w() < 0.0 ? -2.0 : 2.0);
  };
  RowVector error = RowVector::Zero();
  switch (j.kind) {
    case JointKind::kHinge: {
      const Vec3d axis_a = frame_a * Vec3d::UnitZ(), axis_b = frame_b * Vec3d::UnitZ();
      // Beyond a right angle the cross product decreases again.
      const Vec3d tilt = axis_a.dot(axis_b) >= 0.0
                             ? axis_b.cross(axis_a)
                             : Vec3d(2.0 * scene::rotation_between(axis_b, axis_a).vec());
      error.head<5>() << d, x.dot(tilt), y.dot(tilt);
      break;
    }
    case JointKind::kSlider:
      error.head<5>() << x.dot(d), y.dot(d), turn();
      break;
    case JointKind::kFixed:
      error << d, turn();
      break;
    case JointKind::kBall:
      error.head<3>() = d;
      break;
  }
  return error;
}

// `elapsed_s`: since they were built last.
void JointSolver::build_rows(Joint& j, Block& block, double elapsed_s) {
  using scene::JointKind;
  const Body &a = bodies_[block.a], &b = bodies_[block.b];
  const Quatd frame_b = b.now.orientation * j.frame_b;
  const Vec3d x = frame_b * Vec3d::UnitX(), y = frame_b * Vec3d::UnitY(), z = frame_b * Vec3d::UnitZ();
  // Both bodies get their impulses at one point, so that the angular momentum is kept.
  const Vec3d arm_a = a.now.orientation * j.anchor_a, arm_b = a.now.position + arm_a - b.now.position;
  int count = 0;
  auto add = [&](const Vec3d& linear, const Vec3d& angular_a, const Vec3d& angular_b) {
    block.jacobian_a.row(count) << linear.transpose(), angular_a.transpose();
    block.jacobian_b.row(count) << -linear.transpose(), -angular_b.transpose();
    ++count;
  };
  auto add_linear = [&](const Vec3d& n) { add(n, arm_a.cross(n), arm_b.cross(n)); };
  auto add_angular = [&](const Vec3d& n) { add(Vec3d::Zero(), n, n); };
  if (j.kind == JointKind::kSlider)
    add_linear(x), add_linear(y);
  else
    for (int i = 0; i < 3; ++i) add_linear(Vec3d::Unit(i));
  if (j.kind == JointKind::kHinge) add_angular(x), add_angular(y);
  if (j.kind == JointKind::kSlider || j.kind == JointKind::kFixed)
    for (int i = 0; i < 3; ++i) add_angular(Vec3d::Unit(i));
  block.rigid_rows = count;
  block.error = rigid_error(j, a.now, b.now);
  if (j.kind == JointKind::kSlider) add_linear(z);
  if (j.kind == JointKind::kHinge) add_angular(z);
  for (; count < kRows; ++count) block.jacobian_a.row(count).setZero(), block.jacobian_b.row(count).setZero();
  for (int r = 0; r < kRows; ++r) {
    const auto row_a = block.jacobian_a.row(r), row_b = block.jacobian_b.row(r);
    block.response[r] = a.inverse_mass * row_a.head<3>().squaredNorm() +
                        row_a.tail<3>().dot(a.inverse_inertia * row_a.tail<3>().transpose()) +
                        b.inverse_mass * row_b.head<3>().squaredNorm() +
                        row_b.tail<3>().dot(b.inverse_inertia * row_b.tail<3>().transpose());
  }
  if (j.has_coordinate())
    j.coordinate = coordinate_of(j, a.now, b.now, elapsed_s * z.dot(a.angular_velocity - b.angular_velocity));
}

// ---- velocities

// Along the rows.
JointSolver::RowVector JointSolver::speeds(const Block& block) const {
  auto twist = [](const Body& b) { return (RowVector() << b.velocity, b.angular_velocity).finished(); };
  return block.jacobian_a * twist(bodies_[block.a]) + block.jacobian_b * twist(bodies_[block.b]);
}

void JointSolver::apply(Block& block, const RowVector& impulse) {
  block.impulse += impulse;
  auto change = [](Body& body, const RowVector& wrench) {
    if (!body.is_active) return;
    body.velocity += body.inverse_mass * wrench.head<3>();
    body.momentum += wrench.tail<3>();
    body.angular_velocity = body.inverse_inertia * body.momentum;
  };
  change(bodies_[block.a], block.jacobian_a.transpose() * impulse);
  change(bodies_[block.b], block.jacobian_b.transpose() * impulse);
}

void JointSolver::load_velocities(const Rows& rows, IndexRange trees) {
  for_each_body(trees, [&](Body& b) {
    if (!b.is_active) return;
    const BodyVelocity& row = rows.velocity[b.row];
    b.velocity = Vec3(row.velocity).cast<double>();
    b.momentum = b.row_frame * (b.start_inertia * Vec3(row.angular_velocity).cast<double>());
    b.angular_velocity = b.inverse_inertia * b.momentum;
  });
}

// The change is added to the start velocity as well, because the next substep repeats only what contacts add
// to that.
void JointSolver::store_velocities(const Rows& rows, IndexRange trees) {
  for_each_body(trees, [&](Body& b) {
    if (!b.is_active) return;
    const BodyVelocity& row = rows.velocity[b.row];
    const Vec3 linear = Vec3d(b.velocity - Vec3(row.velocity).cast<double>()).cast<float>(),
               angular = Vec3d(b.start_inverse_inertia * (b.row_frame.conjugate() * b.momentum) -
                               Vec3(row.angular_velocity).cast<double>())
                             .cast<float>();
    for (BodyVelocity* const v : {&rows.velocity[b.row], &rows.start_velocity[b.row]}) {
      Eigen::Map<Vec3>(v->velocity) += linear;
      Eigen::Map<Vec3>(v->angular_velocity) += angular;
    }
  });
}

// Call once the bodies have moved.
void JointSolver::turn_row_frames(IndexRange trees) {
  for_each_body(trees, [](Body& b) {
    if (b.is_active) b.row_frame = turned_frame(b);
  });
}

// The least rotation that takes the axis of a slender body from the start of the step to the present pose.
JointSolver::Quatd JointSolver::turned_frame(const Body& b) {
  const double slenderness = b.principal.slenderness();
  if (slenderness == 0.0) return Quatd::Identity();
  const Vec3d axis(b.principal.least_axis);
  return Quatd::Identity().slerp(
      slenderness, scene::rotation_between(b.start.orientation * axis, b.now.orientation * axis));
}

// ---- the segments of the axes

// `spring`: its impulse at speed 0, from which `slope` is taken per speed.
void JointSolver::set_law(Joint& j, Block& block, Stage stage, double h_s, double spring, double slope) {
  constexpr double kUnbounded = std::numeric_limits<double>::infinity();
  // The trapezoidal rule takes the coordinate's speeds before and in the part: those along the axis, less the
  // lead and plus the lead.
  block.law.reset(spring, slope, 0.5 * h_s * h_s * j.spring.stiffness);
  auto speed_of_limit = [&](double room) {
    if (room > 0.0) return -room / h_s;
    return stage == Stage::kSolve ? correction_speed(room, h_s) : 0.0;
  };
  if (std::isfinite(j.lower))
    block.law.add_step(AxisLaw::kLower, speed_of_limit(j.coordinate - j.lower), kUnbounded, 0.0);
  if (std::isfinite(j.upper))
    block.law.add_step(AxisLaw::kUpper, -speed_of_limit(j.upper - j.coordinate), 0.0, -kUnbounded);
  if (j.friction > 0.0) block.law.add_step(AxisLaw::kFriction, 0.0, h_s * j.friction, -h_s * j.friction);
  if (j.has_motor)
    block.law.add_step(AxisLaw::kMotor, j.motor.speed, h_s * j.motor.max_effort, -h_s * j.motor.max_effort);
  set_segment(block, block.law.first_segment(j.held_by, speeds(block)[kAxis], block.impulse[kAxis],
                                             block.response[kAxis]));
}

void JointSolver::set_segment(Block& block, int segment) {
  block.segment = segment;
  if (AxisLaw::is_held(segment) || block.law.slope() > 0.0) return;
  RowVector change = RowVector::Zero();
  change[kAxis] = block.law.offset(segment) - block.impulse[kAxis];
  apply(block, change);
}

// The compliance of the axis row, or a negative number when the axis has none.
double JointSolver::axis_compliance(const Block& block, double relative) {
  if (AxisLaw::is_held(block.segment)) return relative * block.response[kAxis];
  return block.law.slope() > 0.0 ? 1.0 / block.law.slope() : -1.0;
}

// Moves the axes of a tree that disobey their laws to the next segment; all of them, or only the first.
// Releasing an axis leaves transient speeds, from which no pose can be predicted: keeps the speeds that the
// rigid rows were solved for, which the next round restores.
bool JointSolver::change_segments(const JointEquations::Tree& tree, bool all) {
  bool any = false;
  for (const std::int32_t k : joints_of(tree)) {
    Block& block = blocks_[k];
    if (!block.is_active || !joints_[k].has_coordinate()) continue;
    const double impulse_tolerance = kConverged / block.response[kAxis];
    const int segment = block.law.next_segment(block.segment, speeds(block)[kAxis], block.impulse[kAxis],
                                               kConverged, impulse_tolerance);
    if (segment == block.segment) continue;
    if (!any)
      for (const std::int32_t i : joints_of(tree)) blocks_[i].solved_speeds = speeds(blocks_[i]);
    set_segment(block, segment);
    any = true;
    if (!all) break;
  }
  return any;
}

// ---- one step

void JointSolver::index_bodies(const BodyStore& bodies) {
  bodies_.assign(1, Body());
  bodies_[0].start_inertia = bodies_[0].start_inverse_inertia = bodies_[0].inverse_inertia =
      bodies_[0].next_inverse_inertia = Matrix3d::Zero();
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
  auto node_of = [&](std::int32_t index) {
    const std::int32_t body = bodies_[index].body;
    return body < 0 || bodies.is_static(body) ? JointEquations::kFixed : index;
  };
  std::vector<std::array<std::int32_t, 2>> nodes;
  blocks_.assign(joints_.size(), Block());
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    blocks_[k].a = index_of(joints_[k].a), blocks_[k].b = index_of(joints_[k].b);
    nodes.push_back({node_of(blocks_[k].a), node_of(blocks_[k].b)});
  }
  equations_.set_structure(static_cast<std::int32_t>(bodies_.size()), nodes);
  tree_states_.assign(equations_.trees().size(), {});
  for (std::size_t t = 0; t < tree_states_.size(); ++t)
    for (const std::int32_t i : bodies_of(equations_.trees()[t]))
      bodies_[i].tree = static_cast<std::int32_t>(t);
  indexed_ = true;
}

// Trees read the bodies that cannot move, which belong to none of those with joints.
void JointSolver::begin_step(const BodyStore& bodies, const SpatialPartition& partition, int substeps) {
  if (!indexed_) index_bodies(bodies);
  path_.resize(substeps * bodies_.size());
  active_joints_before_.assign(1, 0);
  for (const JointEquations::Tree& tree : equations_.trees()) {
    bool moves = false;
    for (const std::int32_t i : bodies_of(tree)) {
      const std::int32_t body = bodies_[i].body;
      moves = moves || (body >= 0 && bodies.is_active(body));
      if (tree.joint_count == 0 && body >= 0) begin_body(bodies_[i], bodies, partition);
    }
    active_joints_before_.push_back(active_joints_before_.back() + (moves ? tree.joint_count : 0));
  }
}

IndexRange JointSolver::share(const Member& member) const {
  const auto first_tree = [&](int index) {
    if (index == member.member_count) return static_cast<int>(tree_states_.size());
    const long wanted = static_cast<long>(active_joints_before_.back()) * index / member.member_count;
    return static_cast<int>(std::ranges::lower_bound(active_joints_before_, wanted) -
                            active_joints_before_.begin());
  };
  return {first_tree(member.index), first_tree(member.index + 1)};
}

void JointSolver::begin_body(Body& b, const BodyStore& bodies, const SpatialPartition& partition) {
  const std::int32_t i = b.body;
  b.row = partition.row(b.body);
  b.is_active = bodies.is_active(i);
  b.is_sphere = bodies.is_sphere[i];
  b.start = b.now = b.next = pose_of(bodies, b.body);
  b.row_frame.setIdentity();
  b.velocity = b.angular_velocity = b.momentum = Vec3d::Zero();
  b.inverse_mass = 0.0;
  b.inverse_inertia.setZero();
  if (!b.is_active) return;
  b.inverse_mass = static_cast<double>(bodies.body_velocity[i].inverse_mass);
  b.principal = bodies.inertia[i];
  const Vec3d moments(b.principal.moments);
  b.start_inertia = tensor_of(b.principal, b.now.orientation, moments);
  b.inverse_inertia = b.start_inverse_inertia =
      tensor_of(b.principal, b.now.orientation, moments.cwiseInverse());
}

void JointSolver::begin_trees(const BodyStore& bodies, const SpatialPartition& partition, const Rows& rows,
                              IndexRange trees) {
  for (int t = trees.begin; t < trees.end; ++t) {
    const JointEquations::Tree& tree = equations_.trees()[t];
    tree_states_[t] = {};
    if (tree.joint_count == 0) continue;  // see begin_step()
    for (const std::int32_t i : bodies_of(tree)) begin_body(bodies_[i], bodies, partition);
    load_velocities(rows, {t, t + 1});
    for (const std::int32_t k : joints_of(tree)) {
      Block& block = blocks_[k];
      block.is_active = bodies_[block.a].is_active || bodies_[block.b].is_active;
      if (!block.is_active) continue;
      tree_states_[t].is_active = true;
      tree_states_[t].has_axes |= joints_[k].has_coordinate();
      joints_[k].force_impulse.setZero();
      joints_[k].effort_impulse = 0.0;
      build_rows(joints_[k], block, 0.0);
    }
  }
}

// The trapezoidal rule: the mean of the spring's efforts at both ends of the part, of which the later one
// depends on the new speed.
// The displacement is that of the start; see "Joints" in docs/engines.md.
void JointSolver::set_law_of_part(Joint& j, Block& block, double h_s) {
  block.spring_impulse = 0.0;
  if (!j.has_spring) return set_law(j, block, Stage::kSolve, h_s, 0.0, 0.0);
  const double elastic = 0.25 * h_s * h_s * j.spring.stiffness, viscous = 0.5 * h_s * j.spring.damping;
  block.spring_impulse =
      -h_s * j.spring.stiffness * (j.coordinate - j.spring.rest) + (elastic - viscous) * block.speed_before;
  block.spring_at_rest = block.spring_impulse;
  set_law(j, block, Stage::kSolve, h_s, block.spring_impulse, elastic + viscous);
}

// A coordinate's speed at the end of the last substep.
void JointSolver::set_springs_at_start(const BodyStore& bodies, const Rows& rows, const Substep& substep,
                                       IndexRange trees) {
  auto twist_of = [&](std::int32_t index) -> RowVector {
    const Body& b = bodies_[index];
    if (!b.is_active) return RowVector::Zero();
    const surface::Wrench& w = bodies.wrench[b.body];
    const BodyVelocity& start = rows.start_velocity[b.row];
    const auto h = static_cast<double>(substep.h_s);
    const Vec3d momentum = b.start_inertia * Vec3(start.angular_velocity).cast<double>();
    return (RowVector() << Vec3(start.velocity).cast<double>() -
                               h * (substep.gravity.cast<double>() + b.inverse_mass * w.force.cast<double>()),
            b.inverse_inertia * (b.row_frame * (momentum - h * w.torque.cast<double>())))
        .finished();
  };
  for (int t = trees.begin; t < trees.end; ++t)
    for (const std::int32_t k : joints_of(equations_.trees()[t])) {
      Block& block = blocks_[k];
      if (block.is_active && joints_[k].has_spring)
        block.speed_before = block.jacobian_a.row(kAxis).dot(twist_of(block.a)) +
                             block.jacobian_b.row(kAxis).dot(twist_of(block.b));
    }
}

// All parts of the substep but the last one leave the bodies moved and relaxed.
void JointSolver::solve(const BodyStore& bodies, const Rows& rows, const Substep& substep, IndexRange trees) {
  const auto h_s = static_cast<double>(substep.h_s);
  load_velocities(rows, trees);
  set_springs_at_start(bodies, rows, substep, trees);
  // Torques do not turn with the bodies.
  for_each_body(trees, [&](Body& b) {
    if (!b.is_active) return;
    const Vec3d torque = bodies.wrench[b.body].torque.cast<double>();
    b.momentum += h_s * (torque - b.row_frame * torque);
    b.angular_velocity = b.inverse_inertia * b.momentum;
    const Vec3 by_contacts =
        Vec3(rows.velocity[b.row].angular_velocity) - Vec3(rows.start_velocity[b.row].angular_velocity);
    b.contact_momentum = b.row_frame * (b.start_inertia * by_contacts.cast<double>());
  });
  for (TreeState& s : states_of(trees)) {
    s.time_left_s = s.h_s = h_s;
    s.is_unfinished = s.is_active;
  }
  for (;;) {
    bool any = false;
    for (TreeState& s : states_of(trees)) s.select(s.is_unfinished), any = any || s.is_unfinished;
    if (!any) break;
    hold_at_end_of_part(trees);
    for (int t = trees.begin; t < trees.end; ++t) {
      const JointEquations::Tree& tree = equations_.trees()[t];
      TreeState& s = tree_states_[t];
      if (!s.is_selected()) continue;
      if (s.h_s > kMinPart * h_s && is_too_long(tree, s)) {
        s.h_s *= 0.5;
        for (const std::int32_t i : bodies_of(tree)) bodies_[i].restore();
        for (const std::int32_t k : joints_of(tree)) joints_[k].held_by = blocks_[k].kept_held_by;
        s.select(false);
      } else if (s.h_s > 0.999 * s.time_left_s) {
        s.is_unfinished = false;
        s.select(false);
      }
    }
    move_bodies(rows, trees);
    take_back_corrections(trees);
    relax_part(trees);
    for_each_selected(trees, [&](Joint& j, Block& block, double) {
      if (j.has_spring) block.speed_before = speeds(block)[kAxis];
    });
    for (int t = trees.begin; t < trees.end; ++t)
      for (const std::int32_t i : bodies_of(equations_.trees()[t]))
        if (tree_states_[t].is_selected()) bodies_[i].contact_momentum.setZero();
    for (TreeState& s : states_of(trees)) {
      if (!s.is_selected()) continue;
      s.time_left_s -= s.h_s;
      s.h_s = 2.0 * s.h_s < s.time_left_s ? 2.0 * s.h_s : s.time_left_s;
    }
  }
  for (int t = trees.begin; t < trees.end; ++t)
    for (const std::int32_t k : joints_of(equations_.trees()[t]))
      if (blocks_[k].is_active) blocks_[k].end_speeds = speeds(blocks_[k]);
  turn_row_frames(trees);
  store_velocities(rows, trees);
}

bool JointSolver::is_too_long(const JointEquations::Tree& tree, const TreeState& s) const {
  double spin = 0.0, change = 0.0;
  for (const std::int32_t i : bodies_of(tree)) {
    const Body& b = bodies_[i];
    spin = std::max(spin, b.angular_velocity.norm());
    const Vec3d gained = b.momentum - b.kept_momentum + b.contact_momentum;
    change = std::max(change, (b.inverse_inertia * gained).norm());
  }
  return change * s.h_s > kMaxTurnChange_rad ||
         (s.residual > kMaxResidual_ups && spin * s.h_s > kMaxUnsolvedTurn_rad);
}

void JointSolver::relax(const Rows& rows, IndexRange trees) {
  load_velocities(rows, trees);
  for (TreeState& s : states_of(trees)) s.select(s.is_active);
  move_bodies(rows, trees);
  for (int t = trees.begin; t < trees.end; ++t) {
    if (!tree_states_[t].is_active) continue;
    Pose* const ends = path_.data() + tree_states_[t].substep++ * bodies_.size();
    tree_states_[t].kept = tree_states_[t].substep;
    for (const std::int32_t i : bodies_of(equations_.trees()[t])) ends[i] = bodies_[i].now;
  }
  take_back_corrections(trees);
  relax_part(trees);
  turn_row_frames(trees);
  store_velocities(rows, trees);
}

void JointSolver::hold_at_end_of_part(IndexRange trees) {
  for_each_body(trees, [](Body& b) { b.keep(); });
  for_each_selected(trees, [&](Joint& j, Block& block, double h_s) {
    block.kept_held_by = j.held_by;
    block.held_frame_a = j.frame_a, block.held_anchor_b = j.anchor_b;
    block.target_error = block.error;
    correct_target(j, block, h_s);
    block.impulse.setZero();
    block.correction.setZero();
    if (j.has_coordinate()) set_law_of_part(j, block, h_s);
  });
  // Trees that are off their joints are solved as they are first, and then moved back. Only from where the
  // bodies are do the rows describe how the error changes.
  for (int t = trees.begin; t < trees.end; ++t) {
    TreeState& s = tree_states_[t];
    s.is_off = s.is_selected() && std::ranges::any_of(joints_of(equations_.trees()[t]), [&](std::int32_t k) {
                 const Joint& j = joints_[k];
                 const Block& b = blocks_[k];
                 return b.is_active &&
                        ((b.target_error - b.error).head(b.rigid_rows).norm() > kSlowCorrection * s.h_s ||
                         (j.has_coordinate() && correction_speed(room_of(j), s.h_s) > kSlowCorrection));
               });
    if (!s.is_off) continue;
    for (const std::int32_t k : joints_of(equations_.trees()[t]))
      if (blocks_[k].is_active) hold_as_it_is(joints_[k], blocks_[k], s.h_s);
  }
  solve_trees(Stage::kSolve, trees);
  note_springs(trees);
  if (std::ranges::none_of(states_of(trees), &TreeState::is_off)) return;
  for (TreeState& s : states_of(trees))
    if (s.is_selected() && !s.is_off) s.role = Role::kSetAside;
  for_each_selected(trees, [&](Joint& j, Block& block, double h_s) {
    block.correction = block.impulse;
    correct_target(j, block, h_s);
    if (j.has_coordinate()) set_law(j, block, Stage::kSolve, h_s, block.spring_at_rest, block.law.slope());
  });
  solve_trees(Stage::kSolve, trees);
  for_each_selected(
      trees, [](Joint&, Block& block, double) { block.correction = block.impulse - block.correction; });
  for (TreeState& s : states_of(trees))
    if (s.role == Role::kSetAside) s.role = Role::kSelected;
}

void JointSolver::hold_as_it_is(Joint& j, Block& block, double h_s) {
  const Pose &a = bodies_[block.a].now, &b = bodies_[block.b].now;
  block.held_frame_a = a.orientation.conjugate() * (b.orientation * j.frame_b);
  block.held_anchor_b = b.orientation.conjugate() * (a.position + a.orientation * j.anchor_a - b.position);
  block.target_error.setZero();
  if (j.has_coordinate()) set_law(j, block, Stage::kRelax, h_s, block.spring_at_rest, block.law.slope());
}

// Moves what is to be left of a joint's error on by a share of the present one.
void JointSolver::correct_target(const Joint& j, Block& block, double h_s) {
  const int linear = linear_rows(j.kind);
  // A rotation moves a body by its arm.
  const double arm = std::max({1.0, j.anchor_a.norm(), j.b < 0 ? 0.0 : block.held_anchor_b.norm()});
  auto correct = [&](int first, int count, double most) {
    Vec3d correction = Vec3d::Zero();
    correction.head(count) = kErrorReduction * block.error.segment(first, count);
    block.target_error.segment(first, count) -= law::clamp_length(correction, most).head(count);
  };
  correct(0, linear, kMaxJointCorrectionSpeed * h_s);
  correct(linear, block.rigid_rows - linear, kMaxJointCorrectionSpeed * h_s / arm);
}

void JointSolver::take_back_corrections(IndexRange trees) {
  for_each_selected(trees, [&](Joint&, Block& block, double) {
    if (block.correction.isZero(0.0)) return;
    const RowVector correction = block.correction;
    apply(block, -correction);
    block.correction.setZero();
  });
}

void JointSolver::note_springs(IndexRange trees) {
  for_each_selected(trees, [&](Joint& j, Block& block, double) {
    if (j.has_spring) block.spring_impulse = block.law.impulse_without_steps(speeds(block)[kAxis]);
  });
}

void JointSolver::relax_part(IndexRange trees) {
  for_each_selected(trees, [&](Joint& j, Block& block, double h_s) {
    build_rows(j, block, h_s);
    if (j.has_coordinate()) set_law(j, block, Stage::kRelax, h_s, block.spring_impulse, 0.0);
  });
  solve_trees(Stage::kRelax, trees);
  add_efforts(trees, 1.0);
}

JointSolver::RowSprings JointSolver::springs_of(std::int32_t joint, bool is_relaxing) const {
  const Joint& j = joints_[joint];
  const Block& b = blocks_[joint];
  RowSprings s{.jacobian = {&b.jacobian_a, &b.jacobian_b},
               .stiffness = RowVector::Zero(),
               .speed = is_relaxing ? RowVector(RowVector::Zero()) : b.end_speeds,
               .law = j.has_coordinate() ? &b.law : nullptr,
               .segment = b.segment,
               .impulse = b.impulse[kAxis]};
  for (int r = 0; r < kRows; ++r)
    if (r < b.rigid_rows || (r == kAxis && s.law != nullptr))
      s.stiffness[r] = 1.0 / (RowSprings::kCompliance * b.response[r]);
  return s;
}

void JointSolver::add_impulse(std::int32_t joint, const RowVector& impulse, int segment, double axis_speed,
                              bool is_relaxing) {
  Joint& j = joints_[joint];
  Block& block = blocks_[joint];
  block.impulse += impulse;
  if (is_relaxing) add_effort(j, block, impulse);
  if (!j.has_coordinate()) return;
  block.segment = segment;
  note_segment(j, block);
  if (!is_relaxing) block.spring_impulse = block.law.impulse_without_steps(axis_speed);
}

void JointSolver::add_effort(Joint& j, const Block& block, const RowVector& impulse) {
  const int n = block.rigid_rows;
  j.force_impulse += block.jacobian_a.topLeftCorner(n, 3).transpose() * impulse.head(n);
  if (j.has_coordinate()) j.effort_impulse += impulse[kAxis];
}

void JointSolver::add_efforts(IndexRange trees, double sign) {
  for_each_selected(trees,
                    [&](Joint& j, Block& block, double) { add_effort(j, block, sign * block.impulse); });
}

bool JointSolver::solve_again(const Rows& rows, std::int32_t tree, double tolerance, bool predicts) {
  const IndexRange only{tree, tree + 1};
  load_velocities(rows, only);
  tree_states_[tree].select(true);
  if (!solve_trees(predicts ? Stage::kSolveAgain : Stage::kFollow, only, tolerance)) return false;
  note_springs(only);
  store_velocities(rows, only);
  return true;
}

bool JointSolver::relax_again(const Rows& rows, std::int32_t tree, double tolerance) {
  const IndexRange only{tree, tree + 1};
  load_velocities(rows, only);
  tree_states_[tree].select(true);
  add_efforts(only, -1.0);
  const bool was_off = solve_trees(Stage::kRelax, only, tolerance);
  add_efforts(only, 1.0);
  if (was_off) store_velocities(rows, only);
  return was_off;
}

// Rounds of Newton's method, with the matrix of the pose at which the rows were built.
bool JointSolver::solve_trees(Stage stage, IndexRange trees, double tolerance) {
  bool any_off = false;
  for (TreeState& s : states_of(trees)) {
    s.open();
    if (s.is_open()) s.residual = std::numeric_limits<double>::max();
  }
  for (int round = 0;; ++round) {
    if (std::ranges::none_of(states_of(trees), &TreeState::is_open)) break;
    if (predicts(stage)) predict(trees), set_leads(stage, trees);
    for (int t = trees.begin; t < trees.end; ++t) {
      TreeState& s = tree_states_[t];
      if (!s.is_open()) continue;
      // A change leaves speeds that another round must solve for, so the last round makes none.
      s.has_changed =
          round > 0 && round < kMaxRounds && change_segments(equations_.trees()[t], round < kFreeRounds);
      if (s.has_changed) s.is_factored = false;
      const double before = s.residual;
      s.residual = set_residuals(equations_.trees()[t], stage, s.h_s, s.has_changed);
      const bool is_done = !s.has_changed && (s.residual < kConverged || s.residual > kStagnation * before);
      if (round == 0 && s.residual > tolerance) any_off = true;
      if (round > 0 ? is_done || round == kMaxRounds || s.residual < tolerance : s.residual <= tolerance) {
        s.role = Role::kSelected;
        continue;
      }
      if (!is_factored(t)) factor(t, Axes::kOfSegments);
      equations_.solve(t);
      for (const std::int32_t k : joints_of(equations_.trees()[t]))
        if (blocks_[k].is_active) apply(blocks_[k], equations_.of_joint(k));
      // The equations of rigid rows at a given pose are linear.
      if (tolerance > 0.0 && !predicts(stage) && !s.has_axes && !equations_.trees()[t].has_loop)
        s.role = Role::kSelected;
    }
  }
  for_each_selected(trees, [](Joint& j, const Block& block, double) {
    if (j.has_coordinate()) note_segment(j, block);
  });
  return any_off;
}

// How much faster than along its row the curved path to the predicted pose leads each coordinate.
void JointSolver::set_leads(Stage stage, IndexRange trees) {
  for (int t = trees.begin; t < trees.end; ++t) {
    const JointEquations::Tree& tree = equations_.trees()[t];
    if (!tree_states_[t].is_open() || (stage == Stage::kSolveAgain && tree.has_loop)) continue;
    for (const std::int32_t k : joints_of(tree)) {
      const Joint& j = joints_[k];
      Block& block = blocks_[k];
      if (!block.is_active || !j.has_coordinate()) continue;
      const Body &a = bodies_[block.a], &b = bodies_[block.b];
      const double h_s = tree_states_[t].h_s, way = h_s * speeds(block)[kAxis];
      double lead;  // in the part
      if (j.kind == scene::JointKind::kSlider) {
        lead = coordinate_of(j, a.next, b.next) - j.coordinate - way;
      } else {
        // The turn of a about b's axis. The hinge's own angle equals it only where the hinge is not tilted.
        const Quatd turn = (b.next.orientation * j.frame_b).conjugate() * a.next.orientation *
                           a.now.orientation.conjugate() * (b.now.orientation * j.frame_b);
        lead = std::remainder(2.0 * std::atan2(turn.z(), turn.w()) - way, 2.0 * std::numbers::pi);
      }
      block.law.set_lead(lead / h_s);
    }
  }
}

// Sets what the speeds along the rows lack, and returns the greatest of it.
double JointSolver::set_residuals(const JointEquations::Tree& tree, Stage stage, double h_s,
                                  bool has_changed_segments) {
  for (const std::int32_t i : bodies_of(tree)) equations_.of_body(i).setZero();
  double greatest = 0.0;
  for (const std::int32_t k : joints_of(tree)) {
    Block& block = blocks_[k];
    RowVector& out = equations_.of_joint(k);
    out.setZero();
    if (!block.is_active) continue;
    const Joint& j = joints_[k];
    const int n = block.rigid_rows;
    const RowVector now = speeds(block);
    if (has_changed_segments)
      out.head(n) = (block.solved_speeds - now).head(n);
    else if ((stage == Stage::kSolveAgain || stage == Stage::kFollow) && tree.has_loop)
      out.head(n) = (block.end_speeds - now).head(n);
    else if (stage == Stage::kFollow)
      out.head(n) = (block.wanted_speeds - now).head(n);
    else if (stage != Stage::kRelax)
      out.head(n) = (block.target_error - rigid_error(j, block.held_frame_a, block.held_anchor_b,
                                                      bodies_[block.a].next, bodies_[block.b].next))
                        .head(n) /
                    h_s;
    else
      out.head(n) = -now.head(n);
    if (predicts(stage)) block.wanted_speeds.head(n) = (now + out).head(n);
    if (j.has_coordinate()) {
      if (AxisLaw::is_held(block.segment))
        out[kAxis] = block.law.held_speed(block.segment) - now[kAxis];
      else if (block.law.slope() > 0.0)
        out[kAxis] =
            (block.law.offset(block.segment) - block.impulse[kAxis]) / block.law.slope() - now[kAxis];
    }
    greatest = std::max(greatest, out.cwiseAbs().maxCoeff());
  }
  return greatest;
}

bool JointSolver::is_factored(std::int32_t t) const {
  if (!tree_states_[t].is_factored) return false;
  const JointEquations::Tree& tree = equations_.trees()[t];
  for (const std::int32_t k : joints_of(tree))
    if (blocks_[k].is_active && joints_[k].has_coordinate() &&
        axis_compliance(blocks_[k], compliance_of(tree)) != blocks_[k].factored_compliance)
      return false;
  return true;
}

void JointSolver::factor(std::int32_t t, Axes held) {
  const JointEquations::Tree& tree = equations_.trees()[t];
  equations_.begin(t);
  for (const std::int32_t i : bodies_of(tree)) {
    const Body& b = bodies_[i];
    RowMatrix& mass = equations_.mass(i);
    mass.setIdentity();
    if (!b.is_active) continue;
    mass.topLeftCorner<3, 3>() /= b.inverse_mass;
    mass.bottomRightCorner<3, 3>() = tensor_of(b.principal, b.now.orientation, Vec3d(b.principal.moments));
  }
  for (const std::int32_t k : joints_of(tree)) {
    Block& block = blocks_[k];
    RowMatrix &compliance = equations_.compliance(k), a = block.jacobian_a, b = block.jacobian_b;
    compliance.setIdentity();
    if (!block.is_active) a.setZero(), b.setZero();
    if (!bodies_[block.a].is_active) a.setZero();
    if (!bodies_[block.b].is_active) b.setZero();
    if (block.is_active) {
      compliance.diagonal().head(block.rigid_rows) =
          compliance_of(tree) * block.response.head(block.rigid_rows);
      if (joints_[k].has_coordinate()) {
        if (held == Axes::kOfSegments)
          block.factored_compliance = axis_compliance(block, compliance_of(tree));
        else
          block.factored_compliance =
              joints_[k].is_locked() ? compliance_of(tree) * block.response[kAxis] : -1.0;
        if (block.factored_compliance >= 0.0)
          compliance(kAxis, kAxis) = block.factored_compliance;
        else
          a.row(kAxis).setZero(), b.row(kAxis).setZero();
      }
    }
    equations_.set_jacobian(k, 0, a);
    equations_.set_jacobian(k, 1, b);
  }
  equations_.factor(t);
  tree_states_[t].is_factored = held == Axes::kOfSegments;
  tree_states_[t].is_factored_for_blows = held == Axes::kLocked;
}

void JointSolver::find_strained(const BodyStore& bodies, float min_depth,
                                std::vector<JammedBody>& out) const {
  if (!indexed_) return;  // then blocks_ are those of an earlier step
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    const Joint& j = joints_[k];
    const Block& block = blocks_[k];
    if (!block.is_active) continue;
    // An angular error is converted to a length at the body's bounding radius.
    const auto reach = static_cast<double>(bodies.bounding_radius[j.a]);
    const int linear = linear_rows(j.kind);
    double strain = std::max(block.error.head(linear).norm(),
                             reach * block.error.segment(linear, block.rigid_rows - linear).norm());
    if (j.has_coordinate())
      strain = std::max(strain, (j.kind == scene::JointKind::kHinge ? reach : 1.0) *
                                    std::max(j.lower - j.coordinate, j.coordinate - j.upper));
    if (!(strain >= static_cast<double>(min_depth))) continue;
    for (const std::int32_t body : {j.a, j.b})
      if (body >= 0 && bodies.is_active(body)) out.push_back({body, static_cast<float>(strain), false});
  }
}

}  // namespace smartsurf::world
