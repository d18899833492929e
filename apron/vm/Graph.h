// What a trace computes, as values: every write to a register makes a new value, copies and shifts make none,
// and what nobody reads is gone.
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "apron/program/Program.h"
#include "apron/vm/Flow.h"
#include "apron/vm/Step.h"
#include "apron/vm/Trace.h"

namespace apron::vm {

// An operand: a value read `dx` cells east and `dy` cells south of the own cell, or a scalar slot.
struct Arg {
  enum class Kind : std::uint8_t { kNone, kValue, kScalar };
  Kind kind = Kind::kNone;
  std::int8_t dx = 0, dy = 0;
  std::uint32_t index = 0;

  bool shifted() const { return dx != 0 || dy != 0; }
  auto operator<=>(const Arg&) const = default;
};

struct Node {
  enum class Kind : std::uint8_t { kCompute, kRegister, kMask, kColumn, kRow };  // kColumn, kRow: its number
  Kind kind = Kind::kCompute;
  program::Opcode op = program::Opcode::kNop;  // kCompute: element-wise
  std::uint32_t reg = 0;                       // kRegister: its value at entry
  std::array<Arg, program::kMaxSources> args{};

  bool computed() const { return kind == Kind::kCompute; }
  // with(arg) for each operand that is a value.
  template <class With>
  void each_value(const With& with) const {
    for (const Arg& arg : args)
      if (arg.kind == Arg::Kind::kValue) with(arg);
  }
};

// A scalar instruction, on slots.
struct ScalarStep {
  program::Opcode op;
  std::array<std::uint32_t, program::kMaxSources> from;
  std::uint32_t to;
};

struct Graph {
  std::vector<Node> nodes;  // operands come before their users
  struct Output {
    std::uint32_t reg = 0, value = 0;
  };
  std::vector<Output> outputs;  // registers with a new value at exit; computed values, not kRegister nodes
  Edge edge{};                  // of every shifted operand

  std::vector<float> slots;                                   // initial values: literals
  std::vector<std::pair<std::uint32_t, const float*>> loads;  // variables read at entry
  std::vector<ScalarStep> scalar_steps;                       // then these, in order
  std::vector<std::pair<float*, std::uint32_t>> stores;       // variables at exit
};

Graph build_graph(const program::Program& program, const std::vector<Step>& steps, const Flow& flow,
                  const Trace& trace, bool masked);

}  // namespace apron::vm
