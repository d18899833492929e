#include "smartsurf/world/solver/JointedContacts.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "smartsurf/world/solver/ContactLaw-inl.h"

namespace smartsurf::world {

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

void JointedContacts::collect(const ConstraintGraph& graph, const BodyStore& bodies,
                              const SpatialPartition& partition, BatchPoints points, const BodyVelocity* rows,
                              std::span<const char> solved_rows) {
  points_.clear();
  solved_rows_ = solved_rows;
  is_touched_.assign(partition.row_count(), 0);
  const auto is_jointed = [&](std::int32_t row) {
    const std::size_t body = partition.body(row);
    return bodies.is_jointed[body] && bodies.is_active(body);
  };
  const auto add_lane = [&](const ContactBatch& o, ContactKind kind, int lane) {
    const std::int32_t a = o.a[lane], b = is_pair(kind) ? o.b[lane] : -1;
    for (int k = o.first_point; k < o.first_point + o.point_count; ++k) {
      const BatchPoint& q = points.point[k];
      const BatchPointDetail& d = points.detail[k];
      if (!(q.normal_mass[lane] > 0.0F)) continue;
      // A cell of limited force yields by laws of its own.
      if (o.has_impulse_limit && points.limit[k].is_limited(lane)) continue;
      Point p;
      p.index = k, p.lane = lane, p.kind = kind;
      p.row[0] = a, p.row[1] = b;
      p.normal = load_lane(q.normal, lane);
      p.before_last = q.normal_impulse[lane];
      for (int side = 0; side < 2; ++side) {
        if (p.row[side] < 0) continue;
        const std::size_t body = partition.body(p.row[side]);
        if (is_sphere_kind(kind))
          p.anchor[side] = p.normal * (side == 0 ? -q.radius_a[lane] : q.radius_b[lane]);
        else
          p.anchor[side] = load_lane(side == 0 ? d.anchor_a : d.anchor_b, lane);
        p.inverse_inertia[side] = bodies.is_sphere[body]
                                      ? Mat3(rows[p.row[side]].inverse_inertia * Mat3::Identity())
                                      : to_matrix(bodies.world_inverse_inertia[body]);
        is_touched_[p.row[side]] = 1;
      }
      points_.push_back(p);
    }
  };
  lanes_.clear();
  graph.for_each_batch([&](ContactKind kind, int i) {
    const ContactBatch& o = graph.batch(i);
    for (int lane = 0; lane < o.lane_count; ++lane)
      if (is_jointed(o.a[lane]) || (is_pair(kind) && is_jointed(o.b[lane])))
        lanes_.push_back({graph.rank(kind, i, lane), i, lane, kind});
  });
  std::ranges::sort(lanes_, {}, &Lane::rank);
  for (const Lane& l : lanes_) add_lane(graph.batch(l.batch), l.kind, l.lane);
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

void JointedContacts::begin_stage(BatchPoints points, const SolverBodies& rows,
                                  const SubstepParams& pair_params, const SubstepParams& static_params,
                                  bool is_soft) {
  if (!is_soft) return;
  for (Point& p : points_) {
    Vec3 moved = Vec3::Zero();
    for (int side = 0; side < 2; ++side) {
      if (p.row[side] < 0) continue;
      const DeltaPose& delta = rows.delta_pose[p.row[side]];
      const Vec3 by = Vec3(delta.translation) + Vec3(delta.rotation).cross(p.anchor[side]);
      moved += side == 0 ? by : Vec3(-by);
    }
    const SubstepParams& params = is_pair(p.kind) ? pair_params : static_params;
    if (!is_pair(p.kind))
      moved -= params.elapsed_s * load_lane(points.detail[p.index].surface_velocity, p.lane);
    p.separation = points.point[p.index].separation[p.lane] + p.normal.dot(moved);
  }
}

void JointedContacts::sweep(BatchPoints points, const SolverBodies& rows, const SubstepParams& pair_params,
                            const SubstepParams& static_params, bool is_soft) {
  for (Point& p : points_) {
    if (is_solved(p)) continue;
    const SubstepParams& params = is_pair(p.kind) ? pair_params : static_params;
    BatchPoint& q = points.point[p.index];
    const BatchPointDetail& d = points.detail[p.index];
    const int lane = p.lane;
    const Vec3 surface = p.kind == kSpherePair ? Vec3(Vec3::Zero()) : load_lane(d.surface_velocity, lane);
    const float old_impulse = q.normal_impulse[lane],
                speed = p.normal.dot(p.velocity(rows.velocity) - surface);
    float impulse = 0.0F;
    if (!is_soft) {
      impulse = law::normal_impulse(old_impulse, q.normal_mass[lane], speed, q.relax_target_speed[lane]);
      q.total_normal_impulse[lane] += impulse - old_impulse;
    } else {
      const float steady = is_sphere_kind(p.kind) ? 0.0F : d.steady_impulse[lane];
      impulse = law::soft_normal_impulse(
          old_impulse, q.normal_mass[lane], speed, law::push_out_speed(p.separation, params, slop_of(p.kind)),
          p.separation, law::deflecting_impulse(old_impulse, steady, params), params);
    }
    q.normal_impulse[lane] = impulse;
    if (impulse != old_impulse) p.apply((impulse - old_impulse) * p.normal, rows.velocity);
    if (q.friction[lane] == 0.0F) continue;
    const Vec3 velocity = p.velocity(rows.velocity) - surface,
               old_friction = load_lane(q.friction_impulse, lane);
    const Vec3 slip = velocity - p.normal * p.normal.dot(velocity);
    const Vec3 friction =
        law::friction_impulse(old_friction, slip, q.tangent_mass[lane], q.friction[lane] * impulse);
    store_lane(friction, q.friction_impulse, lane);
    p.apply(friction - old_friction, rows.velocity);
  }
}

}  // namespace smartsurf::world
