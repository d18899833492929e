#include "apron/program/Mathematics.h"

#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <limits>

namespace apron::program {
namespace {

__extension__ using Wide = unsigned __int128;
__extension__ using SignedWide = __int128;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// The 128 bits of 2 / pi from that bit on; bit 0 has the weight 1/2. Bits before it are 0.
Wide bits_of_two_over_pi(int first) {
  constexpr std::array<std::uint64_t, 5> kBits{0xA2F9836E4E441529, 0xFC2757D1F534DDC0, 0xDB6295993C439041,
                                               0xFE5163ABDEBBC561, 0xB7246E3A424DD2E0};
  if (first < 0) return bits_of_two_over_pi(0) >> static_cast<unsigned>(-first);
  const auto word = static_cast<std::size_t>(first) / 64;
  const auto shift = static_cast<unsigned>(first) % 64;
  const Wide upper = (Wide{kBits[word]} << 64U) | kBits[word + 1];
  return shift == 0 ? upper : (upper << shift) | (kBits[word + 2] >> (64U - shift));
}

// The primitives of mathematics.def.
using R = float;
using W = double;
using B = bool;

constexpr float kFloatInfinity = std::numeric_limits<float>::infinity();
constexpr float kFloatNan = std::numeric_limits<float>::quiet_NaN();

std::uint32_t bits(float a) { return std::bit_cast<std::uint32_t>(a); }
float from_bits(std::uint32_t bits) { return std::bit_cast<float>(bits); }

R constant(float c) { return c; }
B less(R a, R b) { return a < b; }
B equal(R a, R b) { return a == b; }
B both(B p, B q) { return p && q; }
B either(B p, B q) { return p || q; }
B opposite(B p) { return !p; }
bool all(B p) { return p; }
R choose(B p, R a, R b) { return p ? a : b; }
B choose_truth(B p, B a, B b) { return p ? a : b; }
R smaller(R a, R b) { return a < b ? a : b; }
R larger(R a, R b) { return a > b ? a : b; }
R magnitude(R a) { return std::fabs(a); }
R signed_as(R a, R of) { return from_bits(bits(a) | (bits(of) & 0x80000000U)); }
R flipped_by(R a, R of) { return from_bits(bits(a) ^ (bits(of) & 0x80000000U)); }
R flipped(B p, R a) { return p ? -a : a; }
B is_negative(R a) { return std::signbit(a); }
R square_root(R a) { return std::sqrt(a); }
R floor_of(R a) { return std::floor(a); }
R upper(R a) { return from_bits(bits(a) & 0xFFFFE000U); }
R shift(R a) { return a + 0x1.8p23F; }
R unshift(R a) { return a - 0x1.8p23F; }
B is_odd(R a) { return (bits(a) & 1U) != 0; }
R flipped_if_odd(R b, R a) { return from_bits(bits(b) ^ (bits(a) << 31U)); }
R times_power(R b, R a) { return from_bits(bits(b) + (bits(a) << 23U)); }
R power_of_two(R k) { return from_bits(bits(k + (0x1.8p23F + 127)) << 23U); }
R split(R a, std::uint32_t least, R* k) {
  const std::uint32_t above = bits(a) - least;
  *k = static_cast<float>(static_cast<std::int32_t>(above) >> 23);
  return from_bits((above & 0x7FFFFFU) + least);
}
W wide(R a) { return a; }
R narrow(W a) { return static_cast<float>(a); }
W wide_constant(double c) { return c; }
W wide_nearest(W a) { return (a + 0x1.8p52) - 0x1.8p52; }
W wide_negate_if_odd(W a, W k) {
  return std::bit_cast<double>(std::bit_cast<std::uint64_t>(a) ^ (std::bit_cast<std::uint64_t>(k) << 63U));
}
void reduce_large(R x, W* quadrant, W* r) {
  if (std::fabs(x) < 0x1p20F) return;
  const ReducedAngle angle = reduce_angle(x);
  *quadrant = angle.quadrant;
  *r = angle.rest;
}
void turn_large(R x, double ahead, W* r) {
  if (std::fabs(x) < 0x1p20F) return;
  *r = turn_angle(x, ahead);
}

#define APRON_INLINE inline
#define APRON_RARE [[maybe_unused]]
#include "apron/program/mathematics.def"
#undef APRON_INLINE
#undef APRON_RARE

}  // namespace

// By Payne and Hanek's method: the bits of 2 / pi that contribute multiples of 4 are left out of the product.
ReducedAngle reduce_angle(double x) noexcept {
  if (!(std::fabs(x) < kInfinity)) return {kNan, kNan};
  int exponent_of_x = 0;
  const auto whole = static_cast<std::uint64_t>(std::ldexp(std::frexp(std::fabs(x), &exponent_of_x), 24));
  // The product's unit is 2^-126.
  const Wide product = bits_of_two_over_pi(exponent_of_x - 24 - 2) * whole;
  const Wide quadrant = (product + (Wide{1} << 125U)) >> 126U;
  const auto rest = static_cast<SignedWide>(product - (quadrant << 126U));
  const ReducedAngle angle{static_cast<double>(static_cast<unsigned>(quadrant)),
                           std::ldexp(static_cast<double>(rest), -126) * 1.5707963267948966};
  return x < 0.0 ? ReducedAngle{-angle.quadrant, -angle.rest} : angle;
}

double turn_angle(float x, double ahead) noexcept {
  const ReducedAngle angle = reduce_angle(x);
  return half_turn(angle.quadrant, angle.rest, ahead);
}

float evaluate_mathematics(Opcode op, float a, [[maybe_unused]] float b) noexcept {
  switch (op) {
#define APRON_MATHEMATICS(name, arity, value) \
  case Opcode::k##name:                       \
    return value;
#include "apron/program/elementwise.def"
    default:
      assert(false && "not a mathematical function");
      return 0.0F;
  }
}

}  // namespace apron::program
