// Runs one stage of a plan over a rectangle of cells: as machine code made for it where the CPU has AVX-512,
// else operation by operation over tiles that stay in the first-level cache. Both give the same bits.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "apron/vm/Kernels.h"
#include "apron/vm/Plan.h"

namespace apron::vm {

// The rectangle: for each stream its first cell and the distance of its rows. Rows begin on 64 bytes (streams
// that are read with dx too); columns up to the next multiple of kLanes may be read and written.
struct StageCall {
  std::array<float*, kMaxStreams> first{};
  std::array<std::ptrdiff_t, kMaxStreams> pitch_bytes{};
  std::int64_t rows = 0;
  std::int64_t row_bytes = 0;    // columns rounded up to kLanes, in bytes
  const float* slots = nullptr;  // of the scalars
};

// Machine code of one stage. Owns its memory.
class StageJit {
 public:
  virtual ~StageJit() = default;
  // Null where the CPU, the library or the stage does not allow it.
  // vectors: the vectors of kLanes columns in every row it will be called for are a multiple of this.
  static std::unique_ptr<StageJit> make(const Stage& stage, std::uint32_t vectors);

  void run(const StageCall& call) const noexcept { code_(&call); }

 protected:
  void (*code_)(const StageCall*) = nullptr;
};

// The stage by means of the kernel table.
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
