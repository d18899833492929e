// The law of a contact point: a soft constraint along the normal, Coulomb's cone, rolling friction. Every
// solver of contacts calls these functions, with one number for F or with lanes.
//
// W is a 3-vector over F with a dot product. Its dot product decides the order of a sum, and with it the last
// bit. Included once per instruction set, hence the toggled include guard.
#if defined(SMARTSURF_WORLD_CONTACT_LAW_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SMARTSURF_WORLD_CONTACT_LAW_INL_H
#undef SMARTSURF_WORLD_CONTACT_LAW_INL_H
#else
#define SMARTSURF_WORLD_CONTACT_LAW_INL_H
#endif

#include "smartsurf/world/simd/SimdLanes-inl.h"
#include "smartsurf/world/solver/ContactBatch.h"

HWY_BEFORE_NAMESPACE();
namespace smartsurf::world {
namespace HWY_NAMESPACE {
namespace {

// The lanes of the contact kernels.
using V = LanesOf<float>;
using V3 = Vector3<V>;
constexpr int kVectorWidth = kWidthOf<float>;

WORLD_INLINE V zero() { return constant<V>(0); }

// ---- along the normal

// The normal speed that a contact is given in the solve stage. While separated it may close its gap within
// the substep; an overlap is pushed out as by a damped spring.
template <class F>
WORLD_INLINE F push_out_speed(F separation, const SubstepParams& params, float slop = kSlop) {
  const F zero = constant<F>(0);
  const F overlap = min(separation + constant<F>(slop), zero);
  const F push = min(zero - overlap * constant<F>(params.bias_rate), constant<F>(params.max_bias_velocity));
  return if_positive(separation, zero - separation * constant<F>(params.inverse_h), push);
}

// In the relax stage, a separated contact may still close its gap; the speed of the push-out is removed.
template <class F>
WORLD_INLINE F relax_target_speed(F separation, F push_out_speed) {
  return if_positive(separation, push_out_speed, constant<F>(0));
}

// The part of an impulse that deflects the contact's spring; see SubstepParams::steady_share.
template <class F>
WORLD_INLINE F deflecting_impulse(F impulse, F steady_impulse, const SubstepParams& params) {
  return max(impulse - constant<F>(params.steady_share) * steady_impulse, constant<F>(0));
}

// The normal speed that the direct solution of several contacts of a body gives to one of them in the solve
// stage: where it overlaps, less the speed by which its spring yields.
template <class F>
WORLD_INLINE F soft_target_speed(F separation, F impulse, F steady_impulse, F normal_mass,
                                 const SubstepParams& params) {
  const F push = push_out_speed(separation, params);
  const F softness = constant<F>(params.impulse_scale / params.mass_scale);
  return if_positive(separation, push,
                     push - softness * deflecting_impulse(impulse, steady_impulse, params) / normal_mass);
}

// The impulse with which a contact that has the normal speed `speed` gets `target_speed`. A contact does not
// pull. `relief` is the reduction of the impulse by the deflection of a soft contact.
template <class F>
WORLD_INLINE F normal_impulse(F old_impulse, F mass, F speed, F target_speed, F relief) {
  return max(old_impulse - mass * (speed - target_speed) - relief, constant<F>(0));
}
template <class F>
WORLD_INLINE F normal_impulse(F old_impulse, F mass, F speed, F target_speed) {
  return max(old_impulse - mass * (speed - target_speed), constant<F>(0));
}

// The same of a soft contact in the solve stage. `deflecting`: see deflecting_impulse().
template <class F>
WORLD_INLINE F soft_normal_impulse(F old_impulse, F mass, F speed, F target_speed, F separation, F deflecting,
                                   const SubstepParams& params) {
  const F soft_mass = mass * if_positive(separation, constant<F>(1), constant<F>(params.mass_scale));
  const F relief = if_positive(separation, constant<F>(0), constant<F>(params.impulse_scale)) * deflecting;
  return normal_impulse(old_impulse, soft_mass, speed, target_speed, relief);
}

// Newton's law of restitution: the speed after an impact.
template <class F>
WORLD_INLINE F rebound_speed(F restitution, F approach_speed) {
  return -restitution * approach_speed;
}

// ---- in the tangent plane

template <class W>
WORLD_INLINE auto dot(const W& a, const W& b) -> decltype(a.dot(b)) {
  return a.dot(b);
}

// The factor that brings an impulse of this length within a limit.
template <class F>
WORLD_INLINE F cone_scale(F length, F limit) {
  return min(constant<F>(1), limit / max(length, constant<F>(1e-30)));
}

template <class W, class F>
WORLD_INLINE W clamp_length(const W& u, F limit) {
  return u * cone_scale(square_root(dot(u, u)), limit);
}

// Opposes a slip, within a cone whose radius is `limit`. The same law holds for the torque of rolling
// friction, with the relative angular velocity for the slip.
template <class W, class F>
WORLD_INLINE W friction_impulse(const W& old_impulse, const W& slip, F mass, F limit) {
  return clamp_length(W(old_impulse - slip * mass), limit);
}

// The greater eigenvalue of the inverse effective mass in the tangent plane, [tt tu; tu uu]. Its inverse, as
// a scalar mass, makes friction act exactly against the slip.
template <class F>
WORLD_INLINE F greatest_tangent_response(F tt, F uu, F tu) {
  const F half = (tt - uu) * constant<F>(0.5);
  return (tt + uu) * constant<F>(0.5) + square_root(half * half + tu * tu);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::world
HWY_AFTER_NAMESPACE();

#ifndef HWY_TARGET_INCLUDE  // a file that is compiled once
namespace smartsurf::world {
namespace law = HWY_NAMESPACE;

namespace {

inline law::Vector3<float> to_law(const Vec3& v) { return {v.x(), v.y(), v.z()}; }
inline Vec3 from_law(const law::Vector3<float>& v) { return {v.x, v.y, v.z}; }

// Sums in the order of the kernels, which is not Eigen's.
inline Vec3 multiply(const InverseInertia& m, const Vec3& v) {
  return from_law(law::SymmetricMat3<float>{m.xx, m.yy, m.zz, m.xy, m.xz, m.yz} * to_law(v));
}

}  // namespace
}  // namespace smartsurf::world
#endif

#endif
