// The segments of a program, by the instruction where they begin.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "apron/vm/Flow.h"
#include "apron/vm/MaskStack.h"
#include "apron/vm/Segment.h"

namespace apron::vm {

struct FuseOptions {
  bool on = true;              // off: one instruction at a time
  bool keep_registers = true;  // off: registers that the program does not read again need not be up to date
  bool jit = true;
  std::uint32_t strip_columns = 0, block_rows = 0;  // of a tile; 0: chosen
  std::uint32_t rows_at_once = 0;                   // of machine code; 0: chosen
  unsigned slices = 0;                              // by rows, which threads take; 0: chosen
  std::size_t trace_steps = 400;                    // array instructions of a segment at most
};

class Segments {
 public:
  // Follows every way through the program and compiles what is worth it. Allocates. All arguments but the
  // options must outlive this.
  Segments(const program::Program& program, const std::vector<Step>& steps, Storage& storage,
           Executor& executor, const FuseOptions& options, unsigned threads, std::size_t parallel_cells);

  // What to run at this instruction under these masks instead of its step; null for nothing.
  Segment* at(std::uint32_t instruction, const MaskStack& masks) const noexcept {
    if (entries_.empty()) return nullptr;
    const Entry& entry = entries_[instruction];
    if (masks.active() == MaskStack::Active::kAll) return entry.plain;
    if (entry.masked == nullptr || masks.active() == MaskStack::Active::kNone) return nullptr;
    const ConstPlane& mask = masks.mask();
    return mask.width == entry.masked->width() && mask.height == entry.masked->height() ? entry.masked
                                                                                        : nullptr;
  }

  std::size_t count() const noexcept { return segments_.size(); }

 private:
  struct Entry {
    Segment *plain = nullptr, *masked = nullptr;
  };
  struct Builder;

  std::vector<std::unique_ptr<Segment>> segments_;
  std::vector<Entry> entries_;
  std::vector<Plane> fresh_;  // by register
  PlaneStore store_;
};

}  // namespace apron::vm
