// Compiled once per instruction set: foreach_target.h includes this file again for each.
#include "smartsurf/world/broadphase/UniformGridKernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "smartsurf/world/broadphase/UniformGridKernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace smartsurf::world {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

int find_overlaps_for_target(const BoundingSpheres& s, int self, std::span<const IndexRange> runs,
                             std::int32_t* found) {
  const hn::CappedTag<float, 8> d;  // runs are short: wider vectors would mostly be empty
  const hn::RebindToSigned<decltype(d)> indices;
  const hn::Rebind<std::uint8_t, decltype(d)> bytes;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto x = hn::Set(d, s.x[self]), y = hn::Set(d, s.y[self]), z = hn::Set(d, s.z[self]),
             radius = hn::Set(d, s.radius[self]);
  std::size_t count = 0;
  for (const IndexRange& run : runs)
    for (int k = run.begin; k < run.end; k += lanes) {
      const auto dx = hn::Sub(x, hn::LoadU(d, s.x + k)), dy = hn::Sub(y, hn::LoadU(d, s.y + k)),
                 dz = hn::Sub(z, hn::LoadU(d, s.z + k)),
                 radius_sum = hn::Add(radius, hn::LoadU(d, s.radius + k));
      const auto distance_squared = hn::Add(hn::Add(hn::Mul(dx, dx), hn::Mul(dy, dy)), hn::Mul(dz, dz));
      const auto overlaps =
          hn::And(hn::Lt(distance_squared, hn::Mul(radius_sum, radius_sum)), hn::FirstN(d, run.end - k));
      // Neither CompressStore, which takes a hundred cycles on some cores, nor Compress, whose table Highway
      // 1.0 copies to the stack in each call.
      std::uint8_t bits[8];  // as many as StoreMaskBits() may write
      hn::StoreMaskBits(d, overlaps, bits);
      const auto positions = hn::PromoteTo(indices, hn::LoadU(bytes, kSetBits[bits[0]].data()));
      hn::StoreU(hn::Add(hn::Set(indices, k), positions), indices, found + count);
      count += hn::CountTrue(d, overlaps);
    }
  return static_cast<int>(count);
}

auto* find_overlaps_kernel() { return &find_overlaps_for_target; }

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::world
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace smartsurf::world {

HWY_EXPORT(find_overlaps_kernel);

int find_overlaps(const BoundingSpheres& spheres, int self, std::span<const IndexRange> runs,
                  std::int32_t* found) {
  static const auto kKernel = HWY_DYNAMIC_DISPATCH(find_overlaps_kernel)();
  return kKernel(spheres, self, runs, found);
}

}  // namespace smartsurf::world
#endif
