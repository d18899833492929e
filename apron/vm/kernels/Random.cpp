#include "apron/vm/kernels/Random.h"

#include <algorithm>
#include <cmath>

#include "apron/vm/PlaneStore.h"

namespace apron::vm {
namespace {

float uniform_integer(std::uint32_t word, float a, float b) {
  const float low = std::ceil(a), high = std::floor(b);
  const double count = static_cast<double>(high) - static_cast<double>(low) + 1.0;
  if (!(count >= 1.0)) return low;
  return static_cast<float>(low + std::floor(static_cast<double>(word) * 0x1p-32 * count));
}

// A multiple of kLanes.
constexpr std::uint32_t kBatch = 256;

// The values of cells.count cells, at most kBatch.
void draw_values(const KernelTable& kernels, program::Opcode op, const RandomCells& cells, float a, float b,
                 float* to) {
  if (op == program::Opcode::kRandomFloat) return kernels.random_uniform(cells, a, b, to);
  if (op == program::Opcode::kRandomGauss) return kernels.random_normal(cells, a, b, to);
  std::array<std::uint32_t, kBatch> first;
  kernels.random_words(cells, first.data());
  for (std::uint32_t i = 0; i < cells.count; ++i) to[i] = uniform_integer(first[i], a, b);
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

float RandomStream::draw_one(const KernelTable& kernels, program::Opcode op, std::uint32_t column,
                             std::uint32_t row, float a, float b) const noexcept {
  std::array<float, kLanes> values;
  draw_values(kernels, op, {seed, draw_index, row, column, kLanes}, a, b, values.data());
  return values[0];
}

void RandomStream::fill_row(const KernelTable& kernels, program::Opcode op, std::uint32_t row, float a,
                            float b, float* to, const float* mask, std::uint32_t columns) const noexcept {
  std::array<float, kBatch> values;
  for (std::uint32_t x = 0; x < columns; x += kBatch) {
    const std::uint32_t count = std::min(kBatch, columns - x);
    const std::uint32_t whole_vectors = (count + kLanes - 1) / kLanes * kLanes;
    const bool in_place = mask == nullptr && count == whole_vectors;
    draw_values(kernels, op, {seed, draw_index, row, x, whole_vectors}, a, b,
                in_place ? to + x : values.data());
    if (in_place) continue;
    if (mask == nullptr)
      std::copy_n(values.begin(), count, to + x);
    else
      for (std::uint32_t i = 0; i < count; ++i)
        if (mask[x + i] != 0.0F) to[x + i] = values[i];
  }
}

}  // namespace apron::vm
