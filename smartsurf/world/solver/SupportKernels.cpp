// Compiled once per instruction set: foreach_target.h includes this file again for each.
#include "smartsurf/world/solver/SupportKernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "smartsurf/world/solver/SupportKernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "smartsurf/world/solver/ContactLaw-inl.h"

HWY_BEFORE_NAMESPACE();
namespace smartsurf::world {
namespace HWY_NAMESPACE {
namespace {

// Sums over samples. Sample i always adds to lane i mod kLanes, and lanes are added in one order, so the
// result does not depend on the width of a vector.
template <int kCount>
struct LaneSums {
  float lanes[kCount][kLanes];
  HWY_INLINE void set_lanes(int lane, const V (&sums)[kCount]) {
    for (int k = 0; k < kCount; ++k) store(sums[k], lanes[k], lane);
  }
  double total(int k) const {
    float pair[kLanes / 2];
    for (int i = 0; i < kLanes / 2; ++i) pair[i] = lanes[k][2 * i] + lanes[k][2 * i + 1];
    return static_cast<double>((pair[0] + pair[1]) + (pair[2] + pair[3]));
  }
};
static_assert(kLanes == 8);

// Calls work(i, sums) for the samples of each vector.
template <int kCount, class Work>
HWY_INLINE LaneSums<kCount> sum_lanes(int count, Work work) {
  LaneSums<kCount> total;
  for (int lane = 0; lane < kLanes; lane += kVectorWidth) {
    V sums[kCount];
    for (V& sum : sums) sum = zero();
    for (int i = lane; i < count; i += kLanes) work(i, sums);
    total.set_lanes(lane, sums);
  }
  return total;
}

HWY_INLINE V load_at(const SupportSampleView& s, const float (&load_of)[3], int i) {
  const V value = sum3(set(load_of[0]), set(load_of[1]) * load(s.x, i), set(load_of[2]) * load(s.y, i));
  return load(s.weight, i) * hn::Max(value, zero());
}

template <bool kLimited>
void sum_loads_of(const SupportSampleView& s, const float (&load_of)[3], LoadSums& out) {
  const auto sums = sum_lanes<9>(s.count, [&](int i, V(&sum)[9]) HWY_ATTR {
    const V x = load(s.x, i), y = load(s.y, i);
    V n = load_at(s, load_of, i), w = hn::IfThenElseZero(hn::Gt(n, zero()), load(s.weight, i));
    if constexpr (kLimited) {
      const V limit = load(s.limit, i);
      w = hn::IfThenElseZero(hn::Lt(n, limit), w);
      n = hn::Min(n, limit);
    }
    const V wx = w * x, wy = w * y;
    sum[0] = sum[0] + n;
    sum[1] = sum[1] + n * x;
    sum[2] = sum[2] + n * y;
    sum[3] = sum[3] + w;
    sum[4] = sum[4] + wx;
    sum[5] = sum[5] + wy;
    sum[6] = sum[6] + wx * x;
    sum[7] = sum[7] + wx * y;
    sum[8] = sum[8] + wy * y;
  });
  for (int k = 0; k < 3; ++k) out.load[k] = sums.total(k);
  for (int k = 0; k < 6; ++k) out.stiffness[k] = sums.total(3 + k);
}

void sum_loads(const SupportSampleView& s, const float (&load_of)[3], LoadSums& out) {
  if (s.limit)
    sum_loads_of<true>(s, load_of, out);
  else
    sum_loads_of<false>(s, load_of, out);
}

void store_loads(const SupportSampleView& s, const float (&load_of)[3]) {
  for (int i = 0; i < s.count; i += kVectorWidth) {
    const V n = load_at(s, load_of, i);
    store(s.limit ? hn::Min(n, load(s.limit, i)) : n, s.load, i);
  }
}

template <bool kLimited>
void solve_friction_of(const SupportSampleView& s, const float (&cone)[3], const float (&offset)[2],
                       const float (&velocity)[3], float tangent_mass, FrictionSums& out) {
  const V t = set(tangent_mass), vx = set(velocity[0]), vy = set(velocity[1]), w = set(velocity[2]);
  const V offset_x = set(offset[0]), offset_y = set(offset[1]);
  const auto sums = sum_lanes<7>(s.count, [&](int i, V(&sum)[7]) HWY_ATTR {
    const V x = load(s.x, i) + offset_x, y = load(s.y, i) + offset_y, arm = load(s.arm, i),
            spin = load(s.spin, i);
    const V surface_x = load(s.velocity_x, i) - spin * offset_y,
            surface_y = load(s.velocity_y, i) + spin * offset_x;
    V3 f{load(s.friction[0], i) - t * ((vx - w * y) - surface_x),
         load(s.friction[1], i) - t * ((vy + w * x) - surface_y),
         load(s.friction[2], i) - t * (arm * (w - spin))};
    const V radius = kLimited ? set(cone[0]) * load(s.load, i) : load_at(s, cone, i);
    const V scale = cone_scale(hn::Sqrt(dot(f, f)), radius);
    f = f * scale;
    store(f.x, s.new_friction[0], i);
    store(f.y, s.new_friction[1], i);
    store(f.z, s.new_friction[2], i);
    sum[0] = sum[0] + f.x;
    sum[1] = sum[1] + f.y;
    sum[2] = sum[2] + sum3(x * f.y, zero() - y * f.x, arm * f.z);
    sum[3] = sum[3] + scale;
    sum[4] = sum[4] + scale * x;
    sum[5] = sum[5] + scale * y;
    sum[6] = sum[6] + scale * sum3(x * x, y * y, arm * arm);
  });
  for (int k = 0; k < 3; ++k) out.impulse[k] = sums.total(k);
  for (int k = 0; k < 4; ++k) out.stiffness[k] = sums.total(3 + k);
}

void solve_friction(const SupportSampleView& s, const float (&cone)[3], const float (&offset)[2],
                    const float (&velocity)[3], float tangent_mass, FrictionSums& out) {
  if (s.limit)
    solve_friction_of<true>(s, cone, offset, velocity, tangent_mass, out);
  else
    solve_friction_of<false>(s, cone, offset, velocity, tangent_mass, out);
}

void sum_friction(const SupportSampleView& s, double (&impulse)[3]) {
  const auto sums = sum_lanes<3>(s.count, [&](int i, V(&sum)[3]) HWY_ATTR {
    const V fx = load(s.friction[0], i), fy = load(s.friction[1], i);
    sum[0] = sum[0] + fx;
    sum[1] = sum[1] + fy;
    sum[2] =
        sum[2] + sum3(load(s.x, i) * fy, zero() - load(s.y, i) * fx, load(s.arm, i) * load(s.friction[2], i));
  });
  for (int k = 0; k < 3; ++k) impulse[k] = sums.total(k);
}

// ---- normal impulses, several patches at once, in doubles

using D = LanesOf<double>;
using HalfTag = hn::Rebind<float, LanesTag<double>>;
using Half = hn::Vec<HalfTag>;  // as many floats
constexpr int kDoubles = kWidthOf<double>;

HWY_INLINE D widen(Half a) { return hn::PromoteTo(LanesTag<double>(), a); }
HWY_INLINE Half narrow(D a) { return hn::DemoteTo(HalfTag(), a); }
HWY_INLINE Half load_half(const float* lanes, int first) { return hn::LoadU(HalfTag(), lanes + first); }

// What solve_points() reads and writes of the bodies, by lane.
struct SupportedBodies {
  float velocity_z[kLanes], spin_x[kLanes], spin_y[kLanes], inverse_mass[kLanes];
  float moved_z[kLanes], turned_x[kLanes], turned_y[kLanes];
  float xx[kLanes], xy[kLanes], yy[kLanes];  // of the inverse inertia

