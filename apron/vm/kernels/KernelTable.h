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
// and pitch (in cells; a source pitch of 0 repeats one row). y and mask are 64-byte aligned; sources need
// not be. Kernels may read and write columns up to the next multiple of 64 bytes. y may be identical to a
// source or the mask, but must not overlap them otherwise. Integers stand at the same addresses, and the mask
// has the cells of y.
struct Block {
  float* y = nullptr;
  std::array<const float*, program::kMaxOperands> source{};   // null for scalar operands
  std::array<float, program::kMaxOperands> scalar{};          // values of scalar operands
  std::array<std::int32_t, program::kMaxOperands> integer{};  // of integers: the value
  const float* mask = nullptr;  // masked kernels write only where it is non-zero
  std::ptrdiff_t pitch = 0;     // of y
  std::array<std::ptrdiff_t, program::kMaxOperands> source_pitch{};
  std::ptrdiff_t mask_pitch = 0;
  std::uint32_t rows = 0, columns = 0;
  std::uint8_t cell_bytes = sizeof(float), source_bytes = sizeof(float);  // of y and the mask; of the sources

  Block() = default;
  // Over all cells of a plane, whose pitch the sources and the mask share.
  explicit Block(const Plane& plane, const float* mask_cells = nullptr) noexcept
      : y(plane.data), mask(mask_cells), rows(plane.height), columns(plane.width) {
    cell_bytes = source_bytes = static_cast<std::uint8_t>(plane.cell_bytes());
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

// The same of integers, exactly.
using IntegerRowReduction = void (*)(const float* a, std::ptrdiff_t pitch, std::uint32_t rows,
                                     std::uint32_t columns, std::int64_t* to) noexcept;

enum class Reduction : std::uint8_t { kSum, kMin, kMax, kCount };
inline constexpr std::size_t kReductionCount = 4;

inline constexpr std::size_t kOpcodeCount = 0
#define APRON_OP(name, mnemonic, signature, locality, text) +1
#include "apron/program/opcodes.def"
    ;

// Sets bit x % 64 of to[x / 64] if cell x of the row is true (not 0), up to `columns`, and the others of the
// last word to 0. Reads cells up to the next multiple of 64 bytes.
using TruthKernel = void (*)(const std::byte* row, std::uint32_t columns, std::uint64_t* to) noexcept;

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

// The kernels of one type of integers.
struct IntegerKernels {
  // Indexed [opcode][masked]; an operand without a source is a scalar. Null as in KernelTable::elementwise.
  std::array<std::array<Kernel, 2>, kOpcodeCount> elementwise{};
  std::array<IntegerRowReduction, kReductionCount> reductions{};
};

// Rows of one shape of `outputs` planes y, each the sum over the `inputs` planes x of x times a weight, added
// in their order. The weights of kMatrixRows outputs stand together: weights[(k * inputs + j) * kMatrixRows +
// o] is that of output k * kMatrixRows + o and input j. Columns up to the next multiple of 64 bytes are read
// and written.
inline constexpr std::size_t kMatrixRows = 4;
struct MatrixProduct {
  const float* const* x = nullptr;
  float* const* y = nullptr;
  const float* weights = nullptr;
  std::uint32_t inputs = 0, outputs = 0, columns = 0;
  std::ptrdiff_t pitch = 0;     // of all planes
  const float* mask = nullptr;  // of y, or null
};
using MatrixProductKernel = void (*)(const MatrixProduct& product, std::uint32_t first_row,
                                     std::uint32_t last_row) noexcept;

struct KernelTable {
  // Indexed [opcode][bit k set: operand k is a scalar][masked]; null if the opcode is not element-wise.
  std::array<std::array<std::array<Kernel, 2>, 8>, kOpcodeCount> elementwise{};
  std::array<RowReduction, kReductionCount> reductions{};
  std::array<TruthKernel, program::kCellTypeCount> truths{};  // by type of the cells
  StencilKernels stencils{};
  MatrixProductKernel matrix_product = nullptr;
  RandomWordsKernel random_words = nullptr;
  RandomFloatKernel random_uniform = nullptr, random_normal = nullptr;

  std::array<IntegerKernels, program::kCellTypeCount> integers{};  // by type; of float empty
  // Indexed [type of the source][type of y][saturated][masked]; null where both types are one.
  std::array<std::array<std::array<std::array<Kernel, 2>, 2>, program::kCellTypeCount>,
             program::kCellTypeCount>
      conversions{};

  Kernel kernel(program::Opcode op, unsigned scalars, bool masked,
                program::CellType type = program::CellType::kFloat32) const noexcept {
    const auto index = index_of(op);
    return program::is_integer(type) ? integers[index_of(type)].elementwise[index][masked ? 1 : 0]
                                     : elementwise[index][scalars][masked ? 1 : 0];
  }
  Kernel conversion(program::CellType from, program::CellType to, bool saturated,
                    bool masked) const noexcept {
    return conversions[index_of(from)][index_of(to)][saturated ? 1 : 0][masked ? 1 : 0];
  }
  RowReduction reduction(Reduction r) const noexcept { return reductions[static_cast<std::size_t>(r)]; }
};

}  // namespace apron::vm
