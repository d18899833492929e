// Runs one stage of a plan over a rectangle of cells: as machine code made for it where the CPU has AVX-512,
// else operation by operation over tiles that stay in the first-level cache. Both give the same bits.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "apron/vm/Kernels.h"
#include "apron/vm/Plan.h"

namespace apron::vm {

// The rectangle, turn by turn of one or more rows: for each line (a row that a turn reads or writes) its
// first cell and the distance to the next turn's. Rows begin on 64 bytes; columns up to the next multiple of
// kLanes may be read and written.
inline constexpr std::size_t kMaxLines = 14;
struct StageCall {
  std::array<float*, kMaxLines> first{};
  std::array<std::ptrdiff_t, kMaxLines> step_bytes{};
  std::int64_t turns = 0;
  std::int64_t row_bytes = 0;    // columns rounded up to kLanes, in bytes
  const float* slots = nullptr;  // of the scalars
};

// Machine code of one stage.
class StageJit {
 public:
  struct Code {
    std::uint32_t rows = 1;     // of a turn
    std::vector<Stream> lines;  // dy: from the turn's first row
    void (*run)(const StageCall*) = nullptr;
    std::shared_ptr<const void> memory;  // that the code lies in
  };

  // Nothing where the CPU, the library or the stage does not allow it.
  // vectors: the vectors of kLanes columns in every row it will be called for are a multiple of this.
  // rows: of a turn, where it pays; at least 1.
  static std::optional<StageJit> make(const Stage& stage, std::uint32_t vectors, std::uint32_t rows);

  // The one with the most rows to a turn that so many rows have. rows: at least 1.
  const Code& code(std::int64_t rows) const noexcept {
    return codes_.front().rows <= rows ? codes_.front() : codes_.back();
  }

 private:
  std::vector<Code> codes_;  // the last one takes one row
};

// The stage by means of the kernel table. A turn is one row, its lines are the stage's streams.
class StageTiles {
 public:
  StageTiles(const Stage& stage, const std::vector<Store>& stores, const KernelTable& kernels);

  // tile: scratch_floats() floats, aligned to 64 bytes.
  void run(const StageCall& call, float* tile) const noexcept;
  std::size_t scratch_floats() const noexcept { return places_ * kTileCells; }

 private:
  static constexpr std::size_t kTileCells = 2048;
  static constexpr std::uint32_t kNone = UINT32_MAX;
  struct Op {
    Kernel kernel = nullptr;
    std::array<MicroArg, program::kMaxSources> args{};
    std::uint32_t place = kNone;   // in the scratch, or
    std::uint32_t stream = kNone;  // written where it belongs at once
  };
  struct Rectangle;
  void run_tile(const StageCall& call, const Rectangle& at, float* tile) const noexcept;

  std::vector<Op> ops_;
  std::vector<Stage::Result> copies_;  // results that are written from the scratch at the end
  Kernel copy_;
  std::size_t places_ = 0;
};

}  // namespace apron::vm