  SupportedBodies(const std::int32_t (&row)[kLanes], const BodyVelocity* velocity,
                  const DeltaPose* delta_pose, const InverseInertia* inverse_inertia) {
    for (int i = 0; i < kLanes; ++i) {
      const BodyVelocity& m = velocity[row[i]];
      const DeltaPose& d = delta_pose[row[i]];
      const InverseInertia& w = inverse_inertia[row[i]];
      velocity_z[i] = m.velocity[2], inverse_mass[i] = m.inverse_mass;
      spin_x[i] = m.angular_velocity[0], spin_y[i] = m.angular_velocity[1];
      moved_z[i] = d.translation[2], turned_x[i] = d.rotation[0], turned_y[i] = d.rotation[1];
      xx[i] = w.xx, xy[i] = w.xy, yy[i] = w.yy;
    }
  }
};

// The lanes of a vector of doubles from `at` on.
HWY_INLINE void solve_points_from(int at, const SupportLanes& s, const SupportedBodies& bodies,
                                  BatchPoints points, const SubstepParams& params, bool is_soft,
                                  BodyVelocity* velocity, const InverseInertia* inverse_inertia) {
  const D zero_d = constant<D>(0), one = constant<D>(1);
  const Half none = constant<Half>(0);
  const auto of_bodies = [at](const float(&lanes)[kLanes]) HWY_ATTR { return load_half(lanes, at); };
  const D inverse_mass = widen(of_bodies(bodies.inverse_mass)), xx = widen(of_bodies(bodies.xx)),
          xy = widen(of_bodies(bodies.xy)), yy = widen(of_bodies(bodies.yy));
  const D determinant = xx * yy - xy * xy;
  const D mass = one / inverse_mass, hard_stiffness = mass / constant<D>(kSupportCompliance);
  const D inverse_softness = constant<D>(1.0 / static_cast<double>(params.impulse_scale / params.mass_scale));
  const Half velocity_z = of_bodies(bodies.velocity_z), spin_x = of_bodies(bodies.spin_x),
             spin_y = of_bodies(bodies.spin_y);
  struct Point {
    alignas(64) double x[kDoubles], y[kDoubles], stiffness[kDoubles], error[kDoubles], change[kDoubles];
  };
  Point bearing[SupportLanes::kMostPoints];
  const D inverse_determinant = one / determinant;
  SymmetricMat3<D> sum{mass,   xx * inverse_determinant, yy * inverse_determinant, zero_d,
                       zero_d, xy * inverse_determinant};
  Vector3<D> force{zero_d, zero_d, zero_d};
  D greatest_error = zero_d, count = zero_d;
  for (int k = 0; k < s.point_count; ++k) {
    const BatchPoint& p = points.point[s.first_point + k];
    const BatchPointDetail& d = points.detail[s.first_point + k];
    const Half impulse = load_half(p.normal_impulse, at), normal_mass = load_half(p.normal_mass, at);
    const Half x = load_half(d.anchor_a[0], at), y = load_half(d.anchor_a[1], at),
               rise = load_half(d.surface_velocity[2], at);
    const Half speed = velocity_z + (spin_x * y - spin_y * x) - rise;
    D stiffness = hard_stiffness;
    Half target_speed = load_half(p.relax_target_speed, at);
    if (is_soft) {
      const Half separation = load_half(p.separation, at) + of_bodies(bodies.moved_z) +
                              (of_bodies(bodies.turned_x) * y - of_bodies(bodies.turned_y) * x) -
                              rise * constant<Half>(params.elapsed_s);
      target_speed =
          soft_target_speed(separation, impulse, load_half(d.steady_impulse, at), normal_mass, params);
      stiffness = if_positive(widen(separation), stiffness, inverse_softness * widen(normal_mass));
    }
    float has[kLanes];
    for (int i = 0; i < kDoubles; ++i) has[i] = static_cast<float>(s.points[at + i] >> k & 1U);
    const Half bears_half = if_positive(impulse, if_positive(normal_mass, load_half(has, 0), none), none);
    const D bears = widen(bears_half);
    const D error = if_positive(bears, widen(target_speed - speed), zero_d);
    stiffness = if_positive(bears, stiffness, zero_d);
    greatest_error = hn::Max(greatest_error, hn::Abs(error));
    count = count + bears;
    const D at_x = widen(x), at_y = widen(y), pull = stiffness * error;
    force.x = force.x + pull, force.y = force.y + pull * at_x, force.z = force.z + pull * at_y;
    const D kx = stiffness * at_x, ky = stiffness * at_y;
    sum.xx = sum.xx + stiffness, sum.xy = sum.xy + kx, sum.xz = sum.xz + ky;
    sum.yy = sum.yy + kx * at_x, sum.yz = sum.yz + kx * at_y, sum.zz = sum.zz + ky * at_y;
    store(at_x, bearing[k].x, 0), store(at_y, bearing[k].y, 0);
    store(stiffness, bearing[k].stiffness, 0), store(error, bearing[k].error, 0);
  }
  auto is_solved = hn::And(hn::And(hn::Gt(determinant, zero_d), hn::Gt(inverse_mass, zero_d)),
                           hn::And(hn::Gt(count, one), hn::Gt(greatest_error, constant<D>(kSupportSolved))));
  if (hn::AllFalse(LanesTag<double>(), is_solved)) return;
  const Vector3<D> change = solve_symmetric(sum, force);
  Vector3<D> wrench{zero_d, zero_d, zero_d};
  for (int k = 0; k < s.point_count; ++k) {
    Point& b = bearing[k];
    const D stiffness = load(b.stiffness, 0), x = load(b.x, 0), y = load(b.y, 0);
    const D impulse = stiffness * (load(b.error, 0) - (change.x + x * change.y + y * change.z));
    // Where a point would have to pull, the sweeps decide which one bears.
    const D after = widen(load_half(points.point[s.first_point + k].normal_impulse, at)) + impulse;
    is_solved = hn::And(is_solved, hn::Or(hn::Gt(after, zero_d), hn::Le(stiffness, zero_d)));
    wrench.x = wrench.x + impulse, wrench.y = wrench.y + impulse * x, wrench.z = wrench.z + impulse * y;
    store(impulse, b.change, 0);
  }
  double applies[kDoubles], of_wrench[3][kDoubles];
  store(hn::IfThenElseZero(is_solved, one), applies, 0);
  store(wrench.x, of_wrench[0], 0), store(wrench.y, of_wrench[1], 0), store(wrench.z, of_wrench[2], 0);
  for (int k = 0; k < s.point_count; ++k) {
    BatchPoint& p = points.point[s.first_point + k];
    const Half impulse = narrow(hn::IfThenElseZero(is_solved, load(bearing[k].change, 0)));
    hn::StoreU(load_half(p.normal_impulse, at) + impulse, HalfTag(), p.normal_impulse + at);
    if (!is_soft)
      hn::StoreU(load_half(p.total_normal_impulse, at) + impulse, HalfTag(), p.total_normal_impulse + at);
  }
  for (int i = 0; i < kDoubles; ++i)
    if (applies[i] != 0.0)
      apply_wrench(of_wrench[0][i], of_wrench[1][i], of_wrench[2][i], velocity[s.row[at + i]],
                   inverse_inertia[s.row[at + i]]);
}

void solve_points(const SupportLanes& s, BatchPoints points, const SubstepParams& params, bool is_soft,
                  BodyVelocity* velocity, const DeltaPose* delta_pose,
                  const InverseInertia* inverse_inertia) {
  const SupportedBodies bodies(s.row, velocity, delta_pose, inverse_inertia);
  for (int at = 0; at < kLanes; at += kDoubles)
    solve_points_from(at, s, bodies, points, params, is_soft, velocity, inverse_inertia);
}

const SupportKernelTable* support_table() {
  static const SupportKernelTable kTable{sum_loads, store_loads, solve_friction, sum_friction, solve_points};
  return &kTable;
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::world
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace smartsurf::world {

HWY_EXPORT(support_table);

const SupportKernelTable& support_kernels() { return *HWY_DYNAMIC_DISPATCH(support_table)(); }

}  // namespace smartsurf::world
#endif
