#include "apron/vm/fusion/FlowAnalysis.h"

#include <algorithm>

namespace apron::vm {

using program::Instruction;
using program::Opcode;
using program::Operand;
using program::OperandKind;

namespace {

constexpr std::size_t kMaxLiveWords = std::size_t{1} << 22;
constexpr int kMaxPasses = 64;
constexpr std::size_t kMaxReturnEdges = 1'000'000;

std::size_t bitset_words(const program::Program& program) { return (program.registers.size() + 63) / 64; }

const Operand* label_operand(const Instruction& in) {
  for (const Operand& operand : in.operands)
    if (operand.kind == OperandKind::kLabel) return &operand;
  return nullptr;
}

// True if the instruction overwrites every cell of its destination, so that the old value is dead.
bool overwrites_every_cell(const Instruction& in, bool has_masks) {
  if (in.destination.kind != OperandKind::kRegister || (in.masked && has_masks)) return false;
  if (in.op == Opcode::kPixelSet) return false;
  const char letter = program::opcode_info(in.op).signature.front();
  if (program::requires_out_of_place(in.op)) return true;
  const bool whole = in.op == Opcode::kConvert || in.op == Opcode::kConvertSaturated ||
                     in.op == Opcode::kAddSaturated || in.op == Opcode::kSubSaturated ||
                     in.op == Opcode::kCellX || in.op == Opcode::kCellY || in.op == Opcode::kSurfaceSense;
  return letter == 'D' || letter == 'I' || whole;
}

}  // namespace

FlowAnalysis::FlowAnalysis(const program::Program& program, const ObservedRegisters& observed)
    : program_(program),
      branch_targets_(program.code.size(), false),
      boundary_(program::boundaries_in_force(program)) {
  find_branch_targets();
  // A return has an edge to every return site. Above the limit all registers count as live.
  const std::size_t returns =
      std::ranges::count_if(program.code, [](const Instruction& in) { return in.op == Opcode::kReturn; });
  if (returns * return_sites_.size() > kMaxReturnEdges) return;
  compute_liveness(observed);
}

void FlowAnalysis::find_branch_targets() {
  for (std::size_t at = 0; at < program_.code.size(); ++at) {
    const Instruction& in = program_.code[at];
    if (const Operand* to = label_operand(in)) branch_targets_[to->index] = true;
    if (in.op == Opcode::kCall && at + 1 < program_.code.size()) {
      branch_targets_[at + 1] = true;
      return_sites_.push_back(static_cast<std::uint32_t>(at + 1));
    }
    const std::string_view name = program::opcode_info(in.op).mnemonic;
    has_masks_ = has_masks_ || name.substr(0, 5) == "mask.";
    if (in.op == Opcode::kBoundary && program_.literals[in.operands[0].index] != 0.0F)
      has_only_zero_boundaries_ = false;
  }
}

bool FlowAnalysis::is_live(std::size_t at, std::uint32_t reg) const {
  if (live_bits_.empty()) return true;
  return ((live_bits_[at * bitset_words(program_) + reg / 64] >> (reg % 64)) & 1U) != 0;
}

// Backward data-flow analysis to the fixed point. If the program is too large or the analysis does not
// converge in kMaxPasses, every register counts as live everywhere.
void FlowAnalysis::compute_liveness(const ObservedRegisters& observed) {
  const std::size_t n = bitset_words(program_);
  if (n == 0 || program_.code.size() > kMaxLiveWords / n) return;
  std::vector<std::uint64_t> always_live(n, 0), live_at_end(n, 0);
  const auto add = [](std::vector<std::uint64_t>& set, std::size_t r) {
    set[r / 64] |= std::uint64_t{1} << (r % 64);
  };
  for (std::size_t r = 0; observed.all_named && r < program_.registers.size(); ++r)
    if (program_.registers[r].name.substr(0, 1) != "$") add(always_live, r);
  for (const std::uint32_t r : observed.any_time) add(always_live, r);
  for (const std::uint32_t r : observed.at_end) add(live_at_end, r);
  // Group members are accessed by an index known only at run time.
  for (const program::OperandGroup& group : program_.groups)
    for (std::size_t i = 0; !group.is_variable_group && i < group.members.size(); ++i)
      always_live[group.members[i] / 64] |= std::uint64_t{1} << (group.members[i] % 64);
  live_bits_.assign(program_.code.size() * n, 0);
  for (const program::LocalName& local : program_.local_names) {
    if (!observed.all_named) continue;
    std::vector<program::Operand> all = local.elements;
    all.push_back(local.operand);
    std::erase_if(all, [&](const program::Operand& one) {
      return one.kind != OperandKind::kRegister ||
             (always_live[one.index / 64] >> (one.index % 64) & 1U) != 0;
    });
    for (std::size_t at = local.first; at < std::min<std::size_t>(local.last, program_.code.size()); ++at)
      for (const program::Operand& reg : all)
        live_bits_[at * n + reg.index / 64] |= std::uint64_t{1} << (reg.index % 64);
  }
  for (int pass = 0; pass < kMaxPasses; ++pass)
    if (!liveness_pass(always_live, live_at_end)) return;
  live_bits_.clear();
}

bool FlowAnalysis::liveness_pass(const std::vector<std::uint64_t>& always_live,
                                 const std::vector<std::uint64_t>& live_at_end) {
  const std::size_t n = always_live.size();
  bool changed = false;
  std::vector<std::uint64_t> live_here(n);
  for (std::size_t at = program_.code.size(); at-- > 0;) {
    const Instruction& in = program_.code[at];
    live_here = always_live;
    if (in.op == Opcode::kEnd || in.op == Opcode::kReturn || in.op == Opcode::kSurfaceStep)
      for (std::size_t w = 0; w < n; ++w) live_here[w] |= live_at_end[w];
    for_each_successor(at, [&](std::size_t next) {
      for (std::size_t w = 0; w < n; ++w) live_here[w] |= live_bits_[next * n + w];
    });
    const auto bit = [](const Operand& o) { return std::uint64_t{1} << (o.index % 64); };
    if (overwrites_every_cell(in, has_masks_)) {
      const std::size_t w = in.destination.index / 64;
      live_here[w] &= ~bit(in.destination) | always_live[w];
    }
    for (const Operand& o : in.operands)
      if (o.kind == OperandKind::kRegister) live_here[o.index / 64] |= bit(o);
    const auto place = live_bits_.begin() + at * n;
    for (std::size_t w = 0; w < n; ++w) live_here[w] |= place[w];
    if (!std::equal(live_here.begin(), live_here.end(), place)) {
      std::copy(live_here.begin(), live_here.end(), place);
      changed = true;
    }
  }
  return changed;
}

}  // namespace apron::vm
