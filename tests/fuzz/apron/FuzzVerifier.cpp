// Fuzzes verifier, disassembler and VM with arbitrary bytes as a compiled program: the verifier refuses the
// program, or it is disassembled and run. Nothing may crash, hang or exhaust memory.
#include "tests/fuzz/apron/ProgramCodec.h"
#include "tests/fuzz/apron/RunBounded.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > std::size_t{1} << 16) return 0;
  apron::program::Program program = fuzz::decode(data, size);
  if (!apron::program::verify(program).empty()) return 0;
  apron::program::disassemble(program);
  fuzz::run_bounded(std::move(program));
  return 0;
}
