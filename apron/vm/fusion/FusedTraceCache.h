// The fused traces of a program, by the instruction at which they begin.
#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "apron/vm/MaskStack.h"
#include "apron/vm/fusion/FlowAnalysis.h"
#include "apron/vm/fusion/FusedTrace.h"

namespace apron::vm {

struct FusionOptions {
  bool enabled = true;  // false executes one instruction at a time
  // All other registers may be out of date where the program does not read them again.
  ObservedRegisters observed{};
  bool enable_jit = true;                           // false interprets the stages
  std::uint32_t strip_columns = 0, block_rows = 0;  // tile size; 0 is automatic
  std::uint32_t rows_per_iteration = 0;             // of generated code; 0 is automatic
  unsigned slices = 0;                              // row ranges distributed over threads; 0 is automatic
  std::size_t max_array_instructions = 400;         // per fused trace
};

class FusedTraceCache {
 public:
  // Follows all paths through the program and compiles their traces, within fixed limits. All arguments
  // except the options must outlive the cache. Allocates; find() does not.
  FusedTraceCache(const program::Program& program, const std::vector<DecodedInstruction>& decoded,
                  RegisterFile& register_file, Executor& executor, InstructionSet isa,
                  const FusionOptions& options, unsigned threads, std::size_t parallel_cells);

  // The fused trace to run at this instruction under these masks, or null to execute the instruction itself.
  FusedTrace* find(std::uint32_t instruction, const MaskStack& masks) const noexcept {
    if (entries_.empty()) return nullptr;
    const Entry& entry = entries_[instruction];
    FusedTrace* trace = masks.active() == MaskStack::Active::kAll    ? entry.unmasked
                        : masks.active() == MaskStack::Active::kNone ? nullptr
                                                                     : entry.masked;
    if (trace == nullptr || !trace->filters_match()) return nullptr;
    const ConstPlane& mask = masks.mask();
    const bool fits =
        trace == entry.unmasked ||
        (mask.type == trace->type() && mask.width == trace->width() && mask.height == trace->height());
    return fits ? trace : nullptr;
  }

  // The buffer that a register exchanges with its own when a trace writes it. bind_back_buffer() requires one
  // and returns the previous one.
  bool has_back_buffer(std::size_t register_index) const noexcept {
    return !back_buffers_.empty() && back_buffers_[register_index].data != nullptr;
  }
  Plane bind_back_buffer(std::size_t register_index, const Plane& plane) noexcept {
    return std::exchange(back_buffers_[register_index], plane);
  }

 private:
  struct Entry {
    FusedTrace *unmasked = nullptr, *masked = nullptr;
  };
  struct Builder;

  std::vector<std::unique_ptr<FusedTrace>> traces_;
  std::vector<Entry> entries_;
  std::vector<Plane> back_buffers_;  // indexed by register
  PlaneStore plane_store_;
};

}  // namespace apron::vm
