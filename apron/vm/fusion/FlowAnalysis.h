// Static analysis for fusion: possible predecessors, the boundary condition in force, and register liveness.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "apron/program/Program.h"
#include "apron/vm/kernels/Shift.h"

namespace apron::vm {

class FlowAnalysis {
 public:
  // The program must be verified; it must outlive this. keep_registers: the registers that the user named are
  // read at every moment, for somebody may look at them.
  FlowAnalysis(const program::Program& program, bool preserve_named_registers);

  // Whether control can come here from elsewhere than the instruction before.
  bool is_branch_target(std::size_t at) const { return branch_targets_[at]; }
  // The edge rule in force when control comes here; nothing if it depends on the way there.
  const std::optional<BoundaryCondition>& boundary_at(std::size_t at) const { return boundary_[at]; }
  // Whether a register's value at this moment can still be read.
  bool is_live(std::size_t at, std::uint32_t reg) const;
  // Every shift of the program fills in zero.
  bool has_only_zero_boundaries() const { return has_only_zero_boundaries_; }
  bool has_masks() const { return has_masks_; }
  // No instruction changes the filter's elements.
  bool is_constant_filter(std::uint32_t filter) const { return !filter_modified_[filter]; }

  // Calls go(next) for every instruction that may come after the one at `at`.
  template <class Go>
  void for_each_successor(std::size_t at, const Go& visit) const {
    const program::Instruction& in = program_.code[at];
    if (in.op == program::Opcode::kReturn)
      for (const std::uint32_t to : return_sites_) visit(to);
    for (const program::Operand& operand : in.operands)
      if (operand.kind == program::OperandKind::kLabel) visit(operand.index);
    if (!ends_control_flow(in.op) && at + 1 < program_.code.size()) visit(at + 1);
  }

 private:
  static bool ends_control_flow(program::Opcode op) {
    return op == program::Opcode::kJump || op == program::Opcode::kReturn || op == program::Opcode::kEnd;
  }
  void find_branch_targets();
  void compute_boundaries();
  void compute_liveness(bool preserve_named_registers);
  bool liveness_pass(std::size_t words, const std::vector<std::uint64_t>& always_live);

  const program::Program& program_;
  std::vector<bool> branch_targets_;
  std::vector<std::uint32_t> return_sites_;  // after each call
  std::vector<std::optional<BoundaryCondition>> boundary_;
  std::vector<std::uint64_t> live_bits_;  // a bit a register, words() words an instruction; empty: all are
  bool has_only_zero_boundaries_ = true;
  bool has_masks_ = false;
  std::vector<bool> filter_modified_;
};

}  // namespace apron::vm
