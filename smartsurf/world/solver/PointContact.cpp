#include "smartsurf/world/solver/PointContact.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace smartsurf::world {
namespace {

Mat3 to_matrix(const InverseInertia& q) {
  Mat3 m;
  m << q.xx, q.xy, q.xz, q.xy, q.yy, q.yz, q.xz, q.yz, q.zz;
  return m;
}

Mat3 cross_matrix(const Vec3& v) {
  Mat3 m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

}  // namespace

Vec3 clamp_length(const Vec3& v, float limit) {
  const float length = v.norm();
  return length <= limit ? v : Vec3(v * (limit / length));
}

void PointContact::prepare(const BodyStore& bodies, const SpatialPartition& partition, const Contact& c,
                           const PointRows& rows, const SurfaceMaterial& field_material,
                           const Mat3& other_response) {
  const auto index = static_cast<std::size_t>(body);
  row = partition.row(body);
  const BodyVelocity& v = rows.velocity[row];
  inverse_inertia = bodies.is_sphere[index] ? Mat3(v.inverse_inertia * Mat3::Identity())
                                            : to_matrix(bodies.world_inverse_inertia[index]);
  normal = c.normal, anchor = c.anchor, separation = c.separation;
  normal_impulse = c.normal_impulse;
  friction_impulse = c.friction_impulse, rolling_impulse = c.rolling_impulse;
  const Mat3 lever = cross_matrix(anchor);
  const Mat3 body_response = v.inverse_mass * Mat3::Identity() - lever * inverse_inertia * lever;
  response = body_response + other_response;
  normal_mass = 1.0F / normal.dot(response * normal);
  rigid_mass = 1.0F / normal.dot(body_response * normal);
  // The greater eigenvalue in the tangent plane, so that friction acts against the slip.
  const Vec3 t = normal.unitOrthogonal(), u = normal.cross(t);
  const float tt = t.dot(response * t), uu = u.dot(response * u), tu = t.dot(response * u);
  tangent_mass = 1.0F / (0.5F * (tt + uu) + std::hypot(0.5F * (tt - uu), tu));
  rolling_mass = 1.0F / inverse_inertia.trace();
  const SurfaceMaterial& material = rows.material[row];
  friction = material.friction_root * field_material.friction_root;
  rolling_friction = material.rolling_friction_root * field_material.rolling_friction_root;
}

Vec3 PointContact::velocity(const PointRows& rows) const {
  const BodyVelocity& v = rows.velocity[row];
  return Vec3(v.velocity) + Vec3(v.angular_velocity).cross(anchor);
}

void PointContact::apply(const Vec3& impulse_on_body, const PointRows& rows) const {
  BodyVelocity& v = rows.velocity[row];
  const Vec3 spin = inverse_inertia * anchor.cross(impulse_on_body);
  for (int i = 0; i < 3; ++i) {
    v.velocity[i] += v.inverse_mass * impulse_on_body[i];
    v.angular_velocity[i] += spin[i];
  }
}

float PointContact::push_out_speed(const Vec3& other_moved, const SubstepParams& params,
                                   const PointRows& rows) {
  const DeltaPose& delta = rows.delta_pose[row];
  const Vec3 moved = Vec3(delta.translation) + Vec3(delta.rotation).cross(anchor) - other_moved;
  const float gap = separation + normal.dot(moved);
  relax_target_speed = gap > 0.0F ? -gap * params.inverse_h : 0.0F;
  if (gap > 0.0F) return relax_target_speed;
  return std::min(-std::min(gap + kSlop, 0.0F) * params.bias_rate, params.max_bias_velocity);
}

void PointContact::solve_rolling(const PointRows& rows) {
  if (rolling_friction == 0.0F) return;
  BodyVelocity& v = rows.velocity[row];
  const Vec3 old_impulse = rolling_impulse;
  rolling_impulse =
      clamp_length(old_impulse - rolling_mass * Vec3(v.angular_velocity), rolling_friction * normal_impulse);
  const Vec3 spin = inverse_inertia * (rolling_impulse - old_impulse);
  for (int i = 0; i < 3; ++i) v.angular_velocity[i] += spin[i];
}

void PointContact::store(Contact& c) const {
  c.normal_impulse = normal_impulse, c.total_normal_impulse = total_normal_impulse;
  c.friction_impulse = friction_impulse, c.rolling_impulse = rolling_impulse;
}

}  // namespace smartsurf::world
