// Random numbers: Philox, and what is computed from its words.
// Compiled once per instruction set: foreach_target.h re-includes this file for each.
#include <algorithm>
#include <array>
#include <cstdint>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "apron/vm/kernels/RandomKernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "apron/vm/kernels/CellVectors-inl.h"
#include "apron/vm/kernels/Random.h"

HWY_BEFORE_NAMESPACE();
namespace apron::vm {
namespace HWY_NAMESPACE {
namespace {

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

// The values that the cells of a row share: the keys of the rounds from the third on, one vector each, and
// the words of the first two, in which only the first word of the counter, the column, differs.
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

}  // namespace

void add_random_kernels(KernelTable& table) {
  table.random_words = random_words;
  table.random_uniform = random_uniform;
  table.random_normal = random_normal;
}

}  // namespace HWY_NAMESPACE
}  // namespace apron::vm
HWY_AFTER_NAMESPACE();
