// Executes one stage of a plan over a rectangle of cells: as generated code where the CPU has AVX-512,
// otherwise interpreted, operation by operation, over tiles that stay in the first-level cache. Both give the
// same bits.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "apron/vm/fusion/FusionPlan.h"
#include "apron/vm/kernels/Kernels.h"

namespace apron::vm {

// The rectangle, turn by turn of one or more rows: for each line (a row that a turn reads or writes) its
// first cell and the distance to the next turn's. Rows begin on 64 bytes; columns up to the next multiple of
// kLanes may be read and written.
inline constexpr std::size_t kMaxRowStreams = 14;
struct StageCall {
  std::array<float*, kMaxRowStreams> row_start{};
  std::array<std::ptrdiff_t, kMaxRowStreams> row_step_bytes{};
  std::int64_t iterations = 0;
  std::int64_t row_bytes = 0;           // columns rounded up to kLanes, in bytes
  const float* scalar_slots = nullptr;  // of the scalars
};

// Machine code of one stage.
class StageJit {
 public:
  struct CompiledLoop {
    std::uint32_t rows_per_iteration = 1;  // of a turn
    std::vector<RowStream> row_streams;    // dy: from the turn's first row
    void (*run)(const StageCall*) = nullptr;
    std::shared_ptr<const void> code_memory;  // that the code lies in
  };

  // Nothing where the CPU, the library or the stage does not allow it.
  // vectors: the vectors of kLanes columns in every row it will be called for are a multiple of this.
  // rows: of a turn, where it pays; at least 1.
  static std::optional<StageJit> compile(const Stage& stage, std::uint32_t vectors, std::uint32_t rows);

  // The one with the most rows to a turn that so many rows have. rows: at least 1.
  const CompiledLoop& loop_for(std::int64_t rows) const noexcept {
    return loops_.front().rows_per_iteration <= rows ? loops_.front() : loops_.back();
  }

 private:
  std::vector<CompiledLoop> loops_;  // the last one takes one row
};

// The stage by means of the kernel table. A turn is one row, its lines are the stage's streams.
class StageInterpreter {
 public:
  StageInterpreter(const Stage& stage, const std::vector<RowBuffer>& buffers, const KernelTable& kernels);

  // tile: scratch_floats() floats, aligned to 64 bytes.
  void run(const StageCall& call, float* scratch) const noexcept;
  std::size_t scratch_floats() const noexcept { return scratch_slots_ * kTileCells; }

 private:
  static constexpr std::size_t kTileCells = 2048;
  static constexpr std::uint32_t kUnassigned = UINT32_MAX;
  struct ScratchOp {
    Kernel kernel = nullptr;
    std::array<MicroOperand, program::kMaxOperands> args{};
    std::uint32_t scratch_slot = kUnassigned;  // in the scratch, or
    std::uint32_t stream = kUnassigned;        // written where it belongs at once
  };
  struct Tile;
  void run_tile(const StageCall& call, const Tile& at, float* scratch) const noexcept;

  std::vector<ScratchOp> ops_;
  std::vector<Stage::Result> deferred_copies_;  // results that are written from the scratch at the end
  Kernel copy_kernel_;
  std::size_t scratch_slots_ = 0;
};

}  // namespace apron::vm
