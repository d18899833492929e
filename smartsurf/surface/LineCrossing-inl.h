// Where a line crosses a convex shape, in closed form, for as many lines at once as the vector type D has
// lanes. Included once an instruction set (see SweepKernels.cpp), hence no plain include guard.
//
// A line is o + t·d in the shape's own frame, |d| = 1; o is near the shape, so that nothing cancels. The
// result is the interval of t inside; low > high, or a NaN, where the line passes by. Only IEEE operations,
// no fused ones: the same bits for any number of lanes.
#include <hwy/highway.h>

#include <limits>

#include "smartsurf/surface/SensedBodies.h"

HWY_BEFORE_NAMESPACE();
namespace smartsurf::surface {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

template <class D>
struct Lines {
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
  // Becomes the smallest interval around both; right where the union is convex.
  void join(const Interval& other) {
    const auto mine = hn::Le(low, high), its = hn::Le(other.low, other.high);
    low = hn::Min(hn::IfThenElse(mine, low, hn::Set(D(), kInfinity)),
                  hn::IfThenElse(its, other.low, hn::Set(D(), kInfinity)));
    high = hn::Max(hn::IfThenElse(mine, high, hn::Set(D(), -kInfinity)),
                   hn::IfThenElse(its, other.high, hn::Set(D(), -kInfinity)));
  }
};

// A direction this small along an axis is none: the line is parallel to the planes.
constexpr float kParallel = 1e-9F;

template <class D, class V = hn::Vec<D>>
HWY_INLINE void clip_slab(Interval<D>& t, V o, V d, V low, V high) {
  const auto parallel = hn::Lt(hn::Abs(d), hn::Set(D(), kParallel));
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

// A ball about `z0` on the z axis; o need not be the point nearest to it.
template <class D, class V = hn::Vec<D>>
HWY_INLINE Interval<D> cross_ball(const Lines<D>& l, V z0, V radius) {
  const V along = dot<D>(l.ox, l.oy, hn::Sub(l.oz, z0), l.dx, l.dy, l.dz);
  const V nx = hn::Sub(l.ox, hn::Mul(along, l.dx)), ny = hn::Sub(l.oy, hn::Mul(along, l.dy)),
          nz = hn::Sub(hn::Sub(l.oz, z0), hn::Mul(along, l.dz));
  const V square =
      hn::Sub(hn::Sub(hn::Sub(hn::Mul(radius, radius), hn::Mul(nx, nx)), hn::Mul(ny, ny)), hn::Mul(nz, nz));
  const V half = hn::Sqrt(square);  // NaN where the line passes by
  return {hn::Sub(hn::Neg(half), along), hn::Sub(half, along)};
}

// The endless cylinder about the z axis.
template <class D, class V = hn::Vec<D>>
HWY_INLINE Interval<D> cross_tube(const Lines<D>& l, V radius) {
  const V a = hn::Add(hn::Mul(l.dx, l.dx), hn::Mul(l.dy, l.dy));
  const V b = hn::Add(hn::Mul(l.ox, l.dx), hn::Mul(l.oy, l.dy));
  const V c = hn::Sub(hn::Add(hn::Mul(l.ox, l.ox), hn::Mul(l.oy, l.oy)), hn::Mul(radius, radius));
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
HWY_INLINE Interval<D> cross_box(const Lines<D>& l, const Eigen::Vector3f& half) {
  auto t = Interval<D>::whole();
  const auto hx = hn::Set(D(), half.x()), hy = hn::Set(D(), half.y()), hz = hn::Set(D(), half.z());
  clip_slab<D>(t, l.oz, l.dz, hn::Neg(hz), hz);
  clip_slab<D>(t, l.ox, l.dx, hn::Neg(hx), hx);
  clip_slab<D>(t, l.oy, l.dy, hn::Neg(hy), hy);
  return t;
}

template <class D>
HWY_INLINE Interval<D> cross_cylinder(const Lines<D>& l, const Eigen::Vector3f& extent) {
  auto t = cross_tube<D>(l, hn::Set(D(), extent.x()));
  const auto half = hn::Set(D(), extent.z());
  clip_slab<D>(t, l.oz, l.dz, hn::Neg(half), half);
  return t;
}

template <class D>
HWY_INLINE Interval<D> cross_capsule(const Lines<D>& l, const Eigen::Vector3f& extent) {
  const auto radius = hn::Set(D(), extent.x());
  const float half = extent.z() - extent.x();
  const auto centre = hn::Set(D(), half > 0.0F ? half : 0.0F);
  auto t = cross_tube<D>(l, radius);
  clip_slab<D>(t, l.oz, l.dz, hn::Neg(centre), centre);
  t.join(cross_ball<D>(l, centre, radius));
  t.join(cross_ball<D>(l, hn::Neg(centre), radius));
  return t;
}

// Below the tip at z = 3/4 h the cone is where x² + y² ≤ k²·(3/4 h − z)², k = radius / h; above it the same
// equation has a second, upside-down cone, which the slab cuts off.
template <class D, class V = hn::Vec<D>>
HWY_INLINE Interval<D> cross_cone(const Lines<D>& l, const Eigen::Vector3f& extent) {
  const float h = extent.y();
  const V k = hn::Set(D(), extent.x() / h), k2 = hn::Mul(k, k);
  const V down = hn::Sub(hn::Set(D(), 0.75F * h), l.oz);  // from the tip
  const V a = hn::Sub(hn::Add(hn::Mul(l.dx, l.dx), hn::Mul(l.dy, l.dy)), hn::Mul(k2, hn::Mul(l.dz, l.dz)));
  const V b = hn::Add(hn::Add(hn::Mul(l.ox, l.dx), hn::Mul(l.oy, l.dy)), hn::Mul(k2, hn::Mul(down, l.dz)));
  const V c = hn::Sub(hn::Add(hn::Mul(l.ox, l.ox), hn::Mul(l.oy, l.oy)), hn::Mul(k2, hn::Mul(down, down)));
  const V zero = hn::Zero(D()), far = hn::Set(D(), Interval<D>::kInfinity);
  const V discriminant = hn::Sub(hn::Mul(b, b), hn::Mul(a, c));
  const V root = hn::Sqrt(hn::Max(discriminant, zero));
  // The roots as c/q and q/a: neither cancels, whatever the sign of b.
  const V q = hn::Neg(hn::Add(b, hn::CopySign(root, b)));
  const V r1 = hn::Div(c, q), r2 = hn::Div(q, a);
  const V first = hn::Min(r1, r2), second = hn::Max(r1, r2);
  // a > 0: inside between the roots. a < 0: inside beyond them, in this cone on the side that leads down. a =
  // 0: one root, r1, and inside on the side that leads down.
  const auto level = hn::Lt(hn::Abs(a), hn::Set(D(), 1e-9F));
  const auto steep = hn::Or(hn::Lt(a, zero), level);
  const auto rising = hn::Gt(l.dz, zero);
  const V until = hn::IfThenElse(level, r1, first), from = hn::IfThenElse(level, r1, second);
  Interval<D> t{hn::IfThenElse(steep, hn::IfThenElse(rising, hn::Neg(far), from), first),
                hn::IfThenElse(steep, hn::IfThenElse(rising, until, far), second)};
  t.empty_where(hn::AndNot(steep, hn::Lt(discriminant, zero)));
  clip_slab<D>(t, l.oz, l.dz, hn::Set(D(), -0.25F * h), hn::Set(D(), 0.75F * h));
  return t;
}

template <class D>
HWY_INLINE Interval<D> cross_piece(const Lines<D>& l, const scene::ConvexPiece& piece) {
  auto t = Interval<D>::whole();
  const auto coordinate = [](float v) { return hn::Set(D(), v); };
  clip_slab<D>(t, l.ox, l.dx, coordinate(piece.low.x()), coordinate(piece.high.x()));
  clip_slab<D>(t, l.oy, l.dy, coordinate(piece.low.y()), coordinate(piece.high.y()));
  clip_slab<D>(t, l.oz, l.dz, coordinate(piece.low.z()), coordinate(piece.high.z()));
  if (hn::AllFalse(D(), hn::Le(t.low, t.high))) return t;
  const auto far = hn::Set(D(), Interval<D>::kInfinity);
  for (const scene::ConvexPiece::Face& f : piece.faces) {
    const auto nx = coordinate(f.normal.x()), ny = coordinate(f.normal.y()), nz = coordinate(f.normal.z());
    const auto speed = dot<D>(nx, ny, nz, l.dx, l.dy, l.dz);
    const auto room = hn::Sub(coordinate(f.offset), dot<D>(nx, ny, nz, l.ox, l.oy, l.oz));
    const auto parallel = hn::Lt(hn::Abs(speed), coordinate(kParallel));
    const auto at = hn::Div(room, hn::IfThenElse(parallel, coordinate(1.0F), speed));
    const auto leaves = hn::AndNot(parallel, hn::Gt(speed, hn::Zero(D())));
    const auto enters = hn::AndNot(parallel, hn::Lt(speed, hn::Zero(D())));
    t.clip(hn::IfThenElse(enters, at, hn::Neg(far)), hn::IfThenElse(leaves, at, far));
    t.empty_where(hn::And(parallel, hn::Lt(room, hn::Zero(D()))));
  }
  return t;
}

// Calls meet(interval) with each convex part of the body that lines may cross.
template <class D, class Meet>
HWY_INLINE void cross_body(const SensedBody& body, const Lines<D>& l, Meet meet) {
  switch (body.shape) {
    case scene::ShapeKind::kSphere:
      return meet(cross_ball<D>(l, hn::Zero(D()), hn::Set(D(), body.extent.x())));
    case scene::ShapeKind::kBox:
      return meet(cross_box<D>(l, body.extent));
    case scene::ShapeKind::kCylinder:
      return meet(cross_cylinder<D>(l, body.extent));
    case scene::ShapeKind::kCapsule:
      return meet(cross_capsule<D>(l, body.extent));
    case scene::ShapeKind::kCone:
      return meet(cross_cone<D>(l, body.extent));
    case scene::ShapeKind::kSolid:
      for (const scene::ConvexPiece& piece : body.polyhedron->solid->pieces) meet(cross_piece<D>(l, piece));
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::surface
HWY_AFTER_NAMESPACE();
