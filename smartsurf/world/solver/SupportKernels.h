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
  const float* friction[3];  // of the last solve
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

// The friction impulses: Σ (f_x, f_y, torque about z), and the factor s_i by which each sample's cone scales
// its trial impulse: Σ s_i·(1, x, y, x² + y² + arm²).
struct FrictionSums {
  double impulse[3], stiffness[4];
};

// The patches of the bodies in the lanes of a contact batch.
struct SupportLanes {
  static constexpr int kMostPoints = 32;
  std::int32_t first_point = 0, point_count = 0;  // of the batch
  std::int32_t row[kLanes] = {};                  // of the body
  std::uint32_t points[kLanes] = {};              // bit k: the patch has the batch's point k; 0: no patch
};
// Applies vertical impulses at points (x, y) of a body: their sum, and the sums of impulse·x and impulse·y.
inline void apply_wrench(double force, double moment_x, double moment_y, BodyVelocity& m,
                         const InverseInertia& w) {
  const auto tx = static_cast<float>(moment_y), ty = static_cast<float>(-moment_x);
  m.velocity[2] += static_cast<float>(force) * m.inverse_mass;
  m.angular_velocity[0] += w.xx * tx + w.xy * ty;
  m.angular_velocity[1] += w.xy * tx + w.yy * ty;
  m.angular_velocity[2] += w.xz * tx + w.yz * ty;
}

// See solve_support_points(): compliance of each point, relative to the body's, which shares the load where
// the points are redundant; and the error of the speed that needs no solution, u/s.
inline constexpr double kSupportCompliance = 1e-3, kSupportSolved = 1e-7;

struct SupportKernelTable {
  void (*sum_loads)(const SupportSampleView&, const float (&load)[3], LoadSums&);
  void (*store_loads)(const SupportSampleView&, const float (&load)[3]);
  // new_friction = (friction − tangent_mass · slip), scaled into the cone of the loads times the coefficient
  // of friction, `cone`; with limits, of the stored loads times cone[0]. `velocity` is that of the body's
  // underside below the centre of mass along x and y, and about z; `offset` leads from the samples to where
  // their friction acts.
  void (*solve_friction)(const SupportSampleView&, const float (&cone)[3], const float (&offset)[2],
                         const float (&velocity)[3], float tangent_mass, FrictionSums&);
  void (*sum_friction)(const SupportSampleView&, double (&impulse)[3]);
  // solve_support_points() of patches without shares and elastic tops, of at most kMostPoints points.
  void (*solve_points)(const SupportLanes&, BatchPoints, const SubstepParams&, bool is_soft, BodyVelocity*,
                       const DeltaPose*, const InverseInertia*);
};

// The kernels for the best instruction set of this machine.
const SupportKernelTable& support_kernels();

}  // namespace smartsurf::world
