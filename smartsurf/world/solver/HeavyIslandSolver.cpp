#include "smartsurf/world/solver/HeavyIslandSolver.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartsurf/world/solver/ContactLaw-inl.h"
#include "smartsurf/world/solver/SupportSolver.h"

namespace smartsurf::world {
namespace {

using Vector3 = Eigen::Vector3d;

// Compliance of a hard contact, relative to that of the heavier body.
constexpr double kCompliance = 1e-3;
// The part of a steady load that deflects no spring; see SubstepParams::steady_share.
constexpr double kSteadyShare = 0.8;
constexpr int kMaxPasses = 12, kMaxSwitches = 48;
// Of pressed islands: a point that slips has at least this share of the friction that its load allows.
constexpr double kSlippingShare = 0.9;
// A patch of which samples slip sticks as a whole while its friction is below this share of its limit.
constexpr double kHolding = 0.5;

Vector3 to_double(const float (&v)[3]) { return {v[0], v[1], v[2]}; }

}  // namespace

void HeavyIslandSolver::Point::keep(const BatchPoint& q) {
  impulse[0] = q.normal_impulse[lane];
  for (int i = 0; i < 3; ++i) impulse[1 + i] = q.friction_impulse[i][lane];
}

void HeavyIslandSolver::exchange_impulses(std::span<Point> island, const BatchPoints& points,
                                          const SolverBodies& rows) {
  for (Point& p : island) {
    BatchPoint& q = points.point[p.index];
    const BatchPointDetail& d = points.detail[p.index];
    const Vec3 n = load_lane(q.normal, p.lane);
    float(&kept)[4] = p.impulse;
    Vec3 change = (kept[0] - q.normal_impulse[p.lane]) * n;
    std::swap(kept[0], q.normal_impulse[p.lane]);
    for (int i = 0; i < 3; ++i) {
      change[i] += kept[1 + i] - q.friction_impulse[i][p.lane];
      std::swap(kept[1 + i], q.friction_impulse[i][p.lane]);
    }
    for (int side = 0; side < 2; ++side) {
      if (p.body[side] < 0) continue;
      const std::int32_t row = p.row[side];
      BodyVelocity& m = rows.velocity[row];
      Vec3 anchor = load_lane(side == 0 ? d.anchor_a : d.anchor_b, p.lane);
      if (is_sphere_kind(p.kind)) anchor = n * (side == 0 ? -q.radius_a[p.lane] : q.radius_b[p.lane]);
      const Vec3 along = side == 0 ? change : Vec3(-change);
      const Vec3 spin = to_matrix(rows.inverse_inertia[row]) * anchor.cross(along);
      for (int i = 0; i < 3; ++i)
        m.velocity[i] += m.inverse_mass * along[i], m.angular_velocity[i] += spin[i];
    }
  }
}

// The axes and the Jacobians, which stay through the step.
void HeavyIslandSolver::set_axes(Point& p, const BatchPoints& points, const SolverBodies& rows,
                                 const Island& island) {
  const BatchPoint& q = points.point[p.index];
  const BatchPointDetail& d = points.detail[p.index];
  const Vector3 n = load_lane(q.normal, p.lane).cast<double>();
  law::Vector3<float> t, u;
  law::tangents(to_law(n.cast<float>()), t, u);
  const Vector3 axis[3] = {n, from_law(t).cast<double>(), from_law(u).cast<double>()};
  p.least_inverse_mass = 1e30;
  for (int side = 0; side < 2; ++side) {
    if (p.row[side] < 0) continue;
    Vector3 anchor = load_lane(side == 0 ? d.anchor_a : d.anchor_b, p.lane).cast<double>();
    if (is_sphere_kind(p.kind))
      anchor = n * static_cast<double>(side == 0 ? -q.radius_a[p.lane] : q.radius_b[p.lane]);
    for (int k = 0; k < 3; ++k) {
      const Vector3 along = side == 0 ? axis[k] : Vector3(-axis[k]);
      const Vector3 turn = anchor.cross(along);
      for (int i = 0; i < 3; ++i) p.jacobian[side][k][i] = along[i], p.jacobian[side][k][3 + i] = turn[i];
    }
    if (const float inverse_mass = rows.velocity[p.row[side]].inverse_mass; inverse_mass > 0.0F)
      p.least_inverse_mass = std::min(p.least_inverse_mass, static_cast<double>(inverse_mass));
  }
  p.slipping_share = island.is_pressed ? kSlippingShare : 0.0;
  p.least_compliance = kCompliance * (island.is_pressed ? island.least_inverse_mass : p.least_inverse_mass);
}

void HeavyIslandSolver::set_up(Point& p, const BatchPoints& points, const SolverBodies& rows,
                               const SubstepParams& params, bool is_soft) {
  const BatchPoint& q = points.point[p.index];
  const BatchPointDetail& d = points.detail[p.index];
  const auto axis = [&p](int k) { return Vector3(p.jacobian[0][k]); };
  double speed[3] = {}, displacement = 0.0;
  for (int side = 0; side < 2; ++side) {
    if (p.row[side] < 0) continue;
    const BodyVelocity& m = rows.velocity[p.row[side]];
    const DeltaPose& delta = rows.delta_pose[p.row[side]];
    const Vector3 velocity = to_double(m.velocity), spin = to_double(m.angular_velocity);
    for (int k = 0; k < 3; ++k) {
      const Vector3 along(p.jacobian[side][k]), turn(p.jacobian[side][k] + 3);
      speed[k] += along.dot(velocity) + turn.dot(spin);
      if (k == 0)
        displacement += along.dot(to_double(delta.translation)) + turn.dot(to_double(delta.rotation));
    }
  }
  if (p.kind != kSpherePair) {
    const Vector3 surface = load_lane(d.surface_velocity, p.lane).cast<double>();
    for (int k = 0; k < 3; ++k) speed[k] -= axis(k).dot(surface);
    if (!is_pair(p.kind)) displacement -= axis(0).dot(surface) * static_cast<double>(params.elapsed_s);
  }
  const Vector3 friction = load_lane(q.friction_impulse, p.lane).cast<double>();
  for (int k = 1; k < 3; ++k) {
    p.spring[k].impulse = axis(k).dot(friction);
    p.spring[k].error = -speed[k], p.spring[k].change = 0.0;
  }
  Spring& normal = p.normal();
  normal.impulse = static_cast<double>(q.normal_impulse[p.lane]);
  double target = static_cast<double>(q.relax_target_speed[p.lane]);
  p.yields = false;
  if (is_soft) {
    const float separation = q.separation[p.lane] + static_cast<float>(displacement);
    target = static_cast<double>(law::push_out_speed(separation, params, slop_of(p.kind)));
    p.yields = separation <= 0.0F;
  }
  normal.error = target - speed[0];
}

// `blow`: the greatest impulse that a contact of the island still lacks. A contact yields to it by the speed
// that its greatest deflection has, and no more.
void HeavyIslandSolver::set_stiffness(Point& p, const BatchPoints& points, const SubstepParams& params,
                                      double blow) {
  const BatchPoint& q = points.point[p.index];
  Spring& normal = p.normal();
  const double deflection_speed = static_cast<double>(params.bias_rate * max_deflection(p.kind));
  const double compliance =
      std::max(std::min(kCompliance * p.least_inverse_mass, deflection_speed / std::max(blow, 1e-12)),
               p.least_compliance);
  for (int k = 0; k < 3; ++k) p.spring[k].stiffness = 1.0 / compliance;
  if (p.yields) {
    const double soft =
                     static_cast<double>(params.impulse_scale / (params.mass_scale * q.normal_mass[p.lane])),
                 capped = deflection_speed / std::max({p.steady_impulse, blow, 1e-12});
    const double yielding = std::max(std::min(soft, capped), compliance);
    normal.error -= yielding * (normal.impulse - kSteadyShare * p.steady_impulse);
    normal.stiffness = 1.0 / yielding;
  }
  normal.change = 0.0;
  p.bears = normal.impulse > 0.0 || normal.error > 0.0;
  p.sticks = q.friction[p.lane] > 0.0F;
  p.stuck_again = !p.sticks;
}

void HeavyIslandSolver::set_up(PatchFriction& f, const SolverBodies& rows) {
  const SupportPatch& p = *f.patch;
  const BodyVelocity& m = rows.velocity[p.row];
  const double z = static_cast<double>(p.z);
  const BlockCholesky::Rows axis = {{1, 0, 0, 0, z, 0}, {0, 1, 0, -z, 0, 0}, {0, 0, 0, 0, 0, 1}};
  const double inertia = 1.0 / static_cast<double>(to_matrix(rows.inverse_inertia[p.row])(2, 2));
  const double hard = 1.0 / (kCompliance * static_cast<double>(m.inverse_mass));
  const double belt[3] = {p.belt_x, p.belt_y, 0.0};
  for (int k = 0; k < 3; ++k) {
    Spring& s = f.spring[k];
    double speed = 0.0;
    for (int i = 0; i < 3; ++i) {
      f.jacobian[0][k][i] = axis[k][i], f.jacobian[0][k][3 + i] = axis[k][3 + i];
      speed += axis[k][i] * static_cast<double>(m.velocity[i]) +
               axis[k][3 + i] * static_cast<double>(m.angular_velocity[i]);
    }
    s.stiffness = k < 2 ? hard : inertia / kCompliance;
    s.error = belt[k] - speed, s.change = 0.0;
  }
}

// Rigid rows keep the speeds that the joints' solver has found.
void HeavyIslandSolver::set_up(JointSprings& j, const SolverBodies& rows, const Substep& substep) {
  const JointSolver::RowSprings springs = substep.joints.springs_of(j.joint, !substep.is_soft);
  double speed = 0.0;  // along the present row; in the end along the axis
  for (int part = 0; part < 2; ++part)
    for (int k = 0; k < 3; ++k) {
      const int r = 3 * part + k;
      Spring& s = j.part[part].spring[k];
      speed = 0.0;
      for (int side = 0; side < 2; ++side) {
        double(&axis)[6] = j.part[part].jacobian[side][k];
        for (int i = 0; i < 6; ++i) axis[i] = (*springs.jacobian[side])(r, i);
        if (j.row[side] < 0) continue;
        const BodyVelocity& m = rows.velocity[j.row[side]];
        for (int i = 0; i < 3; ++i)
          speed += axis[i] * static_cast<double>(m.velocity[i]) +
                   axis[3 + i] * static_cast<double>(m.angular_velocity[i]);
      }
      s.stiffness = springs.stiffness[r];
      s.error = springs.speed[r] - speed;
      s.change = 0.0;
    }
  j.law = springs.law, j.constant = 0.0;
  if (j.law == nullptr) return;
  j.held_stiffness = j.axis().stiffness, j.impulse = springs.impulse, j.speed = speed;
  j.set_segment(springs.segment);
}

void HeavyIslandSolver::JointSprings::set_segment(int next) {
  segment = next;
  Spring& s = axis();
  const bool is_held = AxisLaw::is_held(next);
  const double lacks = is_held ? 0.0 : law->offset(next) - impulse;
  s.stiffness = is_held ? held_stiffness : law->slope();
  constant = s.stiffness > 0.0 ? 0.0 : lacks;
  s.error = (is_held ? law->held_speed(next) : s.stiffness > 0.0 ? lacks / s.stiffness : 0.0) - speed;
}

double HeavyIslandSolver::JointSprings::axis_speed(const double* changes) const {
  return speed + axis().error - part[1].lacking_speed(2, changes);
}

bool HeavyIslandSolver::JointSprings::follow(const double* changes, bool may_switch, BlockCholesky& matrix) {
  constexpr double kTolerance_ups = 1e-6;
  for (Springs& s : part)
    for (int k = 0; k < 3; ++k) s.spring[k].change = s.spring[k].stiffness * s.lacking_speed(k, changes);
  if (law == nullptr) return false;
  axis().change += constant;
  if (!may_switch) return false;
  const int next = law->next_segment(segment, axis_speed(changes), impulse + axis().change, kTolerance_ups,
                                     JointSolver::RowSprings::kCompliance * held_stiffness * kTolerance_ups);
  if (next == segment) return false;
  part[1].update({true, true, false}, matrix);
  set_segment(next);
  return true;
}

double HeavyIslandSolver::PatchFriction::load(std::span<const Point> island,
                                              const BatchPoints& points) const {
  if (patch->is_elastic) return patch->spring_wrench[0];
  double load = 0.0;
  for (const Point& p : island)
    if (p.row[0] == patch->row && !is_pair(p.kind))
      load += static_cast<double>(points.point[p.index].normal_impulse[p.lane]);
  return load;
}

double HeavyIslandSolver::PatchFriction::limit_share(double load) const {
  const auto& [x, y, torque] = patch->friction_sum;
  const double limit = static_cast<double>(patch->friction) * load,
               twist = torque - (patch->centre_x * y - patch->centre_y * x);
  const double squares = x * x + y * y + twist * twist / std::max(patch->gyration_squared, 1e-12);
  return squares / std::max(limit * limit, 1e-30);
}

double HeavyIslandSolver::Springs::lacking_speed(int k, const double* changes) const {
  double lacks = spring[k].error;
  for (int side = 0; side < 2; ++side) {
    if (body[side] < 0) continue;
    const double *const row = jacobian[side][k], *const change = changes + 6 * body[side];
    for (int i = 0; i < 6; ++i) lacks -= row[i] * change[i];
  }
  return lacks;
}

// Each speed is the difference that lacking_speed() takes, in its order.
void HeavyIslandSolver::Springs::find_lacking_speeds(const double* changes, double (&lacks)[3]) const {
  for (int k = 0; k < 3; ++k) lacks[k] = spring[k].error;
  for (int side = 0; side < 2; ++side) {
    if (body[side] < 0) continue;
    const BlockCholesky::Rows& j = jacobian[side];
    const double* const change = changes + 6 * body[side];
    for (int i = 0; i < 6; ++i)
      for (int k = 0; k < 3; ++k) lacks[k] -= j[k][i] * change[i];
  }
}

void HeavyIslandSolver::Springs::add_force(const double (&force)[3], double* right_side) const {
  if (force[0] == 0.0 && force[1] == 0.0 && force[2] == 0.0) return;  // as of points that only touch
  for (int side = 0; side < 2; ++side) {
    if (body[side] < 0) continue;
    const BlockCholesky::Rows& j = jacobian[side];
    double sum[6];  // the compiler knows that it does not overlap the Jacobian
    for (int i = 0; i < 6; ++i) sum[i] = force[0] * j[0][i] + force[1] * j[1][i] + force[2] * j[2][i];
    double* const to = right_side + 6 * body[side];
    for (int i = 0; i < 6; ++i) to[i] += sum[i];
  }
}

void HeavyIslandSolver::Springs::update(const bool (&wanted)[3], BlockCholesky& matrix) {
  double weight[3];
  for (int k = 0; k < 3; ++k) {
    weight[k] = (static_cast<int>(wanted[k]) - static_cast<int>(in_matrix[k])) * spring[k].stiffness;
    in_matrix[k] = wanted[k];
  }
  if (weight[0] == 0.0 && weight[1] == 0.0 && weight[2] == 0.0) return;
  for (int side = 0; side < 2; ++side)
    if (body[side] >= 0) matrix.add(body[side], body[side], weight, jacobian[side], jacobian[side]);
  if (body[0] >= 0 && body[1] >= 0) matrix.add(body[0], body[1], weight, jacobian[0], jacobian[1]);
}

void HeavyIslandSolver::prepare_island(const Island& island, const BatchPoints& points,
                                       const SolverBodies& rows, BlockCholesky& bodies) {
  bodies.reset(island.body_count);
  for (Point& p : std::span(points_).subspan(island.first_point, island.point_count)) {
    set_axes(p, points, rows, island);
    if (p.body[0] >= 0 && p.body[1] >= 0) bodies.connect(p.body[0], p.body[1]);
  }
  for (const JointSprings& j : std::span(joints_).subspan(island.first_joint, island.joint_count))
    if (j.row[0] >= 0 && j.row[1] >= 0) bodies.connect(j.part[0].body[0], j.part[0].body[1]);
  bodies.analyse();
  for (int i = 0; i < island.body_count; ++i) {
    const std::int32_t row = rows_[island.first_body + i];
    const Eigen::Matrix3d inertia = to_matrix(rows.inverse_inertia[row]).cast<double>().inverse();
    for (int k = 0; k < 3; ++k) {
      bodies.add_to_diagonal(i, k, k, 1.0 / static_cast<double>(rows.velocity[row].inverse_mass));
      for (int j = 0; j <= k; ++j) bodies.add_to_diagonal(i, 3 + k, 3 + j, inertia(k, j));
    }
  }
}

void HeavyIslandSolver::set_up(const IslandContacts& of, const BatchPoints& points, const SolverBodies& rows,
                               const Substep& substep, const Island& island, bool with_friction,
                               BlockCholesky& matrix) {
  double blow = 0.0;
  for (Point& p : of.points) {
    set_up(p, points, rows, is_pair(p.kind) ? substep.pair_params : substep.static_params, substep.is_soft);
    if (island.is_pressed) blow = std::max(blow, p.normal().error / p.least_inverse_mass);
  }
  for (Point& p : of.points) {
    set_stiffness(p, points, is_pair(p.kind) ? substep.pair_params : substep.static_params, blow);
    std::fill_n(p.in_matrix, 3, false);
    if (with_friction) continue;
    p.sticks = false, p.stuck_again = true;
    for (int k = 1; k < 3; ++k) p.spring[k].change = -p.spring[k].impulse;
  }
  for (PatchFriction& f : of.patches) {
    set_up(f, rows);
    std::fill_n(f.in_matrix, 3, false);
    const auto holds = [&] { return f.limit_share(f.load(of.points, points)) < kHolding * kHolding; };
    f.sticks = with_friction && f.patch->friction > 0.0F &&
               (f.patch->is_lumped || ((f.patch->may_lump() || f.patch->is_elastic) && holds()));
    if (f.sticks) f.update({true, true, true}, matrix);
  }
  for (JointSprings& j : of.joints) {
    set_up(j, rows, substep);
    for (Springs& s : j.part) {
      std::fill_n(s.in_matrix, 3, false);
      s.update({true, true, true}, matrix);
    }
  }
}

void HeavyIslandSolver::assemble(const IslandContacts& of, BlockCholesky& matrix,
                                 std::span<double> right_side) {
  std::ranges::fill(right_side, 0.0);
  double* const b = right_side.data();
  for (Point& p : of.points) {
    const bool sticks = p.bears && p.sticks;
    p.update({p.bears, sticks, sticks}, matrix);
    double force[3] = {p.bears ? p.normal().stiffness * p.normal().error : -p.normal().impulse};
    for (int k = 1; k < 3; ++k)
      force[k] = sticks ? p.spring[k].stiffness * p.spring[k].error : p.spring[k].change;
    p.add_force(force, b);
  }
  const auto add_forces = [&](const Springs& of_all) {
    const Spring(&s)[3] = of_all.spring;
    of_all.add_force({s[0].stiffness * s[0].error, s[1].stiffness * s[1].error, s[2].stiffness * s[2].error},
                     b);
  };
  for (const PatchFriction& f : of.patches)
    if (f.sticks) add_forces(f);
  for (JointSprings& j : of.joints) {
    j.part[1].update({true, true, true}, matrix);
    for (const Springs& s : j.part) add_forces(s);
    j.part[1].add_force({0.0, 0.0, j.constant}, b);
  }
}

bool HeavyIslandSolver::Point::follow(const double* changes, double friction_coefficient, bool may_switch) {
  double lacking[3];
  find_lacking_speeds(changes, lacking);
  const double lacks = lacking[0];
  const bool bore = bears;
  bears = bore ? normal().impulse + normal().stiffness * lacks > 0.0 : lacks > 0.0;
  normal().change = bore && bears ? normal().stiffness * lacks : -normal().impulse;
  bool changed = bears != bore;
  if (!may_switch) bears = bore;
  const double limit = friction_coefficient * (normal().impulse + normal().change);
  double friction[2], work = 0.0;
  for (int k = 0; k < 2; ++k) {
    Spring& t = spring[1 + k];
    const double lack = lacking[1 + k];
    if (sticks) t.change = t.stiffness * lack;
    friction[k] = t.impulse + t.change;
    work += friction[k] * lack;
  }
  const double length = std::sqrt(friction[0] * friction[0] + friction[1] * friction[1]);
  // If friction points along the slip, or is less than the load allows, the point sticks.
  if (!sticks && bears && (work < 0.0 || length < slipping_share * limit) && !stuck_again)
    return sticks = stuck_again = true;
  if (length <= limit) return changed;
  changed |= sticks && bears;
  sticks = false;
  const double scale = law::cone_scale(length, limit);
  for (int k = 0; k < 2; ++k) spring[1 + k].change = scale * friction[k] - spring[1 + k].impulse;
  return changed;
}

void HeavyIslandSolver::ElasticPatch::set_up(MemberData& data, const SolverBodies& rows,
                                             const Substep& substep) {
  motion = motion_of(rows.velocity[patch->row]);
  first_load = data.loads.size();
  append_loads(*list, *patch, substep.static_params.h_s, substep.is_soft, data.loads);
  load_count = data.loads.size() - first_load;
  for (const LinearLoad& load : std::span(data.loads).subspan(first_load))
    data.bears.push_back(load.at_velocity(motion) > 0.0 ? 1 : 0);
  in_matrix.setZero();
}

void HeavyIslandSolver::ElasticPatch::assemble(const MemberData& data, BlockCholesky& matrix,
                                               double* right_side) {
  Vector3 force = -Vector3(patch->spring_wrench);
  support::Matrix3 stiffness = support::Matrix3::Zero();
  for (std::size_t i = first_load; i < first_load + load_count; ++i) {
    if (!data.bears[i]) continue;
    const LinearLoad& load = data.loads[i];
    force += load.at_velocity(motion) * load.at;
    stiffness += load.per_speed * load.at * load.at.transpose();
  }
  // The motion is the velocity along z, and the angular velocities about −y and x.
  const support::Matrix3 change = stiffness - in_matrix;
  matrix.add_to_diagonal(body, 2, 2, change(0, 0));
  matrix.add_to_diagonal(body, 3, 2, change(2, 0));
  matrix.add_to_diagonal(body, 3, 3, change(2, 2));
  matrix.add_to_diagonal(body, 4, 2, -change(1, 0));
  matrix.add_to_diagonal(body, 4, 3, -change(1, 2));
  matrix.add_to_diagonal(body, 4, 4, change(1, 1));
  in_matrix = stiffness;
  double* const to = right_side + BlockCholesky::kSize * body;
  to[2] += force[0], to[3] += force[2], to[4] -= force[1];
}

Vector3 HeavyIslandSolver::ElasticPatch::motion_after(const double* changes) const {
  const double* const change = changes + BlockCholesky::kSize * body;
  return motion + Vector3(change[2], -change[4], change[3]);
}

bool HeavyIslandSolver::ElasticPatch::follow(MemberData& data, const double* changes) const {
  const Vector3 after = motion_after(changes);
  bool changed = false;
  for (std::size_t i = first_load; i < first_load + load_count; ++i) {
    const char bears = data.loads[i].at_velocity(after) > 0.0 ? 1 : 0;
    changed |= bears != data.bears[i];
    data.bears[i] = bears;
  }
  return changed;
}

void HeavyIslandSolver::ElasticPatch::apply(const MemberData& data, const double* changes,
                                            const SolverBodies& rows, bool is_soft) const {
  SupportPatch& p = *patch;
  const Vector3 last_wrench(p.spring_wrench);
  take_back_spring_stage(*list, p, is_soft);
  take_loads(*list, p, std::span(data.loads).subspan(first_load, load_count), motion_after(changes));
  BodyVelocity& m = rows.velocity[p.row];
  support::apply_wrench(Vector3(p.spring_wrench) - last_wrench, m, rows.inverse_inertia[p.row]);
}

void HeavyIslandSolver::apply(const IslandContacts& of, const double* changes, const BatchPoints& points,
                              const SolverBodies& rows, const Substep& substep) {
  const bool is_soft = substep.is_soft;
  const auto move = [&](const Springs& s, int k, std::int32_t row, int side, BodyVelocity* velocity) {
    BodyVelocity& m = velocity[row];
    const double* const axis = s.jacobian[side][k];
    const auto change = static_cast<float>(s.spring[k].change);
    const Vec3 turn = change * Eigen::Map<const Vector3>(axis + 3).cast<float>();
    const Vec3 spin = to_matrix(rows.inverse_inertia[row]) * turn;
    for (int i = 0; i < 3; ++i) {
      m.velocity[i] += change * m.inverse_mass * static_cast<float>(axis[i]);
      m.angular_velocity[i] += spin[i];
    }
  };
  for (Point& p : of.points) {
    BatchPoint& q = points.point[p.index];
    const auto change = static_cast<float>(p.normal().change);
    q.normal_impulse[p.lane] = std::max(0.0F, q.normal_impulse[p.lane] + change);
    if (!is_soft) {
      q.total_normal_impulse[p.lane] += q.normal_impulse[p.lane] - p.impulse[0];
      p.steady_impulse = static_cast<double>(q.normal_impulse[p.lane]);
    }
    for (int k = 0; k < 3; ++k) {
      // The first side's axis is that of the impulse.
      for (int i = 0; k > 0 && i < 3; ++i)
        q.friction_impulse[i][p.lane] += static_cast<float>(p.spring[k].change * p.jacobian[0][k][i]);
      for (int side = 0; side < 2; ++side)
        if (p.body[side] >= 0) move(p, k, p.row[side], side, rows.velocity);
    }
    p.keep(q);
  }
  for (const PatchFriction& f : of.patches) {
    if (!f.sticks) continue;
    for (int k = 0; k < 3; ++k) {
      f.patch->friction_sum[k] += f.spring[k].change;
      move(f, k, f.patch->row, 0, rows.velocity);
    }
    f.patch->is_lumped = true;
    if (f.patch->is_elastic) spread_friction(f.list->samples, *f.patch);
  }
  // The next substep repeats what contacts add to the start velocity, not what joints do.
  for (const JointSprings& j : of.joints) {
    JointEquations::Vector6 impulse;
    for (int r = 0; r < 6; ++r) {
      const Springs& s = j.part[r / 3];
      impulse[r] = s.spring[r % 3].change;
      for (int side = 0; side < 2; ++side)
        for (BodyVelocity* const velocity : {rows.velocity, substep.start_velocity})
          if (j.row[side] >= 0) move(s, r % 3, j.row[side], side, velocity);
    }
    substep.joints.add_impulse(j.joint, impulse, j.segment, j.axis_speed(changes), !is_soft);
  }
}

// Finds the set of contacts that bear, and of those that stick, by iteration. False: it does not settle, or a
// contact is wedged.
bool HeavyIslandSolver::find_changes(const Island& island, const IslandContacts& of,
                                     const BatchPoints& points, bool with_friction, MemberData& data) {
  BlockCholesky& matrix = data.matrix;
  double* const b = data.right_side;
  const auto elastic = std::span(elastic_patches_).subspan(island.first_elastic, island.elastic_count);
  // Without friction there is a set, which changes of one point at a time find (Murty's method).
  const int max_passes = with_friction ? kMaxPasses : kMaxPasses + kMaxSwitches;
  bool changed = true;
  for (int pass = 0; changed && pass < max_passes; ++pass) {
    assemble(of, matrix, {b, static_cast<std::size_t>(BlockCholesky::kSize * island.body_count)});
    for (ElasticPatch& e : elastic) e.assemble(data, matrix, b);
    if (!matrix.factor_and_solve(b)) return false;
    changed = false;
    for (Point& p : of.points)
      changed |=
          p.follow(b, with_friction ? static_cast<double>(points.point[p.index].friction[p.lane]) : 0.0,
                   pass < kMaxPasses || !changed);
    const auto follow = [&](Springs& s) {
      for (int k = 0; k < 3; ++k) s.spring[k].change = s.spring[k].stiffness * s.lacking_speed(k, b);
    };
    for (const ElasticPatch& e : elastic) changed |= e.follow(data, b);
    for (PatchFriction& f : of.patches)
      if (f.sticks) follow(f);
    for (JointSprings& j : of.joints) changed |= j.follow(b, pass < kMaxPasses, matrix);
  }
  return !changed && std::ranges::none_of(of.points, [&](Point& p) {
    return p.normal().impulse + p.normal().change > island.greatest_impulse;
  });
}

HeavyIslandSolver::Energy HeavyIslandSolver::energy_of_contacts(const Island& island,
                                                                const SolverBodies& rows,
                                                                const Substep& substep) const {
  Energy energy;
  for (const std::int32_t row : std::span(rows_).subspan(island.first_body, island.body_count)) {
    const BodyVelocity &v = rows.velocity[row], &start = substep.start_velocity[row];
    const double mass = 1.0 / static_cast<double>(v.inverse_mass);
    const Eigen::Matrix3d inertia = to_matrix(rows.inverse_inertia[row]).cast<double>().inverse();
    const Vector3 before = to_double(start.velocity), spin = to_double(start.angular_velocity),
                  change = to_double(v.velocity) - before, spin_change = to_double(v.angular_velocity) - spin;
    energy.start += 0.5 * (mass * before.squaredNorm() + spin.dot(inertia * spin));
    energy.linear += mass * before.dot(change) + spin.dot(inertia * spin_change);
    energy.quadratic += 0.5 * (mass * change.squaredNorm() + spin_change.dot(inertia * spin_change));
  }
  return energy;
}

void HeavyIslandSolver::solve_island(const Island& island, const BatchPoints& points,
                                     const SolverBodies& rows, const Substep& substep,
                                     const BlockCholesky& bodies, MemberData& data) {
  const IslandContacts of{std::span(points_).subspan(island.first_point, island.point_count),
                          std::span(patches_).subspan(island.first_patch, island.patch_count),
                          std::span(joints_).subspan(island.first_joint, island.joint_count)};
  const auto elastic = std::span(elastic_patches_).subspan(island.first_elastic, island.elastic_count);
  const auto find = [&](bool with_friction) {
    data.matrix = bodies;
    set_up(of, points, rows, substep, island, with_friction, data.matrix);
    data.loads.clear(), data.bears.clear();
    for (ElasticPatch& e : elastic) e.set_up(data, rows, substep);
    return find_changes(island, of, points, with_friction, data);
  };
  const auto take = [&] {
    apply(of, data.right_side, points, rows, substep);
    for (const ElasticPatch& e : elastic) e.apply(data, data.right_side, rows, substep.is_soft);
  };
  exchange_impulses(of.points, points, rows);
  const bool is_solved = find(true) || (island.is_pressed && find(false));
  if (is_solved) {
    take();
  } else {
    exchange_impulses(of.points, points, rows);
    for (Point& p : of.points) p.keep(points.point[p.index]);
  }
  // Contacts take energy away. Where slip turns with the load, the set may be a wrong one that adds some:
  // then normal impulses alone, which are a projection, and at last less of all.
  const bool is_passive = island.is_pressed && island.is_passive && island.joint_count == 0 &&
                          island.elastic_count == 0 && !substep.is_soft;
  if (is_passive && is_solved && energy_of_contacts(island, rows, substep).grows() && find(false)) take();
  if (is_passive) {
    const Energy energy = energy_of_contacts(island, rows, substep);
    if (energy.grows()) scale_impulses(island, of, points, rows, substep, energy.passive_share());
  }
  if (is_solved)
    for (const ElasticPatch& e : elastic)
      end_spring_stage(*e.list, *e.patch, substep.is_soft, rows.velocity[e.patch->row]);
  note_solved(island, is_solved);
}

// Leaves a share of what the contacts have done in the substep.
void HeavyIslandSolver::scale_impulses(const Island& island, const IslandContacts& of,
                                       const BatchPoints& points, const SolverBodies& rows,
                                       const Substep& substep, double share) const {
  const auto scale = static_cast<float>(share);
  for (const std::int32_t row : std::span(rows_).subspan(island.first_body, island.body_count)) {
    BodyVelocity& v = rows.velocity[row];
    const BodyVelocity& start = substep.start_velocity[row];
    for (int i = 0; i < 3; ++i) {
      v.velocity[i] = start.velocity[i] + scale * (v.velocity[i] - start.velocity[i]);
      v.angular_velocity[i] =
          start.angular_velocity[i] + scale * (v.angular_velocity[i] - start.angular_velocity[i]);
    }
  }
  for (Point& p : of.points) {
    BatchPoint& q = points.point[p.index];
    q.total_normal_impulse[p.lane] += (scale - 1.0F) * q.normal_impulse[p.lane];
    q.normal_impulse[p.lane] *= scale;
    for (int i = 0; i < 3; ++i) q.friction_impulse[i][p.lane] *= scale;
    p.keep(q);
  }
}

void HeavyIslandSolver::note_solved(const Island& island, bool is_solved) {
  for (const std::int32_t row : std::span(rows_).subspan(island.first_body, island.body_count))
    is_solved_[row] = static_cast<char>(is_solved);
}

void HeavyIslandSolver::solve(const BatchPoints& points, const SolverBodies& rows, const Substep& substep,
                              const Member& member) {
  const auto share = [this](int m) { return share_of(m); };
  for (int i; (i = queue_.take(member.index, share)) >= 0;) {
    Island& island = islands_[i];
    if (!std::exchange(island.is_prepared, true)) prepare_island(island, points, rows, matrices_[i]);
    solve_island(island, points, rows, substep, matrices_[i], members_[member.index]);
  }
}

}  // namespace smartsurf::world
