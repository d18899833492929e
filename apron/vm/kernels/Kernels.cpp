// Compiled once per instruction set: foreach_target.h re-includes this file for each.
#include "apron/vm/kernels/Kernels.h"

#include <algorithm>
#include <cmath>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "apron/vm/kernels/Kernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "apron/program/Mathematics.h"
#include "apron/program/ScalarArithmetic.h"
#include "apron/vm/PlaneStore.h"
#include "apron/vm/kernels/Random.h"

HWY_BEFORE_NAMESPACE();
namespace apron::vm {
namespace HWY_NAMESPACE {

void add_integer_kernels(KernelTable& table);  // IntegerKernels.cpp

namespace {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<float, kLanes>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;

// The primitives of program/elementwise.def.
HWY_INLINE V zero() { return hn::Zero(D()); }
HWY_INLINE V one() { return hn::Set(D(), 1.0F); }
HWY_INLINE V add(V a, V b) { return hn::Add(a, b); }
HWY_INLINE V subtract(V a, V b) { return hn::Sub(a, b); }
HWY_INLINE V multiply(V a, V b) { return hn::Mul(a, b); }
HWY_INLINE V divide(V a, V b) { return hn::Div(a, b); }
HWY_INLINE V magnitude(V a) { return hn::Abs(a); }
HWY_INLINE V negate(V a) { return hn::Neg(a); }
HWY_INLINE V square_root(V a) { return hn::Sqrt(a); }
HWY_INLINE M less(V a, V b) { return hn::Lt(a, b); }
HWY_INLINE M less_equal(V a, V b) { return hn::Le(a, b); }
HWY_INLINE M equal(V a, V b) { return hn::Eq(a, b); }
// hn::Ne treats NaN differently on some targets.
HWY_INLINE M differ(V a, V b) { return hn::Not(hn::Eq(a, b)); }
HWY_INLINE M is_true(V a) { return differ(a, zero()); }
HWY_INLINE M both(M a, M b) { return hn::And(a, b); }
HWY_INLINE M either(M a, M b) { return hn::Or(a, b); }
HWY_INLINE M one_of(M a, M b) { return hn::Xor(a, b); }
HWY_INLINE V as_number(M m) { return hn::IfThenElseZero(m, one()); }
HWY_INLINE V as_inverse_number(M m) { return hn::IfThenZeroElse(m, one()); }
HWY_INLINE V choose(M m, V a, V b) { return hn::IfThenElse(m, a, b); }

// lesser is a < b ? a : b and greater is a > b ? a : b, which is what the x86 instructions do. Other targets
// treat NaN and signed zeros differently.
#if HWY_ARCH_X86 && HWY_TARGET != HWY_EMU128 && HWY_TARGET != HWY_SCALAR
template <class Vector>
HWY_INLINE Vector lesser(Vector a, Vector b) {
  return hn::Min(a, b);
}
template <class Vector>
HWY_INLINE Vector greater(Vector a, Vector b) {
  return hn::Max(a, b);
}
HWY_INLINE V floor_of(V a) { return hn::Floor(a); }
HWY_INLINE V ceil_of(V a) { return hn::Ceil(a); }
HWY_INLINE V trunc_of(V a) { return hn::Trunc(a); }
#else
template <class Vector>
HWY_INLINE Vector lesser(Vector a, Vector b) {
  return hn::IfThenElse(hn::Lt(a, b), a, b);
}
template <class Vector>
HWY_INLINE Vector greater(Vector a, Vector b) {
  return hn::IfThenElse(hn::Gt(a, b), a, b);
}
// The portable implementations lose the sign of zero.
HWY_INLINE V floor_of(V a) { return hn::CopySign(hn::Floor(a), a); }
HWY_INLINE V ceil_of(V a) { return hn::CopySign(hn::Ceil(a), a); }
HWY_INLINE V trunc_of(V a) { return hn::CopySign(hn::Trunc(a), a); }
#endif

HWY_INLINE V smaller(V a, V b) { return lesser(a, b); }
HWY_INLINE V larger(V a, V b) { return greater(a, b); }
HWY_INLINE V modulo(V a, V b) { return hn::Sub(a, hn::Mul(b, floor_of(hn::Div(a, b)))); }
HWY_INLINE V round_half_away(V a) {
  const V whole = trunc_of(a);
  const M up = hn::Ge(hn::Abs(hn::Sub(a, whole)), hn::Set(D(), 0.5F));
  return hn::IfThenElse(up, hn::Add(whole, hn::CopySign(one(), a)), whole);
}

#define APRON_ELEMENTWISE(name, arity, value)                                                     \
  struct name {                                                                                   \
    static constexpr program::Opcode kOpcode = program::Opcode::k##name;                          \
    static constexpr unsigned kArity = arity;                                                     \
    static HWY_INLINE V apply([[maybe_unused]] V a, [[maybe_unused]] V b, [[maybe_unused]] V c) { \
      return value;                                                                               \
    }                                                                                             \
  };
#include "apron/program/elementwise.def"

// ---- mathematics ----

#if HWY_TARGET == HWY_SCALAR
using DR = hn::Rebind<double, D>;
#else
using DR = hn::Repartition<double, D>;
#endif
using DBits = hn::RebindToUnsigned<DR>;
using DI = hn::RebindToSigned<D>;
using DWideI = hn::RebindToSigned<DR>;

// The primitives of program/mathematics.def.
struct R {
  V v;
};
struct W {  // the halves of a vector; of a vector of one number both are that number
  hn::Vec<DR> low, high;
};
struct I {
  hn::Vec<DI> v;
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
HWY_INLINE R with_sign(R a, R of) { return {hn::CopySign(a.v, of.v)}; }
HWY_INLINE B is_negative(R a) { return hn::RebindMask(D(), hn::Lt(hn::BitCast(DI(), a.v), hn::Zero(DI()))); }
HWY_INLINE R square_root(R a) { return {hn::Sqrt(a.v)}; }
HWY_INLINE R floor_of(R a) { return {floor_of(a.v)}; }
HWY_INLINE R nearest(R a) { return (a + constant(0x1.8p23F)) - constant(0x1.8p23F); }
HWY_INLINE hn::Vec<DI> bits(R a) { return hn::BitCast(DI(), a.v); }
HWY_INLINE R from_bits(hn::Vec<DI> a) { return {hn::BitCast(D(), a)}; }
HWY_INLINE R power_of_two(R k) { return from_bits(hn::ShiftLeft<23>(bits(k + constant(0x1.8p23F + 127)))); }
HWY_INLINE R split(R a, std::int32_t least, R* k) {
  const auto above = hn::Sub(bits(a), hn::Set(DI(), least));
  *k = {hn::ConvertTo(D(), hn::ShiftRight<23>(above))};
  return from_bits(hn::Add(hn::And(above, hn::Set(DI(), 0x7FFFFF)), hn::Set(DI(), least)));
}
HWY_INLINE R split_in_sixteenths(R a, std::int32_t least, R* k, I* i) {
  *i = {hn::And(hn::ShiftRight<19>(hn::Sub(bits(a), hn::Set(DI(), least))), hn::Set(DI(), 15))};
  return split(a, least, k);
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
HWY_INLINE W wide_smaller(W a, W b) {
  return of_halves(a, b, [](auto x, auto y) HWY_ATTR { return lesser(x, y); });
}
HWY_INLINE W wide_larger(W a, W b) {
  return of_halves(a, b, [](auto x, auto y) HWY_ATTR { return greater(x, y); });
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
HWY_INLINE R entry(const float* table, I i) {
  return {hn::TableLookupLanes(hn::LoadU(D(), table), hn::IndicesFromVec(D(), i.v))};
}
template <class Indices>
HWY_INLINE hn::Vec<DR> entries(const double* table, Indices i) {
  return {_mm512_permutex2var_pd(hn::LoadU(DR(), table).raw, hn::PromoteTo(DWideI(), i).raw,
                                 hn::LoadU(DR(), table + 8).raw)};
}
#else
#undef APRON_SCALED
HWY_INLINE R entry(const float* table, I i) { return {hn::GatherIndex(D(), table, i.v)}; }
#if HWY_TARGET != HWY_SCALAR
template <class Indices>
HWY_INLINE hn::Vec<DR> entries(const double* table, Indices i) {
  return hn::GatherIndex(DR(), table, hn::PromoteTo(DWideI(), i));
}
#endif
#endif
#if HWY_TARGET == HWY_SCALAR
HWY_INLINE W wide_entry(const double* table, I i) {
  const auto v = hn::GatherIndex(DR(), table, hn::PromoteTo(DWideI(), i.v));
  return {v, v};
}
#else
HWY_INLINE W wide_entry(const double* table, I i) {
  const hn::Half<DI> half;
  return {entries(table, hn::LowerHalf(half, i.v)), entries(table, hn::UpperHalf(half, i.v))};
}
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
#define APRON_TABLE constexpr
#include "apron/program/mathematics.def"
#undef APRON_INLINE
#undef APRON_TABLE

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

template <class Op, unsigned kScalars, bool kMasked>
void run(const Block& block) noexcept {
  const D d;
  constexpr unsigned kRegisters = ((1U << Op::kArity) - 1U) & ~kScalars;
  const V scalar_a = hn::Set(d, block.scalar[0]);
  const V scalar_b = hn::Set(d, block.scalar[1]);
  const V scalar_c = hn::Set(d, block.scalar[2]);
  // Local copies: vector stores may alias the block, so the compiler would reload its members after each.
  float* y_row = block.y;
  const float *a_row = block.source[0], *b_row = block.source[1], *c_row = block.source[2];
  const float* mask_row = block.mask;
  const std::ptrdiff_t pitch = block.pitch, mask_pitch = block.mask_pitch;
  [[maybe_unused]] const auto [a_pitch, b_pitch, c_pitch] = block.source_pitch;
  const std::size_t columns = block.columns;
  for (std::uint32_t rows = block.rows; rows > 0; --rows) {
    for (std::size_t x = 0; x < columns; x += hn::Lanes(d)) {
      V a = scalar_a, b = scalar_b, c = scalar_c;
      if constexpr ((kRegisters & 1U) != 0) a = hn::LoadU(d, a_row + x);
      if constexpr ((kRegisters & 2U) != 0) b = hn::LoadU(d, b_row + x);
      if constexpr ((kRegisters & 4U) != 0) c = hn::LoadU(d, c_row + x);
      V y = Op::apply(a, b, c);
      if constexpr (kMasked)
        y = hn::IfThenElse(hn::Eq(hn::Load(d, mask_row + x), zero()), hn::Load(d, y_row + x), y);
      hn::Store(y, d, y_row + x);
    }
    y_row += pitch;
    if constexpr ((kRegisters & 1U) != 0) a_row += a_pitch;
    if constexpr ((kRegisters & 2U) != 0) b_row += b_pitch;
    if constexpr ((kRegisters & 4U) != 0) c_row += c_pitch;
    if constexpr (kMasked) mask_row += mask_pitch;
  }
}

template <class Op, unsigned kScalars = 0>
void fill(KernelTable& table) {
  auto& entry = table.elementwise[static_cast<std::size_t>(Op::kOpcode)][kScalars];
  entry[0] = run<Op, kScalars, false>;
  entry[1] = run<Op, kScalars, true>;
  if constexpr (kScalars + 1 < (1U << Op::kArity)) fill<Op, kScalars + 1>(table);
}

// ---- reductions: 16 partial results on every target, so that the order of operations is the same ----

struct SumOp {
  static constexpr float kStart = 0.0F;
  static HWY_INLINE V step(V partial, V cell) { return hn::Add(partial, cell); }
  static float step(float partial, float cell) { return partial + cell; }
  static float join(float a, float b) { return a + b; }
};
struct MinOp {
  static constexpr float kStart = std::numeric_limits<float>::infinity();
  static HWY_INLINE V step(V partial, V cell) { return smaller(cell, partial); }
  static float step(float partial, float cell) { return cell < partial ? cell : partial; }
  static float join(float a, float b) { return step(a, b); }
};
struct MaxOp {
  static constexpr float kStart = -std::numeric_limits<float>::infinity();
  static HWY_INLINE V step(V partial, V cell) { return larger(cell, partial); }
  static float step(float partial, float cell) { return cell > partial ? cell : partial; }
  static float join(float a, float b) { return step(a, b); }
};
struct CountOp : SumOp {
  static HWY_INLINE V step(V partial, V cell) { return hn::Add(partial, as_number(is_true(cell))); }
  static float step(float partial, float cell) { return partial + (cell != 0.0F ? 1.0F : 0.0F); }
};

template <class Op>
float reduce_row(const float* a, std::uint32_t columns) {
  const D d;
  HWY_ALIGN float partial[kLanes];
  for (float& p : partial) p = Op::kStart;
  const std::uint32_t whole = columns / kLanes * kLanes;
  for (std::size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
    V sum = hn::Load(d, partial + lane);
    for (std::size_t x = lane; x < whole; x += kLanes) sum = Op::step(sum, hn::LoadU(d, a + x));
    hn::Store(sum, d, partial + lane);
  }
  for (std::uint32_t x = whole; x < columns; ++x) partial[x - whole] = Op::step(partial[x - whole], a[x]);
  for (std::size_t apart = kLanes / 2; apart > 0; apart /= 2)
    for (std::size_t i = 0; i < apart; ++i) partial[i] = Op::join(partial[i], partial[i + apart]);
  return partial[0];
}

template <class Op>
void reduce(const float* a, std::ptrdiff_t pitch, std::uint32_t rows, std::uint32_t columns,
            float* to) noexcept {
  for (std::uint32_t r = 0; r < rows; ++r, a += pitch) to[r] = reduce_row<Op>(a, columns);
}

// ---- stencils ----

// Loads the cells from `from` on that exist; `count` of them do.
HWY_INLINE V load_cells(const float* from, std::size_t count) {
  const D d;
  if (count >= hn::Lanes(d)) return hn::LoadU(d, from);
  HWY_ALIGN float cells[kLanes] = {};
  for (std::size_t i = 0; i < count; ++i) cells[i] = from[i];
  return hn::Load(d, cells);
}

HWY_INLINE void store_cells(const StencilOutput& to, std::size_t x, V value) {
  const D d;
  const std::size_t count = to.columns - x;
  if (count >= hn::Lanes(d)) {
    if (to.mask != nullptr)
      value = hn::IfThenElse(is_true(hn::LoadU(d, to.mask + x)), value, hn::LoadU(d, to.y + x));
    return hn::StoreU(value, d, to.y + x);
  }
  HWY_ALIGN float cells[kLanes];
  hn::Store(value, d, cells);
  for (std::size_t i = 0; i < count; ++i)
    if (to.mask == nullptr || to.mask[x + i] != 0.0F) to.y[x + i] = cells[i];
}

// Four vectors of sums at once hide the latency of the additions.
HWY_INLINE void correlate_four_vectors(const FilterView& filter, const StencilRows& rows,
                                       const StencilOutput& to, bool accumulate, std::size_t x) {
  const D d;
  const std::size_t lanes = hn::Lanes(d);
  V sum0 = zero(), sum1 = zero(), sum2 = zero(), sum3 = zero();
  if (accumulate) {
    sum0 = hn::LoadU(d, to.y + x);
    sum1 = hn::LoadU(d, to.y + x + lanes);
    sum2 = hn::LoadU(d, to.y + x + 2 * lanes);
    sum3 = hn::LoadU(d, to.y + x + 3 * lanes);
  }
  const float* element = filter.coefficients;
  for (std::uint32_t j = 0; j < filter.height; ++j) {
    const float* from = rows.row[j] + rows.step[j] * static_cast<std::ptrdiff_t>(x);
    for (const float* const end = element + filter.width; element != end; ++element, ++from) {
      if (*element == 0.0F) continue;
      const V e = hn::Set(d, *element);
      sum0 = hn::Add(sum0, hn::Mul(e, hn::LoadU(d, from)));
      sum1 = hn::Add(sum1, hn::Mul(e, hn::LoadU(d, from + lanes)));
      sum2 = hn::Add(sum2, hn::Mul(e, hn::LoadU(d, from + 2 * lanes)));
      sum3 = hn::Add(sum3, hn::Mul(e, hn::LoadU(d, from + 3 * lanes)));
    }
  }
  store_cells(to, x, sum0);
  store_cells(to, x + lanes, sum1);
  store_cells(to, x + 2 * lanes, sum2);
  store_cells(to, x + 3 * lanes, sum3);
}

HWY_INLINE void correlate_vector(const FilterView& filter, const StencilRows& rows, const StencilOutput& to,
                                 bool accumulate, std::size_t x) {
  const std::size_t cells = to.columns - x;
  V sum = accumulate ? load_cells(to.y + x, cells) : zero();
  const float* element = filter.coefficients;
  for (std::uint32_t j = 0; j < filter.height; ++j) {
    const float* from = rows.row[j] + rows.step[j] * static_cast<std::ptrdiff_t>(x);
    for (std::uint32_t i = 0; i < filter.width; ++i, ++element)
      if (*element != 0.0F) sum = hn::Add(sum, hn::Mul(hn::Set(D(), *element), load_cells(from + i, cells)));
  }
  store_cells(to, x, sum);
}

void correlate(const FilterView& filter, const StencilRows& rows, const StencilOutput& to,
               bool accumulate) noexcept {
  const std::size_t lanes = hn::Lanes(D());
  std::size_t x = 0;
  for (; x + 4 * lanes <= to.columns; x += 4 * lanes) correlate_four_vectors(filter, rows, to, accumulate, x);
  for (; x < to.columns; x += lanes) correlate_vector(filter, rows, to, accumulate, x);
}

// kVectors vectors of each of the rows at once: a vector of cells is loaded once for all of them, and a
// coefficient once for all vectors. The order of a cell's products is that of correlate().
template <std::size_t kVectors>
HWY_INLINE void correlate_block(const FilterView& filter, const StencilRows& rows,
                                const std::array<StencilOutput, kFilterRows>& to, std::size_t x) {
  static_assert(kFilterRows == 4);
  const D d;
  const std::size_t lanes = hn::Lanes(d);
  V sums[kFilterRows][kVectors];
#pragma GCC unroll 4
  for (std::size_t o = 0; o < kFilterRows; ++o)
#pragma GCC unroll 4
    for (std::size_t v = 0; v < kVectors; ++v) sums[o][v] = zero();
  const auto last = static_cast<std::ptrdiff_t>(filter.height) - 1;
  for (std::ptrdiff_t j = 0; j < last + static_cast<std::ptrdiff_t>(kFilterRows); ++j) {
    const float* from = rows.row[j] + rows.step[j] * static_cast<std::ptrdiff_t>(x);
    const float* const elements = filter.coefficients + j * filter.width;
    if (j >= static_cast<std::ptrdiff_t>(kFilterRows) - 1 && j <= last) {
      for (std::ptrdiff_t i = 0; i < filter.width; ++i, ++from) {
        V cells[kVectors];
#pragma GCC unroll 4
        for (std::size_t v = 0; v < kVectors; ++v) cells[v] = hn::LoadU(d, from + v * lanes);
#pragma GCC unroll 4
        for (std::size_t o = 0; o < kFilterRows; ++o) {
          const V e = hn::Set(d, elements[i - static_cast<std::ptrdiff_t>(o * filter.width)]);
#pragma GCC unroll 4
          for (std::size_t v = 0; v < kVectors; ++v) sums[o][v] = hn::Add(sums[o][v], hn::Mul(e, cells[v]));
        }
      }
    } else {  // the first rows that the upper outputs read, and the last of the lower ones
#pragma GCC unroll 4
      for (std::size_t o = 0; o < kFilterRows; ++o) {
        const std::ptrdiff_t row = j - static_cast<std::ptrdiff_t>(o);
        if (row < 0 || row > last) continue;
        for (std::ptrdiff_t i = 0; i < filter.width; ++i) {
          const V e = hn::Set(d, filter.coefficients[row * filter.width + i]);
#pragma GCC unroll 4
          for (std::size_t v = 0; v < kVectors; ++v)
            sums[o][v] = hn::Add(sums[o][v], hn::Mul(e, hn::LoadU(d, from + i + v * lanes)));
        }
      }
    }
  }
#pragma GCC unroll 4
  for (std::size_t o = 0; o < kFilterRows; ++o)
#pragma GCC unroll 4
    for (std::size_t v = 0; v < kVectors; ++v) store_cells(to[o], x + v * lanes, sums[o][v]);
}

// 16 or 8 sums, so many registers are there.
constexpr std::size_t kFilterVectors = kLanes * sizeof(float) == 64 && HWY_MAX_BYTES == 64 ? 4 : 2;

// The last block ends with the last column: its first columns may be computed twice.
void correlate_rows(const FilterView& filter, const StencilRows& rows,
                    const std::array<StencilOutput, kFilterRows>& to) noexcept {
  const std::size_t lanes = hn::Lanes(D()), width = kFilterVectors * lanes, columns = to[0].columns;
  if (columns >= width) {
    for (std::size_t x = 0; x + width <= columns; x += width)
      correlate_block<kFilterVectors>(filter, rows, to, x);
    if (columns % width != 0) correlate_block<kFilterVectors>(filter, rows, to, columns - width);
  } else if (columns >= lanes) {
    for (std::size_t x = 0; x + lanes <= columns; x += lanes) correlate_block<1>(filter, rows, to, x);
    if (columns % lanes != 0) correlate_block<1>(filter, rows, to, columns - lanes);
  } else {
    for (std::uint32_t o = 0; o < kFilterRows; ++o)
      correlate_vector(filter, {rows.row + o, rows.step + o}, to[o], false, 0);
  }
}

// The order of operations is that of opcodes.def. load(j, i) loads the cells of row j, column i of the three.
template <class Op, bool kEight, class Load>
HWY_INLINE V join_neighbours(const Load& load) {
  const V sides = Op::apply(load(1, 0), load(1, 2), zero());
  if constexpr (!kEight) return Op::apply(sides, Op::apply(load(0, 1), load(2, 1), zero()), zero());
  const V north = Op::apply(Op::apply(load(0, 0), load(0, 2), zero()), load(0, 1), zero());
  const V south = Op::apply(Op::apply(load(2, 0), load(2, 2), zero()), load(2, 1), zero());
  return Op::apply(sides, Op::apply(north, south, zero()), zero());
}

template <class Op, bool kEight>
void near(const StencilRows& rows, const StencilOutput& to) noexcept {
  const D d;
  std::size_t x = 0;
  const auto from = [&](std::size_t j, std::size_t i) {
    return rows.row[j] + rows.step[j] * static_cast<std::ptrdiff_t>(x) + i;
  };
  const auto whole = [&](std::size_t j, std::size_t i) { return hn::LoadU(d, from(j, i)); };
  const auto part = [&](std::size_t j, std::size_t i) { return load_cells(from(j, i), to.columns - x); };
  for (; x + hn::Lanes(d) <= to.columns; x += hn::Lanes(d))
    store_cells(to, x, join_neighbours<Op, kEight>(whole));
  if (x < to.columns) store_cells(to, x, join_neighbours<Op, kEight>(part));
}

template <class... Ops>
StencilKernels make_stencil_kernels() {
  StencilKernels kernels;
  kernels.correlate = correlate;
  kernels.correlate_rows = correlate_rows;
  kernels.near = {{{near<Ops, false>, near<Ops, true>}...}};
  return kernels;
}

// ---- random numbers ----

// Calls store(x, first, second) with the first two words of the cells from `column + x` on.
#if HWY_TARGET == HWY_SCALAR

using VU = hn::Vec<hn::RebindToUnsigned<D>>;

template <class Store>
HWY_INLINE void draw_words(const RandomCells& cells, const Store& store) {
  for (std::uint32_t x = 0; x < cells.count; ++x) {
    const RandomWords words =
        philox({cells.column + x, cells.row, static_cast<std::uint32_t>(cells.draw_index),
                static_cast<std::uint32_t>(cells.draw_index >> 32U)},
               {cells.seed, 0});
    store(x, hn::Set(hn::RebindToUnsigned<D>(), words[0]), hn::Set(hn::RebindToUnsigned<D>(), words[1]));
  }
}

#else

using DU = hn::RebindToUnsigned<D>;
using VU = hn::Vec<DU>;
using DWide = hn::Repartition<std::uint64_t, DU>;
using VWide = hn::Vec<DWide>;

HWY_INLINE VWide multiply_low_halves(VWide a, std::uint32_t b) {
  return hn::MulEven(hn::BitCast(DU(), a), hn::Set(DU(), b));
}

// Philox with a counter in the low half of each lane. The high halves are arbitrary: the multiplication
// ignores them.
struct PhiloxState {
  VWide c0, c1, c2, c3;

  HWY_INLINE void advance(VWide key0, VWide key1) {
    const VWide a = multiply_low_halves(c0, kPhiloxMultipliers[0]);
    const VWide b = multiply_low_halves(c2, kPhiloxMultipliers[1]);
    c0 = hn::Xor(hn::ShiftRight<32>(b), hn::Xor(c1, key0));
    c1 = b;
    c2 = hn::Xor(hn::ShiftRight<32>(a), hn::Xor(c3, key1));
    c3 = a;
  }
};

// The low halves of even and odd cells, side by side.
HWY_INLINE VU interleave(VWide even, VWide odd) {
  return hn::OddEven(hn::BitCast(DU(), hn::ShiftLeft<32>(odd)), hn::BitCast(DU(), even));
}

// What the cells of a row have in common: the keys of the rounds from the third on, one vector each, and the
// words of the first two, in which only the first word of the counter, the column, differs.
class PhiloxRow {
 public:
  explicit PhiloxRow(const RandomCells& cells) {
    std::array<std::uint32_t, 2> key{cells.seed, 0};
    const auto next_key = [&] {
      const std::array<std::uint32_t, 2> current = key;
      for (std::size_t k = 0; k < 2; ++k) key[k] += kPhiloxKeySteps[k];
      return current;
    };
    const auto first = next_key(), second = next_key();
    const std::uint64_t b = std::uint64_t{kPhiloxMultipliers[1]} * (cells.draw_index & 0xFFFFFFFFU);
    const std::uint32_t c0 = static_cast<std::uint32_t>(b >> 32U) ^ cells.row ^ first[0];
    const std::uint64_t a = std::uint64_t{kPhiloxMultipliers[0]} * c0;
    first2_ = hn::Set(d_, (cells.draw_index >> 32U) ^ first[1]);
    second0_ = hn::Set(d_, b ^ second[0]);
    second2_ = hn::Set(d_, (a >> 32U) ^ second[1]);
    second3_ = hn::Set(d_, a);
    for (std::size_t round = 0; round < kRounds; ++round) {
      const auto current = next_key();
      for (std::size_t k = 0; k < 2; ++k) hn::Store(hn::Set(d_, current[k]), d_, key_address(round, k));
    }
  }

  // The states of the columns 0, 2, … and 1, 3, … after `column`.
  HWY_INLINE std::array<PhiloxState, 2> draw(std::uint32_t column) const {
    const VWide columns = hn::Add(hn::ShiftLeft<1>(hn::Iota(d_, 0)), hn::Set(d_, column));
    PhiloxState even = after_two_rounds(columns), odd = after_two_rounds(hn::Add(columns, hn::Set(d_, 1)));
#pragma GCC unroll 8
    for (std::size_t round = 0; round < kRounds; ++round) {
      const VWide key0 = hn::Load(d_, key_address(round, 0)), key1 = hn::Load(d_, key_address(round, 1));
      even.advance(key0, key1);
      odd.advance(key0, key1);
    }
    return {even, odd};
  }

 private:
  static constexpr std::size_t kRounds = kPhiloxRounds - 2;
  HWY_INLINE PhiloxState after_two_rounds(VWide columns) const {
    const VWide a = multiply_low_halves(columns, kPhiloxMultipliers[0]);
    const VWide b = multiply_low_halves(hn::Xor(hn::ShiftRight<32>(a), first2_), kPhiloxMultipliers[1]);
    return {hn::Xor(hn::ShiftRight<32>(b), second0_), b, hn::Xor(a, second2_), second3_};
  }

  std::uint64_t* key_address(std::size_t round, std::size_t k) {
    return keys_.data() + (2 * round + k) * hn::Lanes(d_);
  }
  const std::uint64_t* key_address(std::size_t round, std::size_t k) const {
    return keys_.data() + (2 * round + k) * hn::Lanes(d_);
  }

  DWide d_;
  HWY_ALIGN std::array<std::uint64_t, 2 * kRounds * kLanes / 2> keys_;
  VWide first2_, second0_, second2_, second3_;
};

template <class Store>
HWY_INLINE void draw_words(const RandomCells& cells, const Store& store) {
  const PhiloxRow row(cells);
  for (std::uint32_t x = 0; x < cells.count; x += static_cast<std::uint32_t>(hn::Lanes(DU()))) {
    const auto [even, odd] = row.draw(cells.column + x);
    store(x, interleave(even.c0, odd.c0), interleave(even.c1, odd.c1));
  }
}

#endif

void random_words(const RandomCells& cells, std::uint32_t* to) noexcept {
  draw_words(cells,
             [&](std::uint32_t x, VU word0, VU) { hn::StoreU(word0, hn::RebindToUnsigned<D>(), to + x); });
}

// Uniform in [0, 1), from the upper 24 bits.
HWY_INLINE V to_unit_interval(VU word) {
  return hn::Mul(hn::ConvertTo(D(), hn::BitCast(hn::RebindToSigned<D>(), hn::ShiftRight<8>(word))),
                 hn::Set(D(), 0x1p-24F));
}

// c[0] + x (c[1] + x (c[2] + ...))
template <std::size_t kCount>
HWY_INLINE V polynomial(const std::array<float, kCount>& c, V x) {
  V sum = hn::Set(D(), c[kCount - 1]);
  for (std::size_t i = kCount - 1; i-- > 0;) sum = hn::Add(hn::Mul(sum, x), hn::Set(D(), c[i]));
  return sum;
}

// -2 ln(n / 2^24) for n from 1 to 2^24, with a relative error below 1e-7. The polynomial is that of logf in
// S. Moshier's Cephes, times -2.
HWY_INLINE V minus_two_log(VU n) {
  constexpr std::array<float, 9> kSeries{-6.6666666348e-1F, 4.9999987986e-1F,  -4.0001429530e-1F,
                                         3.3336115330e-1F,  -2.8498645574e-1F, 2.4840281692e-1F,
                                         -2.3353997480e-1F, 2.3029220620e-1F,  -1.4075367258e-1F};
  // n / 2^24 = m 2^e with m in [sqrt(1/2), sqrt(2))
  const hn::RebindToSigned<D> di;
  const auto sqrt_half = hn::Set(di, 0x3F3504F3);
  const auto bits =
      hn::Sub(hn::BitCast(di, hn::ConvertTo(D(), hn::BitCast(di, n))), hn::Set(di, 0x3F3504F3 + (24 << 23)));
  const V e = hn::ConvertTo(D(), hn::ShiftRight<23>(bits));
  const V m = hn::BitCast(D(), hn::Add(hn::And(bits, hn::Set(di, 0x7FFFFF)), sqrt_half));
  const V x = hn::Sub(m, one()), z = hn::Mul(x, x);
  // ln 2 in two parts, the smaller one added first
  const V small =
      hn::Add(hn::Mul(hn::Mul(x, z), polynomial(kSeries, x)), hn::Mul(e, hn::Set(D(), 4.2438888e-4F)));
  return hn::Add(hn::Sub(hn::Add(small, z), hn::Add(x, x)), hn::Mul(e, hn::Set(D(), -1.38671875F)));
}

// The cosine of t turns, t in [0, 1) and a multiple of 2^-24, with an error below 2e-7.
HWY_INLINE V cos_turns(V t) {
  // Chebyshev interpolation of sin(2 pi r) / r over r^2
  constexpr std::array<float, 5> kSeries{6.2831854820F, -41.3416824341F, 81.6024780273F, -76.5811691284F,
                                         39.7598266602F};
  // cos(2 pi t) = sin(2 pi r) with r in [-1/4, 1/4], without rounding
  const V r = hn::Sub(hn::Abs(hn::Sub(t, hn::Set(D(), 0.5F))), hn::Set(D(), 0.25F));
  return hn::Mul(r, polynomial(kSeries, hn::Mul(r, r)));
}

void random_uniform(const RandomCells& cells, float a, float b, float* to) noexcept {
  const D d;
  const V low = hn::Set(d, a), range = hn::Set(d, b - a);
  draw_words(cells, [&](std::uint32_t x, VU word0, VU) {
    hn::StoreU(hn::Add(low, hn::Mul(range, to_unit_interval(word0))), d, to + x);
  });
}

// Box and Muller's transform of 1 - u and v, the upper 24 bits of the two words / 2^24.
HWY_INLINE V box_muller(VU word0, VU word1) {
  const VU n = hn::Sub(hn::Set(hn::RebindToUnsigned<D>(), 1U << 24U), hn::ShiftRight<8>(word0));
  return hn::Mul(hn::Sqrt(minus_two_log(n)), cos_turns(to_unit_interval(word1)));
}

// Two passes have iterations that are short enough for the CPU to overlap several.
void random_normal(const RandomCells& cells, float mean, float sd, float* to) noexcept {
  constexpr std::uint32_t kPass = 256;
  HWY_ALIGN std::array<std::uint32_t, kPass> first, second;
  const D d;
  const hn::RebindToUnsigned<D> du;
  const auto lanes = static_cast<std::uint32_t>(hn::Lanes(d));
  for (std::uint32_t begin = 0; begin < cells.count; begin += kPass) {
    RandomCells pass = cells;
    pass.column += begin;
    pass.count = std::min(kPass, cells.count - begin);
    draw_words(pass, [&](std::uint32_t x, VU word0, VU word1) {
      hn::Store(word0, du, &first[x]);
      hn::Store(word1, du, &second[x]);
    });
    for (std::uint32_t x = 0; x < pass.count; x += lanes) {
      const V normal = box_muller(hn::Load(du, &first[x]), hn::Load(du, &second[x]));
      hn::StoreU(hn::Add(hn::Set(d, mean), hn::Mul(hn::Set(d, sd), normal)), d, to + begin + x);
    }
  }
}

KernelTable make_table() {
  KernelTable table;
#define APRON_ELEMENTWISE(name, arity, value) fill<name>(table);
#define APRON_MATHEMATICS(name, arity, value) fill<name>(table);
#include "apron/program/elementwise.def"
  table.reductions = {reduce<SumOp>, reduce<MinOp>, reduce<MaxOp>, reduce<CountOp>};
  table.stencils = make_stencil_kernels<Add, Min, Max, Or, And>();
  table.random_words = random_words;
  table.random_uniform = random_uniform;
  table.random_normal = random_normal;
  add_integer_kernels(table);
  return table;
}

const KernelTable* table() {
  static const KernelTable kTable = make_table();
  return &kTable;
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace apron::vm
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace apron::vm {

HWY_EXPORT(table);

namespace {

std::vector<NamedKernelTable> find_kernel_tables() {
  std::vector<NamedKernelTable> all;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    all.push_back({hwy::TargetName(target), HWY_DYNAMIC_DISPATCH(table)()});
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  return all;
}

InstructionSet instruction_set_of(std::string_view target) {
  if (target.starts_with("AVX3")) return InstructionSet::kAvx512;  // AVX3, AVX3_DL, AVX3_ZEN4
  return target == "AVX2" ? InstructionSet::kAvx2 : InstructionSet::kPortable;
}

}  // namespace

const std::vector<NamedKernelTable>& kernel_tables() {
  static const std::vector<NamedKernelTable> kTables = find_kernel_tables();
  return kTables;
}

const KernelTable* kernel_table(InstructionSet isa) {
  const auto find = [](InstructionSet wanted) -> const KernelTable* {
    for (const NamedKernelTable& named : kernel_tables())
      if (instruction_set_of(named.name) == wanted) return named.table;
    return nullptr;
  };
  if (isa != InstructionSet::kAvx512 || find(isa) == nullptr) return find(isa);
  // A single element-wise operation waits for memory, unless it is a mathematical function: see
  // is_bandwidth_bound() in fusion/FusedTrace.cpp.
  static const KernelTable kTable = [&] {
    KernelTable table = *find(InstructionSet::kAvx512);
    if (const KernelTable* narrow = find(InstructionSet::kAvx2))
      for (std::size_t op = 0; op < table.elementwise.size(); ++op)
        if (!program::is_mathematics(static_cast<program::Opcode>(op)))
          table.elementwise[op] = narrow->elementwise[op];
    return table;
  }();
  return &kTable;
}

bool is_supported(InstructionSet isa) { return kernel_table(isa) != nullptr; }

InstructionSet best_instruction_set() {
  for (const InstructionSet isa : {InstructionSet::kAvx512, InstructionSet::kAvx2})
    if (is_supported(isa)) return isa;
  return InstructionSet::kPortable;
}

}  // namespace apron::vm
#endif
