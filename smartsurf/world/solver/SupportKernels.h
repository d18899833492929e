// The inner loops of distributed support: sums over the samples of one patch, see field/SupportPatch.h.
//
// Compiled for several instruction sets with run-time dispatch; all of them give bit-identical results.
#pragma once

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
};

// The kernels for the best instruction set of this machine.
const SupportKernelTable& support_kernels();

}  // namespace smartsurf::world
