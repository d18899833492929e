// Casts the rays of adjacent cells against one body, one ray per SIMD lane. RayKernels.cpp includes this file
// once per instruction set, hence no include guard.
#include <hwy/highway.h>

#include <cmath>
#include <limits>

#include "smartsurf/surface/raycast/RayCastJob.h"
#include "smartsurf/surface/raycast/RayIntersection-inl.h"

HWY_BEFORE_NAMESPACE();
namespace smartsurf::surface {
namespace HWY_NAMESPACE {
namespace {

// Footprints are a few cells wide: most lanes of wider vectors would be wasted.
using Wide = hn::CappedTag<float, 8>;
using Scalar = hn::CappedTag<float, 1>;

// The rays of cells contiguous in memory.
struct RaySpan {
  const float* x;
  // A null array stands for one value of all cells: y0, the job's direction, height 0.
  const float *y = nullptr, *dx = nullptr, *dy = nullptr, *height = nullptr;
  float y0 = 0.0F;
  float *distance, *tag;
};

// Stores distance and tag in the lanes whose hit is valid, within the range and closer than the previous one.
// Returns whether any lane changed.
template <class D, class V = hn::Vec<D>>
HWY_INLINE bool record_closest_hit(float* distance, float* tags, V t_hit, hn::Mask<D> valid, float range,
                                   float tag) {
  const D d;
  const V previous = hn::LoadU(d, distance), previous_tag = hn::LoadU(d, tags);
  const auto is_nearer =
      hn::Or(hn::Lt(t_hit, previous), hn::And(hn::Eq(t_hit, previous), hn::Eq(previous_tag, hn::Zero(d))));
  const auto closer = hn::And(hn::And(valid, hn::Le(t_hit, hn::Set(d, range))), is_nearer);
  if (hn::AllFalse(d, closer)) return false;
  hn::StoreU(hn::IfThenElse(closer, t_hit, previous), d, distance);
  hn::StoreU(hn::IfThenElse(closer, hn::Set(d, tag), previous_tag), d, tags);
  return true;
}

// Vertical rays against a sphere: the most common case, and a cheap one.
template <class D>
HWY_INLINE bool cast_vertical_to_sphere(const RayCastJob& job, const RaySpan& rays, int i,
                                        const RayBody& body, float tag) {
  const D d;
  const auto dx = hn::Sub(hn::LoadU(d, rays.x + i), hn::Set(d, body.centre.x()));
  const float dy = rays.y0 - body.centre.y();
  const float radius = body.dimensions.x();
  const auto square = hn::Sub(hn::Sub(hn::Set(d, radius * radius), hn::Mul(dx, dx)), hn::Set(d, dy * dy));
  const auto half = hn::Sqrt(square);  // NaN where the ray misses
  const auto height = rays.height != nullptr ? hn::LoadU(d, rays.height + i) : hn::Zero(d);
  const auto start = hn::Sub(hn::Add(height, hn::Set(d, job.origin.z())), hn::Set(d, body.centre.z()));
  const auto t_shift = hn::Mul(start, hn::Set(d, -job.direction.z()));
  const auto low = hn::Sub(t_shift, half), high = hn::Add(half, t_shift);
  return record_closest_hit<D>(rays.distance + i, rays.tag + i, hn::Max(low, hn::Zero(d)),
                               hn::Ge(high, hn::Zero(d)), job.range, tag);
}

template <class D>
HWY_INLINE bool cast_to_shape(const RayCastJob& job, const RaySpan& rays, int i, const RayBody& body,
                              float tag) {
  const D d;
  using V = hn::Vec<D>;
  const V dx = rays.dx != nullptr ? hn::LoadU(d, rays.dx + i) : hn::Set(d, job.direction.x());
  const V dy = rays.dy != nullptr ? hn::LoadU(d, rays.dy + i) : hn::Set(d, job.direction.y());
  const V dz = hn::Set(d, job.direction.z());
  const V height = rays.height != nullptr ? hn::LoadU(d, rays.height + i) : hn::Zero(d);
  const V x = hn::Sub(hn::LoadU(d, rays.x + i), hn::Set(d, body.centre.x()));
  const V y = hn::Sub(rays.y != nullptr ? hn::LoadU(d, rays.y + i) : hn::Set(d, rays.y0),
                      hn::Set(d, body.centre.y()));
  const V z = hn::Sub(hn::Add(height, hn::Set(d, job.origin.z())), hn::Set(d, body.centre.z()));
  // Move the origin to the line's closest point to the centre, to avoid cancellation in the closed forms.
  const V t_shift = hn::Neg(dot<D>(x, y, z, dx, dy, dz));
  const V nx = hn::Add(x, hn::Mul(t_shift, dx)), ny = hn::Add(y, hn::Mul(t_shift, dy)),
          nz = hn::Add(z, hn::Mul(t_shift, dz));
  RayPacket<D> ray{nx, ny, nz, dx, dy, dz};
  if (body.shape != scene::ShapeKind::kSphere) {
    const Eigen::Matrix3f& m = body.to_local;
    const auto along = [&](int k, V a, V b, V c) {
      return dot<D>(hn::Set(d, m(k, 0)), hn::Set(d, m(k, 1)), hn::Set(d, m(k, 2)), a, b, c);
    };
    ray = {along(0, nx, ny, nz), along(1, nx, ny, nz), along(2, nx, ny, nz),
           along(0, dx, dy, dz), along(1, dx, dy, dz), along(2, dx, dy, dz)};
  }
  const auto cell_exists = hn::Gt(height, hn::Set(d, -std::numeric_limits<float>::infinity()));
  bool any_hit = false;
  intersect_body<D>(body, ray, [&](const Interval<D>& t) {
    const V low = hn::Add(t.low, t_shift), high = hn::Add(t.high, t_shift);
    const auto valid = hn::And(cell_exists, hn::And(hn::Le(t.low, t.high), hn::Ge(high, hn::Zero(d))));
    any_hit |= record_closest_hit<D>(rays.distance + i, rays.tag + i, hn::Max(low, hn::Zero(d)), valid,
                                     job.range, tag);
  });
  return any_hit;
}

// True if vertical rays may hit the body closer than their previous hits. Upward rays whose range or previous
// hit ends below the body cannot.
template <class D>
HWY_INLINE bool may_hit_closer(const RayCastJob& job, const RaySpan& rays, int i, const RayBody& body) {
  if (job.direction.z() < 0.0F) return true;
  const D d;
  const float bottom = body.centre.z() - body.aabb_half_z;
  const float slack = 1e-4F * (1.0F + std::abs(body.centre.z()) + body.aabb_half_z);
  const auto height = rays.height != nullptr ? hn::LoadU(d, rays.height + i) : hn::Zero(d);
  const auto below = hn::Sub(hn::Set(d, bottom - slack - job.origin.z()), height);
  return !hn::AllFalse(d, hn::Le(below, hn::LoadU(d, rays.distance + i)));
}

template <class D>
HWY_INLINE bool cast_to_body(const RayCastJob& job, const RaySpan& rays, int i, const RayBody& body,
                             float tag, bool vertical) {
  if (vertical && body.shape == scene::ShapeKind::kSphere)
    return cast_vertical_to_sphere<D>(job, rays, i, body, tag);
  if (vertical && !may_hit_closer<D>(job, rays, i, body)) return false;
  return cast_to_shape<D>(job, rays, i, body, tag);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::surface
HWY_AFTER_NAMESPACE();
