// Compiled once per instruction set: foreach_target.h includes this file again for each.
#include "smartsurf/world/solver/SupportKernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "smartsurf/world/solver/SupportKernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <algorithm>

#include "smartsurf/world/solver/ContactLanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace smartsurf::world {
namespace HWY_NAMESPACE {
namespace {

constexpr int kBlock = 4;  // lanes that add up together

#if HWY_TARGET == HWY_SCALAR

// Calls work(i, sums) for the samples of each vector, and adds up the lanes of the sums: those of a block as
// (0 + 1) + (2 + 3), then the blocks. Sample i always adds to lane i mod kLanes, so the result does not
// depend on the width of a vector.
template <int kCount, class Work>
HWY_INLINE void sum_lanes(int count, Work work, double* out) {
  float lanes[kCount][kLanes];
  for (int lane = 0; lane < kLanes; ++lane) {
    V sums[kCount];
    for (V& sum : sums) sum = zero();
    for (int i = lane; i < count; i += kLanes) work(i, sums);
    for (int k = 0; k < kCount; ++k) store(sums[k], lanes[k], lane);
  }
  for (int k = 0; k < kCount; ++k) {
    const float(&a)[kLanes] = lanes[k];
    out[k] = static_cast<double>(((a[0] + a[1]) + (a[2] + a[3])) + ((a[4] + a[5]) + (a[6] + a[7])));
  }
}

#else

template <int kCount, class Work>
HWY_INLINE void sum_lanes(int count, Work work, double* out) {
  constexpr int kGroups = (kCount + kBlock - 1) / kBlock;
  const hn::CappedTag<float, kBlock> block;
  hn::Vec<decltype(block)> totals[kGroups];
  for (int lane = 0; lane < kLanes; lane += kVectorWidth) {
    V sums[kGroups * kBlock];
    for (V& sum : sums) sum = zero();
    for (int i = lane; i < count; i += kLanes) work(i, sums);
    for (int k = 0; k < kGroups; ++k) {
      V &a = sums[kBlock * k], &b = sums[kBlock * k + 1], &c = sums[kBlock * k + 2],
        &d = sums[kBlock * k + 3];
      transpose(a, b, c, d);
      const V sum = (a + b) + (c + d);
#if SMARTSURF_WIDE
      totals[k] = hn::LowerHalf(block, sum) + hn::UpperHalf(block, sum);
#else
      totals[k] = lane == 0 ? sum : totals[k] + sum;
#endif
    }
  }
  float narrow[kGroups * kBlock];
  for (int k = 0; k < kGroups; ++k) hn::StoreU(totals[k], block, narrow + kBlock * k);
  for (int k = 0; k < kCount; ++k) out[k] = static_cast<double>(narrow[k]);
}

#endif

HWY_INLINE V load_at(const SupportSampleView& s, const float (&load_of)[3], int i) {
  const V value = sum3(set(load_of[0]), set(load_of[1]) * load(s.x, i), set(load_of[2]) * load(s.y, i));
  return load(s.weight, i) * hn::Max(value, zero());
}

template <bool kLimited>
void sum_loads_of(const SupportSampleView& s, const float (&load_of)[3], LoadSums& out) {
  double totals[9];
  const auto add = [&](int i, V* sum) HWY_ATTR {
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
  };
  sum_lanes<9>(s.count, add, totals);
  std::copy_n(totals, 3, out.load);
  std::copy_n(totals + 3, 6, out.stiffness);
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

// The friction impulses at a velocity of the body: Σ (f_x, f_y, torque about z), and the factor s_i by which
// each sample's cone scales its trial impulse: Σ s_i·(1, x, y, x² + y² + arm²).
template <bool kLimited>
HWY_INLINE void rub_samples(const SupportSampleView& s, const float (&cone)[3], const float (&offset)[2],
                            const float (&velocity)[3], float tangent_mass, double (&out)[7]) {
  const V t = set(tangent_mass), vx = set(velocity[0]), vy = set(velocity[1]), w = set(velocity[2]);
  const V offset_x = set(offset[0]), offset_y = set(offset[1]);
  const auto add = [&](int i, V* sum) HWY_ATTR {
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
  };
  sum_lanes<7>(s.count, add, out);
}

void sum_friction(const SupportSampleView& s, double (&impulse)[3]) {
  const auto add = [&](int i, V* sum) HWY_ATTR {
    const V fx = load(s.friction[0], i), fy = load(s.friction[1], i);
    sum[0] = sum[0] + fx;
    sum[1] = sum[1] + fy;
    sum[2] =
        sum[2] + sum3(load(s.x, i) * fy, zero() - load(s.y, i) * fx, load(s.arm, i) * load(s.friction[2], i));
  };
  sum_lanes<3>(s.count, add, impulse);
}

// ---- several patches at once, in doubles

using D = LanesOf<double>;
using HalfTag = hn::Rebind<float, LanesTag<double>>;
using Half = hn::Vec<HalfTag>;  // as many floats
constexpr int kDoubles = kWidthOf<double>;
constexpr int kVectors = kLanes / kVectorWidth;

HWY_INLINE D widen(Half a) { return hn::PromoteTo(LanesTag<double>(), a); }
HWY_INLINE Half narrow(D a) { return hn::DemoteTo(HalfTag(), a); }
HWY_INLINE Half load_half(const float* lanes, int first) { return hn::LoadU(HalfTag(), lanes + first); }
HWY_INLINE D load_wide(const float* lanes, int first) { return widen(load_half(lanes, first)); }
HWY_INLINE void store_narrow(D a, float* lanes, int first) {
  hn::StoreU(narrow(a), HalfTag(), lanes + first);
}
// 1 in the lanes whose set has the member.
HWY_INLINE Half has_member(const std::uint32_t (&sets)[kLanes], int first, int member) {
  const hn::RebindToUnsigned<HalfTag> tag;
  const auto bit = hn::Set(tag, std::uint32_t{1} << static_cast<unsigned>(member));
  const auto is_set = hn::TestBit(hn::LoadU(tag, sets + first), bit);
  return hn::IfThenElseZero(hn::RebindMask(HalfTag(), is_set), constant<Half>(1));
}

// The bodies of the lanes.
struct Bodies {
  BodyLanes motion[kVectors];
  SymmetricMat3<V> inverse_inertia[kVectors];

  HWY_INLINE Bodies(const SupportLanes& s, const BodyVelocity* velocity,
                    const InverseInertia* inverse_inertia_of) {
    for (int k = 0; k * kVectorWidth < s.lane_count; ++k) {
      motion[k] = load_body_lanes(velocity, s.row + k * kVectorWidth);
      inverse_inertia[k] = load_inertia(inverse_inertia_of, s.row + k * kVectorWidth);
    }
  }
  HWY_INLINE void store_motion(const SupportLanes& s, BodyVelocity* velocity) const {
    for (int k = 0; k * kVectorWidth < s.lane_count; ++k)
      store_body_lanes(motion[k], velocity, s.row + k * kVectorWidth, s.lane_count - k * kVectorWidth);
  }
};

template <class Mask>
HWY_INLINE V added_if(Mask is_added, V sum, V change) {
  return hn::IfThenElse(is_added, sum + change, sum);
}

// Applies a change of the friction impulse to the lanes in which `applies` is 1.
HWY_INLINE void apply_friction(const SupportFriction& f, const float (&change)[3][kLanes],
                               const float (&applies)[kLanes], int lane_count, Bodies& bodies) {
  for (int k = 0, at = 0; at < lane_count; ++k, at += kVectorWidth) {
    BodyLanes& m = bodies.motion[k];
    const auto is_added = hn::Gt(load(applies, at), zero());
    const V3 impulse = load3(change, at);
    const V z = load(f.z, at);
    const V3 spin = bodies.inverse_inertia[k] * V3{hn::Neg(z) * impulse.y, z * impulse.x, impulse.z};
    m.velocity.x = added_if(is_added, m.velocity.x, impulse.x * m.inverse_mass);
    m.velocity.y = added_if(is_added, m.velocity.y, impulse.y * m.inverse_mass);
    m.angular_velocity.x = added_if(is_added, m.angular_velocity.x, spin.x);
    m.angular_velocity.y = added_if(is_added, m.angular_velocity.y, spin.y);
    m.angular_velocity.z = added_if(is_added, m.angular_velocity.z, spin.z);
  }
}

// The third row sums in another order than the others, which decides the last bit.
HWY_INLINE Vector3<D> multiply(const SymmetricMat3<D>& m, const Vector3<D>& u) {
  return {sum3(m.xx * u.x, m.xy * u.y, m.xz * u.z), sum3(m.xy * u.x, m.yy * u.y, m.yz * u.z),
          m.xz * u.x + (m.yz * u.y + m.zz * u.z)};
}
HWY_INLINE SymmetricMat3<D> load_symmetric(const double (&lanes)[6][kLanes], int at) {
  return {load(lanes[0], at), load(lanes[1], at), load(lanes[2], at),
          load(lanes[3], at), load(lanes[4], at), load(lanes[5], at)};
}

// 1 in the lanes where a proximal step of all samples sticks, whose impulse takes the place of the last one:
// if a field of friction in proportion to the loads is within their cones. A bound by the centre of force and
// the extent of the samples alone, so that the loads need not be known.
HWY_INLINE D stick_lanes_from(int at, const SupportLanes& s, const SupportFriction& f,
                              SupportFrictionStage& stage, BatchPoints points, float (&change)[3][kLanes]) {
  const D zero_d = constant<D>(0), one = constant<D>(1);
  const Half none = constant<Half>(0);
  Vector3<D> wrench = load3(stage.wrench, at);
  for (int k = 0; k < s.point_count && k < SupportLanes::kMaxPoints; ++k) {
    const BatchPointDetail& d = points.detail[s.first_point + k];
    const Half has = has_member(f.points, at, k);
    const D impulse =
        widen(if_positive(has, load_half(points.point[s.first_point + k].normal_impulse, at), none));
    wrench.x = wrench.x + impulse;
    wrench.y = wrench.y + impulse * load_wide(d.anchor_a[0], at);
    wrench.z = wrench.z + impulse * load_wide(d.anchor_a[1], at);
  }
  const D centre_x = load(f.centre[0], at), centre_y = load(f.centre[1], at), extent = load(f.scale, at);
  wrench.y = (wrench.y - centre_x * wrench.x) / extent;
  wrench.z = (wrench.z - centre_y * wrench.x) / extent;
  store3<double>(wrench, stage.wrench, at);

  constexpr double kStep = kTangentMassFactor / (1.0 + kTangentMassFactor);
  SymmetricMat3<D> inverse = load_symmetric(f.inverse_response, at);
  for (D* entry : {&inverse.xx, &inverse.yy, &inverse.zz, &inverse.xy, &inverse.xz, &inverse.yz})
    *entry = constant<D>(kStep) * *entry;
  const Vector3<D> now = load3(stage.velocity, at), old_impulse = load3(stage.impulse, at);
  const Vector3<D> slip = now - Vector3<D>{load_wide(f.belt[0], at), load_wide(f.belt[1], at), zero_d};
  const Vector3<D> impulse = old_impulse - multiply(inverse, slip);
  // The loads' second moment about their centre, per force: least squares leave scale²·(1 − offset²) of a
  // symmetric patch, and more where samples lift off; somewhat less if it is not symmetric.
  const D spread = constant<D>(0.9);
  const D u = wrench.y / wrench.x, v = wrench.z / wrench.x, offset_squared = u * u + v * v;
  const D min_arm = load(f.min_arm, at);
  const D polar = min_arm * min_arm + spread * extent * extent * hn::Max(zero_d, one - offset_squared);
  const D reach = load(f.reach, at) + extent * hn::Sqrt(offset_squared);
  const D x = centre_x + u * extent, y = centre_y + v * extent;
  const D pull = hn::Sqrt(impulse.x * impulse.x + impulse.y * impulse.y),
          torque = hn::Abs(impulse.z - (x * impulse.y - y * impulse.x));
  const auto sticks = hn::And(hn::Gt(wrench.x, zero_d), hn::Le(pull * polar + torque * reach,
                                                               load_wide(f.friction, at) * wrench.x * polar));
  const auto applies = hn::And(sticks, hn::Gt(load_wide(stage.lumps, at), zero_d));
  const Vector3<D> difference = impulse - old_impulse;
  store_narrow(difference.x, change[0], at);
  store_narrow(difference.y, change[1], at);
  store_narrow(difference.z, change[2], at);
  store(hn::IfThenElse(applies, impulse.x, old_impulse.x), stage.impulse[0], at);
  store(hn::IfThenElse(applies, impulse.y, old_impulse.y), stage.impulse[1], at);
  store(hn::IfThenElse(applies, impulse.z, old_impulse.z), stage.impulse[2], at);
  return hn::IfThenElseZero(applies, one);
}

// Returns the set of lanes that stick, whose motion has changed.
HWY_INLINE std::uint32_t stick_lanes(const SupportLanes& s, const SupportFriction& f,
                                     SupportFrictionStage& stage, BatchPoints points, Bodies& bodies) {
  float now[3][kLanes] = {}, change[3][kLanes] = {}, applies[kLanes] = {};
  for (int k = 0, at = 0; at < s.lane_count; ++k, at += kVectorWidth) {
    const BodyLanes& m = bodies.motion[k];
    const V z = load(f.z, at);
    store(m.velocity.x + z * m.angular_velocity.y, now[0], at);
    store(m.velocity.y - z * m.angular_velocity.x, now[1], at);
    store(m.angular_velocity.z, now[2], at);
  }
  std::uint32_t found = 0;
  for (int at = 0; at < s.lane_count; at += kDoubles) {
    for (int axis = 0; axis < 3; ++axis) store(load_wide(now[axis], at), stage.velocity[axis], at);
    store_narrow(stick_lanes_from(at, s, f, stage, points, change), applies, at);
  }
  for (int lane = 0; lane < s.lane_count; ++lane)
    found |= static_cast<std::uint32_t>(applies[lane]) << static_cast<unsigned>(lane);
  if (found != 0) apply_friction(f, change, applies, s.lane_count, bodies);
  return found;
}

std::uint32_t stick(const SupportLanes& s, const SupportFriction& f, SupportFrictionStage& stage,
                    BatchPoints points, BodyVelocity* velocity, const InverseInertia* inverse_inertia) {
  Bodies bodies(s, velocity, inverse_inertia);
  const std::uint32_t found = stick_lanes(s, f, stage, points, bodies);
  if (found != 0) bodies.store_motion(s, velocity);
  return found;
}

// The motion of the bodies, by lane, for solve_points().
struct SupportedBodies {
  float velocity_z[kLanes], spin_x[kLanes], spin_y[kLanes];
  float moved_z[kLanes], turned_x[kLanes], turned_y[kLanes];

  HWY_INLINE void set(int at, const BodyLanes& m) {
    store(m.velocity.z, velocity_z, at);
    store(m.angular_velocity.x, spin_x, at), store(m.angular_velocity.y, spin_y, at);
  }
  HWY_INLINE void set_pose(int at, const DeltaPose* delta_pose, const std::int32_t* row) {
    V3 moved, turned;
    V unused;
    load_rows(&delta_pose->translation[0], row, 0, moved.x, moved.y, moved.z, unused);
    load_rows(&delta_pose->translation[0], row, 4, turned.x, turned.y, turned.z, unused);
    store(moved.z, moved_z, at), store(turned.x, turned_x, at), store(turned.y, turned_y, at);
  }
};

// The lanes of a vector of doubles from `at` on.
HWY_INLINE void solve_points_from(int at, const SupportLanes& s, const SupportedBodies& bodies,
                                  BatchPoints points, const SubstepParams& params, bool is_soft,
                                  float (&of_wrench)[3][kLanes], float (&applies)[kLanes]) {
  const D zero_d = constant<D>(0), one = constant<D>(1);
  const Half none = constant<Half>(0);
  const auto of_bodies = [at](const float(&lanes)[kLanes]) HWY_ATTR { return load_half(lanes, at); };
  const D hard_stiffness = load(s.stiffness, at);
  const D inverse_softness = constant<D>(1.0 / static_cast<double>(params.impulse_scale / params.mass_scale));
  const Half velocity_z = of_bodies(bodies.velocity_z), spin_x = of_bodies(bodies.spin_x),
             spin_y = of_bodies(bodies.spin_y);
  struct Point {
    alignas(64) double x[kDoubles], y[kDoubles], stiffness[kDoubles], error[kDoubles], change[kDoubles];
  };
  Point bearing[SupportLanes::kMaxPoints];
  SymmetricMat3<D> sum{load(s.mass, at), load(s.inertia[0], at), load(s.inertia[1], at), zero_d,
                       zero_d,           load(s.inertia[2], at)};
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
    const Half bears_half =
        if_positive(impulse, if_positive(normal_mass, has_member(s.points, at, k), none), none);
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
  auto is_solved = hn::And(hn::Gt(count, one), hn::Gt(greatest_error, constant<D>(kSupportSolved)));
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
  store_narrow(hn::IfThenElseZero(is_solved, one), applies, at);
  store_narrow(wrench.x, of_wrench[0], at);
  store_narrow(wrench.y, of_wrench[1], at);
  store_narrow(wrench.z, of_wrench[2], at);
  for (int k = 0; k < s.point_count; ++k) {
    BatchPoint& p = points.point[s.first_point + k];
    const Half impulse = narrow(hn::IfThenElseZero(is_solved, load(bearing[k].change, 0)));
    hn::StoreU(load_half(p.normal_impulse, at) + impulse, HalfTag(), p.normal_impulse + at);
    if (!is_soft)
      hn::StoreU(load_half(p.total_normal_impulse, at) + impulse, HalfTag(), p.total_normal_impulse + at);
  }
}

// Returns whether the motion of any lane has changed.
HWY_INLINE bool solve_points_of_lanes(const SupportLanes& s, BatchPoints points, const SubstepParams& params,
                                      bool is_soft, const DeltaPose* delta_pose, Bodies& bodies) {
  SupportedBodies of_bodies{};
  for (int k = 0, at = 0; at < s.lane_count; ++k, at += kVectorWidth) {
    of_bodies.set(at, bodies.motion[k]);
    if (is_soft) of_bodies.set_pose(at, delta_pose, s.row + at);
  }
  float wrench[3][kLanes] = {}, applies[kLanes] = {};
  for (int at = 0; at < s.lane_count; at += kDoubles)
    solve_points_from(at, s, of_bodies, points, params, is_soft, wrench, applies);
  if (std::all_of(applies, applies + kLanes, [](float a) { return a == 0.0F; })) return false;
  for (int k = 0, at = 0; at < s.lane_count; ++k, at += kVectorWidth) {
    BodyLanes& m = bodies.motion[k];
    const SymmetricMat3<V>& w = bodies.inverse_inertia[k];
    const auto is_added = hn::Gt(load(applies, at), zero());
    const V tx = load(wrench[2], at), ty = hn::Neg(load(wrench[1], at));
    m.velocity.z = added_if(is_added, m.velocity.z, load(wrench[0], at) * m.inverse_mass);
    m.angular_velocity.x = added_if(is_added, m.angular_velocity.x, w.xx * tx + w.xy * ty);
    m.angular_velocity.y = added_if(is_added, m.angular_velocity.y, w.xy * tx + w.yy * ty);
    m.angular_velocity.z = added_if(is_added, m.angular_velocity.z, w.xz * tx + w.yz * ty);
  }
  return true;
}

void solve_points(const SupportLanes& s, BatchPoints points, const SubstepParams& params, bool is_soft,
                  BodyVelocity* velocity, const DeltaPose* delta_pose,
                  const InverseInertia* inverse_inertia) {
  Bodies bodies(s, velocity, inverse_inertia);
  if (solve_points_of_lanes(s, points, params, is_soft, delta_pose, bodies)) bodies.store_motion(s, velocity);
}

std::uint32_t solve_points_and_stick(const SupportLanes& s, const SupportFriction& f,
                                     SupportFrictionStage& stage, BatchPoints points,
                                     const SubstepParams& params, bool is_soft, BodyVelocity* velocity,
                                     const DeltaPose* delta_pose, const InverseInertia* inverse_inertia) {
  Bodies bodies(s, velocity, inverse_inertia);
  bool has_changed = solve_points_of_lanes(s, points, params, is_soft, delta_pose, bodies);
  const std::uint32_t found = stick_lanes(s, f, stage, points, bodies);
  has_changed |= found != 0;
  if (!is_soft && found == f.lanes)
    has_changed |= solve_points_of_lanes(s, points, params, is_soft, delta_pose, bodies);
  if (has_changed) bodies.store_motion(s, velocity);
  return found;
}

// Finds the velocity at which the samples cause it, by Newton's method.
void solve_friction(const SupportLanes& s, const SupportFriction& f, SupportFrictionStage& stage,
                    std::uint32_t lanes, int passes, BatchPoints points, const SubstepParams* params,
                    BodyVelocity* velocity, const InverseInertia* inverse_inertia) {
  // Error of the velocity at which a solution is accurate enough, u/s.
  constexpr double kVelocityTolerance = 1e-5;
  const auto has = [](std::uint32_t set, int lane) { return (set >> static_cast<unsigned>(lane) & 1U) != 0; };
  double q[3][kLanes], sums[7][kLanes] = {};
  for (int axis = 0; axis < 3; ++axis) std::copy_n(stage.velocity[axis], kLanes, q[axis]);
  std::uint32_t open = lanes;
  for (int pass = 0; pass < passes && open != 0; ++pass) {
    for (int lane = 0; lane < s.lane_count; ++lane) {
      if (!has(open, lane)) continue;
      const float at_velocity[3] = {static_cast<float>(q[0][lane]), static_cast<float>(q[1][lane]),
                                    static_cast<float>(q[2][lane])};
      const SupportSampleView& samples = f.samples[lane];
      const auto tangent_mass = static_cast<float>(f.tangent_mass[lane]);
      double of_lane[7];
      if (samples.limit)
        rub_samples<true>(samples, stage.cone[lane], stage.offset[lane], at_velocity, tangent_mass, of_lane);
      else
        rub_samples<false>(samples, stage.cone[lane], stage.offset[lane], at_velocity, tangent_mass, of_lane);
      for (int k = 0; k < 7; ++k) sums[k][lane] = of_lane[k];
    }
    std::uint32_t stays_open = 0;
    for (int at = 0; at < s.lane_count; at += kDoubles) {
      const Vector3<D> now = load3(stage.velocity, at), old_impulse = load3(stage.impulse, at),
                       at_velocity = load3(q, at);
      const Vector3<D> impulse{load(sums[0], at), load(sums[1], at), load(sums[2], at)};
      // How far q is from the velocity that these impulses cause.
      const Vector3<D> error =
          (at_velocity - now) + multiply(load_symmetric(f.response, at), old_impulse - impulse);
      const D greatest =
          hn::Max(hn::Max(hn::Abs(error.x), hn::Abs(error.y)), hn::Abs(error.z) * load(f.scale, at));
      const SymmetricMat3<D> inverse = load_symmetric(f.inverse_response, at);
      const D t = load(f.tangent_mass, at), sw = t * load(sums[3], at), sx = t * load(sums[4], at),
              sy = t * load(sums[5], at), polar = t * load(sums[6], at);
      const SymmetricMat3<D> stiffness{inverse.xx + sw, inverse.yy + sw, inverse.zz + polar,
                                       inverse.xy,      inverse.xz - sy, inverse.yz + sx};
      store3<double>(at_velocity - solve_symmetric(stiffness, multiply(inverse, error)), q, at);
      std::uint8_t bits[8];  // as many as StoreMaskBits() may write
      hn::StoreMaskBits(LanesTag<double>(), hn::Gt(greatest, constant<D>(kVelocityTolerance)), bits);
      stays_open |= std::uint32_t{bits[0]} << static_cast<unsigned>(at);
    }
    open &= stays_open;
  }
  float change[3][kLanes] = {}, applies[kLanes];
  for (int lane = 0; lane < kLanes; ++lane) applies[lane] = has(lanes, lane) ? 1.0F : 0.0F;
  for (int at = 0; at < s.lane_count; at += kDoubles) {
    const auto is_applied = hn::Gt(load_wide(applies, at), constant<D>(0));
    for (int axis = 0; axis < 3; ++axis) {
      const D sum = load(sums[axis], at), old_impulse = load(stage.impulse[axis], at);
      store_narrow(sum - old_impulse, change[axis], at);
      store(hn::IfThenElse(is_applied, sum, old_impulse), stage.impulse[axis], at);
    }
  }
  Bodies bodies(s, velocity, inverse_inertia);
  apply_friction(f, change, applies, s.lane_count, bodies);
  if (params != nullptr) solve_points_of_lanes(s, points, *params, false, nullptr, bodies);
  bodies.store_motion(s, velocity);
}

const SupportKernelTable* support_table() {
  static const SupportKernelTable kTable{
      sum_loads, store_loads, stick, solve_friction, sum_friction, solve_points, solve_points_and_stick};
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
