// Compiled once per instruction set: foreach_target.h includes this file again for each.
#include "smartsurf/world/GridKernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "smartsurf/world/GridKernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace smartsurf::world {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

int find_near_of_target(const Spheres& s, int self, std::span<const Range> runs, std::int32_t* found) {
  const hn::CappedTag<float, 8> d;  // runs are short: wider vectors would mostly be empty
  const hn::RebindToSigned<decltype(d)> places;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto x = hn::Set(d, s.x[self]), y = hn::Set(d, s.y[self]), z = hn::Set(d, s.z[self]),
             reach = hn::Set(d, s.reach[self]);
  std::size_t count = 0;
  for (const Range& run : runs)
    for (int k = run.begin; k < run.end; k += lanes) {
      const auto dx = hn::Sub(x, hn::LoadU(d, s.x + k)), dy = hn::Sub(y, hn::LoadU(d, s.y + k)),
                 dz = hn::Sub(z, hn::LoadU(d, s.z + k)), both = hn::Add(reach, hn::LoadU(d, s.reach + k));
      const auto square = hn::Add(hn::Add(hn::Mul(dx, dx), hn::Mul(dy, dy)), hn::Mul(dz, dz));
      const auto meets =
          hn::And(hn::Lt(square, hn::Mul(both, both)), hn::FirstN(d, static_cast<std::size_t>(run.end - k)));
      // Not CompressStore: some cores take a hundred cycles to compress into memory.
      hn::StoreU(hn::Compress(hn::Iota(places, k), hn::RebindMask(places, meets)), places, found + count);
      count += hn::CountTrue(d, meets);
    }
  return static_cast<int>(count);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::world
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace smartsurf::world {

HWY_EXPORT(find_near_of_target);

int find_near(const Spheres& spheres, int self, std::span<const Range> runs, std::int32_t* found) {
  return HWY_DYNAMIC_DISPATCH(find_near_of_target)(spheres, self, runs, found);
}

}  // namespace smartsurf::world
#endif
