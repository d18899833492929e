#include "smartsurf/world/solver/HeavyIslandSolver.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "smartsurf/world/solver/ContactLaw-inl.h"

namespace smartsurf::world {
namespace {

using Vector3 = Eigen::Vector3d;

// Contacts up to this separation take part, u.
constexpr float kTouchingSeparation = 1e-3F;
// Compliance of a hard contact, relative to that of the heavier body.
constexpr double kCompliance = 1e-3;
// The part of a steady load that deflects no spring; see SubstepParams::steady_share.
constexpr double kSteadyShare = 0.8;
// The greatest deflection of a contact under its load, u.
constexpr float kMaxDeflection = 0.5F * kSlop;
constexpr int kMaxPasses = 12;
// A contact bears no more than this many times the weight, the forces and the momentum of its island; what
// does is wedged, and its stresses are no load.
constexpr double kGreatestLeverage = 8.0;

bool is_bearing(const BatchPoint& p, int lane) {
  return p.normal_mass[lane] > 0.0F &&
         (p.normal_impulse[lane] > 0.0F || p.separation[lane] <= kTouchingSeparation);
}

// True if any point of the lane bears or touches.
bool any_bearing(const ContactBatch& o, const BatchPoints& points, int lane) {
  for (int k = o.first_point; k < o.first_point + o.point_count; ++k)
    if (is_bearing(points.point[k], lane)) return true;
  return false;
}

Vector3 load(const float (*from)[kLanes], int lane) { return {from[0][lane], from[1][lane], from[2][lane]}; }
Vector3 to_double(const float (&v)[3]) { return {v[0], v[1], v[2]}; }
Eigen::Map<const Eigen::Matrix<double, 6, 1>> row_of(const double (&v)[6]) {
  return Eigen::Map<const Eigen::Matrix<double, 6, 1>>(v);
}

}  // namespace

void HeavyIslandSolver::reset(int member_count) {
  heavy_rows_.resize(member_count);
  for (HeavyRows& h : heavy_rows_) h.rows.clear();
  islands_.clear();
}

void HeavyIslandSolver::find_heavy_lanes(const ContactBatch& o, ContactKind kind, const BatchPoints& points,
                                         const BodyVelocity* velocity, float weight_impulse, int member) {
  float load[kLanes] = {};
  for (int k = o.first_point; k < o.first_point + o.point_count; ++k)
    for (int lane = 0; lane < kLanes; ++lane) load[lane] += points.point[k].normal_impulse[lane];
  for (int lane = 0; lane < o.lane_count; ++lane) {
    const float a = velocity[o.a[lane]].inverse_mass,
                b = is_pair(kind) ? velocity[o.b[lane]].inverse_mass : 0.0F;
    const float lighter = std::max(a, b), heavier = std::min(a, b);
    const bool of_unequal = heavier > 0.0F && lighter > kHeavyLoad * heavier;
    if (load[lane] * lighter <= kHeavyLoad * weight_impulse && !of_unequal) continue;
    if (any_bearing(o, points, lane)) heavy_rows_[member].rows.push_back(a >= b ? o.a[lane] : o.b[lane]);
  }
}

bool HeavyIslandSolver::any_heavy_lane() const {
  return std::ranges::any_of(heavy_rows_, [](const HeavyRows& h) { return !h.rows.empty(); });
}

std::int32_t HeavyIslandSolver::find_root(std::int32_t row) {
  auto parent = [this](std::int32_t i) -> std::int32_t& { return parent_[i]; };
  while (parent(row) != row) row = parent(row) = parent(parent(row));
  return row;
}

// Calls each(batch, kind, lane) for the lanes with a point that bears or touches.
template <class Each>
void HeavyIslandSolver::for_each_bearing_lane(const ConstraintGraph& graph, const BatchPoints& points,
                                              Each each) {
  const auto visit = [&](const BatchRange& range) {
    for (int i = range.first; i < range.first + range.count; ++i) {
      const ContactBatch& o = graph.batch(i);
      for (int lane = 0; lane < o.lane_count; ++lane)
        if (any_bearing(o, points, lane)) each(o, range.kind, lane);
    }
  };
  for (const ConstraintGraph::Colour& c : graph.colours()) visit(c.spheres), visit(c.general);
  visit(graph.sphere_static()), visit(graph.general_static());
}

void HeavyIslandSolver::build(const ConstraintGraph& graph, const BodyStore& bodies,
                              const SpatialPartition& partition, const BatchPoints& points,
                              const BodyVelocity* velocity, std::span<SupportPatches> supports,
                              const Vec3& gravity, float h_s) {
  const auto row_count = static_cast<std::size_t>(partition.row_count());
  const auto moves = [&](std::int32_t row) { return velocity[row].inverse_mass > 0.0F; };
  parent_.resize(row_count);
  std::iota(parent_.begin(), parent_.end(), 0);
  for_each_bearing_lane(graph, points, [&](const ContactBatch& o, ContactKind kind, int lane) {
    if (!is_pair(kind) || !moves(o.a[lane]) || !moves(o.b[lane])) return;
    const std::int32_t a = find_root(o.a[lane]), b = find_root(o.b[lane]);
    parent_[std::max(a, b)] = std::min(a, b);
  });
  constexpr std::int32_t kNone = -1, kHeavy = -2;
  island_of_row_.assign(row_count, kNone);
  body_of_row_.assign(row_count, kNone);
  for (const HeavyRows& h : heavy_rows_)
    for (const std::int32_t row : h.rows)
      if (moves(row)) island_of_row_[find_root(row)] = kHeavy;
  // Bodies with joints, and cells that yield, have solvers of their own. Where surfaces move, or press from
  // the side or down, the loads are those of a squeeze, which has no solution that holds everything.
  const auto is_squeezed = [&](std::int32_t k, int lane) {
    constexpr float kLeastNormalZ = 0.5F, kGreatestDepth = 0.02F;
    const BatchPoint& p = points.point[k];
    const float(&surface)[3][kLanes] = points.detail[k].surface_velocity;
    return is_bearing(p, lane) &&
           (p.normal[2][lane] < kLeastNormalZ || p.separation[lane] < -kGreatestDepth ||
            surface[0][lane] != 0.0F || surface[1][lane] != 0.0F || surface[2][lane] != 0.0F);
  };
  for_each_bearing_lane(graph, points, [&](const ContactBatch& o, ContactKind kind, int lane) {
    if (is_pair(kind)) return;
    for (int k = o.first_point; k < o.first_point + o.point_count; ++k)
      if (is_squeezed(k, lane) ||
          (o.has_impulse_limit && points.limit[k].stall_impulse[lane] < BatchPointLimit::kUnlimited))
        island_of_row_[find_root(o.a[lane])] = kNone;
  });
  const auto is_fast = [&](std::size_t row) {
    constexpr double kFast = 1.0;  // u/s: a blow is no load
    return to_double(velocity[row].velocity).squaredNorm() > kFast * kFast;
  };
  for (std::size_t row = 0; row < row_count; ++row)
    if (bodies.is_jointed[partition.body(static_cast<int>(row))] || is_fast(row))
      island_of_row_[find_root(static_cast<std::int32_t>(row))] = kNone;
  // The root of an island is its first row, and comes before the others.
  islands_.clear();
  for (std::size_t i = 0; i < row_count; ++i) {
    const auto row = static_cast<std::int32_t>(i);
    if (!moves(row)) continue;
    const std::int32_t root = find_root(row);
    if (island_of_row_[root] == kNone) continue;
    if (root == row) {
      island_of_row_[row] = static_cast<std::int32_t>(islands_.size());
      islands_.push_back({});
    }
    island_of_row_[row] = island_of_row_[root];
    body_of_row_[row] = islands_[island_of_row_[row]].body_count++;
  }
  std::int32_t bodies_so_far = 0;
  for (Island& island : islands_) {
    island.first_body = bodies_so_far;
    if (island.body_count > kMaxBodies || bodies_so_far + island.body_count > kMaxBodiesInAll)
      island.body_count = 0;
    bodies_so_far += island.body_count;
  }
  rows_.resize(bodies_so_far);
  for (std::size_t i = 0; i < row_count; ++i)
    if (body_of_row_[i] >= 0) {
      Island& island = islands_[island_of_row_[i]];
      if (island.body_count == 0) {
        body_of_row_[i] = kNone;
        continue;
      }
      rows_[island.first_body + body_of_row_[i]] = static_cast<std::int32_t>(i);
      const float force = bodies.wrench[partition.body(static_cast<int>(i))].force.norm();
      const float speed = h_s * gravity.norm() + Vec3(velocity[i].velocity).norm();
      island.greatest_impulse +=
          kGreatestLeverage * static_cast<double>(speed / velocity[i].inverse_mass + h_s * force);
    }
  points_.clear();
  for_each_bearing_lane(graph, points, [&](const ContactBatch& o, ContactKind kind, int lane) {
    const bool of_pair = is_pair(kind);
    std::int32_t row[2] = {o.a[lane], of_pair ? o.b[lane] : -1};
    for (std::int32_t& r : row)
      if (r >= 0 && !moves(r)) r = -1;
    const std::int32_t body[2] = {row[0] >= 0 ? body_of_row_[row[0]] : -1,
                                  row[1] >= 0 ? body_of_row_[row[1]] : -1};
    if (body[0] < 0 && body[1] < 0) return;
    for (int k = o.first_point; k < o.first_point + o.point_count; ++k) {
      if (!is_bearing(points.point[k], lane)) continue;
      Point& p = points_.emplace_back();
      p.index = k, p.lane = lane;
      p.row[0] = o.a[lane], p.row[1] = of_pair ? o.b[lane] : -1;
      p.body[0] = body[0], p.body[1] = body[1];
      p.is_sphere = is_sphere_kind(kind);
      p.steady_impulse = static_cast<double>(points.point[k].normal_impulse[lane]);
    }
  });
  const auto island_of = [&](const Point& p) { return island_of_row_[p.body[0] >= 0 ? p.row[0] : p.row[1]]; };
  std::stable_sort(points_.begin(), points_.end(),
                   [&](const Point& p, const Point& q) { return island_of(p) < island_of(q); });
  std::int32_t point = 0;
  for (std::size_t i = 0; i < islands_.size(); ++i) {
    islands_[i].first_point = point;
    while (point < std::ssize(points_) && island_of(points_[point]) == static_cast<std::int32_t>(i)) ++point;
    islands_[i].point_count = point - islands_[i].first_point;
  }
  patches_.clear();
  for (std::size_t i = 0; i < islands_.size(); ++i) {
    Island& island = islands_[i];
    island.first_patch = static_cast<std::int32_t>(patches_.size());
    for (SupportPatches& list : supports)
      for (SupportPatch& p : list.patches)
        if (body_of_row_[p.row] >= 0 && island_of_row_[p.row] == static_cast<std::int32_t>(i) && !p.moves)
          patches_.push_back({&p, body_of_row_[p.row], {}});
    island.patch_count = static_cast<std::int32_t>(patches_.size()) - island.first_patch;
  }
  std::erase_if(islands_, [](const Island& island) { return island.body_count == 0; });
}

void HeavyIslandSolver::set_up(Point& p, const BatchPoints& points, const SolverBodies& rows,
                               const SubstepParams& params, bool is_soft) {
  const BatchPoint& q = points.point[p.index];
  const BatchPointDetail& d = points.detail[p.index];
  const Vector3 n = load(q.normal, p.lane);
  law::Vector3<float> t, u;
  law::tangents(to_law(n.cast<float>()), t, u);
  const Vector3 axis[3] = {n, from_law(t).cast<double>(), from_law(u).cast<double>()};
  Spring* const spring[3] = {&p.normal, &p.tangent[0], &p.tangent[1]};
  double speed[3] = {}, displacement = 0.0, least_inverse_mass = 1e30;
  for (int side = 0; side < 2; ++side) {
    if (p.row[side] < 0) continue;
    const BodyVelocity& m = rows.velocity[p.row[side]];
    const DeltaPose& delta = rows.delta_pose[p.row[side]];
    Vector3 anchor = load(side == 0 ? d.anchor_a : d.anchor_b, p.lane);
    if (p.is_sphere) anchor = n * static_cast<double>(side == 0 ? -q.radius_a[p.lane] : q.radius_b[p.lane]);
    for (int k = 0; k < 3; ++k) {
      const Vector3 along = side == 0 ? axis[k] : Vector3(-axis[k]);
      const Vector3 turn = anchor.cross(along);
      for (int i = 0; i < 3; ++i)
        spring[k]->jacobian[side][i] = along[i], spring[k]->jacobian[side][3 + i] = turn[i];
      speed[k] += along.dot(to_double(m.velocity)) + turn.dot(to_double(m.angular_velocity));
      if (k == 0)
        displacement += along.dot(to_double(delta.translation)) + turn.dot(to_double(delta.rotation));
    }
    if (m.inverse_mass > 0.0F)
      least_inverse_mass = std::min(least_inverse_mass, static_cast<double>(m.inverse_mass));
  }
  if (p.row[1] < 0) {
    const Vector3 surface = load(d.surface_velocity, p.lane);
    for (int k = 0; k < 3; ++k) speed[k] -= axis[k].dot(surface);
    displacement -= n.dot(surface) * static_cast<double>(params.elapsed_s);
  }
  const double hard = 1.0 / (kCompliance * least_inverse_mass);
  const Vector3 friction = load(q.friction_impulse, p.lane);
  for (int k = 1; k < 3; ++k) {
    spring[k]->impulse = axis[k].dot(friction);
    spring[k]->stiffness = hard, spring[k]->error = -speed[k], spring[k]->change = 0.0;
  }
  p.normal.impulse = static_cast<double>(q.normal_impulse[p.lane]);
  p.normal.stiffness = hard;
  double target = static_cast<double>(q.relax_target_speed[p.lane]);
  if (is_soft) {
    const float separation = q.separation[p.lane] + static_cast<float>(displacement);
    target = static_cast<double>(law::push_out_speed(separation, params));
    if (separation <= 0.0F) {
      const double soft = static_cast<double>(params.impulse_scale /
                                              (params.mass_scale * q.normal_mass[p.lane])),
                   capped = static_cast<double>(params.bias_rate * kMaxDeflection) /
                            std::max(p.steady_impulse, 1e-12);
      const double compliance = std::max(std::min(soft, capped), 1.0 / hard);
      target -= compliance * (p.normal.impulse - kSteadyShare * p.steady_impulse);
      p.normal.stiffness = 1.0 / compliance;
    }
  }
  p.normal.error = target - speed[0];
  p.normal.change = 0.0;
  p.bears = p.normal.impulse > 0.0 || p.normal.error > 0.0;
  p.sticks = q.friction[p.lane] > 0.0F;
}

void HeavyIslandSolver::set_up(PatchFriction& f, const SolverBodies& rows) {
  const SupportPatch& p = *f.patch;
  const BodyVelocity& m = rows.velocity[p.row];
  const double z = static_cast<double>(p.z);
  const double axis[3][6] = {{1, 0, 0, 0, z, 0}, {0, 1, 0, -z, 0, 0}, {0, 0, 0, 0, 0, 1}};
  const double inertia = 1.0 / static_cast<double>(to_matrix(rows.inverse_inertia[p.row])(2, 2));
  const double hard = 1.0 / (kCompliance * static_cast<double>(m.inverse_mass));
  for (int k = 0; k < 3; ++k) {
    Spring& s = f.spring[k];
    double speed = 0.0;
    for (int i = 0; i < 3; ++i) {
      s.jacobian[0][i] = axis[k][i], s.jacobian[0][3 + i] = axis[k][3 + i];
      speed += axis[k][i] * static_cast<double>(m.velocity[i]) +
               axis[k][3 + i] * static_cast<double>(m.angular_velocity[i]);
    }
    s.stiffness = k < 2 ? hard : inertia / kCompliance;
    s.error = -speed, s.change = 0.0;
  }
}

// Adds a spring to the equations, or a force alone.
void HeavyIslandSolver::add(const Spring& s, const std::int32_t (&body)[2], bool is_stiff, double force) {
  Eigen::Map<Eigen::MatrixXd> a(matrix_.data(), size_, size_);
  Eigen::Map<Eigen::VectorXd> b(right_side_.data(), size_);
  for (int side = 0; side < 2; ++side) {
    if (body[side] < 0) continue;
    b.segment<6>(6 * body[side]) += force * row_of(s.jacobian[side]);
    for (int other = 0; is_stiff && other < 2; ++other)
      if (body[other] >= 0)
        a.block<6, 6>(6 * body[side], 6 * body[other]) +=
            s.stiffness * row_of(s.jacobian[side]) * row_of(s.jacobian[other]).transpose();
  }
}

// The speed that a spring still lacks with the velocity changes of the solution.
double HeavyIslandSolver::lacking_speed(const Spring& s, const std::int32_t (&body)[2]) const {
  Eigen::Map<const Eigen::VectorXd> solution(right_side_.data(), size_);
  double lacks = s.error;
  for (int side = 0; side < 2; ++side)
    if (body[side] >= 0) lacks -= row_of(s.jacobian[side]).dot(solution.segment<6>(6 * body[side]));
  return lacks;
}

void HeavyIslandSolver::solve_island(const Island& island, const BatchPoints& points,
                                     const SolverBodies& rows, const SubstepParams& pair_params,
                                     const SubstepParams& static_params, bool is_soft) {
  const auto of_island = std::span(points_).subspan(island.first_point, island.point_count);
  const auto patches = std::span(patches_).subspan(island.first_patch, island.patch_count);
  for (Point& p : of_island) set_up(p, points, rows, p.row[1] < 0 ? static_params : pair_params, is_soft);
  for (PatchFriction& f : patches) set_up(f, rows);
  size_ = 6 * island.body_count;
  matrix_.resize(static_cast<std::size_t>(size_) * static_cast<std::size_t>(size_));
  right_side_.resize(size_);
  Eigen::Map<Eigen::MatrixXd> a(matrix_.data(), size_, size_);
  Eigen::Map<Eigen::VectorXd> b(right_side_.data(), size_);
  bool changed = true;
  for (int pass = 0; changed && pass < kMaxPasses; ++pass) {
    a.setZero(), b.setZero();
    for (int i = 0; i < island.body_count; ++i) {
      const std::int32_t row = rows_[island.first_body + i];
      const BodyVelocity& m = rows.velocity[row];
      a.block<3, 3>(6 * i, 6 * i).diagonal().setConstant(1.0 / static_cast<double>(m.inverse_mass));
      const Eigen::Matrix3d inverse_inertia = to_matrix(rows.inverse_inertia[row]).cast<double>();
      a.block<3, 3>(6 * i + 3, 6 * i + 3) = inverse_inertia.inverse();
    }
    for (const Point& p : of_island) {
      add(p.normal, p.body, p.bears, p.bears ? p.normal.stiffness * p.normal.error : -p.normal.impulse);
      for (const Spring& t : p.tangent)
        add(t, p.body, p.bears && p.sticks, p.bears && p.sticks ? t.stiffness * t.error : t.change);
    }
    for (const PatchFriction& f : patches)
      for (const Spring& s : f.spring)
        if (f.patch->is_lumped) add(s, {f.body, -1}, true, s.stiffness * s.error);
    Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> cholesky(a);
    if (cholesky.info() != Eigen::Success) return;
    cholesky.solveInPlace(b);
    changed = false;
    for (Point& p : of_island) {
      const double lacks = lacking_speed(p.normal, p.body);
      const bool bears = p.bears ? p.normal.impulse + p.normal.stiffness * lacks > 0.0 : lacks > 0.0;
      p.normal.change = p.bears && bears ? p.normal.stiffness * lacks : -p.normal.impulse;
      changed |= bears != p.bears;
      p.bears = bears;
      const double limit =
          static_cast<double>(points.point[p.index].friction[p.lane]) * (p.normal.impulse + p.normal.change);
      double friction[2];
      for (int k = 0; k < 2; ++k) {
        Spring& t = p.tangent[k];
        if (p.sticks) t.change = t.stiffness * lacking_speed(t, p.body);
        friction[k] = t.impulse + t.change;
      }
      const double length = std::hypot(friction[0], friction[1]);
      if (length <= limit) continue;
      changed |= p.sticks && p.bears;
      p.sticks = false;
      for (int k = 0; k < 2; ++k) p.tangent[k].change = friction[k] * limit / length - p.tangent[k].impulse;
    }
    for (PatchFriction& f : patches)
      for (Spring& s : f.spring)
        if (f.patch->is_lumped) s.change = s.stiffness * lacking_speed(s, {f.body, -1});
  }
  if (std::ranges::any_of(of_island, [&](const Point& p) {
        return p.normal.impulse + p.normal.change > island.greatest_impulse;
      }))
    return;
  const auto apply = [&](const Spring& s, std::int32_t row, int side) {
    BodyVelocity& m = rows.velocity[row];
    const auto change = static_cast<float>(s.change);
    const Vec3 turn = change * row_of(s.jacobian[side]).tail<3>().cast<float>();
    const Vec3 spin = to_matrix(rows.inverse_inertia[row]) * turn;
    for (int i = 0; i < 3; ++i) {
      m.velocity[i] += change * m.inverse_mass * static_cast<float>(s.jacobian[side][i]);
      m.angular_velocity[i] += spin[i];
    }
  };
  for (Point& p : of_island) {
    BatchPoint& q = points.point[p.index];
    const auto change = static_cast<float>(p.normal.change);
    q.normal_impulse[p.lane] = std::max(0.0F, q.normal_impulse[p.lane] + change);
    if (!is_soft) {
      q.total_normal_impulse[p.lane] += change;
      p.steady_impulse = static_cast<double>(q.normal_impulse[p.lane]);
    }
    for (int side = 0; side < 2; ++side)
      if (p.body[side] >= 0) apply(p.normal, p.row[side], side);
    for (const Spring& t : p.tangent) {
      // The first side's axis is that of the impulse.
      for (int i = 0; i < 3; ++i)
        q.friction_impulse[i][p.lane] += static_cast<float>(t.change * t.jacobian[0][i]);
      for (int side = 0; side < 2; ++side)
        if (p.body[side] >= 0) apply(t, p.row[side], side);
    }
  }
  for (const PatchFriction& f : patches)
    for (int k = 0; k < 3 && f.patch->is_lumped; ++k) {
      f.patch->friction_sum[k] += f.spring[k].change;
      apply(f.spring[k], f.patch->row, 0);
    }
}

void HeavyIslandSolver::solve(const BatchPoints& points, const SolverBodies& rows,
                              const SubstepParams& pair_params, const SubstepParams& static_params,
                              bool is_soft) {
  for (const Island& island : islands_)
    solve_island(island, points, rows, pair_params, static_params, is_soft);
}

}  // namespace smartsurf::world
