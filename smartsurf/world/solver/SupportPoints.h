// The points of support patches: their normal impulses, and access to them for SupportSolver.h.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <span>

#include "smartsurf/world/field/SupportPatch.h"
#include "smartsurf/world/solver/ContactLaw-inl.h"
#include "smartsurf/world/solver/SupportKernels.h"

namespace smartsurf::world::support {

using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;

// Solves a·x = b for a positive definite matrix.
inline Vector3 solve(const Matrix3& a, const Vector3& b) {
  const law::Vector3<double> x = law::solve_symmetric(
      law::SymmetricMat3<double>{a(0, 0), a(1, 1), a(2, 2), a(0, 1), a(0, 2), a(1, 2)}, {b[0], b[1], b[2]});
  return {x.x, x.y, x.z};
}

// Newton's method with a line search, on a convex function.
struct LineSearch {
  Vector3 point;         // where the gradient is to be found next
  Vector3 best = point;  // the last point that was accepted
  Vector3 step = Vector3::Zero();
  double fraction = 1.0, descent = 0.0;  // descent: −derivative along `step` at `best`

  // Accepts the point, or moves it back if it is too far. Returns whether it was.
  bool accept(const Vector3& gradient) {
    const double ascent = gradient.dot(step);
    if (ascent > 0.5 * descent) {
      fraction *= std::max(0.1, descent / (descent + ascent));
      point = best + fraction * step;
      return false;
    }
    best = point;
    return true;
  }
  void take(const Vector3& newton_step, const Vector3& gradient) {
    step = newton_step;
    fraction = 1.0, descent = -gradient.dot(step);
    point = best + step;
  }
};

// Applies vertical impulses at points (x, y) of a body: their sum, and the sums of impulse·x and impulse·y.
inline void apply_wrench(const Vector3& wrench, BodyVelocity& m, const InverseInertia& w) {
  const auto tx = static_cast<float>(wrench[2]), ty = static_cast<float>(-wrench[1]);
  m.velocity[2] += static_cast<float>(wrench[0]) * m.inverse_mass;
  m.angular_velocity[0] += w.xx * tx + w.xy * ty;
  m.angular_velocity[1] += w.xy * tx + w.yy * ty;
  m.angular_velocity[2] += w.xz * tx + w.yz * ty;
}

inline std::span<const std::int32_t> points_of(const SupportPatches& list, const SupportPatch& p) {
  return std::span(list.points).subspan(p.first_point, p.point_count);
}

// Calls each(point, limit of the first point on its cell or null, share) for the points of a patch with
// shares.
template <class Each>
void for_each_share(const SupportPatches& list, const SupportPatch& p, BatchPoints points, Each each) {
  for (int i = p.first_point; i < p.first_point + p.point_count; ++i) {
    const std::int32_t k = p.batch_point + list.points[i];
    BatchPointLimit* limit = nullptr;
    if (p.has_impulse_limit && points.limit[k].is_limited(p.lane))
      limit = &points.limit[k] + points.limit[k].to_first[p.lane];
    each(k, limit, list.shares[i]);
  }
}

}  // namespace smartsurf::world::support

namespace smartsurf::world {

// Solves the normal impulses at all points that bear at once, after a sweep over the contacts, with the soft
// constraints of the solve stage or the hard ones of the relax stage. The sweep alone leaves an error that
// alternates from step to step, and the pressure with it.
void solve_support_points(const SupportPatches&, const SupportPatch&, BatchPoints, const SubstepParams&,
                          bool is_soft, BodyVelocity&, const DeltaPose&, const InverseInertia&);

}  // namespace smartsurf::world
