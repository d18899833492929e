#include "apron/vm/kernels/Random.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "apron/vm/PlaneStore.h"

namespace apron::vm {
namespace {

double uniform_integer(std::uint32_t word, double a, double b) {
  const double low = std::ceil(a), count = std::floor(b) - low + 1.0;
  if (!(count >= 1.0)) return low;
  return low + std::floor(static_cast<double>(word) * 0x1p-32 * count);
}

// The cell that holds the number: limited to the values of an integer type, and 0 of NaN.
template <class T>
T to_cell(double value) {
  if constexpr (std::is_integral_v<T>) {
    if (!(value >= std::numeric_limits<T>::min())) return value < 0 ? std::numeric_limits<T>::min() : T{0};
    if (value > std::numeric_limits<T>::max()) return std::numeric_limits<T>::max();
  }
  return static_cast<T>(value);
}

// A multiple of kLanes.
constexpr std::uint32_t kBatch = 256;

// The values of cells.count cells, at most kBatch.
template <class T>
void draw_values(const KernelTable& kernels, program::Opcode op, const RandomCells& cells, double a, double b,
                 T* to) {
  if constexpr (std::is_same_v<T, float>) {
    const auto x = static_cast<float>(a), y = static_cast<float>(b);
    if (op == program::Opcode::kRandomFloat) return kernels.random_uniform(cells, x, y, to);
    if (op == program::Opcode::kRandomGauss) return kernels.random_normal(cells, x, y, to);
  }
  std::array<std::uint32_t, kBatch> first;
  kernels.random_words(cells, first.data());
  for (std::uint32_t i = 0; i < cells.count; ++i) to[i] = to_cell<T>(uniform_integer(first[i], a, b));
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

double RandomStream::draw_one(const KernelTable& kernels, program::Opcode op, std::uint32_t column,
                              std::uint32_t row, double a, double b) const noexcept {
  const RandomCells cells{seed, draw_index, row, column, kLanes};
  if (op == program::Opcode::kRandomInt) {
    std::array<double, kLanes> whole;
    draw_values(kernels, op, cells, a, b, whole.data());
    return whole[0];
  }
  std::array<float, kLanes> values;
  draw_values(kernels, op, cells, a, b, values.data());
  return static_cast<double>(values[0]);
}

template <class T>
void RandomStream::fill_row(const KernelTable& kernels, program::Opcode op, std::uint32_t row, double a,
                            double b, T* to, const std::type_identity_t<T>* mask,
                            std::uint32_t columns) const noexcept {
  std::array<T, kBatch> values;
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
        if (mask[x + i] != T{0}) to[x + i] = values[i];
  }
}

template void RandomStream::fill_row(const KernelTable&, program::Opcode, std::uint32_t, double, double,
                                     float*, const float*, std::uint32_t) const noexcept;
template void RandomStream::fill_row(const KernelTable&, program::Opcode, std::uint32_t, double, double,
                                     std::int32_t*, const std::int32_t*, std::uint32_t) const noexcept;
template void RandomStream::fill_row(const KernelTable&, program::Opcode, std::uint32_t, double, double,
                                     std::uint16_t*, const std::uint16_t*, std::uint32_t) const noexcept;
template void RandomStream::fill_row(const KernelTable&, program::Opcode, std::uint32_t, double, double,
                                     std::uint8_t*, const std::uint8_t*, std::uint32_t) const noexcept;

}  // namespace apron::vm
