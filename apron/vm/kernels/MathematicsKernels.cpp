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

// Long functions are computed in passes over some columns, whose iterations are short enough for the CPU to
// overlap several. A pass replaces what the earlier ones have kept of each cell.
constexpr std::size_t kColumnsOfPass = 256, kMaxKept = 4;

template <class Function>
struct Passes {};  // how many floats of a cell each pass keeps, the passes and the end

template <>
struct Passes<Sin> {
  static constexpr std::size_t kKept[] = {1};
  static HWY_INLINE void pass(std::size_t, R a, R, R* kept) { kept[0] = begin_sine(a); }
  static HWY_INLINE R end(R, R, const R* kept) { return sine_series(kept[0]); }
};

template <>
struct Passes<Cos> {
  static constexpr std::size_t kKept[] = {1};
  static HWY_INLINE void pass(std::size_t, R a, R, R* kept) { kept[0] = begin_cosine(a); }
  static HWY_INLINE R end(R, R, const R* kept) { return sine_series(kept[0]); }
};

template <>
struct Passes<Tan> {
  static constexpr std::size_t kKept[] = {3, 1};
  static HWY_INLINE void pass(std::size_t k, R a, R, R* kept) {
    if (k == 0)
      kept[2] = begin_tangent(a, &kept[0], &kept[1]);
    else
      kept[0] = tangent_series(kept[0], kept[1]);
  }
  static HWY_INLINE R end(R, R, const R* kept) { return end_tangent(kept[0], kept[2]); }
};

template <>
struct Passes<Exp> {
  static constexpr std::size_t kKept[] = {2};
  static HWY_INLINE void pass(std::size_t, R a, R, R* kept) { kept[0] = begin_exponential(a, &kept[1]); }
  static HWY_INLINE R end(R, R, const R* kept) { return end_exponential(kept[0], kept[1]); }
};

template <>
struct Passes<Tanh> {
  static constexpr std::size_t kKept[] = {2, 1};
  static HWY_INLINE void pass(std::size_t k, R a, R, R* kept) {
    kept[0] = k == 0 ? begin_hyperbolic_tangent(a, &kept[1]) : exponential_less_one(kept[0], kept[1]);
  }
  static HWY_INLINE R end(R a, R, const R* kept) { return end_hyperbolic_tangent(a, kept[0]); }
};

template <>
struct Passes<Sinh> {
  static constexpr std::size_t kKept[] = {2, 1};
  static HWY_INLINE void pass(std::size_t k, R a, R, R* kept) {
    kept[0] = k == 0 ? begin_half_exponential(a, &kept[1]) : end_exponential(kept[0], kept[1]);
  }
  static HWY_INLINE R end(R a, R, const R* kept) { return end_hyperbolic_sine(a, kept[0]); }
};

template <>
struct Passes<Cosh> {
  static constexpr std::size_t kKept[] = {2};
  static HWY_INLINE void pass(std::size_t, R a, R, R* kept) { kept[0] = begin_half_exponential(a, &kept[1]); }
  static HWY_INLINE R end(R, R, const R* kept) {
    return end_hyperbolic_cosine(end_exponential(kept[0], kept[1]));
  }
};

template <>
struct Passes<Ln> {
  static constexpr std::size_t kKept[] = {2};
  static HWY_INLINE void pass(std::size_t, R a, R, R* kept) { kept[0] = begin_logarithm(a, &kept[1]); }
  static HWY_INLINE R end(R a, R, const R* kept) { return end_logarithm(a, kept[0], kept[1]); }
};

template <>
struct Passes<Log> {
  static constexpr std::size_t kKept[] = {4};
  static HWY_INLINE void pass(std::size_t, R a, R, R* kept) {
    kept[0] = begin_decimal_logarithm(a, &kept[1], &kept[2], &kept[3]);
  }
  static HWY_INLINE R end(R a, R, const R* kept) {
    return end_decimal_logarithm(a, kept[0], kept[1], kept[2], kept[3]);
  }
};

