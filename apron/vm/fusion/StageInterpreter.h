// Executes one stage of a plan operation by operation, over tiles that stay in the first-level cache: the
// fallback where no code can be generated, with the same bits.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "apron/vm/fusion/FusionPlan.h"
#include "apron/vm/kernels/KernelTable.h"

namespace apron::vm {

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

  CellType type_;
  std::vector<ScratchOp> ops_;
  std::vector<Stage::Result> deferred_copies_;  // copied from the scratch after all operations
  Kernel copy_kernel_;
  std::size_t scratch_slots_ = 0;
};

}  // namespace apron::vm
