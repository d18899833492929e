// The inner loops of distributed support, see field/SupportPatch.h: sums over the samples of one patch, and
// the normal impulses of several.
//
// Compiled for several instruction sets with run-time dispatch; all of them give bit-identical results.
#pragma once

#include "smartsurf/world/solver/ContactBatch.h"

namespace smartsurf::world {

// The samples of one patch; `count` is a multiple of kLanes.
struct SupportSampleView {
  const float *x, *y, *arm, *velocity_x, *velocity_y, *spin, *weight;
  float* friction[3];  // of the last solve
  float* new_friction[3];
  float* load;
  const float* limit;  // null: unlimited
  int count;
};

// Loads N_i = min(limit, weight · max(0, load[0] + load[1]·x + load[2]·y)): Σ N_i·(1, x, y), and over the
// samples with 0 < N_i < limit Σ weight·(1, x, y, x², xy, y²).
struct LoadSums {
  double load[3], stiffness[6];
};

// The patches of the bodies in the lanes of a contact batch.
struct SupportLanes {
  static constexpr int kMaxPoints = 32;
  std::int32_t first_point = 0, point_count = 0;  // of the batch
  std::int32_t lane_count = 0;
  std::int32_t row[kLanes] = {};      // of the body
  std::uint32_t points[kLanes] = {};  // bit k: the patch has the batch's point k; 0: no patch
  // set_body() sets these: the body's mass, the stiffness of a hard point, and the inertia against turning
  // about x and y as xx, yy, xy.
  double mass[kLanes] = {}, stiffness[kLanes] = {}, inertia[3][kLanes] = {};

  // A body that cannot move so loses its points. Call once a step, after `points` is set.
  void set_body(int lane, float inverse_mass, const InverseInertia&);
};

// Parameters of the friction of these patches for a step; see SupportPatch and SupportSolver.h.
struct SupportFriction {
  std::uint32_t lanes = 0;            // with a patch: a bit for each
  std::uint32_t points[kLanes] = {};  // as in SupportLanes; 0 if the wrench of the lane is found elsewhere
  double response[6][kLanes] = {}, inverse_response[6][kLanes] = {}, tangent_mass[kLanes] = {};
  double centre[2][kLanes] = {}, scale[kLanes] = {}, reach[kLanes] = {}, min_arm[kLanes] = {};
  float z[kLanes] = {}, friction[kLanes] = {}, belt[2][kLanes] = {};
  float lumps[kLanes] = {};  // 1: the samples may be solved as one
  SupportSampleView samples[kLanes];
};
// Input and output of a stage of friction. A set of lanes has a bit for each.
struct SupportFrictionStage {
  float lumps[kLanes] = {};        // that of SupportFriction in the lanes to be solved, 0 in others
  double impulse[3][kLanes] = {};  // of the last stage, then of this one: force along x and y, torque about z
  // The force and moments of the normal impulses about the centre of mass that are not those of
  // SupportFriction::points; then of all, in the scaled coordinates of the loads.
  double wrench[3][kLanes] = {};
  // Velocity along x and y of the body's underside below the centre of mass, and spin about z.
  double velocity[3][kLanes] = {};
  // ---- of solve_friction()
  float cone[kLanes][3], offset[kLanes][2];
};

// See solve_support_points(): compliance of each point, relative to the body's, which shares the load where
// the points are redundant; and the error of the speed that needs no solution, u/s.
inline constexpr double kSupportCompliance = 1e-3, kSupportSolved = 1e-7;
// Tangent mass of all samples of a patch together, as a multiple of the body's.
inline constexpr double kTangentMassFactor = 8.0;

struct SupportKernelTable {
  void (*sum_loads)(const SupportSampleView&, const float (&load)[3], LoadSums&);
  void (*store_loads)(const SupportSampleView&, const float (&load)[3]);
  // Finds the wrench and the velocity of the lanes, and the impulse of a proximal step of those that lump:
  // applies it if the samples can hold it. Returns the set of these lanes.
  std::uint32_t (*stick)(const SupportLanes&, const SupportFriction&, SupportFrictionStage&, BatchPoints,
                         BodyVelocity*, const InverseInertia*);
  // Solves the friction of the samples of these lanes, of at least one, in at most `passes`, and applies it:
  // new_friction = (friction − tangent_mass · slip), scaled into the cone of the loads times the coefficient
  // of friction, `cone`; with limits, of the stored loads times cone[0]. `offset` leads from the samples to
  // where their friction acts. Unless `params` is null, solves the points then, as solve_points().
  void (*solve_friction)(const SupportLanes&, const SupportFriction&, SupportFrictionStage&,
                         std::uint32_t lanes, int passes, BatchPoints, const SubstepParams* params,
                         BodyVelocity*, const InverseInertia*);
  void (*sum_friction)(const SupportSampleView&, double (&impulse)[3]);
  // solve_support_points() of patches without shares and elastic tops, of at most kMaxPoints points.
  void (*solve_points)(const SupportLanes&, BatchPoints, const SubstepParams&, bool is_soft, BodyVelocity*,
                       const DeltaPose*, const InverseInertia*);
  // Both in one, where SupportFriction::points has the points of all patches; unless `is_soft`, and if all
  // of them stick, the points again.
  std::uint32_t (*solve_points_and_stick)(const SupportLanes&, const SupportFriction&, SupportFrictionStage&,
                                          BatchPoints, const SubstepParams&, bool is_soft, BodyVelocity*,
                                          const DeltaPose*, const InverseInertia*);
};

// The kernels for the best instruction set of this machine.
const SupportKernelTable& support_kernels();

}  // namespace smartsurf::world
