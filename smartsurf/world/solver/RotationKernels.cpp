// Compiled once per instruction set: foreach_target.h includes this file again for each.
#include "smartsurf/world/solver/RotationKernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "smartsurf/world/solver/RotationKernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "smartsurf/world/solver/SimdLanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace smartsurf::world {
namespace HWY_NAMESPACE {
namespace {

// A 3 × 3 matrix by columns.
struct M3 {
  V3 x, y, z;
  HWY_INLINE V3 operator*(const V3& u) const { return x * u.x + y * u.y + z * u.z; }
  HWY_INLINE V3 transposed_times(const V3& u) const { return {dot(x, u), dot(y, u), dot(z, u)}; }
};

HWY_INLINE SymmetricMat3 load_symmetric(const float (*lanes)[kLanes], int at) {
  return {load(lanes[0], at), load(lanes[1], at), load(lanes[2], at),
          load(lanes[3], at), load(lanes[4], at), load(lanes[5], at)};
}

HWY_INLINE M3 rotation_matrix(const float (*q)[kLanes], int at) {
  const V x = load(q[0], at), y = load(q[1], at), z = load(q[2], at), w = load(q[3], at);
  const V one = set(1.0F), tx = x + x, ty = y + y, tz = z + z;
  const V xx = tx * x, yy = ty * y, zz = tz * z, xy = ty * x, xz = tz * x, yz = tz * y;
  const V wx = tx * w, wy = ty * w, wz = tz * w;
  return {{one - (yy + zz), xy + wz, xz - wy},
          {xy - wz, one - (xx + zz), yz + wx},
          {xz + wy, yz - wx, one - (xx + yy)}};
}

// One Newton step of implicit Euler on Euler's equations, I dω/dt = −ω × Iω, in body axes: stable at any angular
// velocity (E. Catto, Numerical Methods, GDC 2015).
HWY_INLINE V3 solve_gyroscopic(const SymmetricMat3& local_inertia, const V3& angular_velocity, V dt) {
  const V3 momentum = local_inertia * angular_velocity;
  const V3 inertia_x{local_inertia.xx, local_inertia.xy, local_inertia.xz},
      inertia_y{local_inertia.xy, local_inertia.yy, local_inertia.yz},
      inertia_z{local_inertia.xz, local_inertia.yz, local_inertia.zz};
  const V zeros = zero();
  const M3 jacobian{
      inertia_x + (cross(angular_velocity, inertia_x) - V3{zeros, momentum.z, zeros - momentum.y}) * dt,
      inertia_y + (cross(angular_velocity, inertia_y) - V3{zeros - momentum.z, zeros, momentum.x}) * dt,
      inertia_z + (cross(angular_velocity, inertia_z) - V3{momentum.y, zeros - momentum.x, zeros}) * dt};
  const V3 torque = cross(angular_velocity, momentum) * dt;
  const V3 yz = cross(jacobian.y, jacobian.z);
  const V inverse_determinant = set(1.0F) / dot(jacobian.x, yz);
  const V3 change{dot(torque, yz) * inverse_determinant,
                  dot(torque, cross(jacobian.z, jacobian.x)) * inverse_determinant,
                  dot(torque, cross(jacobian.x, jacobian.y)) * inverse_determinant};
  const V3 next = angular_velocity - change;
  // The Jacobian can become singular at a very high angular velocity about the intermediate axis. Scale the
  // result so that kinetic energy never grows; keep the old velocity where that is impossible.
  const V energy = dot(angular_velocity, momentum), next_energy = dot(next, local_inertia * next);
  const auto positive = hn::Gt(next_energy, zero());
  const V scale = hn::IfThenElse(hn::Le(next_energy, energy), set(1.0F),
                                 hn::Sqrt(energy / hn::IfThenElse(positive, next_energy, set(1.0F))));
  const auto valid = hn::Or(positive, hn::Le(next_energy, energy));
  auto pick = [&](V yes, V no) HWY_ATTR { return hn::IfThenElse(valid, yes * scale, no); };
  return {pick(next.x, angular_velocity.x), pick(next.y, angular_velocity.y),
          pick(next.z, angular_velocity.z)};
}

// Where enabled, replaces the axes by ones with the same z, whose x is the projection of the previous x: the axes of
// a shape of revolution then do not spin with it. Keeps the axes where x was nearly parallel to z.
HWY_INLINE M3 remove_twist(const M3& to, const V3& x_before, hn::Mask<D> enabled) {
  const V3 x = x_before - to.z * dot(to.z, x_before);
  const V length = hn::Sqrt(dot(x, x));
  const auto use = hn::And(enabled, hn::Gt(length, set(0.1F)));
  const V3 unit = x * (set(1.0F) / hn::IfThenElse(use, length, set(1.0F)));
  auto pick = [&](const V3& yes, const V3& no) HWY_ATTR {
    return V3{hn::IfThenElse(use, yes.x, no.x), hn::IfThenElse(use, yes.y, no.y),
              hn::IfThenElse(use, yes.z, no.z)};
  };
  return {pick(unit, to.x), pick(cross(to.z, unit), to.y), to.z};
}

HWY_INLINE SymmetricMat3 rotate_inertia(const SymmetricMat3& local_inertia, const M3& axes) {
  const V3 x = axes * V3{local_inertia.xx, local_inertia.xy, local_inertia.xz},
           y = axes * V3{local_inertia.xy, local_inertia.yy, local_inertia.yz},
           z = axes * V3{local_inertia.xz, local_inertia.yz, local_inertia.zz};
  auto entry = [](V ax, V bx, V ay, V by, V az, V bz) HWY_ATTR { return sum3(ax * bx, ay * by, az * bz); };
  return {
      entry(x.x, axes.x.x, y.x, axes.y.x, z.x, axes.z.x), entry(x.y, axes.x.y, y.y, axes.y.y, z.y, axes.z.y),
      entry(x.z, axes.x.z, y.z, axes.y.z, z.z, axes.z.z), entry(x.x, axes.x.y, y.x, axes.y.y, z.x, axes.z.y),
      entry(x.x, axes.x.z, y.x, axes.y.z, z.x, axes.z.z), entry(x.y, axes.x.z, y.y, axes.y.z, z.y, axes.z.z)};
}

void integrate_gyroscopic_for_target(RotationBatch& t, float dt_s) {
  for (int at = 0; at < kLanes; at += kVectorWidth) {
    const M3 orientation = rotation_matrix(t.orientation, at);
    const V3 angular_velocity =
        solve_gyroscopic(load_symmetric(t.inertia, at),
                         orientation.transposed_times(load3(t.angular_velocity, at)), set(dt_s));
    store3(orientation * angular_velocity, t.angular_velocity, at);
    const auto is_axisymmetric = hn::Gt(load(t.is_axisymmetric, at), zero());
    const M3 axes = remove_twist(orientation, load3(t.previous_x_axis, at), is_axisymmetric);
    store3(axes.x, t.axes[0], at), store3(axes.y, t.axes[1], at), store3(axes.z, t.axes[2], at);
    const SymmetricMat3 inverse = rotate_inertia(load_symmetric(t.inverse_inertia, at), axes);
    const V entries[] = {inverse.xx, inverse.yy, inverse.zz, inverse.xy, inverse.xz, inverse.yz};
    for (int i = 0; i < 6; ++i) store(entries[i], t.world_inverse_inertia[i], at);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::world
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace smartsurf::world {

HWY_EXPORT(integrate_gyroscopic_for_target);

void integrate_gyroscopic(RotationBatch& batch, float dt_s) {
  HWY_DYNAMIC_DISPATCH(integrate_gyroscopic_for_target)(batch, dt_s);
}

}  // namespace smartsurf::world
#endif
