#include "apron/vm/kernels/Random.h"

#include <cmath>

namespace apron::vm {
namespace {

// Uniform in [0, 1), from the upper 24 bits.
float to_unit_interval(std::uint32_t word) { return static_cast<float>(word >> 8U) * 0x1p-24F; }

float box_muller(const RandomWords& words) {
  constexpr float kTwoPi = 6.2831853F;
  return std::sqrt(-2.0F * std::log(1.0F - to_unit_interval(words[0]))) *
         std::cos(kTwoPi * to_unit_interval(words[1]));
}

float uniform_integer(std::uint32_t word, float a, float b) {
  const float low = std::ceil(a), high = std::floor(b);
  const double count = static_cast<double>(high) - static_cast<double>(low) + 1.0;
  if (!(count >= 1.0)) return low;
  return static_cast<float>(low + std::floor(static_cast<double>(word) * 0x1p-32 * count));
}

}  // namespace

RandomWords philox(RandomWords c, std::array<std::uint32_t, 2> key) noexcept {
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t a = std::uint64_t{0xD2511F53} * c[0], b = std::uint64_t{0xCD9E8D57} * c[2];
    c = {static_cast<std::uint32_t>(b >> 32U) ^ c[1] ^ key[0], static_cast<std::uint32_t>(b),
         static_cast<std::uint32_t>(a >> 32U) ^ c[3] ^ key[1], static_cast<std::uint32_t>(a)};
    key[0] += 0x9E3779B9;
    key[1] += 0xBB67AE85;
  }
  return c;
}

float RandomStream::operator()(program::Opcode op, std::uint32_t column, std::uint32_t row, float a,
                               float b) const noexcept {
  const RandomWords words = philox(
      {column, row, static_cast<std::uint32_t>(draw_index), static_cast<std::uint32_t>(draw_index >> 32U)},
      {seed, 0});
  switch (op) {
    case program::Opcode::kRandomGauss:
      return a + b * box_muller(words);
    case program::Opcode::kRandomInt:
      return uniform_integer(words[0], a, b);
    default:
      return a + (b - a) * to_unit_interval(words[0]);
  }
}

}  // namespace apron::vm
