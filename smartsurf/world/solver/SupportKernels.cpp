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

const SupportKernelTable* support_table() {
  static const SupportKernelTable kTable{sum_loads, store_loads, solve_friction, sum_friction};
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
