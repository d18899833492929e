#include "smartsurf/world/solver/JointedContacts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/index/UnionFind.h"
#include "smartsurf/world/solver/ContactLaw-inl.h"
#include "smartsurf/world/solver/SupportPoints.h"

namespace smartsurf::world {
namespace {

// The entries of a root in a list in the order of their roots, from `next` on, which is then behind them.
template <class List>
IndexRange entries_of(const List& list, std::int32_t root, int& next) {
  const auto count = static_cast<int>(list.size());
  while (next < count && list[next].root < root) ++next;
  const int begin = next;
  while (next < count && list[next].root == root) ++next;
  return {begin, next};
}

}  // namespace

Vec3 JointedContacts::Point::velocity(const BodyVelocity* rows) const {
  Vec3 sum = Vec3::Zero();
  for (int side = 0; side < 2; ++side) {
    if (row[side] < 0) continue;
    const BodyVelocity& m = rows[row[side]];
    const Vec3 v = Vec3(m.velocity) + Vec3(m.angular_velocity).cross(anchor[side]);
    sum += side == 0 ? v : Vec3(-v);
  }
  return sum;
}

void JointedContacts::Point::apply(const Vec3& impulse, BodyVelocity* rows) const {
  for (int side = 0; side < 2; ++side) {
    if (row[side] < 0) continue;
    BodyVelocity& m = rows[row[side]];
    if (m.inverse_mass == 0.0F) continue;
    const Vec3 on_body = side == 0 ? impulse : Vec3(-impulse);
    Eigen::Map<Vec3>(m.velocity) += m.inverse_mass * on_body;
    Eigen::Map<Vec3>(m.angular_velocity) += inverse_inertia[side] * anchor[side].cross(on_body);
  }
}

float JointedContacts::Point::normal_speed(const BodyVelocity* rows) const {
  float sum = 0.0F;
  for (int side = 0; side < 2; ++side) {
    if (row[side] < 0) continue;
    const BodyVelocity& m = rows[row[side]];
    const float along = normal.dot(Vec3(m.velocity));
    sum += (side == 0 ? along : -along) + normal_torque[side].dot(Vec3(m.angular_velocity));
  }
  return sum;
}

void JointedContacts::Point::apply_normal(float impulse, BodyVelocity* rows) const {
  for (int side = 0; side < 2; ++side) {
    if (row[side] < 0) continue;
    BodyVelocity& m = rows[row[side]];
    if (m.inverse_mass == 0.0F) continue;
    Eigen::Map<Vec3>(m.velocity) += (side == 0 ? impulse : -impulse) * m.inverse_mass * normal;
    Eigen::Map<Vec3>(m.angular_velocity) += impulse * normal_spin[side];
  }
}

void JointedContacts::collect(const Input& in) {
  points_.clear(), lanes_.clear(), islands_.clear();
  solved_rows_ = in.solved_rows;
  in.graph.for_each_batch([&](ContactKind kind, int i) {
    const ContactBatch& o = in.graph.batch(i);
    for (int lane = 0; lane < o.lane_count; ++lane)
      if (in.is_jointed(o.a[lane]))
        lanes_.push_back({o.a[lane], in.graph.rank(kind, i, lane), i, lane, kind});
      else if (is_pair(kind) && in.is_jointed(o.b[lane]))
        lanes_.push_back({o.b[lane], in.graph.rank(kind, i, lane), i, lane, kind});
  });
  if (lanes_.empty()) return;
  unite_rows(in);
  for (Lane& l : lanes_) l.root = common::find_root(parent_, l.root);
  std::ranges::sort(lanes_, {}, [](const Lane& l) { return std::pair(l.root, l.rank); });
  is_touched_.assign(in.partition.row_count(), 0);
  for (const Lane& l : lanes_) {
    const int first = static_cast<int>(points_.size());
    add_points(in, l);
    const int end = static_cast<int>(points_.size());
    if (first == end) continue;
    if (islands_.empty() || islands_.back().root != l.root)
      islands_.push_back({l.root, {first, end}, {}, {}});
    islands_.back().points.end = end;
  }
  collect_trees(in.joints);
  collect_supports(in);
}

// What joints and contacts connect; the least row of a set is its root.
void JointedContacts::unite_rows(const Input& in) {
  parent_.resize(in.partition.row_count());
  std::iota(parent_.begin(), parent_.end(), 0);
  const auto unite = [&](std::int32_t row, std::int32_t other) {
    const std::int32_t a = common::find_root(parent_, row), b = common::find_root(parent_, other);
    parent_[std::max(a, b)] = std::min(a, b);
  };
  std::int32_t last_tree = -1, first_row = -1;
  in.joints.for_each_moving_row([&](std::int32_t tree, std::int32_t row) {
    if (std::exchange(last_tree, tree) != tree) first_row = row;
    unite(first_row, row);
  });
  for (const Lane& l : lanes_) {
    if (!is_pair(l.kind)) continue;
    const ContactBatch& o = in.graph.batch(l.batch);
    const std::int32_t a = o.a[l.lane], b = o.b[l.lane];
    if (in.rows[a].inverse_mass > 0.0F && in.rows[b].inverse_mass > 0.0F) unite(a, b);
  }
}

void JointedContacts::add_points(const Input& in, const Lane& l) {
  const ContactBatch& o = in.graph.batch(l.batch);
  const int lane = l.lane;
  for (int k = o.first_point; k < o.first_point + o.point_count; ++k) {
    const BatchPoint& q = in.points.point[k];
    const BatchPointDetail& d = in.points.detail[k];
    if (!(q.normal_mass[lane] > 0.0F)) continue;
    // A cell of limited force yields by laws of its own.
    if (o.has_impulse_limit && in.points.limit[k].is_limited(lane)) continue;
    Point p;
    p.index = k, p.lane = lane, p.kind = l.kind;
    p.row[0] = o.a[lane], p.row[1] = is_pair(l.kind) ? o.b[lane] : -1;
    p.normal = load_lane(q.normal, lane);
    p.before_last = q.normal_impulse[lane];
    for (int side = 0; side < 2; ++side) {
      if (p.row[side] < 0) continue;
      const std::size_t body = in.partition.body(p.row[side]);
      if (is_sphere_kind(l.kind))
        p.anchor[side] = p.normal * (side == 0 ? -q.radius_a[lane] : q.radius_b[lane]);
      else
        p.anchor[side] = load_lane(side == 0 ? d.anchor_a : d.anchor_b, lane);
      p.inverse_inertia[side] = in.bodies.is_sphere[body]
                                    ? Mat3(in.rows[p.row[side]].inverse_inertia * Mat3::Identity())
                                    : to_matrix(in.bodies.world_inverse_inertia[body]);
      p.normal_torque[side] = p.anchor[side].cross(side == 0 ? p.normal : Vec3(-p.normal));
      p.normal_spin[side] = p.inverse_inertia[side] * p.normal_torque[side];
      is_touched_[p.row[side]] = 1;
    }
    points_.push_back(p);
  }
}

// The trees that contacts touch.
void JointedContacts::collect_trees(const JointSolver& joints) {
  trees_.clear();
  joints.for_each_moving_row([&](std::int32_t tree, std::int32_t row) {
    if (is_touched_[row] != 0 && (trees_.empty() || trees_.back().index != tree))
      trees_.push_back({common::find_root(parent_, row), tree});
  });
  std::ranges::sort(trees_, {}, [](const Tree& t) { return std::pair(t.root, t.index); });
  int next = 0;
  for (Island& island : islands_) island.trees = entries_of(trees_, island.root, next);
}

void JointedContacts::collect_supports(const Input& in) {
  supports_.clear(), groups_.clear();
  for (std::vector<SupportBatch>& of_member : in.supports)
    for (SupportBatch& batch : of_member)
      batch.for_each([&](const SupportPatches&, const SupportPatch& p, int lane) {
        if (!p.is_elastic && in.is_jointed(p.row))
          supports_.push_back({common::find_root(parent_, p.row), lane, &batch});
      });
  std::ranges::sort(supports_, {}, &Support::root);
  int next = 0;
  for (Island& island : islands_) {
    const IndexRange own = entries_of(supports_, island.root, next);
    island.groups.begin = static_cast<int>(groups_.size());
    for (int k = own.begin; k < own.end; ++k) {
      const int lane = (k - own.begin) % kLanes;
      if (lane == 0) groups_.emplace_back().first = k;
      add_support(*supports_[k].batch, supports_[k].lane, groups_.back().batch, lane);
    }
    island.groups.end = static_cast<int>(groups_.size());
  }
}

Vec3 JointedContacts::lower_to_load(Point& p, BatchPoints points) const {
  BatchPoint& q = points.point[p.index];
  const float last = q.normal_impulse[p.lane], kept = std::min(last, p.before_last);
  p.before_last = last;
  if (kept == last || is_solved(p)) return Vec3::Zero();
  const float share = kept / last;
  const Vec3 friction = load_lane(q.friction_impulse, p.lane);
  q.normal_impulse[p.lane] = kept;
  store_lane(share * friction, q.friction_impulse, p.lane);
  return (kept - last) * p.normal + (share - 1.0F) * friction;
}

void JointedContacts::keep_loads(BatchPoints points, const SolverBodies& rows) {
  for (Point& p : points_)
    if (const Vec3 change = lower_to_load(p, points); !change.isZero(0.0F)) p.apply(change, rows.velocity);
}

void JointedContacts::end_step(BatchPoints points) {
  for (Point& p : points_) lower_to_load(p, points);
}

void JointedContacts::settle(const Stage& stage, const Member& member) {
  const auto share_of = [&](int index) {
    return Member{index, member.member_count, member.barrier}.share(static_cast<int>(islands_.size()));
  };
  for (int i; (i = queue_.take(member.index, share_of)) >= 0;) settle(islands_[i], stage);
}

void JointedContacts::settle(const Island& island, const Stage& stage) {
  constexpr int kMaxTurns = 30;
  constexpr double kTolerance_ups = 1e-4;
  // The rest of a series is applied at once if its ratio is between these bounds and has changed in the last
  // turn by no more than kSteadiness of its distance from 1; but not in the last turns, which are to take out
  // what that misses.
  constexpr double kLeastRatio = 0.1, kMostRatio = 0.97, kSteadiness = 0.5;
  constexpr int kLastTurns = 4;
  const auto joints_were_off = [&](bool predicts) {
    bool any = false;
    for (int k = island.trees.begin; k < island.trees.end; ++k)
      any |= stage.is_soft
                 ? stage.joints.solve_again(stage.joint_rows, trees_[k].index, kTolerance_ups, predicts)
                 : stage.joints.relax_again(stage.joint_rows, trees_[k].index, kTolerance_ups);
    return any;
  };
  begin_stage(island, stage);
  double last_ratio = 1.0;
  for (int turn = 0; turn < kMaxTurns; ++turn) {
    // A prediction has the last word.
    if (!(turn > 0 && joints_were_off(false)) && !joints_were_off(true)) break;
    const double ratio = sweep(island, stage);
    solve_supports(island, stage);
    const bool is_series = ratio > kLeastRatio && ratio < kMostRatio && last_ratio < 1.0 &&
                           std::abs(ratio - last_ratio) < kSteadiness * (1.0 - ratio);
    last_ratio = is_series || turn == 0 ? 1.0 : ratio;
    if (is_series && turn < kMaxTurns - kLastTurns)
      repeat_change(island, stage, static_cast<float>(ratio / (1.0 - ratio)));
  }
}

void JointedContacts::begin_stage(const Island& island, const Stage& stage) {
  for (int i = island.points.begin; i < island.points.end; ++i) {
    Point& p = points_[i];
    p.change.setZero();
    if (!stage.is_soft) continue;
    Vec3 moved = Vec3::Zero();
    for (int side = 0; side < 2; ++side) {
      if (p.row[side] < 0) continue;
      const DeltaPose& delta = stage.rows.delta_pose[p.row[side]];
      const Vec3 by = Vec3(delta.translation) + Vec3(delta.rotation).cross(p.anchor[side]);
      moved += side == 0 ? by : Vec3(-by);
    }
    if (!is_pair(p.kind))
      moved -=
          stage.static_params.elapsed_s * load_lane(stage.points.detail[p.index].surface_velocity, p.lane);
    p.separation = stage.points.point[p.index].separation[p.lane] + p.normal.dot(moved);
  }
}

double JointedContacts::sweep(const Island& island, const Stage& stage) {
  double along_last = 0.0, last_squared = 0.0;
  BodyVelocity* const rows = stage.rows.velocity;
  for (int i = island.points.begin; i < island.points.end; ++i) {
    Point& p = points_[i];
    if (is_solved(p)) continue;
    const SubstepParams& params = is_pair(p.kind) ? stage.pair_params : stage.static_params;
    BatchPoint& q = stage.points.point[p.index];
    const BatchPointDetail& d = stage.points.detail[p.index];
    const int lane = p.lane;
    const Vec3 surface = p.kind == kSpherePair ? Vec3(Vec3::Zero()) : load_lane(d.surface_velocity, lane);
    const float old_impulse = q.normal_impulse[lane], speed = p.normal_speed(rows) - p.normal.dot(surface);
    float impulse = 0.0F;
    if (!stage.is_soft) {
      impulse = law::normal_impulse(old_impulse, q.normal_mass[lane], speed, q.relax_target_speed[lane]);
      q.total_normal_impulse[lane] += impulse - old_impulse;
    } else {
      const float steady = is_sphere_kind(p.kind) ? 0.0F : d.steady_impulse[lane];
      impulse = law::soft_normal_impulse(
          old_impulse, q.normal_mass[lane], speed, law::push_out_speed(p.separation, params, slop_of(p.kind)),
          p.separation, law::deflecting_impulse(old_impulse, steady, params), params);
    }
    q.normal_impulse[lane] = impulse;
    p.last_change = p.change;
    p.change = (impulse - old_impulse) * p.normal;
    if (impulse != old_impulse) p.apply_normal(impulse - old_impulse, rows);
    if (q.friction[lane] != 0.0F && (impulse > 0.0F || old_impulse > 0.0F)) {
      const Vec3 velocity = p.velocity(rows) - surface, old_friction = load_lane(q.friction_impulse, lane);
      const Vec3 slip = velocity - p.normal * p.normal.dot(velocity);
      const Vec3 friction =
          law::friction_impulse(old_friction, slip, q.tangent_mass[lane], q.friction[lane] * impulse);
      store_lane(friction, q.friction_impulse, lane);
      p.apply(friction - old_friction, rows);
      p.change += friction - old_friction;
    }
    const double weight = 1.0 / static_cast<double>(q.normal_mass[lane]);
    along_last += weight * static_cast<double>(p.change.dot(p.last_change));
    last_squared += weight * static_cast<double>(p.last_change.squaredNorm());
  }
  return last_squared > 0.0 ? along_last / last_squared : 0.0;
}

void JointedContacts::repeat_change(const Island& island, const Stage& stage, float factor) {
  for (int i = island.points.begin; i < island.points.end; ++i) {
    const Point& p = points_[i];
    if (is_solved(p) || p.change.isZero(0.0F)) continue;
    BatchPoint& q = stage.points.point[p.index];
    const int lane = p.lane;
    const Vec3 change = factor * p.change, old_friction = load_lane(q.friction_impulse, lane);
    const float along = p.normal.dot(change), old_impulse = q.normal_impulse[lane],
                impulse = std::max(0.0F, old_impulse + along);
    Vec3 friction = old_friction;
    if (q.friction[lane] != 0.0F)
      friction =
          law::clamp_length(Vec3(old_friction + change - along * p.normal), q.friction[lane] * impulse);
    q.normal_impulse[lane] = impulse;
    if (!stage.is_soft) q.total_normal_impulse[lane] += impulse - old_impulse;
    store_lane(friction, q.friction_impulse, lane);
    p.apply((impulse - old_impulse) * p.normal + friction - old_friction, stage.rows.velocity);
  }
}

void JointedContacts::solve_supports(const Island& island, const Stage& stage) {
  for (int i = island.groups.begin; i < island.groups.end; ++i) {
    SupportGroup& group = groups_[i];
    std::uint32_t lanes = 0;
    const auto samples_of = [&](int lane) -> SupportSampleView& {
      const Support& s = supports_[group.first + lane];
      return s.batch->friction.samples[s.lane];
    };
    group.batch.for_each([&](const SupportPatches& list, const SupportPatch& p, int lane) {
      if (is_solved(p.row)) return;
      lanes |= std::uint32_t{1} << static_cast<unsigned>(lane);
      group.batch.friction.samples[lane] = samples_of(lane);
      solve_support_points(list, p, stage.points, stage.static_params, stage.is_soft,
                           stage.rows.velocity[p.row], stage.rows.delta_pose[p.row],
                           stage.rows.inverse_inertia[p.row]);
    });
    if (lanes == 0) continue;
    world::solve_supports(group.batch, lanes, stage.points, stage.is_soft, stage.rows.velocity,
                          stage.rows.inverse_inertia);
    for (int lane = 0; lane < group.batch.lanes.lane_count; ++lane)
      if ((lanes >> static_cast<unsigned>(lane) & 1U) != 0)
        samples_of(lane) = group.batch.friction.samples[lane];
  }
}

}  // namespace smartsurf::world
