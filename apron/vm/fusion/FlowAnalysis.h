// Static analysis for fusion: possible predecessors, the boundary condition in force, and register liveness.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "apron/program/Program.h"
#include "apron/vm/kernels/Shift.h"

namespace apron::vm {

// The registers whose cells are read from outside of the program, which keeps their values alive.
struct ObservedRegisters {
  // All that the user named, at any time; local names of macros and functions, in their bodies.
  bool all_named = true;
  std::vector<std::uint32_t> any_time;  // these, at any time
  // These, when the program ends or completes a surface.step, and unless it fails.
  std::vector<std::uint32_t> at_end;
};

class FlowAnalysis {
 public:
  // The program must be verified and must outlive this object. Allocates.
  FlowAnalysis(const program::Program& program, const ObservedRegisters& observed);

  // True if an instruction other than the preceding one may transfer control to `at`.
  bool is_branch_target(std::size_t at) const { return branch_targets_[at]; }
  // The boundary condition in force before instruction `at`; nullopt if it depends on the path.
  const std::optional<BoundaryCondition>& boundary_at(std::size_t at) const { return boundary_[at]; }
  // True if the value that register `reg` holds before instruction `at` may still be read.
  bool is_live(std::size_t at, std::uint32_t reg) const;
  // True if no instruction of the program sets a boundary rule other than zero.
  bool has_only_zero_boundaries() const { return has_only_zero_boundaries_; }
  bool has_masks() const { return has_masks_; }

  // Calls visit(next) for every instruction that may follow `at`. A return may go to any return site.
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
  void compute_liveness(const ObservedRegisters& observed);
  bool liveness_pass(const std::vector<std::uint64_t>& always_live,
                     const std::vector<std::uint64_t>& live_at_end);

  const program::Program& program_;
  std::vector<bool> branch_targets_;
  std::vector<std::uint32_t> return_sites_;  // the instructions after calls
  std::vector<std::optional<BoundaryCondition>> boundary_;
  // Indexed [instruction][register], one bit per register, rows padded to whole words. Empty if all are live.
  std::vector<std::uint64_t> live_bits_;
  bool has_only_zero_boundaries_ = true;
  bool has_masks_ = false;
};

}  // namespace apron::vm
