// Intersects lines with convex shapes in closed form, one line per lane of the vector tag D. RayKernels.cpp
// includes this file once per instruction set, hence no include guard.
//
// A line is o + t·d in the shape's frame with |d| = 1; o must be close to the shape to avoid cancellation.
// The result is the interval of t inside the shape; a miss gives low > high or NaN. Uses IEEE operations
// without fused multiply-add only, so that results are bit-identical for any number of lanes.
#include <hwy/highway.h>

#include <limits>

#include "smartsurf/surface/raycast/RayBodies.h"

HWY_BEFORE_NAMESPACE();
namespace smartsurf::surface {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

template <class D>
struct RayPacket {
  using V = hn::Vec<D>;
  V ox, oy, oz, dx, dy, dz;
};

template <class D>
struct Interval {
  using V = hn::Vec<D>;
  V low, high;

  static Interval whole() { return {hn::Set(D(), -kInfinity), hn::Set(D(), kInfinity)}; }
  static constexpr float kInfinity = std::numeric_limits<float>::infinity();

  void clip(V from, V to) {
    low = hn::Max(low, from);
    high = hn::Min(high, to);
  }
  void empty_where(hn::Mask<D> m) {
    low = hn::IfThenElse(m, hn::Set(D(), kInfinity), low);
    high = hn::IfThenElse(m, hn::Set(D(), -kInfinity), high);
  }
  // Becomes the hull of both intervals, which is their union if the shape is convex.
  void join(const Interval& other) {
    const auto nonempty = hn::Le(low, high), other_nonempty = hn::Le(other.low, other.high);
    low = hn::Min(hn::IfThenElse(nonempty, low, hn::Set(D(), kInfinity)),
                  hn::IfThenElse(other_nonempty, other.low, hn::Set(D(), kInfinity)));
    high = hn::Max(hn::IfThenElse(nonempty, high, hn::Set(D(), -kInfinity)),
                   hn::IfThenElse(other_nonempty, other.high, hn::Set(D(), -kInfinity)));
  }
};

// Lines with a smaller direction component count as parallel to the planes.
constexpr float kParallelTolerance = 1e-9F;

template <class D, class V = hn::Vec<D>>
HWY_INLINE void clip_slab(Interval<D>& t, V o, V d, V low, V high) {
  const auto parallel = hn::Lt(hn::Abs(d), hn::Set(D(), kParallelTolerance));
  const V safe = hn::IfThenElse(parallel, hn::Set(D(), 1.0F), d);
  const V a = hn::Div(hn::Sub(low, o), safe), b = hn::Div(hn::Sub(high, o), safe);
  const V far = hn::Set(D(), Interval<D>::kInfinity);
  t.clip(hn::IfThenElse(parallel, hn::Neg(far), hn::Min(a, b)), hn::IfThenElse(parallel, far, hn::Max(a, b)));
  t.empty_where(hn::And(parallel, hn::Or(hn::Lt(o, low), hn::Gt(o, high))));
}

template <class D, class V = hn::Vec<D>>
HWY_INLINE V dot(V ax, V ay, V az, V bx, V by, V bz) {
  return hn::Add(hn::Add(hn::Mul(ax, bx), hn::Mul(ay, by)), hn::Mul(az, bz));
}

// A sphere centred at (0, 0, z0).
template <class D, class V = hn::Vec<D>>
HWY_INLINE Interval<D> intersect_sphere(const RayPacket<D>& ray, V z0, V radius) {
  const V along = dot<D>(ray.ox, ray.oy, hn::Sub(ray.oz, z0), ray.dx, ray.dy, ray.dz);
  const V nx = hn::Sub(ray.ox, hn::Mul(along, ray.dx)), ny = hn::Sub(ray.oy, hn::Mul(along, ray.dy)),
          nz = hn::Sub(hn::Sub(ray.oz, z0), hn::Mul(along, ray.dz));
  const V square =
      hn::Sub(hn::Sub(hn::Sub(hn::Mul(radius, radius), hn::Mul(nx, nx)), hn::Mul(ny, ny)), hn::Mul(nz, nz));
  const V half = hn::Sqrt(square);  // NaN where the line misses
  return {hn::Sub(hn::Neg(half), along), hn::Sub(half, along)};
}

// An infinite cylinder about the z axis.
template <class D, class V = hn::Vec<D>>
HWY_INLINE Interval<D> intersect_infinite_cylinder(const RayPacket<D>& ray, V radius) {
  const V a = hn::Add(hn::Mul(ray.dx, ray.dx), hn::Mul(ray.dy, ray.dy));
  const V b = hn::Add(hn::Mul(ray.ox, ray.dx), hn::Mul(ray.oy, ray.dy));
  const V c = hn::Sub(hn::Add(hn::Mul(ray.ox, ray.ox), hn::Mul(ray.oy, ray.oy)), hn::Mul(radius, radius));
  const auto parallel = hn::Lt(a, hn::Set(D(), 1e-12F));
  const V safe = hn::IfThenElse(parallel, hn::Set(D(), 1.0F), a);
  const V discriminant = hn::Sub(hn::Mul(b, b), hn::Mul(a, c));
  const V root = hn::Sqrt(hn::Max(discriminant, hn::Zero(D())));
  const V far = hn::Set(D(), Interval<D>::kInfinity);
  Interval<D> t{hn::IfThenElse(parallel, hn::Neg(far), hn::Div(hn::Sub(hn::Neg(b), root), safe)),
                hn::IfThenElse(parallel, far, hn::Div(hn::Sub(root, b), safe))};
  t.empty_where(hn::Or(hn::And(parallel, hn::Gt(c, hn::Zero(D()))),
                       hn::AndNot(parallel, hn::Lt(discriminant, hn::Zero(D())))));
  return t;
}

template <class D>
HWY_INLINE Interval<D> intersect_box(const RayPacket<D>& ray, const Eigen::Vector3f& half) {
  auto t = Interval<D>::whole();
  const auto hx = hn::Set(D(), half.x()), hy = hn::Set(D(), half.y()), hz = hn::Set(D(), half.z());
  clip_slab<D>(t, ray.oz, ray.dz, hn::Neg(hz), hz);
  clip_slab<D>(t, ray.ox, ray.dx, hn::Neg(hx), hx);
  clip_slab<D>(t, ray.oy, ray.dy, hn::Neg(hy), hy);
  return t;
}

template <class D>
HWY_INLINE Interval<D> intersect_cylinder(const RayPacket<D>& ray, const Eigen::Vector3f& extent) {
  auto t = intersect_infinite_cylinder<D>(ray, hn::Set(D(), extent.x()));
  const auto half = hn::Set(D(), extent.z());
  clip_slab<D>(t, ray.oz, ray.dz, hn::Neg(half), half);
  return t;
}

template <class D>
HWY_INLINE Interval<D> intersect_capsule(const RayPacket<D>& ray, const Eigen::Vector3f& extent) {
  const auto radius = hn::Set(D(), extent.x());
  const float half = extent.z() - extent.x();
  const auto centre = hn::Set(D(), half > 0.0F ? half : 0.0F);
  auto t = intersect_infinite_cylinder<D>(ray, radius);
  clip_slab<D>(t, ray.oz, ray.dz, hn::Neg(centre), centre);
  t.join(intersect_sphere<D>(ray, centre, radius));
  t.join(intersect_sphere<D>(ray, hn::Neg(centre), radius));
  return t;
}

// Below the tip at z = 3/4 h the cone is x² + y² ≤ k²·(3/4 h − z)² with k = radius/h. The same equation
// describes a mirrored nappe above the tip, which the slab removes.
template <class D, class V = hn::Vec<D>>
HWY_INLINE Interval<D> intersect_cone(const RayPacket<D>& ray, const Eigen::Vector3f& extent) {
  const float h = extent.y();
  const V k = hn::Set(D(), extent.x() / h), k2 = hn::Mul(k, k);
  const V down = hn::Sub(hn::Set(D(), 0.75F * h), ray.oz);  // distance below the tip
  const V a = hn::Sub(hn::Add(hn::Mul(ray.dx, ray.dx), hn::Mul(ray.dy, ray.dy)),
                      hn::Mul(k2, hn::Mul(ray.dz, ray.dz)));
  const V b =
      hn::Add(hn::Add(hn::Mul(ray.ox, ray.dx), hn::Mul(ray.oy, ray.dy)), hn::Mul(k2, hn::Mul(down, ray.dz)));
  const V c =
      hn::Sub(hn::Add(hn::Mul(ray.ox, ray.ox), hn::Mul(ray.oy, ray.oy)), hn::Mul(k2, hn::Mul(down, down)));
  const V zero = hn::Zero(D()), far = hn::Set(D(), Interval<D>::kInfinity);
  const V discriminant = hn::Sub(hn::Mul(b, b), hn::Mul(a, c));
  const V root = hn::Sqrt(hn::Max(discriminant, zero));
  // Roots as c/q and q/a: no cancellation for either sign of b.
  const V q = hn::Neg(hn::Add(b, hn::CopySign(root, b)));
  const V r1 = hn::Div(c, q), r2 = hn::Div(q, a);
  const V first = hn::Min(r1, r2), second = hn::Max(r1, r2);
  // a > 0: inside between the roots. a < 0: inside beyond them; the lower nappe is on the descending side.
  // a = 0: a single root r1, inside on the descending side.
  const auto level = hn::Lt(hn::Abs(a), hn::Set(D(), 1e-9F));
  const auto steep = hn::Or(hn::Lt(a, zero), level);
  const auto rising = hn::Gt(ray.dz, zero);
  const V until = hn::IfThenElse(level, r1, first), from = hn::IfThenElse(level, r1, second);
  Interval<D> t{hn::IfThenElse(steep, hn::IfThenElse(rising, hn::Neg(far), from), first),
                hn::IfThenElse(steep, hn::IfThenElse(rising, until, far), second)};
  t.empty_where(hn::AndNot(steep, hn::Lt(discriminant, zero)));
  clip_slab<D>(t, ray.oz, ray.dz, hn::Set(D(), -0.25F * h), hn::Set(D(), 0.75F * h));
  return t;
}

template <class D>
HWY_INLINE Interval<D> intersect_hull(const RayPacket<D>& ray, const scene::ConvexHull& hull) {
  auto t = Interval<D>::whole();
  const auto splat = [](float v) { return hn::Set(D(), v); };
  clip_slab<D>(t, ray.ox, ray.dx, splat(hull.bounds_min.x()), splat(hull.bounds_max.x()));
  clip_slab<D>(t, ray.oy, ray.dy, splat(hull.bounds_min.y()), splat(hull.bounds_max.y()));
  clip_slab<D>(t, ray.oz, ray.dz, splat(hull.bounds_min.z()), splat(hull.bounds_max.z()));
  if (hn::AllFalse(D(), hn::Le(t.low, t.high))) return t;
  const auto far = hn::Set(D(), Interval<D>::kInfinity);
  for (const scene::ConvexHull::Face& f : hull.faces) {
    const auto nx = splat(f.normal.x()), ny = splat(f.normal.y()), nz = splat(f.normal.z());
    const auto rate = dot<D>(nx, ny, nz, ray.dx, ray.dy, ray.dz);
    const auto clearance = hn::Sub(splat(f.offset), dot<D>(nx, ny, nz, ray.ox, ray.oy, ray.oz));
    const auto parallel = hn::Lt(hn::Abs(rate), splat(kParallelTolerance));
    const auto t_plane = hn::Div(clearance, hn::IfThenElse(parallel, splat(1.0F), rate));
    const auto leaves = hn::AndNot(parallel, hn::Gt(rate, hn::Zero(D())));
    const auto enters = hn::AndNot(parallel, hn::Lt(rate, hn::Zero(D())));
    t.clip(hn::IfThenElse(enters, t_plane, hn::Neg(far)), hn::IfThenElse(leaves, t_plane, far));
    t.empty_where(hn::And(parallel, hn::Lt(clearance, hn::Zero(D()))));
  }
  return t;
}

// Calls on_interval(interval) for each convex hull of the body.
template <class D, class Meet>
HWY_INLINE void intersect_body(const RayBody& body, const RayPacket<D>& ray, Meet on_interval) {
  switch (body.shape) {
    case scene::ShapeKind::kSphere:
      return on_interval(intersect_sphere<D>(ray, hn::Zero(D()), hn::Set(D(), body.dimensions.x())));
    case scene::ShapeKind::kBox:
      return on_interval(intersect_box<D>(ray, body.dimensions));
    case scene::ShapeKind::kCylinder:
      return on_interval(intersect_cylinder<D>(ray, body.dimensions));
    case scene::ShapeKind::kCapsule:
      return on_interval(intersect_capsule<D>(ray, body.dimensions));
    case scene::ShapeKind::kCone:
      return on_interval(intersect_cone<D>(ray, body.dimensions));
    case scene::ShapeKind::kSolid:
      for (const scene::ConvexHull& hull : body.polyhedron->solid->hulls)
        on_interval(intersect_hull<D>(ray, hull));
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::surface
HWY_AFTER_NAMESPACE();
