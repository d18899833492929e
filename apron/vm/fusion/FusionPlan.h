// The schedule of a value graph: stages (operations fused into one loop over rows), each skewed by some rows
// against its inputs, in column strips with a halo that neighbouring strips compute twice.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "apron/program/Program.h"
#include "apron/vm/fusion/ValueGraph.h"

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
  std::size_t offset = 0;  // floats from the start of the worker's memory to row 0 of a kRing
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
};

// Operations fused into one loop over rows. All results are written after all operations have read.
struct Stage {
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

struct FusionPlanOptions {
  unsigned threads = 1;
  // 0 is automatic for each of these.
  unsigned slices = 0;
  std::uint32_t strip_columns = 0;  // rounded up to whole vectors
  std::uint32_t block_rows = 0;
  std::uint32_t rows_per_iteration = 0;
};

// The array is divided into slices of rows, which threads take; each slice into strips of columns; each strip
// into blocks of rows, for each of which all stages run in order. Under the boundary rule wrap, a slice's
// halo continues beyond the north and south edge with the rows of the opposite side, and there is one strip.
struct FusionPlan {
  std::uint32_t width = 0, height = 0;
  BoundaryCondition boundary{};
  std::vector<RowBuffer> buffers;
  std::vector<Stage> stages;
  unsigned threads = 1;
  unsigned slices = 1;              // a multiple of the threads if there are enough rows
  std::uint32_t strip_columns = 0;  // a multiple of kLanes, or the whole width
  std::uint32_t block_rows = 0;
  std::uint32_t rows_per_iteration = 1;  // upper limit for generated code
  std::uint32_t ring_halo = 0;           // columns of the rings beyond a strip's own, a multiple of kLanes
  std::uint32_t ring_pitch = 0;          // floats between rows of a ring
  std::size_t worker_floats = 0;         // size of one worker's rings
};

// Schedules the graph over arrays of width x height. Allocates.
FusionPlan make_fusion_plan(const ValueGraph& graph, std::uint32_t width, std::uint32_t height,
                            const FusionPlanOptions& options);

}  // namespace apron::vm
