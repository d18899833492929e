// A trace in SSA form: every write to a register creates a value, copies and shifts create none, and dead
// values are removed.
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "apron/program/Program.h"
#include "apron/vm/DecodedInstruction.h"
#include "apron/vm/fusion/FlowAnalysis.h"
#include "apron/vm/fusion/Trace.h"

namespace apron::vm {

// An operand: a value read dx cells east and dy cells south of the current cell, or a scalar slot.
struct ValueRef {
  enum class Kind : std::uint8_t { kNone, kValue, kScalar };
  Kind kind = Kind::kNone;
  std::int8_t dx = 0, dy = 0;
  std::uint32_t index = 0;

  bool is_shifted() const { return dx != 0 || dy != 0; }
  auto operator<=>(const ValueRef&) const = default;
};

struct ValueNode {
  enum class Kind : std::uint8_t {
    kCompute,      // the element-wise operation `op` on `operands`
    kRegister,     // register `reg` at entry
    kMask,         // the mask in force at entry
    kColumnIndex,  // each cell's column index
    kRowIndex      // each cell's row index
  };
  Kind kind = Kind::kCompute;
  program::Opcode op = program::Opcode::kNop;
  std::uint32_t reg = 0;
  std::array<ValueRef, program::kMaxOperands> operands{};

  bool is_computed() const { return kind == Kind::kCompute; }
  // Calls visit(operand) for each operand that is a value.
  template <class With>
  void for_each_value(const With& visit) const {
    for (const ValueRef& arg : operands)
      if (arg.kind == ValueRef::Kind::kValue) visit(arg);
  }
};

// An element-wise operation on scalar slots.
struct ScalarInstruction {
  program::Opcode op;
  std::array<std::uint32_t, program::kMaxOperands> sources;
  std::uint32_t destination;
};

inline constexpr std::size_t kMaxResults =
    6;  // rows that a stage writes, and registers that one value goes to

struct ValueGraph {
  std::vector<ValueNode> nodes;  // in topological order: operands before their users
  struct Output {
    std::uint32_t reg = 0, value = 0;
  };
  std::vector<Output> outputs;   // live registers with a new value at exit; every value is a kCompute node
  BoundaryCondition boundary{};  // applies to every shifted operand
  CellType type = CellType::kFloat32;

  // Scalar code runs once per execution, before the array pass.
  std::vector<double> scalar_slots;       // initialised with the literals
  std::vector<bool> is_literal;           // by slot
  std::vector<std::uint32_t> cell_slots;  // that meet registers of integers, of removed values as well
  std::vector<std::pair<std::uint32_t, const double*>> variable_loads;  // slot, variable read at entry
  std::vector<ScalarInstruction> scalar_instructions;                   // in program order
  std::vector<std::pair<double*, std::uint32_t>> variable_stores;       // variable written at exit, slot
};

// Lowers a trace to values. `masked` means that a mask is in force at entry. Allocates.
ValueGraph build_value_graph(const program::Program& program, const std::vector<DecodedInstruction>& decoded,
                             const FlowAnalysis& flow, const FilterPrediction& filters, const Trace& trace,
                             bool masked);

}  // namespace apron::vm
