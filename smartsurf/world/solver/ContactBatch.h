// The data of the contact kernels: batches of manifolds, their points, the parameters of a substep.
#pragma once

#include <algorithm>
#include <cstdint>

#include "smartsurf/world/body/BodyRows.h"
#include "smartsurf/world/simd/Lanes.h"

namespace smartsurf::world {

// The kind of all manifolds in a batch: pair or static; all bodies spheres, or general.
enum ContactKind { kSpherePair, kGeneralPair, kSphereStatic, kGeneralStatic, kContactKindCount };
constexpr bool is_pair(ContactKind kind) { return kind == kSpherePair || kind == kGeneralPair; }
constexpr bool is_sphere_kind(ContactKind kind) { return kind == kSpherePair || kind == kSphereStatic; }

// Penetration up to this depth, u, is not resolved, so that resting bodies keep their contacts.
inline constexpr float kSlop = 1e-3F;
// The same between two non-spheres, which form stacks.
inline constexpr float kGeneralPairSlop = 5e-4F;
constexpr float slop_of(ContactKind kind) { return kind == kGeneralPair ? kGeneralPairSlop : kSlop; }

// A 3-vector of one lane.
inline Vec3 load_lane(const float (&from)[3][kLanes], int lane) {
  return {from[0][lane], from[1][lane], from[2][lane]};
}
inline void store_lane(const Vec3& from, float (&to)[3][kLanes], int lane) {
  for (int i = 0; i < 3; ++i) to[i][lane] = from[i];
}

// Rows by index; rows of static bodies are never written.
struct SolverBodies {
  BodyVelocity* velocity;
  const DeltaPose* delta_pose;
  const InverseInertia* inverse_inertia;
};

// ---- one batch of up to kLanes manifolds: lanes [0, lane_count) are in use. a and b are rows of bodies.
struct ContactBatch {
  std::int32_t a[kLanes], b[kLanes];
  std::int32_t first_point = 0, point_count = 0,
               lane_count = 0;        // points [first_point, first_point + point_count)
  bool has_friction = true;           // of any point
  bool has_rolling_friction = false;  // of any lane
  bool has_impulse_limit = false;     // of any point
  bool has_surface_spin = false;      // of any point
  bool has_moving_points = false;     // any surface_acceleration
  bool has_face_patch = false;        // of any lane: points with a twist_friction_loss
};

// The k-th contact point of each lane. Lanes without one have a zero normal and a large separation. Fields
// that every stage over sphere pairs reads are kept apart from the details, because the stages are
// memory-bound.
struct alignas(64) BatchPoint {
  float normal[3][kLanes];
  float radius_a[kLanes], radius_b[kLanes];  // of spheres; in a general pair, of the bounding spheres
  float normal_impulse[kLanes], friction_impulse[3][kLanes], total_normal_impulse[kLanes];
  float separation[kLanes];
  // Target of the normal velocity in the relax stage: −separation / h for a speculative contact, otherwise 0.
  float relax_target_speed[kLanes];
  float normal_mass[kLanes], tangent_mass[kLanes], friction[kLanes];  // masses of 0: exerts no impulse
  float approach_speed[kLanes];  // normal velocity at the start of the step
};
struct alignas(64) BatchPointDetail {
  float anchor_a[3][kLanes], anchor_b[3][kLanes];
  // The velocity of the static surface, and what b's surface gains on a's because the point has moved since
  // the start of the step: along the contact, in a general pair whose point does not roll.
  float surface_velocity[3][kLanes];
  float surface_acceleration[3][kLanes];  // Contact::surface_acceleration; valid if has_moving_points
  float surface_spin[kLanes];
  float anchor_time[kLanes];  // Contact::anchor_time_s; for pairs, not for spheres
  float rolling_friction[kLanes], rolling_mass[kLanes], rolling_impulse[3][kLanes];
  float twist_friction_loss[kLanes];  // see Contact; not for spheres
  float steady_impulse[kLanes];       // normal: see SubstepParams::steady_share; not for spheres
  float slip_per_impulse[3][kLanes];  // slip velocity of a against b per unit normal impulse; not for spheres
};
// A point on a cell of limited force; valid if ContactBatch::has_impulse_limit. The points of one body on one
// cell share its force: the first of them holds their sums.
struct alignas(64) BatchPointLimit {
  static constexpr float kUnlimited = 1e30F;
  BatchPointLimit() {
    std::fill_n(stall_impulse, kLanes, kUnlimited), std::fill_n(no_load_speed, kLanes, 1.0F);
  }
  bool is_limited(int lane) const { return stall_impulse[lane] < kUnlimited; }

  float stall_impulse[kLanes];         // vertical impulse of the cell at rest, mass·u/s in a substep
  float no_load_speed[kLanes];         // at which the cell rises without force, u/s
  float planned_speed[kLanes] = {};    // of the cell by its motion profile, u/s
  std::int32_t to_first[kLanes] = {};  // from this point to the first one of the cell, ≤ 0
  // ---- of all points on the cell, at the first one
  float anchor[3][kLanes] = {};      // mean of the points' anchors
  float load[kLanes] = {};           // vertical impulse in the substep, mass·u/s
  float capacity[kLanes] = {};       // upper bound of the load
  float speed[kLanes] = {};          // of the cell under the load, u/s
  float step_capacity[kLanes] = {};  // sum of the capacities in the step
  float lag[kLanes] = {};            // by which the cell has stayed below its planned motion in the step, u
};
struct BatchPoints {
  BatchPoint* point;
  BatchPointDetail* detail;
  BatchPointLimit* limit;
};

struct SubstepParams {
  float h_s, inverse_h;
  float elapsed_s = 0.0F;                      // since the start of the step
  float bias_rate, mass_scale, impulse_scale;  // contact softness
  // The share of a contact's steady impulse that its spring bears without deflection, so that loads at rest
  // hardly press bodies into each other. The steady impulse follows the impulse by steady_gain in a substep:
  // frozen for a step, it would make stacks jitter. Not for spheres.
  float steady_share, steady_gain;
  float max_bias_velocity;        // u/s
  float substep_fraction = 1.0F;  // substep length / step length
};

}  // namespace smartsurf::world
