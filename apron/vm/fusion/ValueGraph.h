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

// An operand: a value read `dx` cells east and `dy` cells south of the own cell, or a scalar slot.
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
    kCompute,
    kRegister,
    kMask,
    kColumnIndex,
    kRowIndex
  };  // kColumn, kRow: its number
  Kind kind = Kind::kCompute;
  program::Opcode op = program::Opcode::kNop;  // kCompute: element-wise
  std::uint32_t reg = 0;                       // kRegister: its value at entry
  std::array<ValueRef, program::kMaxOperands> operands{};

  bool is_computed() const { return kind == Kind::kCompute; }
  // with(arg) for each operand that is a value.
  template <class With>
  void for_each_value(const With& visit) const {
    for (const ValueRef& arg : operands)
      if (arg.kind == ValueRef::Kind::kValue) visit(arg);
  }
};

// A scalar instruction, on slots.
struct ScalarInstruction {
  program::Opcode op;
  std::array<std::uint32_t, program::kMaxOperands> sources;
  std::uint32_t destination;
};

struct ValueGraph {
  std::vector<ValueNode> nodes;  // operands come before their users
  struct Output {
    std::uint32_t reg = 0, value = 0;
  };
  std::vector<Output> outputs;   // registers with a new value at exit; computed values, not kRegister nodes
  BoundaryCondition boundary{};  // of every shifted operand

  std::vector<float> scalar_slots;                                     // initial values: literals
  std::vector<std::pair<std::uint32_t, const float*>> variable_loads;  // variables read at entry
  std::vector<ScalarInstruction> scalar_instructions;                  // then these, in order
  std::vector<std::pair<float*, std::uint32_t>> variable_stores;       // variables at exit
};

ValueGraph build_value_graph(const program::Program& program, const std::vector<DecodedInstruction>& decoded,
                             const FlowAnalysis& flow, const Trace& trace, bool masked);

}  // namespace apron::vm
