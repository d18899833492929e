// The kernels of int32, uint16 and uint8: loops that the compiler turns into vectors of the instruction set.
// Compiled once per instruction set: foreach_target.h re-includes this file for each.
#include <algorithm>
#include <array>
#include <limits>
#include <type_traits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "apron/vm/kernels/IntegerKernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "apron/vm/PlaneStore.h"
#include "apron/vm/kernels/KernelTable.h"

// No cell depends on another one: a destination is disjoint from a source or identical to it.
#undef APRON_INDEPENDENT
#ifdef __clang__
#define APRON_INDEPENDENT _Pragma("clang loop vectorize(assume_safety)")
#else
#define APRON_INDEPENDENT _Pragma("GCC ivdep")
#endif

HWY_BEFORE_NAMESPACE();
namespace apron::vm {
namespace HWY_NAMESPACE {
namespace {

using program::CellType;
using program::Opcode;

// The arithmetic of one type, by the primitives of program/elementwise.def: C's, modulo 2^n.
template <class T>
struct Arithmetic {
  static constexpr int kBits = 8 * sizeof(T);
  using Limits = std::numeric_limits<T>;
  using Bits = std::uint32_t;

  static HWY_INLINE T wrap(Bits a) { return static_cast<T>(a); }
  static HWY_INLINE Bits bits(T a) { return static_cast<Bits>(a); }
  static HWY_INLINE T zero() { return 0; }
  static HWY_INLINE T add(T a, T b) { return wrap(bits(a) + bits(b)); }
  static HWY_INLINE T subtract(T a, T b) { return wrap(bits(a) - bits(b)); }
  static HWY_INLINE T multiply(T a, T b) { return wrap(bits(a) * bits(b)); }
  // The quotient of the least int32 and -1 wraps.
  static HWY_INLINE T divide(T a, T b) {
    return b == 0 ? T{0} : static_cast<T>(static_cast<std::int64_t>(a) / static_cast<std::int64_t>(b));
  }
  static HWY_INLINE T modulo(T a, T b) {
    return b == 0 ? a : static_cast<T>(static_cast<std::int64_t>(a) % static_cast<std::int64_t>(b));
  }
  static HWY_INLINE T smaller(T a, T b) { return a < b ? a : b; }
  static HWY_INLINE T larger(T a, T b) { return a > b ? a : b; }
  static HWY_INLINE T negate(T a) { return wrap(Bits{0} - bits(a)); }
  static HWY_INLINE T magnitude(T a) {
    if constexpr (std::is_signed_v<T>) return a < 0 ? negate(a) : a;
    return a;
  }
  static HWY_INLINE T choose(bool condition, T a, T b) { return condition ? a : b; }
  static HWY_INLINE T as_number(bool truth) { return truth ? 1 : 0; }
  static HWY_INLINE T as_inverse_number(bool truth) { return truth ? 0 : 1; }
  static HWY_INLINE bool is_true(T a) { return a != 0; }
  static HWY_INLINE bool less(T a, T b) { return a < b; }
  static HWY_INLINE bool less_equal(T a, T b) { return a <= b; }
  static HWY_INLINE bool equal(T a, T b) { return a == b; }
  static HWY_INLINE bool differ(T a, T b) { return a != b; }
  static HWY_INLINE bool both(bool a, bool b) { return a & b; }
  static HWY_INLINE bool either(bool a, bool b) { return a | b; }
  static HWY_INLINE bool one_of(bool a, bool b) { return a != b; }
  static HWY_INLINE T bit_and(T a, T b) { return wrap(bits(a) & bits(b)); }
  static HWY_INLINE T bit_or(T a, T b) { return wrap(bits(a) | bits(b)); }
  static HWY_INLINE T bit_xor(T a, T b) { return wrap(bits(a) ^ bits(b)); }
  static HWY_INLINE T bit_not(T a) { return wrap(~bits(a)); }
  static HWY_INLINE bool within(T distance) { return bits(distance) < kBits; }
  static HWY_INLINE T bit_left(T a, T b) { return within(b) ? wrap(bits(a) << (bits(b) & 31U)) : T{0}; }
  static HWY_INLINE T bit_right(T a, T b) {
    if constexpr (std::is_signed_v<T>) return static_cast<T>(a >> (within(b) ? bits(b) : 31U));
    return within(b) ? wrap(bits(a) >> (bits(b) & 31U)) : T{0};
  }
  static HWY_INLINE T limit(std::int64_t a) {
    return static_cast<T>(std::min<std::int64_t>(std::max<std::int64_t>(a, Limits::min()), Limits::max()));
  }
  static HWY_INLINE T add_saturated(T a, T b) {
    if constexpr (std::is_signed_v<T>) return limit(std::int64_t{a} + b);
    const T room = bit_not(b);
    return add(smaller(a, room), b);
  }
  static HWY_INLINE T subtract_saturated(T a, T b) {
    if constexpr (std::is_signed_v<T>) return limit(std::int64_t{a} - b);
    return subtract(larger(a, b), b);
  }

#define APRON_ELEMENTWISE(name, arity, value)                                                     \
  struct name {                                                                                   \
    static constexpr Opcode kOpcode = Opcode::k##name;                                            \
    static constexpr unsigned kArity = arity;                                                     \
    static HWY_INLINE T apply([[maybe_unused]] T a, [[maybe_unused]] T b, [[maybe_unused]] T c) { \
      return value;                                                                               \
    }                                                                                             \
  };
#define APRON_INTEGER APRON_ELEMENTWISE
#include "apron/program/elementwise.def"
  struct AddSaturated {
    static constexpr Opcode kOpcode = Opcode::kAddSaturated;
    static constexpr unsigned kArity = 2;
    static HWY_INLINE T apply(T a, T b, T) { return add_saturated(a, b); }
  };
  struct SubSaturated {
    static constexpr Opcode kOpcode = Opcode::kSubSaturated;
    static constexpr unsigned kArity = 2;
    static HWY_INLINE T apply(T a, T b, T) { return subtract_saturated(a, b); }
  };
};

template <class T>
HWY_INLINE T* cells_of(float* cells) {
  return reinterpret_cast<T*>(cells);
}
template <class T>
HWY_INLINE const T* cells_of(const float* cells) {
  return reinterpret_cast<const T*>(cells);
}

// One operand of a kernel: 64 bytes of cells at a time, of a row or of a scalar.
template <class T>
struct KernelOperand {
  static constexpr std::size_t kVector = kVectorBytes / sizeof(T);
  std::array<T, kVector> scalar;
  const T* row;
  std::ptrdiff_t pitch;
  std::size_t step;

