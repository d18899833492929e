#include "apron/vm/fusion/StageInterpreter.h"

#include <algorithm>
#include <bit>

#include "apron/vm/PlaneStore.h"

namespace apron::vm {

using program::Opcode;

struct StageInterpreter::Tile {
  std::int64_t row = 0, rows = 0, column = 0, columns = 0;

  std::ptrdiff_t cell_bytes = sizeof(float);

  float* cell(const StageCall& call, std::uint32_t stream, std::ptrdiff_t dx = 0) const {
    return reinterpret_cast<float*>(call.row_start[stream] + row * call.row_step_bytes[stream] +
                                    (column + dx) * cell_bytes);
  }
  std::ptrdiff_t pitch(const StageCall& call, std::uint32_t stream) const {
    return call.row_step_bytes[stream] / cell_bytes;
  }
};

StageInterpreter::StageInterpreter(const Stage& stage, const std::vector<RowBuffer>& buffers,
                                   const KernelTable& kernels)
    : type_(stage.type), copy_kernel_(kernels.kernel(Opcode::kCopy, 0, false, stage.type)) {
  // Select the kernels and find the last use of each intermediate value.
  std::vector<std::size_t> last_use(stage.ops.size());
  for (std::size_t i = 0; i < stage.ops.size(); ++i) {
    ScratchOp op;
    unsigned scalars = 0;
    for (std::size_t k = 0; k < op.args.size(); ++k) {
      op.args[k] = stage.ops[i].operands[k];
      if (op.args[k].kind == MicroOperand::Kind::kScalar) scalars |= 1U << k;
      if (op.args[k].kind == MicroOperand::Kind::kTemp) last_use[op.args[k].index] = i;
    }
    op.kernel = kernels.kernel(stage.ops[i].op, scalars, false, stage.type);
    ops_.push_back(op);
  }
  // Write results directly where no operation reads the old rows; copy the others at the end.
  for (const Stage::Result& result : stage.results) {
    // A ring shared with another buffer may be read until the last operation is done.
    const RowBuffer& to = buffers[stage.streams[result.stream].buffer];
    const bool shared = std::ranges::any_of(stage.streams, [&](const RowStream& other) {
      const RowBuffer& store = buffers[other.buffer];
      return &store != &to && store.kind == RowBuffer::Kind::kRing && store.offset == to.offset;
    });
    const bool written_directly =
        to.kind == RowBuffer::Kind::kDoubleBuffered || (to.kind == RowBuffer::Kind::kRing && !shared);
    if (written_directly && ops_[result.op].stream == kUnassigned) {
      ops_[result.op].stream = result.stream;
    } else {
      deferred_copies_.push_back(result);
      last_use[result.op] = stage.ops.size();
    }
  }
  // Assign scratch slots to the remaining values by linear scan.
  std::vector<std::size_t> free_after;  // indexed by scratch slot: last use of its current value
  for (std::size_t i = 0; i < ops_.size(); ++i) {
    if (ops_[i].stream != kUnassigned) continue;
    const auto slot = std::ranges::find_if(free_after, [&](std::size_t use) { return use <= i; });
    ops_[i].scratch_slot = static_cast<std::uint32_t>(slot - free_after.begin());
    if (slot == free_after.end())
      free_after.push_back(last_use[i]);
    else
      *slot = last_use[i];
  }
  scratch_slots_ = free_after.size();
}

void StageInterpreter::run(const StageCall& call, float* scratch) const noexcept {
  const auto cell_bytes = static_cast<std::ptrdiff_t>(program::cell_bytes(type_));
  const std::int64_t columns = call.row_bytes / cell_bytes;
  constexpr auto kCells = static_cast<std::int64_t>(kTileCells);
  const std::int64_t rows_at_once = std::max<std::int64_t>(1, kCells / columns);
  for (std::int64_t row = 0; row < call.iterations; row += rows_at_once)
    for (std::int64_t column = 0; column < columns; column += kCells)
      run_tile(call,
               {row, std::min(rows_at_once, call.iterations - row), column,
                std::min(kCells, columns - column), cell_bytes},
               scratch);
}

void StageInterpreter::run_tile(const StageCall& call, const Tile& at, float* scratch) const noexcept {
  Block block;
  block.rows = static_cast<std::uint32_t>(at.rows);
  block.columns = static_cast<std::uint32_t>(at.columns);
  const auto place = [&](const ScratchOp& op) {
    return op.stream != kUnassigned ? at.cell(call, op.stream) : scratch + op.scratch_slot * kTileCells;
  };
  const auto pitch = [&](const ScratchOp& op) {
    return op.stream != kUnassigned ? at.pitch(call, op.stream) : at.columns;
  };
  for (const ScratchOp& op : ops_) {
    for (std::size_t k = 0; k < op.args.size(); ++k) {
      const MicroOperand& arg = op.args[k];
      block.source[k] = nullptr;
      if (arg.kind == MicroOperand::Kind::kScalar) {
        block.scalar[k] = std::bit_cast<float>(call.scalar_slots[arg.index]);
        block.integer[k] = std::bit_cast<std::int32_t>(call.scalar_slots[arg.index]);
      }
      if (arg.kind == MicroOperand::Kind::kTemp) {
        block.source[k] = place(ops_[arg.index]);
        block.source_pitch[k] = pitch(ops_[arg.index]);
      } else if (arg.kind == MicroOperand::Kind::kStream) {
        block.source[k] = at.cell(call, arg.index, arg.dx);
        block.source_pitch[k] = at.pitch(call, arg.index);
      }
    }
    block.y = place(op);
    block.pitch = pitch(op);
    op.kernel(block);
  }
  for (const Stage::Result& result : deferred_copies_) {
    block.y = at.cell(call, result.stream);
    block.pitch = at.pitch(call, result.stream);
    block.source[0] = place(ops_[result.op]);
    block.source_pitch[0] = pitch(ops_[result.op]);
    copy_kernel_(block);
  }
}

}  // namespace apron::vm
