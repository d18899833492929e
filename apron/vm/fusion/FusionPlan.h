// The schedule of a value graph: stages (operations fused into one loop over rows), each skewed by some rows
// against its inputs, in column strips with a halo that neighbouring strips compute twice.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "apron/program/Program.h"
#include "apron/vm/fusion/ValueGraph.h"

namespace apron::vm {

// Where the rows of a value are.
struct RowBuffer {
  enum class Kind : std::uint8_t {
    kRegister,        // as it was at entry
    kMask,            // the mask in force at entry
    kColumnIndex,     // one row for all: the columns' numbers
    kRowIndex,        // the rows' numbers
    kInPlace,         // a register's own rows, written
    kDoubleBuffered,  // rows that become a register's when the segment is through
    kRing,            // `capacity` rows of a worker's own, row r in place r mod capacity
  };
  Kind kind = Kind::kRing;
  std::uint32_t reg = 0;
  std::uint32_t ring_rows = 0;
  std::uint32_t pad_columns = 0;  // columns read beyond its west and east edge
  std::uint32_t margin_rows =
      0;  // kRing with a place for every row: rows of what lies beyond the edge, above and below
  std::size_t offset = 0;  // kRing: of its first row, floats from the start of a worker's memory
};

// The rows that a stage reads or writes, at its own row plus dy.
struct RowStream {
  std::uint32_t buffer = 0;
  std::int8_t dy = 0;
  auto operator<=>(const RowStream&) const = default;
};

struct MicroOperand {
  enum class Kind : std::uint8_t { kNone, kTemp, kStream, kScalar };
  Kind kind = Kind::kNone;
  std::int8_t dx = 0;       // kStream
  std::uint32_t index = 0;  // an earlier operation of the stage, a stream, a scalar slot
  auto operator<=>(const MicroOperand&) const = default;
};

struct MicroOp {
  program::Opcode op = program::Opcode::kCopy;
  std::array<MicroOperand, program::kMaxOperands> operands{};
};

struct Stage {
  std::vector<RowStream> streams;
  std::vector<MicroOp> ops;
  struct Result {
    std::uint32_t op = 0, stream = 0;
    bool non_temporal = false;  // nobody reads it while it would stay there
  };
  std::vector<Result> results;           // written when all operations have read; streams with dy 0
  std::uint32_t skew = 0;                // rows behind the first stage
  std::uint32_t halo_x = 0, halo_y = 0;  // columns and rows needed beyond a strip's or slice's own
};

inline constexpr std::size_t kMaxStreams = 10;  // of a stage
inline constexpr std::size_t kMaxResults = 6;

struct FusionPlanOptions {
  unsigned threads = 1;
  unsigned slices = 0;                   // by rows; 0: chosen
  std::uint32_t strip_columns = 0;       // 0: chosen; else rounded up to whole vectors
  std::uint32_t block_rows = 0;          // 0: chosen
  std::uint32_t rows_per_iteration = 0;  // 0: chosen
};

struct FusionPlan {
  std::uint32_t width = 0, height = 0;
  BoundaryCondition boundary{};
  std::vector<RowBuffer> buffers;
  std::vector<Stage> stages;
  unsigned threads = 1;
  unsigned slices = 1;              // by rows, a multiple of the threads where there are rows enough
  std::uint32_t strip_columns = 0;  // a multiple of 16, or the whole width
  std::uint32_t block_rows = 0;
  std::uint32_t rows_per_iteration = 1;  // that machine code may compute together
  std::uint32_t ring_halo = 0;           // columns beyond a strip's own in the rings, a multiple of 16
  std::uint32_t ring_pitch = 0;          // floats from one row of a ring to the next
  std::size_t worker_floats = 0;         // memory of a worker for all rings
  std::uint32_t max_skew = 0;            // the largest
};

FusionPlan make_fusion_plan(const ValueGraph& graph, std::uint32_t width, std::uint32_t height,
                            const FusionPlanOptions& options);

}  // namespace apron::vm
