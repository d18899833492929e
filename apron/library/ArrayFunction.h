// A program as a function: registers in, registers and scalars out. Each call is a run of the program from
// its first instruction, with the result that `apron run` has, to the bit.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apron/library/EmbeddedHost.h"
#include "apron/library/PlaneBlock.h"
#include "apron/program/Program.h"
#include "apron/vm/Vm.h"

namespace apron::library {

// The operands that a program reads from its caller and writes for it, as register and variable indices in
// the order of their declaration. Names that the compiler creates take no part.
struct FunctionSignature {
  std::vector<std::uint32_t> inputs;   // the registers that it never writes
  std::vector<std::uint32_t> needed;   // those of them that it reads
  std::vector<std::uint32_t> outputs;  // those that it writes
  std::vector<std::uint32_t> scalars;
};
FunctionSignature find_signature(const program::Program&);

struct FunctionOptions {
  std::vector<std::uint32_t> results;  // registers that finish() makes available
  unsigned threads = 1;
  vm::InstructionSet isa = vm::best_instruction_set();
  std::optional<std::uint64_t> ticks;  // the run ends after that many surface.step; endless ticks are refused
};

// One thread at a time; its threads end with it. Only the constructor and advance() allocate.
class ArrayFunction {
 public:
  ArrayFunction(program::Program, const FunctionOptions&, EmbeddedHost::Print);

  const program::Program& program() const noexcept { return vm_.program(); }

  // A call: start(), then the inputs, then advance() until it returns false, then the results. Registers that
  // get no input are 0 at the start.
  void start(ParameterValues parameters);
  // The plane that takes an input's cells: rows at its pitch.
  vm::Plane input(std::uint32_t reg);
  // The value must be one of the register's cells.
  void set_input(std::uint32_t reg, double value);
  // An input without a copy; false if it must be copied. The block must last until the call ends.
  bool bind_input(std::uint32_t reg, const PlaneBlock&);
  // After the inputs: the block for a result that is written without a copy; false if it must be copied. The
  // block must last until the call ends, and what an input or another result is bound to is refused.
  bool bind_result(std::uint32_t reg, PlaneBlock&);

  // Executes the next instructions, some tenths of a second. Returns whether to call it again. Throws
  // common::UserError, "file:line: error: …", if the program fails.
  bool advance();

  vm::ConstPlane result(std::uint32_t reg) const noexcept { return vm_.plane(reg); }
  // The result in a block of its own, without a copy.
  SharedBlock take_result(std::uint32_t reg);
  double variable(std::uint32_t index) const noexcept { return vm_.variable(index); }

  // Ends the call: bound blocks are the caller's alone again. Also after an exception.
  void finish() noexcept;

 private:
  struct OwnedBlocks {
    SharedBlock front, back;  // back: null unless the register has a back buffer
  };
  SharedBlock new_block(const vm::ConstPlane& like) const;
  OwnedBlocks& own_blocks(std::uint32_t reg);

  FrameCountingHost host_;
  std::optional<std::uint64_t> ticks_;
  vm::Vm vm_;
  std::vector<std::uint32_t> zeroed_;  // registers whose first cells the program may read
  std::vector<bool> is_written_;       // by register
  std::vector<OwnedBlocks> blocks_;    // by register; empty until take_result() needs them
  std::vector<std::pair<std::uint32_t, vm::Vm::Storage>> bound_;  // registers, and the storage of their own
  std::vector<bool> has_input_;
  std::uint64_t budget_ = 0, ticks_done_ = 0;
};

}  // namespace apron::library
