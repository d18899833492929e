#include "smartsurf/world/solver/HeavyIslandSolver.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

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
// How far two bodies overlap without being pushed out.
float slop_of(bool of_pair, bool of_spheres) { return of_pair && !of_spheres ? kPairSlop : kSlop; }
// The greatest deflection of a contact under its load, u.
float max_deflection(bool of_pair, bool of_spheres) { return 0.5F * slop_of(of_pair, of_spheres); }
constexpr int kMaxPasses = 12;
// A point that slips faster than this has the friction of the sweeps, u/s: whether it bears is not known
// before the end.
constexpr double kSliding = 0.02;
// A contact bears no more than this many times the weight, the forces and the momentum of its island; what
// does is wedged, and its stresses are no load.
constexpr double kGreatestLeverage = 8.0;

bool is_bearing(const BatchPoint& p, int lane) {
  return p.normal_mass[lane] > 0.0F &&
         (p.normal_impulse[lane] > 0.0F || p.separation[lane] <= kTouchingSeparation);
}

// By lane: whether any of its points bears or touches.
struct BearingMask {
  std::int32_t lane[kLanes] = {};
  BearingMask(const ContactBatch& o, const BatchPoints& points) {
    for (const BatchPoint& p : std::span(points.point + o.first_point, o.point_count))
      for (int i = 0; i < kLanes; ++i)
        lane[i] |= (p.normal_mass[i] > 0.0F) &
                   ((p.normal_impulse[i] > 0.0F) | (p.separation[i] <= kTouchingSeparation));
  }
};

Vector3 load(const float (*from)[kLanes], int lane) { return {from[0][lane], from[1][lane], from[2][lane]}; }
Vector3 to_double(const float (&v)[3]) { return {v[0], v[1], v[2]}; }

}  // namespace

void HeavyIslandSolver::reset(int member_count) {
  members_.resize(member_count);
  for (MemberData& m : members_) m.heavy_rows.clear();
  islands_.clear();
}

void HeavyIslandSolver::find_heavy_lanes(const ContactBatch& o, ContactKind kind, const BatchPoints& points,
                                         const BodyVelocity* velocity, const SubstepParams& params,
                                         float weight_impulse, int member) {
  float load[kLanes] = {};
  for (int k = o.first_point; k < o.first_point + o.point_count; ++k)
    for (int lane = 0; lane < kLanes; ++lane) load[lane] += points.point[k].normal_impulse[lane];
  for (int lane = 0; lane < o.lane_count; ++lane) {
    const float a = velocity[o.a[lane]].inverse_mass,
                b = is_pair(kind) ? velocity[o.b[lane]].inverse_mass : 0.0F;
    const float lighter = std::max(a, b), heavier = std::min(a, b);
    const bool of_unequal = heavier > 0.0F && lighter > kHeavyLoad * heavier;
    // The speed that the load gives to its bearer in a substep. Spheres have springs that nothing stiffens.
    const float loading = load[lane] * lighter;
    const float deflection = (1.0F - params.steady_share) * params.impulse_scale * loading /
                             (params.mass_scale * params.bias_rate);
    const bool sinks = !is_sphere_kind(kind) && is_pair(kind) && deflection > max_deflection(true, false);
    if (loading <= kHeavyLoad * weight_impulse && !of_unequal && !sinks) continue;
    if (BearingMask(o, points).lane[lane])
      members_[member].heavy_rows.push_back(a >= b ? o.a[lane] : o.b[lane]);
  }
}

bool HeavyIslandSolver::any_heavy_lane() const {
  return std::ranges::any_of(members_, [](const MemberData& m) { return !m.heavy_rows.empty(); });
}

std::int32_t HeavyIslandSolver::find_root(std::int32_t row) {
  auto parent = [this](std::int32_t i) -> std::int32_t& { return parent_[i]; };
  while (parent(row) != row) row = parent(row) = parent(parent(row));
  return row;
}