template <>
struct Passes<Pow> {
  static constexpr std::size_t kKept[] = {4, 2};
  static HWY_INLINE void pass(std::size_t k, R a, R b, R* kept) {
    if (k == 0)
      kept[0] = begin_power(a, &kept[1], &kept[2], &kept[3]);
    else
      kept[0] = exponent_of_power(b, kept[0], kept[1], kept[2], kept[3], &kept[1]);
  }
  static HWY_INLINE R end(R a, R b, const R* kept) { return end_power(a, b, kept[0], kept[1]); }
};

template <class Function, unsigned kScalars, bool kMasked>
void run_in_passes(const Block& block) noexcept {
  using Its = Passes<Function>;
  constexpr unsigned kRegisters = ((1U << Function::kArity) - 1U) & ~kScalars;
  HWY_ALIGN float kept_cells[kMaxKept][kColumnsOfPass];
  const D d;
  const std::size_t lanes = hn::Lanes(d);
  const R scalar_a = constant(block.scalar[0]), scalar_b = constant(block.scalar[1]);
  const float *a_row = block.source[0], *b_row = block.source[1], *mask_row = block.mask;
  float* y_row = block.y;
  for (std::uint32_t rows = block.rows; rows > 0; --rows) {
    for (std::size_t begin = 0; begin < block.columns; begin += kColumnsOfPass) {
      const std::size_t columns = std::min(kColumnsOfPass, block.columns - begin);
      const auto a = [&](std::size_t x) HWY_ATTR {
        return (kRegisters & 1U) != 0 ? R{hn::LoadU(d, a_row + begin + x)} : scalar_a;
      };
      const auto b = [&](std::size_t x) HWY_ATTR {
        return (kRegisters & 2U) != 0 ? R{hn::LoadU(d, b_row + begin + x)} : scalar_b;
      };
      const auto load = [&](std::size_t x, std::size_t count, R* kept) HWY_ATTR {
        for (std::size_t i = 0; i < count; ++i) kept[i] = {hn::Load(d, &kept_cells[i][x])};
      };
      const auto pass = [&](std::size_t k, std::size_t kept_before, std::size_t kept_after) HWY_ATTR {
        for (std::size_t x = 0; x < columns; x += lanes) {
          R kept[kMaxKept] = {};
          load(x, kept_before, kept);
          Its::pass(k, a(x), b(x), kept);
          for (std::size_t i = 0; i < kept_after; ++i) hn::Store(kept[i].v, d, &kept_cells[i][x]);
        }
      };
      pass(0, 0, Its::kKept[0]);
      if constexpr (std::size(Its::kKept) > 1) pass(1, Its::kKept[0], Its::kKept[1]);
      for (std::size_t x = 0; x < columns; x += lanes) {
        R kept[kMaxKept] = {};
        load(x, Its::kKept[0], kept);
        V value = Its::end(a(x), b(x), kept).v;
        if constexpr (kMasked) {
          const V mask = hn::Load(d, mask_row + begin + x);
          value = hn::IfThenElse(hn::Eq(mask, zero()), hn::Load(d, y_row + begin + x), value);
        }
        hn::Store(value, d, y_row + begin + x);
      }
    }
    y_row += block.pitch;
    if constexpr ((kRegisters & 1U) != 0) a_row += block.source_pitch[0];
    if constexpr ((kRegisters & 2U) != 0) b_row += block.source_pitch[1];
    if constexpr (kMasked) mask_row += block.mask_pitch;
  }
}

template <class Function, unsigned kScalars = 0>
void fill_function(KernelTable& table) {
  if constexpr (requires { Passes<Function>::kKept; }) {
    auto& entry = table.elementwise[index_of(Function::kOpcode)][kScalars];
    entry[0] = run_in_passes<Function, kScalars, false>;
    entry[1] = run_in_passes<Function, kScalars, true>;
    if constexpr (kScalars + 1 < (1U << Function::kArity)) fill_function<Function, kScalars + 1>(table);
  } else {
    fill<Function>(table);
  }
}

}  // namespace

void add_mathematics_kernels(KernelTable& table) {
#define APRON_MATHEMATICS(name, arity, value) fill_function<name>(table);
#include "apron/program/elementwise.def"
}

}  // namespace HWY_NAMESPACE
}  // namespace apron::vm
HWY_AFTER_NAMESPACE();
