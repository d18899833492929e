#include "smartsurf/world/solver/PointContact.h"

#include <Eigen/Geometry>
#include <cmath>

#include "smartsurf/world/contact/ContactMaterial.h"
#include "smartsurf/world/solver/ContactLaw-inl.h"

namespace smartsurf::world {
namespace {

Mat3 cross_matrix(const Vec3& v) {
  Mat3 m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

}  // namespace

void PointContact::prepare(const PointStep& step, const Mat3& other_response) {
  const BodyStore& bodies = step.bodies;
  const Contact& c = step.static_contacts.contacts[contact];
  row = step.partition.row(body);
  const BodyVelocity& v = step.velocity[row];
  inverse_inertia = bodies.is_sphere[body] ? Mat3(v.inverse_inertia * Mat3::Identity())
                                           : to_matrix(bodies.world_inverse_inertia[body]);
  normal = c.normal, anchor = c.anchor, separation = c.separation;
  normal_impulse = c.normal_impulse;
  friction_impulse = c.friction_impulse, rolling_impulse = c.rolling_impulse;
  const Mat3 lever = cross_matrix(anchor);
  body_response = v.inverse_mass * Mat3::Identity() - lever * inverse_inertia * lever;
  rigid_mass = 1.0F / normal.dot(body_response * normal);
  set_response(other_response);
  rolling_mass = 1.0F / inverse_inertia.trace();
  const SurfaceMaterial& material = step.material[row];
  friction = friction_of(material, step.field_material);
  rolling_friction = rolling_friction_of(material, step.field_material);
}

void PointContact::set_response(const Mat3& other_response) {
  const Mat3 response = body_response + other_response;
  normal_mass = 1.0F / normal.dot(response * normal);
  // This is law::greatest_tangent_response() with std::hypot, which differs from a root of squares in the
  // last bit.
  const Vec3 t = normal.unitOrthogonal(), u = normal.cross(t);
  const float tt = t.dot(response * t), uu = u.dot(response * u), tu = t.dot(response * u);
  tangent_mass = 1.0F / (0.5F * (tt + uu) + std::hypot(0.5F * (tt - uu), tu));
}

Vec3 PointContact::velocity(const PointStep& step) const {
  const BodyVelocity& v = step.velocity[row];
  return Vec3(v.velocity) + Vec3(v.angular_velocity).cross(anchor);
}

void PointContact::apply(const Vec3& impulse_on_body, const PointStep& step) const {
  BodyVelocity& v = step.velocity[row];
  Eigen::Map<Vec3>(v.velocity) += v.inverse_mass * impulse_on_body;
  Eigen::Map<Vec3>(v.angular_velocity) += inverse_inertia * anchor.cross(impulse_on_body);
}

float PointContact::push_out_speed(const Vec3& other_moved, const PointStep& step) {
  const DeltaPose& delta = step.delta_pose[row];
  const Vec3 moved = Vec3(delta.translation) + Vec3(delta.rotation).cross(anchor) - other_moved;
  const float gap = separation + normal.dot(moved);
  const float speed = law::push_out_speed(gap, step.params);
  relax_target_speed = law::relax_target_speed(gap, speed);
  return speed;
}

float PointContact::normal_impulse_for(float target_speed, const Vec3& relative_velocity) const {
  return law::normal_impulse(normal_impulse, normal_mass, normal.dot(relative_velocity), target_speed);
}

Vec3 PointContact::solve_friction(const Vec3& relative_velocity) {
  const Vec3 old_impulse = friction_impulse;
  const Vec3 slip = relative_velocity - normal * normal.dot(relative_velocity);
  friction_impulse = law::friction_impulse(old_impulse, slip, tangent_mass, friction * normal_impulse);
  return friction_impulse - old_impulse;
}

void PointContact::solve_rolling(const PointStep& step) {
  if (rolling_friction == 0.0F) return;
  Eigen::Map<Vec3> angular_velocity(step.velocity[row].angular_velocity);
  const Vec3 old_impulse = rolling_impulse;
  rolling_impulse = law::friction_impulse(old_impulse, Vec3(angular_velocity), rolling_mass,
                                          rolling_friction * normal_impulse);
  angular_velocity += inverse_inertia * (rolling_impulse - old_impulse);
}

void PointContact::store(Contact& c) const {
  c.normal_impulse = normal_impulse, c.total_normal_impulse = total_normal_impulse;
  c.friction_impulse = friction_impulse, c.rolling_impulse = rolling_impulse;
}

}  // namespace smartsurf::world
