// Compiled once per instruction set: foreach_target.h includes this file again for each.
#include "smartsurf/world/body/RotationKernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "smartsurf/world/body/RotationKernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "smartsurf/world/simd/SimdLanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace smartsurf::world {
namespace HWY_NAMESPACE {
namespace {

using V = LanesOf<double>;
using V3 = Vector3<V>;

HWY_INLINE V zero() { return constant<V>(0); }

// A 3 × 3 matrix by columns.
struct M3 {
  V3 x, y, z;
  HWY_INLINE V3 operator*(const V3& u) const { return x * u.x + y * u.y + z * u.z; }
};

struct Q4 {
  V x, y, z, w;
  HWY_INLINE Q4 operator*(const Q4& b) const {
    return {(w * b.x + x * b.w) + (y * b.z - z * b.y), (w * b.y + y * b.w) + (z * b.x - x * b.z),
            (w * b.z + z * b.w) + (x * b.y - y * b.x), (w * b.w - x * b.x) - (y * b.y + z * b.z)};
  }
  HWY_INLINE V squared_norm() const { return (x * x + y * y) + (z * z + w * w); }
};

// The quaternion need not be quite unit.
HWY_INLINE M3 rotation_matrix(const Q4& q) {
  const V one = set(1.0), two = set(2.0) / q.squared_norm();
  const V tx = two * q.x, ty = two * q.y, tz = two * q.z;
  const V xx = tx * q.x, yy = ty * q.y, zz = tz * q.z, xy = ty * q.x, xz = tz * q.x, yz = tz * q.y;
  const V wx = tx * q.w, wy = ty * q.w, wz = tz * q.w;
  return {{one - (yy + zz), xy + wz, xz - wy},
          {xy - wz, one - (xx + zz), yz + wx},
          {xz + wy, yz - wx, one - (xx + yy)}};
}

struct SinCos {
  V sin, cos;
};

// Accurate below 1e5 rad; beyond that the reduction is inexact, but sin² + cos² stays 1 (Sun Microsystems,
// fdlibm).
HWY_INLINE SinCos sin_cos(V angle) {
  const V quarters = hn::Round(angle * set(0.63661977236758134308));
  const V remainder =
      (angle - quarters * set(1.57079632673412561417)) - quarters * set(6.07710050650619224932e-11);
  const V r = hn::Min(hn::Max(remainder, set(-0.8)), set(0.8)), z = r * r;
  V s = set(1.58969099521155010221e-10), c = set(-1.13596475577881948265e-11);
  for (const double coefficient :
       {-2.50507602534068634195e-08, 2.75573137070700676789e-06, -1.98412698298579493134e-04,
        8.33333333332248946124e-03, -1.66666666666666324348e-01})
    s = s * z + set(coefficient);
  for (const double coefficient :
       {2.08757232129817482790e-09, -2.75573143513906633035e-07, 2.48015872894767294178e-05,
        -1.38888888888741095749e-03, 4.16666666666666019037e-02})
    c = c * z + set(coefficient);
  const V sin_r = r + r * z * s, cos_r = (set(1.0) - z * set(0.5)) + z * z * c;
  const V quadrant = quarters - set(4.0) * hn::Floor(quarters * set(0.25));
  const auto is_1 = hn::Eq(quadrant, set(1.0)), is_3 = hn::Eq(quadrant, set(3.0));
  const auto swap = hn::Or(is_1, is_3);
  const V sin = hn::IfThenElse(swap, cos_r, sin_r), cos = hn::IfThenElse(swap, sin_r, cos_r);
  return {hn::IfThenElse(hn::Ge(quadrant, set(2.0)), zero() - sin, sin),
          hn::IfThenElse(hn::Or(is_1, hn::Eq(quadrant, set(2.0))), zero() - cos, cos)};
}

HWY_INLINE V3 unit(const V3& v) { return v * (set(1.0) / hn::Sqrt(dot(v, v))); }

using Mask = hn::Mask<LanesTag<double>>;
HWY_INLINE V3 choose(Mask mask, const V3& yes, const V3& no) {
  return {hn::IfThenElse(mask, yes.x, no.x), hn::IfThenElse(mask, yes.y, no.y),
          hn::IfThenElse(mask, yes.z, no.z)};
}

HWY_INLINE Q4 rotation_by_vector(const V3& u) {
  const V angle = hn::Sqrt(dot(u, u));
  const SinCos half = sin_cos(angle * set(0.5));
  const auto turns = hn::Gt(angle, zero());
  const V scale = hn::IfThenElseZero(turns, half.sin / hn::IfThenElse(turns, angle, set(1.0)));
  return {u.x * scale, u.y * scale, u.z * scale, half.cos};
}

// Rotates q and the vector v, which is perpendicular to the axis, about the unit vector `axis`.
HWY_INLINE void rotate_about(const V3& axis, V angle, Q4& q, V3& v) {
  const SinCos half = sin_cos(angle * set(0.5));
  q = Q4{axis.x * half.sin, axis.y * half.sin, axis.z * half.sin, half.cos} * q;
  const V s2 = half.sin + half.sin;
  v = v * (set(1.0) - s2 * half.sin) + cross(axis, v) * (s2 * half.cos);
}

// An inertia tensor, or its inverse: middle·1 + least·u⊗u + greatest·v⊗v, where u and v are the unit axes of
// the least and the greatest principal moment. Exact for equal moments.
struct PrincipalTensor {
  V middle, least, greatest;
  HWY_INLINE V3 times(const V3& x, const V3& u, const V3& v) const {
    return x * middle + u * (least * dot(u, x)) + v * (greatest * dot(v, x));
  }
};

// A free rotation by more than kMaxTurn, rad, takes several steps, up to kMaxSteps.
constexpr double kMaxTurn = 1.0, kMaxSteps = 256.0;

// Free rotation at constant angular momentum: the kinetic energy is split into that of a sphere, of the
// middle moment, and what the least and the greatest moment add to it. Each part alone makes the body rotate
// uniformly, about the momentum or about one of its own axes, and the first commutes with the others; these
// are composed as half, whole, half (R. McLachlan, Explicit Lie–Poisson integration, 1993; J. Touma, J.
// Wisdom, 1994). Exact for bodies with two equal moments and for rotation about one axis; otherwise of second
// order, without drift of the energy, unless it turns by about π in a step, where it resonates: fast bodies
// take several. Returns the new orientation, not quite unit.
HWY_INLINE Q4 rotate_freely(Q4 q, const V3& momentum, V3 u, V3 v, const PrincipalTensor& inverse, V time) {
  const V spin =
      hn::Sqrt(dot(momentum, momentum)) * hn::Max(hn::Abs(inverse.least), hn::Abs(inverse.greatest));
  const V steps = hn::Min(hn::Max(hn::Ceil(spin * time / set(kMaxTurn)), set(1.0)), set(kMaxSteps));
  const V step_time = time / steps, half_time = step_time * set(0.5);
  for (V step = zero();;) {
    const Mask turns = hn::Lt(step, steps);
    Q4 next = q;
    V3 next_u = u, next_v = v;
    rotate_about(next_u, half_time * inverse.least * dot(next_u, momentum), next, next_v);
    rotate_about(next_v, step_time * inverse.greatest * dot(next_v, momentum), next, next_u);
    rotate_about(next_u, half_time * inverse.least * dot(next_u, momentum), next, next_v);
    q = {hn::IfThenElse(turns, next.x, q.x), hn::IfThenElse(turns, next.y, q.y),
         hn::IfThenElse(turns, next.z, q.z), hn::IfThenElse(turns, next.w, q.w)};
    step = step + set(1.0);
    if (hn::AllFalse(LanesTag<double>(), hn::Lt(step, steps))) break;
    // A rotation passes the error of its axis's length on to the other axis: it would grow from step to step.
    u = choose(turns, unit(next_u), u);
    v = choose(turns, unit(next_v - u * dot(u, next_v)), v);
  }
  return rotation_by_vector(momentum * (time * inverse.middle)) * q;
}

// Where enabled, replaces the axes by ones with the same z, whose x is the projection of the previous x: the
// axes of a shape of revolution then do not spin with it. Keeps the axes where x was nearly parallel to z.
HWY_INLINE M3 remove_twist(const M3& to, const V3& x_before, Mask enabled) {
  const V3 x = x_before - to.z * dot(to.z, x_before);
  const V length = hn::Sqrt(dot(x, x));
  const auto use = hn::And(enabled, hn::Gt(length, set(0.1)));
  const V3 new_x = x * (set(1.0) / hn::IfThenElse(use, length, set(1.0)));
  return {choose(use, new_x, to.x), choose(use, cross(to.z, new_x), to.y), to.z};
}

HWY_INLINE void integrate_lanes(RotationBatch& t, int at) {
  const V one = set(1.0), time = load(t.free_time, at);
  const V3 least_axis = load3(t.least_axis, at), greatest_axis = load3(t.greatest_axis, at);
  const V least = load(t.moments[0], at), middle = load(t.moments[1], at), greatest = load(t.moments[2], at);
  const PrincipalTensor inertia{middle, least - middle, greatest - middle};
  const V inverse_middle = one / middle;
  const PrincipalTensor inverse{inverse_middle, one / least - inverse_middle,
                                one / greatest - inverse_middle};

  const Q4 before{load(t.orientation[0], at), load(t.orientation[1], at), load(t.orientation[2], at),
                  load(t.orientation[3], at)};
  const M3 axes_before = rotation_matrix(before);
  const V3 u_before = axes_before * least_axis, v_before = axes_before * greatest_axis;
  const V3 momentum =
      load3(t.momentum, at) + inertia.times(load3(t.angular_velocity_change, at), u_before, v_before);
  // Without contacts the two differ by the rounding of the solver only, which would be noise.
  const V3 rotation = load3(t.rotation, at), added = rotation - load3(t.angular_velocity, at) * time;
  const V significant =
      hn::IfThenElseZero(hn::Gt(dot(added, added), dot(rotation, rotation) * set(1e-12)), one);
  const Q4 turned = rotation_by_vector(added * significant) *
                    rotate_freely(before, momentum, u_before, v_before, inverse, time);
  const V norm = hn::Sqrt(turned.squared_norm());
  const Q4 q{turned.x / norm, turned.y / norm, turned.z / norm, turned.w / norm};
  store(q.x, t.orientation[0], at), store(q.y, t.orientation[1], at);
  store(q.z, t.orientation[2], at), store(q.w, t.orientation[3], at);

  const M3 body_axes = rotation_matrix(q);
  const V3 u = body_axes * least_axis, v = body_axes * greatest_axis;
  // Contacts act on the body as it lay at the start of the step. The momentum that they leave along the axis
  // of a slender body turns with that axis: the little moment would make much energy of a small error.
  const V slenderness = load(t.slenderness, at) * significant;
  const V3 turned_momentum = momentum + u * (slenderness * (dot(momentum, u_before) - dot(momentum, u)));
  store3(turned_momentum, t.momentum, at);
  store3(inverse.times(turned_momentum, u, v), t.angular_velocity, at);
  const auto is_axisymmetric = hn::Gt(load(t.is_axisymmetric, at), zero());
  const M3 axes = remove_twist(body_axes, load3(t.previous_x_axis, at), is_axisymmetric);
  store3(axes.x, t.axes[0], at), store3(axes.y, t.axes[1], at), store3(axes.z, t.axes[2], at);
  auto entry = [&](V diagonal, V ua, V ub, V va, V vb) HWY_ATTR {
    return sum3(diagonal, inverse.least * (ua * ub), inverse.greatest * (va * vb));
  };
  const V entries[] = {entry(inverse.middle, u.x, u.x, v.x, v.x), entry(inverse.middle, u.y, u.y, v.y, v.y),
                       entry(inverse.middle, u.z, u.z, v.z, v.z), entry(zero(), u.x, u.y, v.x, v.y),
                       entry(zero(), u.x, u.z, v.x, v.z),         entry(zero(), u.y, u.z, v.y, v.z)};
  for (int i = 0; i < 6; ++i) store(entries[i], t.world_inverse_inertia[i], at);
}

void integrate_rotation_for_target(RotationBatch& t) {
  for (int at = 0; at < kLanes; at += kWidthOf<double>) integrate_lanes(t, at);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::world
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace smartsurf::world {

HWY_EXPORT(integrate_rotation_for_target);

void integrate_rotation(RotationBatch& batch) { HWY_DYNAMIC_DISPATCH(integrate_rotation_for_target)(batch); }

}  // namespace smartsurf::world
#endif
