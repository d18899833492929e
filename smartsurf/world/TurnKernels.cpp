// Compiled once per instruction set: foreach_target.h includes this file again for each.
#include "smartsurf/world/TurnKernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "smartsurf/world/TurnKernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "smartsurf/world/Lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace smartsurf::world {
namespace HWY_NAMESPACE {
namespace {

// By its columns.
struct M3 {
  V3 x, y, z;
  HWY_INLINE V3 operator*(const V3& u) const { return x * u.x + y * u.y + z * u.z; }
  HWY_INLINE V3 transposed_times(const V3& u) const { return {dot(x, u), dot(y, u), dot(z, u)}; }
};

HWY_INLINE Symmetric load_symmetric(const float (*lanes)[kLanes], int at) {
  return {load(lanes[0], at), load(lanes[1], at), load(lanes[2], at),
          load(lanes[3], at), load(lanes[4], at), load(lanes[5], at)};
}

HWY_INLINE M3 rotation(const float (*q)[kLanes], int at) {
  const V x = load(q[0], at), y = load(q[1], at), z = load(q[2], at), w = load(q[3], at);
  const V one = set(1.0F), tx = x + x, ty = y + y, tz = z + z;
  const V xx = tx * x, yy = ty * y, zz = tz * z, xy = ty * x, xz = tz * x, yz = tz * y;
  const V wx = tx * w, wy = ty * w, wz = tz * w;
  return {{one - (yy + zz), xy + wz, xz - wy},
          {xy - wz, one - (xx + zz), yz + wx},
          {xz + wy, yz - wx, one - (xx + yy)}};
}

// One Newton step of implicit Euler on Euler's equations, in own axes: stable at any rate of turning.
HWY_INLINE V3 gyrated(const Symmetric& own, const V3& spin, V dt) {
  const V3 momentum = own * spin;
  const V3 own_x{own.xx, own.xy, own.xz}, own_y{own.xy, own.yy, own.yz}, own_z{own.xz, own.yz, own.zz};
  const V none = zero();
  const M3 slope{own_x + (cross(spin, own_x) - V3{none, momentum.z, none - momentum.y}) * dt,
                 own_y + (cross(spin, own_y) - V3{none - momentum.z, none, momentum.x}) * dt,
                 own_z + (cross(spin, own_z) - V3{momentum.y, none - momentum.x, none}) * dt};
  const V3 torque = cross(spin, momentum) * dt;
  const V3 yz = cross(slope.y, slope.z);
  const V per = set(1.0F) / dot(slope.x, yz);
  const V3 change{dot(torque, yz) * per, dot(torque, cross(slope.z, slope.x)) * per,
                  dot(torque, cross(slope.x, slope.y)) * per};
  const V3 next = spin - change;
  // The step's matrix has a pole at a very fast turn about the middle axis; energy must never come from
  // there.
  const V energy = dot(spin, momentum), next_energy = dot(next, own * next);
  const auto some = hn::Gt(next_energy, zero());
  const V scale = hn::IfThenElse(hn::Le(next_energy, energy), set(1.0F),
                                 hn::Sqrt(energy / hn::IfThenElse(some, next_energy, set(1.0F))));
  const auto sound = hn::Or(some, hn::Le(next_energy, energy));
  auto pick = [&](V yes, V no) HWY_ATTR { return hn::IfThenElse(sound, yes * scale, no); };
  return {pick(next.x, spin.x), pick(next.y, spin.y), pick(next.z, spin.z)};
}

// Axes with the z of a matrix that turn as little as may be from where x was.
HWY_INLINE M3 without_twist(const M3& to, const V3& x_before, hn::Mask<D> wanted) {
  const V3 x = x_before - to.z * dot(to.z, x_before);
  const V length = hn::Sqrt(dot(x, x));
  const auto use = hn::And(wanted, hn::Gt(length, set(0.1F)));
  const V3 unit = x * (set(1.0F) / hn::IfThenElse(use, length, set(1.0F)));
  auto pick = [&](const V3& yes, const V3& no) HWY_ATTR {
    return V3{hn::IfThenElse(use, yes.x, no.x), hn::IfThenElse(use, yes.y, no.y),
              hn::IfThenElse(use, yes.z, no.z)};
  };
  return {pick(unit, to.x), pick(cross(to.z, unit), to.y), to.z};
}

HWY_INLINE Symmetric turned(const Symmetric& own, const M3& axes) {
  const V3 x = axes * V3{own.xx, own.xy, own.xz}, y = axes * V3{own.xy, own.yy, own.yz},
           z = axes * V3{own.xz, own.yz, own.zz};
  auto entry = [](V ax, V bx, V ay, V by, V az, V bz) HWY_ATTR { return sum3(ax * bx, ay * by, az * bz); };
  return {
      entry(x.x, axes.x.x, y.x, axes.y.x, z.x, axes.z.x), entry(x.y, axes.x.y, y.y, axes.y.y, z.y, axes.z.y),
      entry(x.z, axes.x.z, y.z, axes.y.z, z.z, axes.z.z), entry(x.x, axes.x.y, y.x, axes.y.y, z.x, axes.z.y),
      entry(x.x, axes.x.z, y.x, axes.y.z, z.x, axes.z.z), entry(x.y, axes.x.z, y.y, axes.y.z, z.y, axes.z.z)};
}

void turn_freely_of_target(Turns& t, float dt_s) {
  for (int at = 0; at < kLanes; at += kWidth) {
    const M3 now = rotation(t.orientation, at);
    const V3 spin =
        gyrated(load_symmetric(t.inertia, at), now.transposed_times(load3(t.spin, at)), set(dt_s));
    store3(now * spin, t.spin, at);
    const auto revolves = hn::Gt(load(t.revolves, at), zero());
    const M3 axes = without_twist(now, load3(t.x_axis, at), revolves);
    store3(axes.x, t.axes[0], at), store3(axes.y, t.axes[1], at), store3(axes.z, t.axes[2], at);
    const Symmetric inverse = turned(load_symmetric(t.inverse, at), axes);
    const V entries[] = {inverse.xx, inverse.yy, inverse.zz, inverse.xy, inverse.xz, inverse.yz};
    for (int i = 0; i < 6; ++i) store(entries[i], t.world_inverse[i], at);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::world
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace smartsurf::world {

HWY_EXPORT(turn_freely_of_target);

void turn_freely(Turns& turns, float dt_s) { HWY_DYNAMIC_DISPATCH(turn_freely_of_target)(turns, dt_s); }

}  // namespace smartsurf::world
#endif
