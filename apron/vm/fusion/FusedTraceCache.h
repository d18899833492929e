// The fused traces of a program, by the instruction at which they begin.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "apron/vm/MaskStack.h"
#include "apron/vm/fusion/FlowAnalysis.h"
#include "apron/vm/fusion/FusedTrace.h"

namespace apron::vm {

struct FusionOptions {
  bool enabled = true;  // off: one instruction at a time
  bool preserve_named_registers =
      true;  // off: registers that the program does not read again need not be up to date
  bool enable_jit = true;
  std::uint32_t strip_columns = 0, block_rows = 0;  // of a tile; 0: chosen
  std::uint32_t rows_per_iteration = 0;             // of machine code; 0: chosen
  unsigned slices = 0;                              // by rows, which threads take; 0: chosen
  std::size_t max_array_instructions = 400;         // array instructions of a segment at most
};

class FusedTraceCache {
 public:
  // Follows every way through the program and compiles what is worth it. Allocates. All arguments but the
  // options must outlive this.
  FusedTraceCache(const program::Program& program, const std::vector<DecodedInstruction>& decoded,
                  RegisterFile& register_file, Executor& executor, const FusionOptions& options,
                  unsigned threads, std::size_t parallel_cells);

  // What to run at this instruction under these masks instead of its step; null for nothing.
  FusedTrace* find(std::uint32_t instruction, const MaskStack& masks) const noexcept {
    if (entries_.empty()) return nullptr;
    const Entry& entry = entries_[instruction];
    if (masks.active() == MaskStack::Active::kAll) return entry.unmasked;
    if (entry.masked == nullptr || masks.active() == MaskStack::Active::kNone) return nullptr;
    const ConstPlane& mask = masks.mask();
    return mask.width == entry.masked->width() && mask.height == entry.masked->height() ? entry.masked
                                                                                        : nullptr;
  }

  std::size_t size() const noexcept { return traces_.size(); }

 private:
  struct Entry {
    FusedTrace *unmasked = nullptr, *masked = nullptr;
  };
  struct Builder;

  std::vector<std::unique_ptr<FusedTrace>> traces_;
  std::vector<Entry> entries_;
  std::vector<Plane> back_buffers_;  // by register
  PlaneStore plane_store_;
};

}  // namespace apron::vm
