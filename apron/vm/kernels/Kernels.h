// The VM's inner loops, behind a table: one entry per element-wise opcode, mix of register and scalar
// operands, and masked or not; written once and compiled for each instruction set. Every entry gives the same
// bits on each of them (NaN for NaN): no fused multiply-add, no approximation, libm cell by cell for
// transcendental functions.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "apron/program/Program.h"

namespace apron::vm {

// A block of `rows` x `columns` cells of y, a, b, c and mask, each with its own start and pitch (in floats; 0
// reads one row again and again). y and mask start on 64 bytes; a, b and c anywhere. Kernels may read and
// write columns up to the next multiple of kLanes. y may be a, b, c or mask; it may not overlap them
// otherwise.
struct Block {
  float* y = nullptr;
  std::array<const float*, program::kMaxOperands> source{};  // null where the operand is a scalar
  std::array<float, program::kMaxOperands> scalar{};         // used where the operand is a scalar
  const float* mask = nullptr;                               // masked kernels write only where it is non-zero
  std::ptrdiff_t pitch = 0;                                  // of y
  std::array<std::ptrdiff_t, program::kMaxOperands> source_pitch{};
  std::ptrdiff_t mask_pitch = 0;
  std::uint32_t rows = 0, columns = 0;

  void set_pitch(std::ptrdiff_t of_all) noexcept {
    pitch = mask_pitch = of_all;
    source_pitch.fill(of_all);
  }
};

using Kernel = void (*)(const Block&) noexcept;

// Reduces each row of a to one float, in the order that opcodes.def declares; to[r] is row r's.
using RowReduction = void (*)(const float* a, std::ptrdiff_t pitch, std::uint32_t rows, std::uint32_t columns,
                              float* to) noexcept;

enum class Reduction : std::uint8_t { kSum, kMin, kMax, kCount };
inline constexpr std::size_t kReductionCount = 4;

inline constexpr std::size_t kOpcodeCount = 0
#define APRON_OP(name, mnemonic, signature, locality, text) +1
#include "apron/program/opcodes.def"
    ;

struct KernelTable {
  // [opcode][bit k set: operand k is a scalar][masked]; null for what is not element-wise
  std::array<std::array<std::array<Kernel, 2>, 8>, kOpcodeCount> elementwise{};
  std::array<RowReduction, kReductionCount> reductions{};

  Kernel kernel(program::Opcode op, unsigned scalars, bool masked) const noexcept {
    return elementwise[static_cast<std::size_t>(op)][scalars][masked ? 1 : 0];
  }
  RowReduction reduction(Reduction r) const noexcept { return reductions[static_cast<std::size_t>(r)]; }
};

// The table for the best instruction set of this CPU.
const KernelTable& kernel_table();

struct NamedKernelTable {
  std::string_view name;
  const KernelTable* table;
};
// Those of every instruction set that this CPU has; for tests and benchmarks.
std::vector<NamedKernelTable> kernel_tables();

}  // namespace apron::vm
