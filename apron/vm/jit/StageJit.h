// Generated machine code of one stage of a plan, for AVX-512 and AVX2; see fusion/StageInterpreter.h for
// other CPUs. All give the same bits.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "apron/vm/InstructionSet.h"
#include "apron/vm/Stage.h"

namespace apron::vm {

// Generated machine code of one stage.
class StageJit {
 public:
  struct CompiledLoop {
    std::uint32_t rows_per_iteration = 1;
    std::vector<RowStream> row_streams;  // dy is relative to the iteration's first row
    void (*run)(const StageCall*) = nullptr;
    std::shared_ptr<const void> code_memory;  // owns the code of `run`
  };

  // Returns nullopt if the instruction set, the build or the stage does not support code generation. The CPU
  // must support `isa`. The number of columns per row must be a multiple of `vectors` times kLanes in every
  // call. `rows` is the maximum number of rows per iteration, at least 1.
  static std::optional<StageJit> compile(const Stage& stage, InstructionSet isa, std::uint32_t vectors,
                                         std::uint32_t rows);

  // The loop with the most rows per iteration, at most `rows`. rows must be at least 1.
  const CompiledLoop& loop_for(std::int64_t rows) const noexcept {
    return loops_.front().rows_per_iteration <= rows ? loops_.front() : loops_.back();
  }

 private:
  std::vector<CompiledLoop> loops_;  // one or two; the last has one row per iteration
};

}  // namespace apron::vm
