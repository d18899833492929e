// Numbers and lanes of numbers under the same names, and the algebra of 3-vectors over either, so that scalar
// code and vector kernels call the same functions.
//
// F is float, double, or a vector of one value per lane. Included once per instruction set, hence the toggled
// include guard; files that are compiled once get the instruction set of all machines.
#if defined(SMARTSURF_WORLD_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SMARTSURF_WORLD_LANES_INL_H
#undef SMARTSURF_WORLD_LANES_INL_H
#else
#define SMARTSURF_WORLD_LANES_INL_H
#endif

#include <hwy/highway.h>

#include <cmath>
#include <type_traits>

#include "smartsurf/world/simd/Lanes.h"

// Files that are compiled once may have fewer instructions than the lanes (sanitized builds): they cannot
// inline these functions, and need not.
#undef WORLD_INLINE
#ifdef HWY_TARGET_INCLUDE
#define WORLD_INLINE HWY_INLINE
#else
#define WORLD_INLINE inline
#endif

HWY_BEFORE_NAMESPACE();
namespace smartsurf::world {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
// The lanes of a batch that fit into a vector of at most 256 bits: all, some, or one (scalar target). Support
// solves with wider vectors of doubles take 5 % longer.
template <class T>
using LanesTag = hn::CappedTag<T, kLanes * sizeof(float) / sizeof(T)>;
template <class T>
using LanesOf = hn::Vec<LanesTag<T>>;
template <class T>
constexpr int kWidthOf = static_cast<int>(hn::MaxLanes(LanesTag<T>()));
static_assert(kLanes % kWidthOf<float> == 0 && kLanes % kWidthOf<double> == 0);

// ---- one number or lanes

template <class F>
WORLD_INLINE F constant(double value) {
  if constexpr (std::is_arithmetic_v<F>)
    return static_cast<F>(value);
  else
    return hn::Set(hn::DFromV<F>(), static_cast<hn::TFromV<F>>(value));
}
template <class F>
WORLD_INLINE F max(F a, F b) {
  if constexpr (std::is_arithmetic_v<F>)
    return a > b ? a : b;
  else
    return hn::Max(a, b);
}
template <class F>
WORLD_INLINE F min(F a, F b) {
  if constexpr (std::is_arithmetic_v<F>)
    return a < b ? a : b;
  else
    return hn::Min(a, b);
}
template <class F>
WORLD_INLINE F square_root(F a) {
  if constexpr (std::is_arithmetic_v<F>)
    return std::sqrt(a);
  else
    return hn::Sqrt(a);
}
template <class F>
WORLD_INLINE F copy_sign(F magnitude, F sign) {
  if constexpr (std::is_arithmetic_v<F>)
    return std::copysign(magnitude, sign);
  else
    return hn::CopySign(magnitude, sign);
}
template <class F>
WORLD_INLINE F if_positive(F x, F yes, F no) {
  if constexpr (std::is_arithmetic_v<F>)
    return x > F(0) ? yes : no;
  else
    return hn::IfThenElse(hn::Gt(x, constant<F>(0)), yes, no);
}
// 1 / a; 0 for a ≤ 0, which occurs in unused lanes and for bodies without mass.
template <class F>
WORLD_INLINE F inverse(F a) {
  return if_positive(a, constant<F>(1) / a, constant<F>(0));
}
template <class F>
WORLD_INLINE F sum3(F a, F b, F c) {
  return (a + b) + c;
}

template <class T>
WORLD_INLINE LanesOf<T> set(T value) {
  return hn::Set(LanesTag<T>(), value);
}
template <class T>
WORLD_INLINE LanesOf<T> load(const T* lanes, int first) {
  return hn::LoadU(LanesTag<T>(), lanes + first);
}
template <class T>
WORLD_INLINE void store(LanesOf<T> value, T* lanes, int first) {
  hn::StoreU(value, LanesTag<T>(), lanes + first);
}

// ---- 3-vectors

template <class F>
struct Vector3 {
  F x, y, z;
};
template <class F>
WORLD_INLINE Vector3<F> operator+(const Vector3<F>& a, const Vector3<F>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class F>
WORLD_INLINE Vector3<F> operator-(const Vector3<F>& a, const Vector3<F>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class F>
WORLD_INLINE Vector3<F> operator*(const Vector3<F>& a, F s) {
  return {a.x * s, a.y * s, a.z * s};
}
template <class F>
WORLD_INLINE F dot(const Vector3<F>& a, const Vector3<F>& b) {
  return sum3(a.x * b.x, a.y * b.y, a.z * b.z);
}
template <class F>
WORLD_INLINE Vector3<F> cross(const Vector3<F>& a, const Vector3<F>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class T>
WORLD_INLINE Vector3<LanesOf<T>> load3(const T (&lanes)[3][kLanes], int first) {
  return {load(lanes[0], first), load(lanes[1], first), load(lanes[2], first)};
}
template <class T>
WORLD_INLINE void store3(const Vector3<LanesOf<T>>& value, T (&lanes)[3][kLanes], int first) {
  store(value.x, lanes[0], first);
  store(value.y, lanes[1], first);
  store(value.z, lanes[2], first);
}

template <class F>
struct SymmetricMat3 {
  F xx, yy, zz, xy, xz, yz;
  WORLD_INLINE Vector3<F> operator*(const Vector3<F>& u) const {
    return {sum3(xx * u.x, xy * u.y, xz * u.z), sum3(xy * u.x, yy * u.y, yz * u.z),
            sum3(xz * u.x, yz * u.y, zz * u.z)};
  }
};

// Solves a·x = b for a positive definite matrix (LDLᵀ).
template <class F>
WORLD_INLINE Vector3<F> solve_symmetric(const SymmetricMat3<F>& a, const Vector3<F>& b) {
  const F one = constant<F>(1);
  const F i0 = one / a.xx, l1 = a.xy * i0, l2 = a.xz * i0;
  const F i1 = one / (a.yy - l1 * a.xy), rest = a.yz - l2 * a.xy, l3 = rest * i1;
  const F i2 = one / (a.zz - l2 * a.xz - l3 * rest);
  const F y1 = b.y - l1 * b.x, y2 = b.z - l2 * b.x - l3 * y1;
  const F x2 = y2 * i2, x1 = y1 * i1 - l3 * x2;
  return {b.x * i0 - l1 * x1 - l2 * x2, x1, x2};
}

// Completes a unit vector to an orthonormal basis (Duff et al., Building an Orthonormal Basis, Revisited,
// 2017).
template <class F>
WORLD_INLINE void tangents(const Vector3<F>& n, Vector3<F>& t, Vector3<F>& u) {
  const F one = constant<F>(1), zero = constant<F>(0);
  const F sign = copy_sign(one, n.z);
  const F a = constant<F>(-1) / (sign + n.z);
  const F b = n.x * n.y * a;
  t = {one + sign * n.x * n.x * a, sign * b, zero - sign * n.x};
  u = {b, sign + n.y * n.y * a, zero - n.y};
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::world
HWY_AFTER_NAMESPACE();

#endif
