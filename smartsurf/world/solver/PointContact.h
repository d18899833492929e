// A contact of a body with something that gives way, solved by itself: what the solvers of yielding tips (TipSolver.h) and of
// elastic sheets (SkinSolver.h) share, the body's side.
#pragma once

#include "smartsurf/world/BodyStore.h"
#include "smartsurf/world/Contact.h"
#include "smartsurf/world/parallel/SpatialPartition.h"
#include "smartsurf/world/solver/ContactKernels.h"

namespace smartsurf::world {

// Indexed by row of the partition.
struct PointRows {
  BodyVelocity* velocity;
  const DeltaPose* delta_pose;
  const SurfaceMaterial* material;
};

struct PointContact {
  std::int32_t contact, body, row = -1;
  Vec3 normal, anchor;
  float separation;
  Mat3 inverse_inertia,
      response;  // velocity change of the point per impulse, that of the other side included
  float normal_mass, rigid_mass, tangent_mass, rolling_mass;  // rigid: if the other side did not give way
  float friction, rolling_friction;
  float normal_impulse, total_normal_impulse = 0.0F, relax_target_speed = 0.0F;
  Vec3 friction_impulse, rolling_impulse;

  Vec3 impulse() const { return normal_impulse * normal + friction_impulse; }

  // other_response: of the other side.
  void prepare(const BodyStore&, const SpatialPartition&, const Contact&, const PointRows&,
               const SurfaceMaterial& field_material, const Mat3& other_response);
  // Velocity of the body there.
  Vec3 velocity(const PointRows&) const;
  void apply(const Vec3& impulse, const PointRows&) const;
  // The speed at which the contact is to separate. Separated, it may close its gap within the substep; overlapping, it is
  // pushed out, without the softness of other contacts, which would be great against what gives way. Sets
  // relax_target_speed. other_moved: of the other side in this step, u.
  float push_out_speed(const Vec3& other_moved, const SubstepParams&, const PointRows&);
  void solve_rolling(const PointRows&);
  void store(Contact&) const;
};

Vec3 clamp_length(const Vec3&, float limit);

}  // namespace smartsurf::world
