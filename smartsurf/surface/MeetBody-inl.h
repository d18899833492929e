// A body met by the segments of cells that lie side by side, as many at once as a vector has lanes. Included
// once an instruction set (see SweepKernels.cpp), hence no plain include guard.
#include <hwy/highway.h>

#include <cmath>
#include <limits>

#include "smartsurf/surface/LineCrossing-inl.h"
#include "smartsurf/surface/SweepKernels.h"

HWY_BEFORE_NAMESPACE();
namespace smartsurf::surface {
namespace HWY_NAMESPACE {
namespace {

// A footprint is a few cells wide: wider vectors would mostly compute what nobody reads.
using Wide = hn::CappedTag<float, 8>;
using Narrow = hn::CappedTag<float, 1>;

// A stretch of cells that lie side by side in memory, with what is the same for all of them.
struct Stretch {
  const float* x;
  // Null where one value serves all.
  const float *y = nullptr, *dx = nullptr, *dy = nullptr, *height = nullptr;
  float y0 = 0.0F;
  float *distance, *mark;
};

// Writes distance and mark where something is within the range and nearer than what was met before; whether
// it was, anywhere.
template <class D, class V = hn::Vec<D>>
HWY_INLINE bool keep_nearer(float* distance, float* marks, V reached, hn::Mask<D> ok, float range,
                            float mark) {
  const D d;
  const V before = hn::LoadU(d, distance), mark_before = hn::LoadU(d, marks);
  const auto nearer =
      hn::Or(hn::Lt(reached, before), hn::And(hn::Eq(reached, before), hn::Eq(mark_before, hn::Zero(d))));
  const auto take = hn::And(hn::And(ok, hn::Le(reached, hn::Set(d, range))), nearer);
  if (hn::AllFalse(d, take)) return false;
  hn::StoreU(hn::IfThenElse(take, reached, before), d, distance);
  hn::StoreU(hn::IfThenElse(take, hn::Set(d, mark), mark_before), d, marks);
  return true;
}

// Upright segments and a ball: the commonest case, and a short one.
template <class D>
HWY_INLINE bool meet_ball(const SweepJob& job, const Stretch& stretch, int i, const SensedBody& body,
                          float mark) {
  const D d;
  const auto dx = hn::Sub(hn::LoadU(d, stretch.x + i), hn::Set(d, body.centre.x()));
  const float dy = stretch.y0 - body.centre.y();
  const float radius = body.extent.x();
  const auto square = hn::Sub(hn::Sub(hn::Set(d, radius * radius), hn::Mul(dx, dx)), hn::Set(d, dy * dy));
  const auto half = hn::Sqrt(square);  // NaN where the segment passes by
  const auto height = stretch.height != nullptr ? hn::LoadU(d, stretch.height + i) : hn::Zero(d);
  const auto start = hn::Sub(hn::Add(height, hn::Set(d, job.origin.z())), hn::Set(d, body.centre.z()));
  const auto shift = hn::Mul(start, hn::Set(d, -job.direction.z()));
  const auto low = hn::Sub(shift, half), high = hn::Add(half, shift);
  return keep_nearer<D>(stretch.distance + i, stretch.mark + i, hn::Max(low, hn::Zero(d)),
                        hn::Ge(high, hn::Zero(d)), job.range, mark);
}

template <class D>
HWY_INLINE bool meet_any(const SweepJob& job, const Stretch& stretch, int i, const SensedBody& body,
                         float mark) {
  const D d;
  using V = hn::Vec<D>;
  const V dx = stretch.dx != nullptr ? hn::LoadU(d, stretch.dx + i) : hn::Set(d, job.direction.x());
  const V dy = stretch.dy != nullptr ? hn::LoadU(d, stretch.dy + i) : hn::Set(d, job.direction.y());
  const V dz = hn::Set(d, job.direction.z());
  const V height = stretch.height != nullptr ? hn::LoadU(d, stretch.height + i) : hn::Zero(d);
  const V x = hn::Sub(hn::LoadU(d, stretch.x + i), hn::Set(d, body.centre.x()));
  const V y = hn::Sub(stretch.y != nullptr ? hn::LoadU(d, stretch.y + i) : hn::Set(d, stretch.y0),
                      hn::Set(d, body.centre.y()));
  const V z = hn::Sub(hn::Add(height, hn::Set(d, job.origin.z())), hn::Set(d, body.centre.z()));
  // The line's point nearest to the centre, so that nothing cancels in the closed forms.
  const V shift = hn::Neg(dot<D>(x, y, z, dx, dy, dz));
  const V nx = hn::Add(x, hn::Mul(shift, dx)), ny = hn::Add(y, hn::Mul(shift, dy)),
          nz = hn::Add(z, hn::Mul(shift, dz));
  Lines<D> line{nx, ny, nz, dx, dy, dz};
  if (body.shape != scene::ShapeKind::kSphere) {
    const Eigen::Matrix3f& m = body.to_local;
    const auto along = [&](int k, V a, V b, V c) {
      return dot<D>(hn::Set(d, m(k, 0)), hn::Set(d, m(k, 1)), hn::Set(d, m(k, 2)), a, b, c);
    };
    line = {along(0, nx, ny, nz), along(1, nx, ny, nz), along(2, nx, ny, nz),
            along(0, dx, dy, dz), along(1, dx, dy, dz), along(2, dx, dy, dz)};
  }
  const auto there = hn::Gt(height, hn::Set(d, -std::numeric_limits<float>::infinity()));
  bool any = false;
  cross_body<D>(body, line, [&](const Interval<D>& t) {
    const V low = hn::Add(t.low, shift), high = hn::Add(t.high, shift);
    const auto ok = hn::And(there, hn::And(hn::Le(t.low, t.high), hn::Ge(high, hn::Zero(d))));
    any |= keep_nearer<D>(stretch.distance + i, stretch.mark + i, hn::Max(low, hn::Zero(d)), ok, job.range,
                          mark);
  });
  return any;
}

// Whether upright segments may meet the body nearer than what they met before: not those that end, or are
// stopped, below it.
template <class D>
HWY_INLINE bool may_be_nearer(const SweepJob& job, const Stretch& stretch, int i, const SensedBody& body) {
  if (job.direction.z() < 0.0F) return true;
  const D d;
  const float bottom = body.centre.z() - body.reach_z;
  const float slack = 1e-4F * (1.0F + std::abs(body.centre.z()) + body.reach_z);
  const auto height = stretch.height != nullptr ? hn::LoadU(d, stretch.height + i) : hn::Zero(d);
  const auto below = hn::Sub(hn::Set(d, bottom - slack - job.origin.z()), height);
  return !hn::AllFalse(d, hn::Le(below, hn::LoadU(d, stretch.distance + i)));
}

template <class D>
HWY_INLINE bool meet(const SweepJob& job, const Stretch& stretch, int i, const SensedBody& body, float mark,
                     bool upright) {
  if (upright && body.shape == scene::ShapeKind::kSphere) return meet_ball<D>(job, stretch, i, body, mark);
  if (upright && !may_be_nearer<D>(job, stretch, i, body)) return false;
  return meet_any<D>(job, stretch, i, body, mark);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::surface
HWY_AFTER_NAMESPACE();
