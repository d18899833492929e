// SIMD vectors, 3-vectors and matrices over lanes, for the solver's kernels.
//
// Included once per instruction set, hence the toggled include guard.
#if defined(SMARTSURF_WORLD_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SMARTSURF_WORLD_LANES_INL_H
#undef SMARTSURF_WORLD_LANES_INL_H
#else
#define SMARTSURF_WORLD_LANES_INL_H
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <cstdint>

#include "smartsurf/world/simd/Lanes.h"

// Whether a vector consists of two 128-bit blocks.
#undef SMARTSURF_WIDE
#define SMARTSURF_WIDE (HWY_TARGET <= HWY_AVX2)

HWY_BEFORE_NAMESPACE();
namespace smartsurf::world {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<float, kLanes>;
using V = hn::Vec<D>;
// Lanes per vector: a whole batch, half of it, or one lane (scalar target).
constexpr int kVectorWidth = static_cast<int>(hn::MaxLanes(D()));
static_assert(kVectorWidth == 1 || kVectorWidth == 4 || kVectorWidth == 8);

HWY_INLINE V set(float value) { return hn::Set(D(), value); }
HWY_INLINE V zero() { return hn::Zero(D()); }
HWY_INLINE V load(const float* lanes, int first) { return hn::LoadU(D(), lanes + first); }
HWY_INLINE void store(V value, float* lanes, int first) { hn::StoreU(value, D(), lanes + first); }
HWY_INLINE V sum3(V a, V b, V c) { return (a + b) + c; }
// 1 / a; 0 for a ≤ 0, which occurs in unused lanes and for bodies without mass.
HWY_INLINE V inverse(V a) { return hn::IfThenElseZero(hn::Gt(a, zero()), set(1.0F) / a); }

struct V3 {
  V x, y, z;
};
HWY_INLINE V3 operator+(const V3& a, const V3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
HWY_INLINE V3 operator-(const V3& a, const V3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
HWY_INLINE V3 operator*(const V3& a, V s) { return {a.x * s, a.y * s, a.z * s}; }
HWY_INLINE V dot(const V3& a, const V3& b) { return sum3(a.x * b.x, a.y * b.y, a.z * b.z); }
HWY_INLINE V3 cross(const V3& a, const V3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
HWY_INLINE V3 load3(const float (*lanes)[kLanes], int first) {
  return {load(lanes[0], first), load(lanes[1], first), load(lanes[2], first)};
}
HWY_INLINE void store3(const V3& value, float (*lanes)[kLanes], int first) {
  store(value.x, lanes[0], first);
  store(value.y, lanes[1], first);
  store(value.z, lanes[2], first);
}

struct SymmetricMat3 {
  V xx, yy, zz, xy, xz, yz;
  HWY_INLINE V3 operator*(const V3& u) const {
    return {sum3(xx * u.x, xy * u.y, xz * u.z), sum3(xy * u.x, yy * u.y, yz * u.z),
            sum3(xz * u.x, yz * u.y, zz * u.z)};
  }
};

// Completes a unit vector to an orthonormal basis (Duff et al., Building an Orthonormal Basis, Revisited, 2017).
HWY_INLINE void tangents(const V3& n, V3& t, V3& u) {
  const V sign = hn::CopySign(set(1.0F), n.z);
  const V a = set(-1.0F) / (sign + n.z);
  const V b = n.x * n.y * a;
  t = {set(1.0F) + sign * n.x * n.x * a, sign * b, zero() - sign * n.x};
  u = {b, sign + n.y * n.y * a, zero() - n.y};
}

// Gather and scatter of rows of eight floats, one row per body. load_rows() and store_rows() transfer the four
// floats from `column` on of the bodies in the lanes.
constexpr int kRow = 8;

#if HWY_TARGET == HWY_SCALAR

HWY_INLINE void load_rows(const float* rows, const std::int32_t* index, int column, V& a, V& b, V& c, V& d) {
  const float* row = rows + static_cast<std::ptrdiff_t>(index[0]) * kRow + column;
  a = load(row, 0), b = load(row, 1), c = load(row, 2), d = load(row, 3);
}
HWY_INLINE void store_rows(V a, V b, V c, V d, float* rows, const std::int32_t* index, int, int column) {
  float* row = rows + static_cast<std::ptrdiff_t>(index[0]) * kRow + column;
  store(a, row, 0), store(b, row, 1), store(c, row, 2), store(d, row, 3);
}

#else

// Transposes a 4 × 4 matrix in each 128-bit block.
HWY_INLINE void transpose(V& a, V& b, V& c, V& d) {
  const D t;
  const V ac = hn::InterleaveLower(t, a, c), bd = hn::InterleaveLower(t, b, d);
  const V ac_high = hn::InterleaveUpper(t, a, c), bd_high = hn::InterleaveUpper(t, b, d);
  a = hn::InterleaveLower(t, ac, bd);
  b = hn::InterleaveUpper(t, ac, bd);
  c = hn::InterleaveLower(t, ac_high, bd_high);
  d = hn::InterleaveUpper(t, ac_high, bd_high);
}

HWY_INLINE V load_row(const float* rows, const std::int32_t* index, int lane) {
  const float* low = rows + static_cast<std::ptrdiff_t>(index[lane]) * kRow;
#if SMARTSURF_WIDE
  const hn::Half<D> half;
  const float* high = rows + static_cast<std::ptrdiff_t>(index[lane + 4]) * kRow;
  return hn::Combine(D(), hn::Load(half, high), hn::Load(half, low));
#else
  return hn::Load(D(), low);
#endif
}
HWY_INLINE void load_rows(const float* rows, const std::int32_t* index, int column, V& a, V& b, V& c, V& d) {
  rows += column;
  a = load_row(rows, index, 0);
  b = load_row(rows, index, 1);
  c = load_row(rows, index, 2);
  d = load_row(rows, index, 3);
  transpose(a, b, c, d);
}

// Stores nothing for lanes from `count` on.
HWY_INLINE void store_row(V value, float* rows, const std::int32_t* index, int count, int lane) {
  float* low = rows + static_cast<std::ptrdiff_t>(index[lane]) * kRow;
#if SMARTSURF_WIDE
  const hn::Half<D> half;
  if (lane < count) hn::Store(hn::LowerHalf(half, value), half, low);
  if (lane + 4 < count)
    hn::Store(hn::UpperHalf(half, value), half, rows + static_cast<std::ptrdiff_t>(index[lane + 4]) * kRow);
#else
  if (lane < count) hn::Store(value, D(), low);
#endif
}
HWY_INLINE void store_rows(V a, V b, V c, V d, float* rows, const std::int32_t* index, int count,
                           int column) {
  transpose(a, b, c, d);
  rows += column;
  store_row(a, rows, index, count, 0);
  store_row(b, rows, index, count, 1);
  store_row(c, rows, index, count, 2);
  store_row(d, rows, index, count, 3);
}

#endif

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::world
HWY_AFTER_NAMESPACE();

#endif
