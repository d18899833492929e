// Operations fused into one loop over rows, the rows that they read and write, and one call of the loop.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "apron/program/Program.h"
#include "apron/program/ScalarArithmetic.h"
#include "apron/vm/Plane.h"

namespace apron::vm {

// Storage for the rows of one value.
struct RowBuffer {
  enum class Kind : std::uint8_t {
    kRegister,        // input: a register at entry
    kMask,            // input: the mask in force at entry
    kColumnIndex,     // input: column indices, one row shared by all
    kRowIndex,        // input: row indices
    kInPlace,         // output: the register's own rows
    kDoubleBuffered,  // output: the register's back buffer, exchanged at the end of the trace
    kRing,            // intermediate: private to a worker, row r at r mod ring_rows
  };
  Kind kind = Kind::kRing;
  std::uint32_t reg = 0;          // of kRegister, kInPlace and kDoubleBuffered
  std::uint32_t ring_rows = 0;    // of kRing
  std::uint32_t pad_columns = 0;  // columns read beyond the west and east edge
  // The number of constant rows beyond the north and south edge of a kRing that holds every row.
  std::uint32_t margin_rows = 0;
  std::size_t offset = 0;  // cells from the start of the worker's memory to row 0 of a kRing
};

// The rows that a stage reads or writes: row r + dy of a buffer when computing row r.
struct RowStream {
  std::uint32_t buffer = 0;
  std::int8_t dy = 0;
  auto operator<=>(const RowStream&) const = default;
};

struct MicroOperand {
  enum class Kind : std::uint8_t { kNone, kTemp, kStream, kScalar };
  Kind kind = Kind::kNone;
  std::int8_t dx = 0;       // kStream
  std::uint32_t index = 0;  // of an earlier operation of the stage, a stream or a scalar slot
  auto operator<=>(const MicroOperand&) const = default;
};

struct MicroOp {
  program::Opcode op = program::Opcode::kCopy;
  std::array<MicroOperand, program::kMaxOperands> operands{};
  std::int64_t immediate = -1;  // of a bit shift: its distance, if that is a literal
};

// Operations fused into one loop over rows. All results are written after all operations have read.
struct Stage {
  CellType type = CellType::kFloat32;
  std::vector<RowStream> streams;
  std::vector<MicroOp> ops;
  struct Result {
    std::uint32_t op = 0, stream = 0;
    bool non_temporal = false;  // bypasses the caches
  };
  std::vector<Result> results;           // their streams have dy == 0
  std::uint32_t skew = 0;                // rows behind the first stage
  std::uint32_t halo_x = 0, halo_y = 0;  // columns and rows computed beyond the strip's and slice's own
};

inline constexpr std::size_t kMaxStreams = 10;  // per stage

// True if an operation of this opcode may share a stage with others.
inline bool is_fusible_opcode(program::Opcode op) noexcept {
  return op < program::Opcode::kRound && !program::is_mathematics(op);
}

inline constexpr std::size_t kMaxRowStreams = 14;

// One call of a stage, generated or interpreted: a rectangle of cells, processed in iterations of one or more
// rows. Rows are 64-byte aligned; columns up to the next multiple of 64 bytes may be read and written.
struct StageCall {
  std::array<std::byte*, kMaxRowStreams> row_start{};           // first cell of each stream's first row
  std::array<std::ptrdiff_t, kMaxRowStreams> row_step_bytes{};  // to the same row of the next iteration
  std::int64_t iterations = 0;
  std::int64_t row_bytes = 0;  // columns rounded up to 64 bytes
  // The bits of the scalars: of a float, or those of an integer as often as 32 bits hold them.
  const std::uint32_t* scalar_slots = nullptr;
};

}  // namespace apron::vm
