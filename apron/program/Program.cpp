#include "apron/program/Program.h"

namespace apron::program {
namespace {

constexpr OpcodeInfo kOpcodeTable[] = {
#define APRON_OP(name, mnemonic, signature, locality, text) {mnemonic, signature, Locality::locality, text},
#include "apron/program/opcodes.def"
};

}  // namespace

const OpcodeInfo& opcode_info(Opcode op) noexcept { return kOpcodeTable[static_cast<std::size_t>(op)]; }
bool requires_out_of_place(Opcode op) noexcept {
  return op == Opcode::kShift || op == Opcode::kRotate ||
         (op >= Opcode::kNearSum && op <= Opcode::kNearAll) || op == Opcode::kFilterDo ||
         op == Opcode::kFlood || op == Opcode::kDistance || op == Opcode::kSpreadMax;
}

std::size_t opcode_count() noexcept { return std::size(kOpcodeTable); }

}  // namespace apron::program
