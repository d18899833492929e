#include "apron/vm/jit/StageJit.h"

#if defined(__x86_64__) && defined(APRON_HAVE_XBYAK)

#include <algorithm>
#include <set>

#include "apron/vm/jit/StageAssembler.h"

namespace apron::vm {
namespace {

// True if successive rows read the same memory, so that computing several per iteration saves loads.
bool has_row_reuse(const Stage& stage) {
  std::set<std::uint32_t> stores;
  return std::ranges::any_of(stage.streams,
                             [&](const RowStream& stream) { return !stores.insert(stream.buffer).second; });
}

std::optional<StageJit::CompiledLoop> assemble(const Stage& stage, InstructionSet isa, std::uint32_t rows,
                                               std::uint32_t vectors) {
  try {
    const auto assembler = std::make_shared<StageAssembler>(stage, isa, rows, vectors);
    return StageJit::CompiledLoop{rows, assembler->row_streams(), assembler->entry_point(), assembler};
  } catch (const StageAssembler::CannotCompile&) {
    return std::nullopt;
  } catch (const Xbyak::Error&) {
    return std::nullopt;  // no executable memory
  }
}

}  // namespace

std::optional<StageJit> StageJit::compile(const Stage& stage, InstructionSet isa, std::uint32_t vectors,
                                          std::uint32_t max_rows_per_iteration) {
  const bool supported =
      std::ranges::all_of(stage.ops, [](const MicroOp& op) { return is_fusible_opcode(op.op); });
  if (isa == InstructionSet::kPortable || !supported) return std::nullopt;
  StageJit jit;
  for (std::uint32_t rows = has_row_reuse(stage) ? max_rows_per_iteration : 1; rows > 1 && jit.loops_.empty();
       rows /= 2)
    if (auto code = assemble(stage, isa, rows, vectors)) jit.loops_.push_back(std::move(*code));
  auto single = assemble(stage, isa, 1, vectors);
  if (!single) return std::nullopt;
  jit.loops_.push_back(std::move(*single));
  return jit;
}

}  // namespace apron::vm

#else

namespace apron::vm {

std::optional<StageJit> StageJit::compile(const Stage&, InstructionSet, std::uint32_t, std::uint32_t) {
  return std::nullopt;
}

}  // namespace apron::vm

#endif
