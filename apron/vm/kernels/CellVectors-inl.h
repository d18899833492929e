// Vectors of cells: the element-wise instructions but the mathematical functions, and the loop that applies
// an instruction to a block. Included once per instruction set, hence the toggled include guard.
#if defined(APRON_VM_CELL_VECTORS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef APRON_VM_CELL_VECTORS_INL_H
#undef APRON_VM_CELL_VECTORS_INL_H
#else
#define APRON_VM_CELL_VECTORS_INL_H
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <cstdint>

#include "apron/vm/PlaneStore.h"
#include "apron/vm/kernels/KernelTable.h"

HWY_BEFORE_NAMESPACE();
namespace apron::vm {
namespace HWY_NAMESPACE {
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
  auto& entry = table.elementwise[index_of(Op::kOpcode)][kScalars];
  entry[0] = run<Op, kScalars, false>;
  entry[1] = run<Op, kScalars, true>;
  if constexpr (kScalars + 1 < (1U << Op::kArity)) fill<Op, kScalars + 1>(table);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace apron::vm
HWY_AFTER_NAMESPACE();

#endif
