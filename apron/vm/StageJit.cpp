#include "apron/vm/StageCode.h"

#if defined(__x86_64__) && defined(APRON_HAVE_XBYAK)

#include <xbyak/xbyak_util.h>

#include <algorithm>
#include <set>

#include "apron/vm/StageAssembler.h"
#include "apron/vm/Stages.h"

namespace apron::vm {
namespace {

bool cpu_fits() {
  static const bool kFits = [] {
    const Xbyak::util::Cpu cpu;
    return cpu.has(Xbyak::util::Cpu::tAVX512F) && cpu.has(Xbyak::util::Cpu::tAVX512DQ);
  }();
  return kFits;
}

// Whether rows that follow each other read the same memory.
bool shares_rows(const Stage& stage) {
  std::set<std::uint32_t> stores;
  return std::any_of(stage.streams.begin(), stage.streams.end(),
                     [&](const Stream& stream) { return !stores.insert(stream.store).second; });
}

std::optional<StageJit::Code> assemble(const Stage& stage, std::uint32_t rows, std::uint32_t vectors) {
  try {
    const auto assembler = std::make_shared<StageAssembler>(stage, rows, vectors);
    return StageJit::Code{rows, assembler->lines(), assembler->code(), assembler};
  } catch (const StageAssembler::DoesNotFit&) {
    return std::nullopt;
  } catch (const Xbyak::Error&) {
    return std::nullopt;  // no memory that may be executed
  }
}

}  // namespace

std::optional<StageJit> StageJit::make(const Stage& stage, std::uint32_t vectors, std::uint32_t most) {
  const bool known =
      std::all_of(stage.ops.begin(), stage.ops.end(), [](const MicroOp& op) { return joins_stages(op.op); });
  if (!cpu_fits() || !known) return std::nullopt;
  StageJit jit;
  for (std::uint32_t rows = shares_rows(stage) ? most : 1; rows > 1 && jit.codes_.empty(); rows /= 2)
    if (auto code = assemble(stage, rows, vectors)) jit.codes_.push_back(std::move(*code));
  auto single = assemble(stage, 1, vectors);
  if (!single) return std::nullopt;
  jit.codes_.push_back(std::move(*single));
  return jit;
}

}  // namespace apron::vm

#else

namespace apron::vm {

std::optional<StageJit> StageJit::make(const Stage&, std::uint32_t, std::uint32_t) { return std::nullopt; }

}  // namespace apron::vm

#endif