void HeavyIslandSolver::collect_bearing_lanes(const ConstraintGraph& graph, const BatchPoints& points) {
  lanes_.clear();
  const auto visit = [&](const BatchRange& range) {
    for (int i = range.first; i < range.first + range.count; ++i) {
      const ContactBatch& o = graph.batch(i);
      const BearingMask bears(o, points);
      for (int lane = 0; lane < o.lane_count; ++lane)
        if (bears.lane[lane]) lanes_.push_back({&o, range.kind, lane});
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
  collect_bearing_lanes(graph, points);
  for (const auto& [o, kind, lane] : lanes_) {
    if (!is_pair(kind) || !moves(o->a[lane]) || !moves(o->b[lane])) continue;
    const std::int32_t a = find_root(o->a[lane]), b = find_root(o->b[lane]);
    parent_[std::max(a, b)] = std::min(a, b);
  }
  constexpr std::int32_t kNone = -1, kHeavy = -2;
  island_of_row_.assign(row_count, kNone);
  body_of_row_.assign(row_count, kNone);
  for (const MemberData& m : members_)
    for (const std::int32_t row : m.heavy_rows)
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
  for (const auto& [o, kind, lane] : lanes_) {
    if (is_pair(kind)) continue;
    for (int k = o->first_point; k < o->first_point + o->point_count; ++k)
      if (is_squeezed(k, lane) ||
          (o->has_impulse_limit && points.limit[k].stall_impulse[lane] < BatchPointLimit::kUnlimited))
        island_of_row_[find_root(o->a[lane])] = kNone;
  }
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
  collect_points(points, velocity);
  collect_patches(supports);
  std::erase_if(islands_, [](const Island& island) { return island.body_count == 0; });
}

// Island by island, in the order of the lanes.
void HeavyIslandSolver::collect_points(const BatchPoints& points, const BodyVelocity* velocity) {
  // Calls each(point, its island).
  const auto for_each_point = [&](auto each) {
    for (const auto& [o, kind, lane] : lanes_) {
      const auto body_of = [&](std::int32_t row) {
        return velocity[row].inverse_mass > 0.0F ? body_of_row_[row] : -1;
      };
      const bool of_pair = is_pair(kind);
      const std::int32_t a = body_of(o->a[lane]), b = of_pair ? body_of(o->b[lane]) : -1;
      if (a < 0 && b < 0) continue;
      Island& island = islands_[island_of_row_[a >= 0 ? o->a[lane] : o->b[lane]]];
      for (int k = o->first_point; k < o->first_point + o->point_count; ++k) {
        if (!is_bearing(points.point[k], lane)) continue;
        Point p;
        p.body[0] = a, p.body[1] = b;
        p.index = k, p.lane = lane;
        p.row[0] = o->a[lane], p.row[1] = of_pair ? o->b[lane] : -1;
        p.is_sphere = is_sphere_kind(kind);
        p.steady_impulse = static_cast<double>(points.point[k].normal_impulse[lane]);
        each(p, island);
      }
    }
  };
  for (Island& island : islands_) island.point_count = 0;
  std::int32_t count = 0;
  for_each_point([&](const Point&, Island& island) { ++island.point_count, ++count; });
  points_.resize(count);
  count = 0;
  for (Island& island : islands_) island.first_point = count, count += std::exchange(island.point_count, 0);
  for_each_point(
      [&](const Point& p, Island& island) { points_[island.first_point + island.point_count++] = p; });
}

void HeavyIslandSolver::collect_patches(std::span<SupportPatches> supports) {
  const auto for_each_patch = [&](auto each) {
    for (SupportPatches& list : supports)
      for (SupportPatch& p : list.patches)
        if (body_of_row_[p.row] >= 0 && !p.moves) each(p, islands_[island_of_row_[p.row]]);
  };
  for (Island& island : islands_) island.patch_count = 0;
  std::int32_t count = 0;
  for_each_patch([&](const SupportPatch&, Island& island) { ++island.patch_count, ++count; });
  patches_.resize(count);
  count = 0;
  for (Island& island : islands_) island.first_patch = count, count += std::exchange(island.patch_count, 0);
  for_each_patch([&](SupportPatch& p, Island& island) {
    PatchFriction& f = patches_[island.first_patch + island.patch_count++];
    f.patch = &p;
    f.body[0] = body_of_row_[p.row], f.body[1] = -1;
  });
}

void HeavyIslandSolver::set_up(Point& p, const BatchPoints& points, const SolverBodies& rows,
                               const SubstepParams& params, bool is_soft) {
  const BatchPoint& q = points.point[p.index];
  const BatchPointDetail& d = points.detail[p.index];
  const Vector3 n = load(q.normal, p.lane);
  law::Vector3<float> t, u;
  law::tangents(to_law(n.cast<float>()), t, u);
  const Vector3 axis[3] = {n, from_law(t).cast<double>(), from_law(u).cast<double>()};
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
      for (int i = 0; i < 3; ++i) p.jacobian[side][k][i] = along[i], p.jacobian[side][k][3 + i] = turn[i];
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
    p.spring[k].impulse = axis[k].dot(friction);
    p.spring[k].stiffness = hard, p.spring[k].error = -speed[k], p.spring[k].change = 0.0;
  }
  Spring& normal = p.normal();
  normal.impulse = static_cast<double>(q.normal_impulse[p.lane]);
  normal.stiffness = hard;
  double target = static_cast<double>(q.relax_target_speed[p.lane]);
  if (is_soft) {
    const float separation = q.separation[p.lane] + static_cast<float>(displacement);
    const bool of_pair = p.row[1] >= 0;
    target = static_cast<double>(law::push_out_speed(separation, params, slop_of(of_pair, p.is_sphere)));
    if (separation <= 0.0F) {
      const double soft = static_cast<double>(params.impulse_scale /
                                              (params.mass_scale * q.normal_mass[p.lane])),
                   capped = static_cast<double>(params.bias_rate * max_deflection(of_pair, p.is_sphere)) /
                            std::max(p.steady_impulse, 1e-12);
      const double compliance = std::max(std::min(soft, capped), 1.0 / hard);
      target -= compliance * (normal.impulse - kSteadyShare * p.steady_impulse);
      normal.stiffness = 1.0 / compliance;
    }
  }
  normal.error = target - speed[0];
  normal.change = 0.0;
  p.bears = normal.impulse > 0.0 || normal.error > 0.0;
  p.slides = speed[1] * speed[1] + speed[2] * speed[2] > kSliding * kSliding;
  p.sticks = q.friction[p.lane] > 0.0F && !p.slides;
}

void HeavyIslandSolver::set_up(PatchFriction& f, const SolverBodies& rows) {
  const SupportPatch& p = *f.patch;
  const BodyVelocity& m = rows.velocity[p.row];
  const double z = static_cast<double>(p.z);
  const BlockCholesky::Rows axis = {{1, 0, 0, 0, z, 0}, {0, 1, 0, -z, 0, 0}, {0, 0, 0, 0, 0, 1}};
  const double inertia = 1.0 / static_cast<double>(to_matrix(rows.inverse_inertia[p.row])(2, 2));
  const double hard = 1.0 / (kCompliance * static_cast<double>(m.inverse_mass));
  for (int k = 0; k < 3; ++k) {
    Spring& s = f.spring[k];
    double speed = 0.0;
    for (int i = 0; i < 3; ++i) {
      f.jacobian[0][k][i] = axis[k][i], f.jacobian[0][k][3 + i] = axis[k][3 + i];
      speed += axis[k][i] * static_cast<double>(m.velocity[i]) +
               axis[k][3 + i] * static_cast<double>(m.angular_velocity[i]);
    }
    s.stiffness = k < 2 ? hard : inertia / kCompliance;
    s.error = -speed, s.change = 0.0;
  }
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

void HeavyIslandSolver::Springs::add_force(const double (&force)[3], double* right_side) const {
  for (int side = 0; side < 2; ++side) {
    if (body[side] < 0) continue;
    const BlockCholesky::Rows& j = jacobian[side];
    double* const to = right_side + 6 * body[side];
    for (int i = 0; i < 6; ++i) to[i] += force[0] * j[0][i] + force[1] * j[1][i] + force[2] * j[2][i];
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

void HeavyIslandSolver::solve_island(const Island& island, const BatchPoints& points,
                                     const SolverBodies& rows, const SubstepParams& pair_params,
                                     const SubstepParams& static_params, bool is_soft, MemberData& data) {
  const auto of_island = std::span(points_).subspan(island.first_point, island.point_count);
  const auto patches = std::span(patches_).subspan(island.first_patch, island.patch_count);
  BlockCholesky& matrix = data.matrix;
  double* const b = data.right_side;
  matrix.reset(island.body_count);
  for (Point& p : of_island) {
    set_up(p, points, rows, p.row[1] < 0 ? static_params : pair_params, is_soft);
    std::fill_n(p.in_matrix, 3, false);
    if (p.body[0] >= 0 && p.body[1] >= 0) matrix.connect(p.body[0], p.body[1]);
  }
  matrix.analyse();
  for (int i = 0; i < island.body_count; ++i) {
    const std::int32_t row = rows_[island.first_body + i];
    const Eigen::Matrix3d inertia = to_matrix(rows.inverse_inertia[row]).cast<double>().inverse();
    for (int k = 0; k < 3; ++k) {
      matrix.add_to_diagonal(i, k, k, 1.0 / static_cast<double>(rows.velocity[row].inverse_mass));
      for (int j = 0; j <= k; ++j) matrix.add_to_diagonal(i, 3 + k, 3 + j, inertia(k, j));
    }
  }
  for (PatchFriction& f : patches) {
    set_up(f, rows);
    std::fill_n(f.in_matrix, 3, false);
    if (f.patch->is_lumped) f.update({true, true, true}, matrix);
  }
  bool changed = true;
  for (int pass = 0; changed && pass < kMaxPasses; ++pass) {
    std::fill_n(b, BlockCholesky::kSize * island.body_count, 0.0);
    for (Point& p : of_island) {
      const bool sticks = p.bears && p.sticks;
      p.update({p.bears, sticks, sticks}, matrix);
      double force[3] = {p.bears ? p.normal().stiffness * p.normal().error : -p.normal().impulse};
      for (int k = 1; k < 3; ++k)
        force[k] = sticks ? p.spring[k].stiffness * p.spring[k].error : p.spring[k].change;
      p.add_force(force, b);
    }
    for (const PatchFriction& f : patches) {
      const Spring(&s)[3] = f.spring;
      if (f.patch->is_lumped)
        f.add_force({s[0].stiffness * s[0].error, s[1].stiffness * s[1].error, s[2].stiffness * s[2].error},
                    b);
    }
    if (!matrix.factor()) return;
    matrix.solve(b);
    changed = false;
    for (Point& p : of_island) {
      Spring& normal = p.normal();
      const double lacks = p.lacking_speed(0, b);
      const bool bears = p.bears ? normal.impulse + normal.stiffness * lacks > 0.0 : lacks > 0.0;
      normal.change = p.bears && bears ? normal.stiffness * lacks : -normal.impulse;
      changed |= bears != p.bears;
      p.bears = bears;
      const double limit =
          static_cast<double>(points.point[p.index].friction[p.lane]) * (normal.impulse + normal.change);
      double friction[2];
      for (int k = 0; k < 2; ++k) {
        Spring& t = p.spring[1 + k];
        if (p.slides) t.change = 0.0;
        if (p.sticks) t.change = t.stiffness * p.lacking_speed(1 + k, b);
        friction[k] = t.impulse + t.change;
      }
      const double length = std::sqrt(friction[0] * friction[0] + friction[1] * friction[1]);
      if (length <= limit) continue;
      changed |= p.sticks && p.bears;
      p.sticks = false;
      for (int k = 0; k < 2; ++k)
        p.spring[1 + k].change = friction[k] * limit / length - p.spring[1 + k].impulse;
    }
    for (PatchFriction& f : patches)
      for (int k = 0; f.patch->is_lumped && k < 3; ++k)
        f.spring[k].change = f.spring[k].stiffness * f.lacking_speed(k, b);
  }
  if (std::ranges::any_of(of_island, [&](Point& p) {
        return p.normal().impulse + p.normal().change > island.greatest_impulse;
      }))
    return;
  const auto apply = [&](const Springs& s, int k, std::int32_t row, int side) {
    BodyVelocity& m = rows.velocity[row];
    const double* const axis = s.jacobian[side][k];
    const auto change = static_cast<float>(s.spring[k].change);
    const Vec3 turn = change * Eigen::Map<const Vector3>(axis + 3).cast<float>();
    const Vec3 spin = to_matrix(rows.inverse_inertia[row]) * turn;
    for (int i = 0; i < 3; ++i) {
      m.velocity[i] += change * m.inverse_mass * static_cast<float>(axis[i]);
      m.angular_velocity[i] += spin[i];
    }
  };
  for (Point& p : of_island) {
    BatchPoint& q = points.point[p.index];
    const auto change = static_cast<float>(p.normal().change);
    q.normal_impulse[p.lane] = std::max(0.0F, q.normal_impulse[p.lane] + change);
    if (!is_soft) {
      q.total_normal_impulse[p.lane] += change;
      p.steady_impulse = static_cast<double>(q.normal_impulse[p.lane]);
    }
    for (int k = 0; k < 3; ++k) {
      // The first side's axis is that of the impulse.
      for (int i = 0; k > 0 && i < 3; ++i)
        q.friction_impulse[i][p.lane] += static_cast<float>(p.spring[k].change * p.jacobian[0][k][i]);
      for (int side = 0; side < 2; ++side)
        if (p.body[side] >= 0) apply(p, k, p.row[side], side);
    }
  }
  for (const PatchFriction& f : patches)
    for (int k = 0; k < 3 && f.patch->is_lumped; ++k) {
      f.patch->friction_sum[k] += f.spring[k].change;
      apply(f, k, f.patch->row, 0);
    }
}

void HeavyIslandSolver::solve(const BatchPoints& points, const SolverBodies& rows,
                              const SubstepParams& pair_params, const SubstepParams& static_params,
                              bool is_soft, const Member& member) {
  for (std::size_t i = member.index; i < islands_.size(); i += static_cast<std::size_t>(member.member_count))
    solve_island(islands_[i], points, rows, pair_params, static_params, is_soft, members_[member.index]);
}

}  // namespace smartsurf::world