  KernelOperand(const Block& block, std::size_t k) {
    const bool is_register = block.source[k] != nullptr;
    scalar.fill(static_cast<T>(block.integer[k]));
    row = is_register ? cells_of<T>(block.source[k]) : scalar.data();
    pitch = is_register ? block.source_pitch[k] : 0;
    step = is_register ? 1 : 0;
  }
};

// kUniform: the second operand is a scalar. A shift by one distance is an instruction where one by many is
// none.
template <class T, class Op, bool kMasked, bool kUniform>
void run(const Block& block) noexcept {
  constexpr std::size_t kVector = kVectorBytes / sizeof(T);
  KernelOperand<T> a(block, 0), b(block, Op::kArity > 1 ? 1 : 0), c(block, Op::kArity > 2 ? 2 : 0);
  [[maybe_unused]] const T uniform = b.scalar[0];
  T* y = cells_of<T>(block.y);
  const T* mask = cells_of<T>(block.mask);
  for (std::uint32_t rows = block.rows; rows > 0; --rows) {
    for (std::size_t x = 0; x < block.columns; x += kVector) {
      const T *a_at = a.row + x * a.step, *b_at = b.row + x * b.step, *c_at = c.row + x * c.step;
      T* const y_at = y + x;
      [[maybe_unused]] const T* const mask_at = mask + x;
      APRON_INDEPENDENT
      for (std::size_t i = 0; i < kVector; ++i) {
        const T value = Op::apply(a_at[i], kUniform ? uniform : b_at[i], c_at[i]);
        if constexpr (kMasked)
          y_at[i] = mask_at[i] != 0 ? value : y_at[i];
        else
          y_at[i] = value;
      }
    }
    y += block.pitch;
    a.row += a.pitch;
    b.row += b.pitch;
    c.row += c.pitch;
    if constexpr (kMasked) mask += block.mask_pitch;
  }
}

template <class T, class Op, bool kMasked>
void run_shift(const Block& block) noexcept {
  return block.source[1] == nullptr ? run<T, Op, kMasked, true>(block) : run<T, Op, kMasked, false>(block);
}

// One kernel takes any mix of registers and scalars.
template <class T, class Op>
void fill(IntegerKernels& table) {
  auto& kernels = table.elementwise[index_of(Op::kOpcode)];
  if constexpr (Op::kOpcode == Opcode::kBitLeft || Op::kOpcode == Opcode::kBitRight)
    kernels = {run_shift<T, Op, false>, run_shift<T, Op, true>};
  else
    kernels = {run<T, Op, false, false>, run<T, Op, true, false>};
}

// ---- reductions ----

template <class T, Reduction kReduction>
void reduce(const float* from, std::ptrdiff_t pitch, std::uint32_t rows, std::uint32_t columns,
            std::int64_t* to) noexcept {
  const T* a = cells_of<T>(from);
  for (std::uint32_t row = 0; row < rows; ++row, a += pitch) {
    std::int64_t result = kReduction == Reduction::kMin || kReduction == Reduction::kMax ? a[0] : 0;
    for (std::uint32_t x = 0; x < columns; ++x) {
      const std::int64_t cell = a[x];
      if constexpr (kReduction == Reduction::kSum) result += cell;
      if constexpr (kReduction == Reduction::kMin) result = std::min(result, cell);
      if constexpr (kReduction == Reduction::kMax) result = std::max(result, cell);
      if constexpr (kReduction == Reduction::kCount) result += cell != 0 ? 1 : 0;
    }
    to[row] = result;
  }
}

// ---- conversions ----

template <class To, bool kSaturated, class From>
HWY_INLINE To convert_cell(From a) {
  if constexpr (std::is_same_v<To, float>) {
    return static_cast<float>(a);
  } else if constexpr (std::is_same_v<From, float>) {
    const float number = a == a ? a : 0.0F;
    if constexpr (sizeof(To) < sizeof(std::int32_t)) {
      constexpr float kHighest = std::numeric_limits<To>::max();
      const float low = number < 0.0F ? 0.0F : number;
      return static_cast<To>(static_cast<std::int32_t>(low > kHighest ? kHighest : low));
    } else {
      const bool is_large = number >= 0x1p31F;
      const float low = number < -0x1p31F ? -0x1p31F : number;
      const auto whole = static_cast<std::int32_t>(is_large ? 0.0F : low);
      return is_large ? std::numeric_limits<std::int32_t>::max() : whole;
    }
  } else if constexpr (kSaturated) {
    return Arithmetic<To>::limit(a);
  } else {
    return static_cast<To>(a);
  }
}

// Handles exactly the columns: a row of the source may end before the vector of y does.
template <class From, class To, bool kSaturated, bool kMasked>
void convert(const Block& block) noexcept {
  const From* a = cells_of<From>(block.source[0]);
  To* y = cells_of<To>(block.y);
  const To* mask = cells_of<To>(block.mask);
  const std::size_t columns = block.columns;
  for (std::uint32_t row = 0; row < block.rows; ++row) {
    APRON_INDEPENDENT
    for (std::size_t x = 0; x < columns; ++x) {
      const To value = convert_cell<To, kSaturated>(a[x]);
      if constexpr (kMasked)
        y[x] = mask[x] != 0 ? value : y[x];
      else
        y[x] = value;
    }
    a += block.source_pitch[0];
    y += block.pitch;
    if constexpr (kMasked) mask += block.mask_pitch;
  }
}

template <class From, class To>
void add_conversion(KernelTable& table, CellType from, CellType to) {
  if constexpr (!std::is_same_v<From, To>)
    table.conversions[index_of(from)][index_of(to)] = {
        {{convert<From, To, false, false>, convert<From, To, false, true>},
         {convert<From, To, true, false>, convert<From, To, true, true>}}};
}

template <class From>
void add_conversions(KernelTable& table, CellType from) {
  add_conversion<From, float>(table, from, CellType::kFloat32);
  add_conversion<From, std::int32_t>(table, from, CellType::kInt32);
  add_conversion<From, std::uint16_t>(table, from, CellType::kUint16);
  add_conversion<From, std::uint8_t>(table, from, CellType::kUint8);
}

template <class T>
void add_type(KernelTable& table, CellType type) {
  IntegerKernels& kernels = table.integers[index_of(type)];
  using A = Arithmetic<T>;
#define APRON_ELEMENTWISE(name, arity, value) \
  if constexpr (Opcode::k##name < Opcode::kSin) fill<T, typename A::name>(kernels);
#define APRON_INTEGER APRON_ELEMENTWISE
#include "apron/program/elementwise.def"
  fill<T, typename A::AddSaturated>(kernels);
  fill<T, typename A::SubSaturated>(kernels);
  kernels.reductions = {reduce<T, Reduction::kSum>, reduce<T, Reduction::kMin>, reduce<T, Reduction::kMax>,
                        reduce<T, Reduction::kCount>};
  add_conversions<T>(table, type);
}

}  // namespace

void add_integer_kernels(KernelTable& table) {
  add_type<std::int32_t>(table, CellType::kInt32);
  add_type<std::uint16_t>(table, CellType::kUint16);
  add_type<std::uint8_t>(table, CellType::kUint8);
  add_conversions<float>(table, CellType::kFloat32);
}

}  // namespace HWY_NAMESPACE
}  // namespace apron::vm
HWY_AFTER_NAMESPACE();
