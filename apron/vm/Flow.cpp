#include "apron/vm/Flow.h"

#include <algorithm>

namespace apron::vm {

using program::BoundaryRule;
using program::Instruction;
using program::Opcode;
using program::Operand;
using program::OperandKind;

namespace {

constexpr std::size_t kMaxLiveWords = std::size_t{1} << 22;
constexpr int kMaxPasses = 64;
constexpr std::size_t kMaxReturnEdges = 1'000'000;

std::size_t words(const program::Program& program) { return (program.registers.size() + 63) / 64; }

const Operand* label(const Instruction& in) {
  for (const Operand& operand : in.operands)
    if (operand.kind == OperandKind::kLabel) return &operand;
  return nullptr;
}

// Writes every cell of its destination whatever the mask.
bool overwrites(const Instruction& in, bool has_masks) {
  if (in.destination.kind != OperandKind::kRegister || (in.masked && has_masks)) return false;
  if (in.op == Opcode::kPixelSet) return false;
  const char letter = program::info(in.op).signature.front();
  if (program::is_out_of_place(in.op)) return true;
  const bool whole = in.op == Opcode::kCellX || in.op == Opcode::kCellY || in.op == Opcode::kSurfaceSense;
  return letter == 'D' || whole;
}

}  // namespace

Flow::Flow(const program::Program& program, bool keep_registers)
    : program_(program),
      target_(program.code.size(), false),
      edge_(program.code.size()),
      filter_set_(program.filters.size(), false) {
  find_targets();
  // A return goes on after every call: with very many of both, nothing is known.
  const auto returns =
      static_cast<std::size_t>(std::count_if(program.code.begin(), program.code.end(),
                                             [](const Instruction& in) { return in.op == Opcode::kReturn; }));
  if (returns * returns_to_.size() > kMaxReturnEdges) return;
  find_edges();
  find_live(keep_registers);
}

void Flow::find_targets() {
  for (std::size_t at = 0; at < program_.code.size(); ++at) {
    const Instruction& in = program_.code[at];
    if (const Operand* to = label(in)) target_[to->index] = true;
    if (in.op == Opcode::kCall && at + 1 < program_.code.size()) {
      target_[at + 1] = true;
      returns_to_.push_back(static_cast<std::uint32_t>(at + 1));
    }
    const std::string_view name = program::info(in.op).mnemonic;
    has_masks_ = has_masks_ || name.substr(0, 5) == "mask.";
    if (in.op == Opcode::kFilterSet) filter_set_[in.operands[0].index] = true;
    if (in.op == Opcode::kBoundary && program_.literals[in.operands[0].index] != 0.0F)
      only_zero_edges_ = false;
  }
}

// Forward, from "zero" at the start. A return goes on after any call. A rule is known until two ways differ.
void Flow::find_edges() {
  constexpr std::uint8_t kUnseen = 0, kKnown = 1, kVaries = 2;
  std::vector<std::uint8_t> state(program_.code.size(), kUnseen);
  std::vector<std::size_t> work;
  const auto reach = [&](std::size_t at, const std::optional<Edge>& edge) {
    const auto differs = [&] {
      return !edge || edge->rule != edge_[at]->rule || edge->value != edge_[at]->value;
    };
    if (state[at] == kUnseen) {
      state[at] = edge ? kKnown : kVaries;
      edge_[at] = edge;
    } else if (state[at] == kKnown && differs()) {
      state[at] = kVaries;
      edge_[at].reset();
    } else {
      return;
    }
    work.push_back(at);
  };
  reach(0, Edge{});
  while (!work.empty()) {
    const std::size_t at = work.back();
    work.pop_back();
    const Instruction& in = program_.code[at];
    std::optional<Edge> after = edge_[at];
    if (in.op == Opcode::kBoundary) {
      const auto rule = static_cast<BoundaryRule>(program_.literals[in.operands[0].index]);
      const bool fixed = rule != BoundaryRule::kValue || in.operands[1].kind == OperandKind::kLiteral;
      after = Edge{rule, 0.0F};
      if (rule == BoundaryRule::kValue && fixed) after->value = program_.literals[in.operands[1].index];
      if (!fixed || after->value != after->value) after.reset();
    }
    successors(at, [&](std::size_t next) { reach(next, after); });
  }
}

bool Flow::live(std::size_t at, std::uint32_t reg) const {
  if (live_.empty()) return true;
  return ((live_[at * words(program_) + reg / 64] >> (reg % 64)) & 1U) != 0;
}

// Backward to the fixed point. A program too large for that has every register live everywhere.
void Flow::find_live(bool keep_registers) {
  const std::size_t n = words(program_);
  if (n == 0 || program_.code.size() > kMaxLiveWords / n) return;
  std::vector<std::uint64_t> always(n, 0);
  for (std::size_t r = 0; keep_registers && r < program_.registers.size(); ++r)
    if (program_.registers[r].name.substr(0, 1) != "$") always[r / 64] |= std::uint64_t{1} << (r % 64);
  // Reached by number at run time.
  for (const program::Group& group : program_.groups)
    for (std::size_t i = 0; !group.of_variables && i < group.elements.size(); ++i)
      always[group.elements[i] / 64] |= std::uint64_t{1} << (group.elements[i] % 64);
  live_.assign(program_.code.size() * n, 0);
  for (int pass = 0; pass < kMaxPasses; ++pass)
    if (!live_pass(n, always)) return;
  live_.clear();
}

bool Flow::live_pass(std::size_t n, const std::vector<std::uint64_t>& always) {
  bool changed = false;
  std::vector<std::uint64_t> here(n);
  for (std::size_t at = program_.code.size(); at-- > 0;) {
    const Instruction& in = program_.code[at];
    here = always;
    successors(at, [&](std::size_t next) {
      for (std::size_t w = 0; w < n; ++w) here[w] |= live_[next * n + w];
    });
    const auto bit = [](const Operand& o) { return std::uint64_t{1} << (o.index % 64); };
    if (overwrites(in, has_masks_)) {
      const std::size_t w = in.destination.index / 64;
      here[w] &= ~bit(in.destination) | always[w];
    }
    for (const Operand& o : in.operands)
      if (o.kind == OperandKind::kRegister) here[o.index / 64] |= bit(o);
    const auto place = live_.begin() + static_cast<std::ptrdiff_t>(at * n);
    if (!std::equal(here.begin(), here.end(), place)) {
      std::copy(here.begin(), here.end(), place);
      changed = true;
    }
  }
  return changed;
}

}  // namespace apron::vm
