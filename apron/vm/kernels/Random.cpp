#include "apron/vm/kernels/Random.h"

#include <algorithm>
#include <cmath>

#include "apron/vm/kernels/Kernels.h"

namespace apron::vm {
namespace {

// Uniform in [0, 1), from the upper 24 bits.
float to_unit_interval(std::uint32_t word) { return static_cast<float>(word >> 8U) * 0x1p-24F; }

float box_muller(std::uint32_t first, std::uint32_t second) {
  constexpr float kTwoPi = 6.2831853F;
  return std::sqrt(-2.0F * std::log(1.0F - to_unit_interval(first))) *
         std::cos(kTwoPi * to_unit_interval(second));
}

float uniform_integer(std::uint32_t word, float a, float b) {
  const float low = std::ceil(a), high = std::floor(b);
  const double count = static_cast<double>(high) - static_cast<double>(low) + 1.0;
  if (!(count >= 1.0)) return low;
  return static_cast<float>(low + std::floor(static_cast<double>(word) * 0x1p-32 * count));
}

float to_value(program::Opcode op, std::uint32_t first, std::uint32_t second, float a, float b) {
  switch (op) {
    case program::Opcode::kRandomGauss:
      return a + b * box_muller(first, second);
    case program::Opcode::kRandomInt:
      return uniform_integer(first, a, b);
    default:
      return a + (b - a) * to_unit_interval(first);
  }
}

}  // namespace

RandomWords philox(RandomWords c, std::array<std::uint32_t, 2> key) noexcept {
  for (int round = 0; round < kPhiloxRounds; ++round) {
    const std::uint64_t a = std::uint64_t{kPhiloxMultipliers[0]} * c[0],
                        b = std::uint64_t{kPhiloxMultipliers[1]} * c[2];
    c = {static_cast<std::uint32_t>(b >> 32U) ^ c[1] ^ key[0], static_cast<std::uint32_t>(b),
         static_cast<std::uint32_t>(a >> 32U) ^ c[3] ^ key[1], static_cast<std::uint32_t>(a)};
    key[0] += kPhiloxKeySteps[0];
    key[1] += kPhiloxKeySteps[1];
  }
  return c;
}

float RandomStream::operator()(program::Opcode op, std::uint32_t column, std::uint32_t row, float a,
                               float b) const noexcept {
  const RandomWords words = philox(
      {column, row, static_cast<std::uint32_t>(draw_index), static_cast<std::uint32_t>(draw_index >> 32U)},
      {seed, 0});
  return to_value(op, words[0], words[1], a, b);
}

void RandomStream::fill_row(const KernelTable& kernels, program::Opcode op, std::uint32_t row, float a,
                            float b, float* to, const float* mask, std::uint32_t columns) const noexcept {
  constexpr std::uint32_t kBatch = 256;  // a multiple of kLanes
  std::array<std::uint32_t, kBatch> first, second;
  std::array<float, kBatch> values;
  RandomCells cells{seed, draw_index, row, 0, kBatch};
  for (std::uint32_t& x = cells.column; x < columns; x += kBatch) {
    const std::uint32_t count = std::min(kBatch, columns - x);
    if (op == program::Opcode::kRandomFloat) {
      kernels.random_uniform(cells, a, b, values.data());
    } else {
      kernels.random_words(cells, first.data(), second.data());
      for (std::uint32_t i = 0; i < count; ++i) values[i] = to_value(op, first[i], second[i], a, b);
    }
    if (mask == nullptr)
      std::copy_n(values.begin(), count, to + x);
    else
      for (std::uint32_t i = 0; i < count; ++i)
        if (mask[x + i] != 0.0F) to[x + i] = values[i];
  }
}

}  // namespace apron::vm
