// A contact of a body with something that gives way, solved by itself: the body's side, which the solvers of
// yielding tips (TipSolver.h) and of elastic skins (SkinSolver.h) share.
#pragma once

#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/broadphase/SpatialPartition.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/solver/ContactBatch.h"

namespace smartsurf::world {

// Input and output of such a solver in a step.
struct PointStep {
  const BodyStore& bodies;
  const SpatialPartition& partition;
  const ContactList& static_contacts;
  const SurfaceMaterial& field_material;
  const SubstepParams& params;
  // ---- by row of the partition
  BodyVelocity* velocity;
  const DeltaPose* delta_pose;
  const SurfaceMaterial* material;
};

struct PointContact {
  std::int32_t contact, body, row = -1;
  Vec3 normal, anchor;
  float separation;
  Mat3 inverse_inertia;
  Mat3 body_response;  // velocity change of the body at the contact per impulse
  float normal_mass, tangent_mass, rolling_mass;
  float rigid_mass;  // normal mass if the other side did not give way
  float friction, rolling_friction;
  float normal_impulse, total_normal_impulse = 0.0F, relax_target_speed = 0.0F;
  Vec3 friction_impulse, rolling_impulse;

  Vec3 impulse() const { return normal_impulse * normal + friction_impulse; }

  // `other_response` is the velocity change of the other side per impulse.
  void prepare(const PointStep&, const Mat3& other_response);
  // Sets the masses; after prepare(), which does so, for another response.
  void set_response(const Mat3& other_response);
  // Velocity of the body at the contact.
  Vec3 velocity(const PointStep&) const;
  void apply(const Vec3& impulse_on_body, const PointStep&) const;
  // The speed at which the contact is to separate, without the softness of other contacts, which would be
  // great against what gives way. Sets relax_target_speed. `other_moved` is the motion of the other side in
  // this step, u.
  float push_out_speed(const Vec3& other_moved, const PointStep&);
  // The normal impulse with which the contact separates at `target_speed`. The velocity is relative to the
  // other side.
  float normal_impulse_for(float target_speed, const Vec3& relative_velocity) const;
  // Sets the friction impulse and returns its change.
  Vec3 solve_friction(const Vec3& relative_velocity);
  void solve_rolling(const PointStep&);
  void store(Contact&) const;
};

}  // namespace smartsurf::world
