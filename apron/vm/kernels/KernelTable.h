// The VM's inner loops, indexed by element-wise opcode, mix of register and scalar operands, and masking.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "apron/program/Program.h"
#include "apron/vm/Plane.h"
#include "apron/vm/kernels/StencilKernels.h"

namespace apron::vm {

// A kernel's arguments: rows x columns cells of y, up to three sources and the mask, each with its own start
// and pitch (in floats; a source pitch of 0 repeats one row). y and mask are 64-byte aligned; sources need
// not be. Kernels may read and write columns up to the next multiple of kLanes. y may be identical to a
// source or the mask, but must not overlap them otherwise.
struct Block {
  float* y = nullptr;
  std::array<const float*, program::kMaxOperands> source{};  // null for scalar operands
  std::array<float, program::kMaxOperands> scalar{};         // values of scalar operands
  const float* mask = nullptr;                               // masked kernels write only where it is non-zero
  std::ptrdiff_t pitch = 0;                                  // of y
  std::array<std::ptrdiff_t, program::kMaxOperands> source_pitch{};
  std::ptrdiff_t mask_pitch = 0;
  std::uint32_t rows = 0, columns = 0;

  Block() = default;
  // Over all cells of a plane, whose pitch the sources and the mask share.
  explicit Block(const Plane& plane, const float* mask_cells = nullptr) noexcept
      : y(plane.data), mask(mask_cells), rows(plane.height), columns(plane.width) {
    set_pitch(plane.pitch);
  }

  void set_pitch(std::ptrdiff_t of_all) noexcept {
    pitch = mask_pitch = of_all;
    source_pitch.fill(of_all);
  }
};

using Kernel = void (*)(const Block&) noexcept;

// Reduces each row r of a to one float, to[r], in the order that opcodes.def specifies.
using RowReduction = void (*)(const float* a, std::ptrdiff_t pitch, std::uint32_t rows, std::uint32_t columns,
                              float* to) noexcept;

enum class Reduction : std::uint8_t { kSum, kMin, kMax, kCount };
inline constexpr std::size_t kReductionCount = 4;

inline constexpr std::size_t kOpcodeCount = 0
#define APRON_OP(name, mnemonic, signature, locality, text) +1
#include "apron/program/opcodes.def"
    ;

// The cells [column, column + count) of a row, count being a multiple of kLanes, and a draw; see Random.h.
struct RandomCells {
  std::uint32_t seed = 0;
  std::uint64_t draw_index = 0;
  std::uint32_t row = 0, column = 0, count = 0;
};
// The first Philox word of each cell.
using RandomWordsKernel = void (*)(const RandomCells& cells, std::uint32_t* to) noexcept;
// The cells' values of random.float.rand or random.float.gauss with operands a and b.
using RandomFloatKernel = void (*)(const RandomCells& cells, float a, float b, float* to) noexcept;

struct KernelTable {
  // Indexed [opcode][bit k set: operand k is a scalar][masked]; null if the opcode is not element-wise.
  std::array<std::array<std::array<Kernel, 2>, 8>, kOpcodeCount> elementwise{};
  std::array<RowReduction, kReductionCount> reductions{};
  StencilKernels stencils{};
  RandomWordsKernel random_words = nullptr;
  RandomFloatKernel random_uniform = nullptr, random_normal = nullptr;

  Kernel kernel(program::Opcode op, unsigned scalars, bool masked) const noexcept {
    return elementwise[static_cast<std::size_t>(op)][scalars][masked ? 1 : 0];
  }
  RowReduction reduction(Reduction r) const noexcept { return reductions[static_cast<std::size_t>(r)]; }
};

}  // namespace apron::vm
