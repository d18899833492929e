#include "apron/program/Program.h"

namespace apron::program {
namespace {

constexpr OpcodeInfo kTable[] = {
#define APRON_OP(name, mnemonic, signature, locality, text) {mnemonic, signature, Locality::locality, text},
#include "apron/program/opcodes.def"
};

}  // namespace

const OpcodeInfo& info(Opcode op) noexcept { return kTable[static_cast<std::size_t>(op)]; }
std::size_t opcode_count() noexcept { return std::size(kTable); }

}  // namespace apron::program
