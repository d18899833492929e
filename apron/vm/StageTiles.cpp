#include <algorithm>

#include "apron/vm/PlaneStore.h"
#include "apron/vm/StageCode.h"

namespace apron::vm {

using program::Opcode;

struct StageTiles::Rectangle {
  std::int64_t row = 0, rows = 0, column = 0, columns = 0;

  float* cell(const StageCall& call, std::uint32_t stream) const {
    return call.first[stream] + row * pitch(call, stream) + column;
  }
  static std::ptrdiff_t pitch(const StageCall& call, std::uint32_t stream) {
    return call.step_bytes[stream] / static_cast<std::ptrdiff_t>(sizeof(float));
  }
};

StageTiles::StageTiles(const Stage& stage, const std::vector<Store>& stores, const KernelTable& kernels)
    : copy_(kernels.kernel(Opcode::kCopy, 0, false)) {
  std::vector<std::size_t> last_use(stage.ops.size());
  for (std::size_t i = 0; i < stage.ops.size(); ++i) {
    Op op;
    unsigned scalars = 0;
    for (std::size_t k = 0; k < op.args.size(); ++k) {
      op.args[k] = stage.ops[i].args[k];
      if (op.args[k].kind == MicroArg::Kind::kScalar) scalars |= 1U << k;
      if (op.args[k].kind == MicroArg::Kind::kTemp) last_use[op.args[k].index] = i;
    }
    op.kernel = kernels.kernel(stage.ops[i].op, scalars, false);
    ops_.push_back(op);
  }
  for (const Stage::Result& result : stage.results) {
    // Rows in whose place others lie may be read until the last operation is done.
    const Store& to = stores[stage.streams[result.stream].store];
    const bool shared = std::any_of(stage.streams.begin(), stage.streams.end(), [&](const Stream& other) {
      const Store& store = stores[other.store];
      return &store != &to && store.kind == Store::Kind::kRing && store.offset == to.offset;
    });
    const bool at_once = to.kind == Store::Kind::kFresh || (to.kind == Store::Kind::kRing && !shared);
    if (at_once && ops_[result.op].stream == kNone) {
      ops_[result.op].stream = result.stream;
    } else {
      copies_.push_back(result);
      last_use[result.op] = stage.ops.size();
    }
  }
  std::vector<std::size_t> free_after;  // by place
  for (std::size_t i = 0; i < ops_.size(); ++i) {
    if (ops_[i].stream != kNone) continue;
    const auto place =
        std::find_if(free_after.begin(), free_after.end(), [&](std::size_t use) { return use <= i; });
    ops_[i].place = static_cast<std::uint32_t>(place - free_after.begin());
    if (place == free_after.end())
      free_after.push_back(last_use[i]);
    else
      *place = last_use[i];
  }
  places_ = free_after.size();
}

void StageTiles::run(const StageCall& call, float* tile) const noexcept {
  const std::int64_t columns = call.row_bytes / static_cast<std::int64_t>(sizeof(float));
  constexpr auto kCells = static_cast<std::int64_t>(kTileCells);
  const std::int64_t rows_at_once = std::max<std::int64_t>(1, kCells / columns);
  for (std::int64_t row = 0; row < call.turns; row += rows_at_once)
    for (std::int64_t column = 0; column < columns; column += kCells)
      run_tile(call,
               {row, std::min(rows_at_once, call.turns - row), column, std::min(kCells, columns - column)},
               tile);
}

void StageTiles::run_tile(const StageCall& call, const Rectangle& at, float* tile) const noexcept {
  Block block;
  block.rows = static_cast<std::uint32_t>(at.rows);
  block.columns = static_cast<std::uint32_t>(at.columns);
  const auto place = [&](const Op& op) {
    return op.stream != kNone ? at.cell(call, op.stream) : tile + op.place * kTileCells;
  };
  const auto pitch = [&](const Op& op) {
    return op.stream != kNone ? Rectangle::pitch(call, op.stream) : at.columns;
  };
  for (const Op& op : ops_) {
    for (std::size_t k = 0; k < op.args.size(); ++k) {
      const MicroArg& arg = op.args[k];
      block.source[k] = nullptr;
      if (arg.kind == MicroArg::Kind::kScalar) block.scalar[k] = call.slots[arg.index];
      if (arg.kind == MicroArg::Kind::kTemp) {
        block.source[k] = place(ops_[arg.index]);
        block.source_pitch[k] = pitch(ops_[arg.index]);
      } else if (arg.kind == MicroArg::Kind::kStream) {
        block.source[k] = at.cell(call, arg.index) + arg.dx;
        block.source_pitch[k] = Rectangle::pitch(call, arg.index);
      }
    }
    block.y = place(op);
    block.pitch = pitch(op);
    op.kernel(block);
  }
  for (const Stage::Result& result : copies_) {
    block.y = at.cell(call, result.stream);
    block.pitch = Rectangle::pitch(call, result.stream);
    block.source[0] = place(ops_[result.op]);
    block.source_pitch[0] = pitch(ops_[result.op]);
    copy_(block);
  }
}

}  // namespace apron::vm
