// Random numbers as a function of seed, cell and draw, independent of the order of execution.
#pragma once

#include <array>
#include <cstdint>
#include <type_traits>

#include "apron/program/Program.h"
#include "apron/vm/kernels/KernelTable.h"

namespace apron::vm {

using RandomWords = std::array<std::uint32_t, 4>;

// Philox4x32 with 10 rounds: J. Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011.
inline constexpr int kPhiloxRounds = 10;
inline constexpr std::array<std::uint32_t, 2> kPhiloxMultipliers{0xD2511F53, 0xCD9E8D57},
    kPhiloxKeySteps{0x9E3779B9, 0xBB67AE85};
RandomWords philox(RandomWords counter, std::array<std::uint32_t, 2> key) noexcept;

// The random numbers of one instruction. All kernel tables give the same bits.
struct RandomStream {
  std::uint32_t seed = 0;        // bit pattern of the float seed
  std::uint64_t draw_index = 0;  // random instructions executed since the seed was set

  // The value of op (kRandomFloat, kRandomGauss or kRandomInt) with operands a and b, as specified in
  // opcodes.def.
  double draw_one(const KernelTable& kernels, program::Opcode op, std::uint32_t column, std::uint32_t row,
                  double a, double b) const noexcept;

  // Writes the values of the cells of a row, of integers those of kRandomInt. If mask is not null, only its
  // non-zero cells are written.
  template <class T>
  void fill_row(const KernelTable& kernels, program::Opcode op, std::uint32_t row, double a, double b, T* to,
                const std::type_identity_t<T>* mask, std::uint32_t columns) const noexcept;
};

}  // namespace apron::vm
