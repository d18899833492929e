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

inline constexpr std::size_t kMaxRowStreams = 14;

// A rectangle of cells, processed in iterations of one or more rows. Rows are 64-byte aligned; columns up to
// the next multiple of kLanes may be read and written.
struct StageCall {
  std::array<float*, kMaxRowStreams> row_start{};               // first cell of each stream's first row
  std::array<std::ptrdiff_t, kMaxRowStreams> row_step_bytes{};  // to the same row of the next iteration
  std::int64_t iterations = 0;
  std::int64_t row_bytes = 0;  // columns rounded up to kLanes, in bytes
  const float* scalar_slots = nullptr;
};

// Generated machine code of one stage.
class StageJit {
 public:
  struct CompiledLoop {
    std::uint32_t rows_per_iteration = 1;
    std::vector<RowStream> row_streams;  // dy is relative to the iteration's first row
    void (*run)(const StageCall*) = nullptr;
    std::shared_ptr<const void> code_memory;  // owns the code of `run`
  };

  // Returns nullopt if the CPU, the build or the stage does not support code generation. The number of
  // vectors (kLanes columns) per row must be a multiple of `vectors` in every call. `rows` is the maximum
  // number of rows per iteration, at least 1.
  static std::optional<StageJit> compile(const Stage& stage, std::uint32_t vectors, std::uint32_t rows);

  // The loop with the most rows per iteration, at most `rows`. rows must be at least 1.
  const CompiledLoop& loop_for(std::int64_t rows) const noexcept {
    return loops_.front().rows_per_iteration <= rows ? loops_.front() : loops_.back();
  }

 private:
  std::vector<CompiledLoop> loops_;  // one or two; the last has one row per iteration
};

// Executes a stage with the kernels of the table. An iteration is one row; the row streams are the stage's
// streams.
class StageInterpreter {
 public:
  StageInterpreter(const Stage& stage, const std::vector<RowBuffer>& buffers, const KernelTable& kernels);

  // `scratch` holds scratch_floats() floats, 64-byte aligned. Does not allocate.
  void run(const StageCall& call, float* scratch) const noexcept;
  std::size_t scratch_floats() const noexcept { return scratch_slots_ * kTileCells; }

 private:
  static constexpr std::size_t kTileCells = 2048;
  static constexpr std::uint32_t kUnassigned = UINT32_MAX;
  struct ScratchOp {
    Kernel kernel = nullptr;
    std::array<MicroOperand, program::kMaxOperands> args{};
    // The result goes either to a scratch slot or directly to a stream.
    std::uint32_t scratch_slot = kUnassigned;
    std::uint32_t stream = kUnassigned;
  };
  struct Tile;
  void run_tile(const StageCall& call, const Tile& at, float* scratch) const noexcept;

  std::vector<ScratchOp> ops_;
  std::vector<Stage::Result> deferred_copies_;  // copied from the scratch after all operations
  Kernel copy_kernel_;
  std::size_t scratch_slots_ = 0;
};

}  // namespace apron::vm
