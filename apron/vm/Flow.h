// What can be known about a program before it runs, for fusing it: where control can come from, which edge
// rule is in force, which registers are still read.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "apron/program/Program.h"
#include "apron/vm/Shift.h"

namespace apron::vm {

class Flow {
 public:
  // The program must be verified; it must outlive this. keep_registers: the registers that the user named are
  // read at every moment, for somebody may look at them.
  Flow(const program::Program& program, bool keep_registers);

  // Whether control can come here from elsewhere than the instruction before.
  bool is_target(std::size_t at) const { return target_[at]; }
  // The edge rule in force when control comes here; nothing if it depends on the way there.
  const std::optional<Edge>& edge(std::size_t at) const { return edge_[at]; }
  // Whether a register's value at this moment can still be read.
  bool live(std::size_t at, std::uint32_t reg) const;
  // Every shift of the program fills in zero.
  bool only_zero_edges() const { return only_zero_edges_; }
  bool has_masks() const { return has_masks_; }
  // No instruction changes the filter's elements.
  bool fixed_filter(std::uint32_t filter) const { return !filter_set_[filter]; }

  // Calls go(next) for every instruction that may come after the one at `at`.
  template <class Go>
  void successors(std::size_t at, const Go& go) const {
    const program::Instruction& in = program_.code[at];
    if (in.op == program::Opcode::kReturn)
      for (const std::uint32_t to : returns_to_) go(to);
    for (const program::Operand& operand : in.operands)
      if (operand.kind == program::OperandKind::kLabel) go(operand.index);
    if (!ends_flow(in.op) && at + 1 < program_.code.size()) go(at + 1);
  }

 private:
  static bool ends_flow(program::Opcode op) {
    return op == program::Opcode::kJump || op == program::Opcode::kReturn || op == program::Opcode::kEnd;
  }
  void find_targets();
  void find_edges();
  void find_live(bool keep_registers);
  bool live_pass(std::size_t words, const std::vector<std::uint64_t>& always);

  const program::Program& program_;
  std::vector<bool> target_;
  std::vector<std::uint32_t> returns_to_;  // after each call
  std::vector<std::optional<Edge>> edge_;
  std::vector<std::uint64_t> live_;  // a bit a register, words() words an instruction; empty: all are
  bool only_zero_edges_ = true;
  bool has_masks_ = false;
  std::vector<bool> filter_set_;
};

}  // namespace apron::vm
