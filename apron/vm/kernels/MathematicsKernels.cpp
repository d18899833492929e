// The mathematical functions: program/mathematics.def on vectors.
// Compiled once per instruction set: foreach_target.h re-includes this file for each.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "apron/vm/kernels/MathematicsKernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "apron/program/Mathematics.h"
#include "apron/vm/kernels/CellVectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace apron::vm {
namespace HWY_NAMESPACE {
namespace {

#if HWY_TARGET == HWY_SCALAR
using DR = hn::Rebind<double, D>;
#else
using DR = hn::Repartition<double, D>;
#endif
using DBits = hn::RebindToUnsigned<DR>;
using DI = hn::RebindToSigned<D>;

// The primitives of program/mathematics.def.
struct R {
  V v;
};
struct W {  // the halves of a vector; of a vector of one number both are that number
  hn::Vec<DR> low, high;
};
using B = M;

constexpr float kFloatInfinity = std::numeric_limits<float>::infinity();
constexpr float kFloatNan = std::numeric_limits<float>::quiet_NaN();

HWY_INLINE R operator+(R a, R b) { return {hn::Add(a.v, b.v)}; }
HWY_INLINE R operator-(R a, R b) { return {hn::Sub(a.v, b.v)}; }
HWY_INLINE R operator*(R a, R b) { return {hn::Mul(a.v, b.v)}; }
HWY_INLINE R operator/(R a, R b) { return {hn::Div(a.v, b.v)}; }
HWY_INLINE R operator-(R a) { return {hn::Neg(a.v)}; }
HWY_INLINE R constant(float c) { return {hn::Set(D(), c)}; }
HWY_INLINE B less(R a, R b) { return hn::Lt(a.v, b.v); }
HWY_INLINE B equal(R a, R b) { return hn::Eq(a.v, b.v); }
HWY_INLINE B opposite(B p) { return hn::Not(p); }
HWY_INLINE bool all(B p) { return hn::AllTrue(D(), p); }
HWY_INLINE R choose(B p, R a, R b) { return {hn::IfThenElse(p, a.v, b.v)}; }
HWY_INLINE B choose_truth(B p, B a, B b) { return hn::Or(hn::And(p, a), hn::AndNot(p, b)); }
HWY_INLINE R smaller(R a, R b) { return {smaller(a.v, b.v)}; }
HWY_INLINE R larger(R a, R b) { return {larger(a.v, b.v)}; }
HWY_INLINE R magnitude(R a) { return {hn::Abs(a.v)}; }
HWY_INLINE B is_negative(R a) { return hn::RebindMask(D(), hn::Lt(hn::BitCast(DI(), a.v), hn::Zero(DI()))); }
HWY_INLINE R square_root(R a) { return {hn::Sqrt(a.v)}; }
HWY_INLINE R floor_of(R a) { return {floor_of(a.v)}; }
HWY_INLINE hn::Vec<DI> bits(R a) { return hn::BitCast(DI(), a.v); }
HWY_INLINE R from_bits(hn::Vec<DI> a) { return {hn::BitCast(D(), a)}; }
HWY_INLINE R sign_of(R a) { return {hn::And(a.v, hn::SignBit(D()))}; }
HWY_INLINE R signed_as(R a, R of) { return {hn::Or(a.v, sign_of(of).v)}; }
HWY_INLINE R flipped_by(R a, R of) { return {hn::Xor(a.v, sign_of(of).v)}; }
HWY_INLINE R flipped(B p, R a) { return {hn::Xor(a.v, hn::IfThenElseZero(p, hn::SignBit(D())))}; }
HWY_INLINE R upper(R a) {
  return from_bits(hn::And(bits(a), hn::Set(DI(), static_cast<std::int32_t>(0xFFFFE000U))));
}
HWY_INLINE R shift(R a) { return a + constant(0x1.8p23F); }
HWY_INLINE R unshift(R a) { return a - constant(0x1.8p23F); }
HWY_INLINE B is_odd(R a) { return hn::RebindMask(D(), hn::TestBit(bits(a), hn::Set(DI(), 1))); }
HWY_INLINE R flipped_if_odd(R b, R a) { return from_bits(hn::Xor(bits(b), hn::ShiftLeft<31>(bits(a)))); }
HWY_INLINE R times_power(R b, R a) { return from_bits(hn::Add(bits(b), hn::ShiftLeft<23>(bits(a)))); }
HWY_INLINE R power_of_two(R k) { return from_bits(hn::ShiftLeft<23>(bits(k + constant(0x1.8p23F + 127)))); }
HWY_INLINE R split(R a, std::int32_t least, R* k) {
  const auto above = hn::Sub(bits(a), hn::Set(DI(), least));
  *k = {hn::ConvertTo(D(), hn::ShiftRight<23>(above))};
  return from_bits(hn::Add(hn::And(above, hn::Set(DI(), 0x7FFFFF)), hn::Set(DI(), least)));
}

HWY_INLINE W operator+(W a, W b) { return {hn::Add(a.low, b.low), hn::Add(a.high, b.high)}; }
HWY_INLINE W operator-(W a, W b) { return {hn::Sub(a.low, b.low), hn::Sub(a.high, b.high)}; }
HWY_INLINE W operator*(W a, W b) { return {hn::Mul(a.low, b.low), hn::Mul(a.high, b.high)}; }
HWY_INLINE W wide_constant(double c) { return {hn::Set(DR(), c), hn::Set(DR(), c)}; }
HWY_INLINE W wide_nearest(W a) { return (a + wide_constant(0x1.8p52)) - wide_constant(0x1.8p52); }
template <class Function>
HWY_INLINE W of_halves(W a, W b, const Function& function) {
  return {function(a.low, b.low), function(a.high, b.high)};
}
HWY_INLINE W wide_negate_if_odd(W a, W k) {
  return of_halves(a, k, [](auto x, auto y) HWY_ATTR {
    return hn::Xor(x, hn::BitCast(DR(), hn::ShiftLeft<63>(hn::BitCast(DBits(), y))));
  });
}
#if HWY_TARGET == HWY_SCALAR
HWY_INLINE W wide(R a) {
  const auto v = hn::PromoteTo(DR(), a.v);
  return {v, v};
}
HWY_INLINE R narrow(W a) { return {hn::DemoteTo(D(), a.low)}; }
#else
HWY_INLINE W wide(R a) {
  const hn::Half<D> half;
  return {hn::PromoteTo(DR(), hn::LowerHalf(half, a.v)), hn::PromoteTo(DR(), hn::UpperHalf(half, a.v))};
}
HWY_INLINE R narrow(W a) {
  const hn::Half<D> half;
  return {hn::Combine(D(), hn::DemoteTo(half, a.high), hn::DemoteTo(half, a.low))};
}
#endif

#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX3
#define APRON_SCALED
HWY_INLINE R scaled(R a, R k) { return {V{_mm512_scalef_ps(a.v.raw, k.v.raw)}}; }
#else
#undef APRON_SCALED
#endif

// Calls change(lane, doubles) for the lanes of |x| of 2^20 and more, with arrays of the doubles of `of`.
template <std::size_t kCount, class Change>
HWY_NOINLINE void change_large_lanes(R x, const std::array<W*, kCount>& of, const Change& change) {
  HWY_ALIGN float angles[kLanes];
  HWY_ALIGN std::array<std::array<double, kLanes>, kCount> values;
  const std::size_t high = hn::Lanes(D()) - hn::Lanes(DR());
  hn::Store(x.v, D(), angles);
  for (std::size_t k = 0; k < kCount; ++k) {
    hn::Store(of[k]->low, DR(), values[k].data());
    hn::Store(of[k]->high, DR(), values[k].data() + high);
  }
  for (std::size_t i = 0; i < hn::Lanes(D()); ++i)
    if (!(std::fabs(angles[i]) < 0x1p20F)) change(angles[i], values, i);
  for (std::size_t k = 0; k < kCount; ++k)
    *of[k] = {hn::Load(DR(), values[k].data()), hn::Load(DR(), values[k].data() + high)};
}
HWY_INLINE bool has_large(R x) { return HWY_UNLIKELY(!all(less(magnitude(x), constant(0x1p20F)))); }
HWY_INLINE void turn_large(R x, double ahead, W* r) {
  if (!has_large(x)) return;
  change_large_lanes<1>(x, {r}, [ahead](float angle, auto& values, std::size_t i) {
    values[0][i] = program::turn_angle(angle, ahead);
  });
}
HWY_INLINE void reduce_large(R x, W* quadrant, W* r) {
  if (!has_large(x)) return;
  change_large_lanes<2>(x, {quadrant, r}, [](float angle, auto& values, std::size_t i) {
    const program::ReducedAngle reduced = program::reduce_angle(angle);
    values[0][i] = reduced.quadrant;
    values[1][i] = reduced.rest;
  });
}

#define APRON_INLINE HWY_INLINE
#define APRON_RARE [[maybe_unused]] HWY_NOINLINE
#include "apron/program/mathematics.def"
#undef APRON_INLINE
#undef APRON_RARE

#define APRON_MATHEMATICS(name, arity, value)                                \
  struct name {                                                              \
    static constexpr program::Opcode kOpcode = program::Opcode::k##name;     \
    static constexpr unsigned kArity = arity;                                \
    static HWY_INLINE V apply(V first, V second, [[maybe_unused]] V third) { \
      const R a{first};                                                      \
      [[maybe_unused]] const R b{second};                                    \
      return (value).v;                                                      \
    }                                                                        \
  };
#include "apron/program/elementwise.def"

// Powers in two passes over some columns: iterations are short enough for the CPU to overlap several.
template <unsigned kScalars, bool kMasked>
void raise(const Block& block) noexcept {
  constexpr std::size_t kPass = 256;
  HWY_ALIGN std::array<float, kPass> first, rest;
  const D d;
  const std::size_t lanes = hn::Lanes(d), columns = block.columns;
  const R scalar_a = constant(block.scalar[0]), scalar_b = constant(block.scalar[1]);
  for (std::ptrdiff_t row = 0; row < static_cast<std::ptrdiff_t>(block.rows); ++row) {
    float* const y = block.y + row * block.pitch;
    const float* const a_row = block.source[0] + row * block.source_pitch[0];
    const float* const b_row = block.source[1] + row * block.source_pitch[1];
    const auto a = [&](std::size_t x)
                       HWY_ATTR { return (kScalars & 1U) != 0 ? scalar_a : R{hn::LoadU(d, a_row + x)}; };
    const auto b = [&](std::size_t x)
                       HWY_ATTR { return (kScalars & 2U) != 0 ? scalar_b : R{hn::LoadU(d, b_row + x)}; };
    for (std::size_t begin = 0; begin < columns; begin += kPass) {
      const std::size_t end = std::min(begin + kPass, columns);
      for (std::size_t x = begin; x < end; x += lanes) {
        R upper_part, lower_part;
        begin_power(a(x), b(x), &upper_part, &lower_part);
        hn::Store(upper_part.v, d, &first[x - begin]);
        hn::Store(lower_part.v, d, &rest[x - begin]);
      }
      for (std::size_t x = begin; x < end; x += lanes) {
        V value = end_power(a(x), b(x), {hn::Load(d, &first[x - begin])}, {hn::Load(d, &rest[x - begin])}).v;
        if constexpr (kMasked) {
          const V mask = hn::Load(d, block.mask + row * block.mask_pitch + static_cast<std::ptrdiff_t>(x));
          value = hn::IfThenElse(hn::Eq(mask, zero()), hn::Load(d, y + x), value);
        }
        hn::Store(value, d, y + x);
      }
    }
  }
}

}  // namespace

void add_mathematics_kernels(KernelTable& table) {
#define APRON_MATHEMATICS(name, arity, value) fill<name>(table);
#include "apron/program/elementwise.def"
  auto& kernels = table.elementwise[static_cast<std::size_t>(program::Opcode::kPow)];
  kernels[0] = {raise<0, false>, raise<0, true>};
  kernels[1] = {raise<1, false>, raise<1, true>};
  kernels[2] = {raise<2, false>, raise<2, true>};
}

}  // namespace HWY_NAMESPACE
}  // namespace apron::vm
HWY_AFTER_NAMESPACE();
