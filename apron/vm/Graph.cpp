#include "apron/vm/Graph.h"

#include <algorithm>
#include <bit>
#include <map>
#include <optional>
#include <tuple>
#include <unordered_map>

namespace apron::vm {
namespace {

using program::BoundaryRule;
using program::Instruction;
using program::Opcode;
using program::OperandKind;

class Builder {
 public:
  Builder(const program::Program& program, const std::vector<Step>& steps, const Flow& flow,
          const Trace& trace, bool masked)
      : program_(program), steps_(steps), flow_(flow), trace_(trace) {
    if (const auto& edge = flow.edge(trace.entry)) graph_.edge = *edge;
    if (masked) entry_mask_ = value_arg(add(Node{Node::Kind::kMask}));
  }

  Graph run() {
    for (const std::uint32_t at : trace_.path) step(at);
    finish();
    return std::move(graph_);
  }

 private:
  using MaybeArg = std::optional<Arg>;

  static Arg value_arg(std::uint32_t value) { return {Arg::Kind::kValue, 0, 0, value}; }

  std::uint32_t add(const Node& node) {
    graph_.nodes.push_back(node);
    return static_cast<std::uint32_t>(graph_.nodes.size() - 1);
  }

  // The same operation on the same operands is computed once.
  Arg compute(Opcode op, Arg a, Arg b = {}, Arg c = {}) {
    const auto [place, added] = computed_.try_emplace(std::make_tuple(op, a, b, c), 0);
    if (added) {
      Node node;
      node.op = op;
      node.args = {a, b, c};
      place->second = add(node);
    }
    return value_arg(place->second);
  }

  // ---- scalars ----
  std::uint32_t new_slot(float value) {
    graph_.slots.push_back(value);
    return static_cast<std::uint32_t>(graph_.slots.size() - 1);
  }

  std::uint32_t slot(const float* scalar, program::Operand operand) {
    const auto [place, added] = slots_.try_emplace(scalar, 0);
    if (added) {
      const bool literal = operand.kind == OperandKind::kLiteral;
      place->second = new_slot(literal ? *scalar : 0.0F);
      if (!literal) graph_.loads.emplace_back(place->second, scalar);
    }
    return place->second;
  }

  void scalar_step(const Step& step, const Instruction& in) {
    ScalarStep s{step.op, {}, 0};
    for (std::size_t k = 0; k < s.from.size(); ++k)
      s.from[k] = step.scalars[k] != nullptr ? slot(step.scalars[k], in.operands[k]) : zero_slot();
    s.to = new_slot(0.0F);
    graph_.scalar_steps.push_back(s);
    slots_[step.variable] = s.to;
    written_[step.variable] = s.to;
  }

  std::uint32_t zero_slot() {
    if (!zero_slot_) zero_slot_ = new_slot(0.0F);
    return *zero_slot_;
  }

  // ---- registers ----

  Arg version(std::uint32_t reg) {
    const auto [place, added] = versions_.try_emplace(reg);
    if (added) {
      Node node;
      node.kind = Node::Kind::kRegister;
      node.reg = reg;
      place->second = value_arg(add(node));
    }
    return place->second;
  }

  Arg operand(const Step& step, const Instruction& in, std::size_t k) {
    if (step.planes[k] != nullptr) return version(in.operands[k].index);
    if (step.scalars[k] == nullptr) return {};
    return {Arg::Kind::kScalar, 0, 0, slot(step.scalars[k], in.operands[k])};
  }

  void write(const Instruction& in, Arg value) {
    if (const MaybeArg mask = in.masked ? effective() : std::nullopt)
      value = compute(Opcode::kSelect, *mask, value, version(in.destination.index));
    versions_[in.destination.index] = value;
  }

  // a moved: a view of it where reading from further away is the same, else of a value of its own.
  Arg shifted(Arg a, Offset by) {
    const auto dx = static_cast<int>(-by.dx), dy = static_cast<int>(-by.dy);
    if (dx == 0 && dy == 0) return a;
    const bool reflect = graph_.edge.rule == BoundaryRule::kReflect;
    const auto joins = [&](int had, int more) {
      if (had == 0 || more == 0) return true;
      return !reflect && (had > 0) == (more > 0) && std::abs(had + more) <= kMaxReach;
    };
    const auto within = [](int d, std::uint32_t n) { return std::abs(d) < static_cast<int>(n); };
    const bool view = a.kind == Arg::Kind::kValue && joins(a.dx, dx) && joins(a.dy, dy) &&
                      within(a.dx + dx, trace_.width) && within(a.dy + dy, trace_.height);
    if (!view) a = compute(Opcode::kCopy, a);
    a.dx = static_cast<std::int8_t>(a.dx + dx);
    a.dy = static_cast<std::int8_t>(a.dy + dy);
    return a;
  }

  // In the order that opcodes.def declares.
  Arg near(Opcode op, Arg a, bool eight) {
    const Opcode join = op == Opcode::kNearSum   ? Opcode::kAdd
                        : op == Opcode::kNearMin ? Opcode::kMin
                        : op == Opcode::kNearMax ? Opcode::kMax
                        : op == Opcode::kNearAny ? Opcode::kOr
                                                 : Opcode::kAnd;
    const Arg sides = compute(join, shifted(a, {1, 0}), shifted(a, {-1, 0}));
    const Arg row = eight ? compute(join, sides, a) : a;
    return compute(join, sides, compute(join, shifted(row, {0, 1}), shifted(row, {0, -1})));
  }

  // In the order that opcodes.def declares.
  Arg filtered(Arg a, const program::Filter& filter) {
    Arg sum{Arg::Kind::kScalar, 0, 0, zero_slot()};
    bool empty = true;
    for (std::uint32_t i = 0; i < filter.elements.size(); ++i) {
      if (filter.elements[i] == 0.0F) continue;
      const Offset by{(static_cast<std::int64_t>(filter.width) - 1) / 2 - i % filter.width,
                      (static_cast<std::int64_t>(filter.height) - 1) / 2 - i / filter.width};
      sum = compute(Opcode::kMac, shifted(a, by),
                    {Arg::Kind::kScalar, 0, 0, element_slot(filter.elements[i])}, sum);
      empty = false;
    }
    return empty ? compute(Opcode::kCopy, sum) : sum;
  }

  std::uint32_t element_slot(float value) {
    const auto [place, added] = element_slots_.try_emplace(std::bit_cast<std::uint32_t>(value), 0);
    if (added) place->second = new_slot(value);
    return place->second;
  }

  Arg number(Node::Kind kind) {
    const auto [place, added] = numbers_.try_emplace(kind, 0);
    if (added) {
      Node node;
      node.kind = kind;
      place->second = add(node);
    }
    return value_arg(place->second);
  }

  // ---- masks ----
  MaybeArg both(const MaybeArg& a, const MaybeArg& b) {
    if (!a) return b;
    if (!b) return a;
    return compute(Opcode::kAnd, *a, *b);
  }
  MaybeArg outer(std::size_t level) const { return level == 0 ? entry_mask_ : levels_[level - 1]; }
  MaybeArg effective() { return both(base_, outer(levels_.size())); }

  void mask_step(const Step& step, const Instruction& in) {
    switch (step.op) {
      case Opcode::kMaskOn:
        base_ = version(in.operands[0].index);
        break;
      case Opcode::kMaskOff:
        base_.reset();
        break;
      case Opcode::kMaskPush: {
        const MaybeArg outside = outer(levels_.size());
        levels_.push_back(both(version(in.operands[0].index), outside));
        break;
      }
      case Opcode::kMaskElse:
        levels_.back() = both(compute(Opcode::kNot, *levels_.back()), outer(levels_.size() - 1));
        break;
      default:
        levels_.pop_back();
        break;
    }
  }

  void step(std::uint32_t at) {
    const Step& step = steps_[at];
    const Instruction& in = program_.code[at];
    switch (step.action) {
      case Action::kScalar:
        scalar_step(step, in);
        break;
      case Action::kElementwise: {
        const Arg a = operand(step, in, 0), b = operand(step, in, 1), c = operand(step, in, 2);
        write(in, step.op == Opcode::kCopy ? a : compute(step.op, a, b, c));
        break;
      }
      case Action::kShift:
        write(in, shifted(version(in.operands[0].index), step.offset));
        break;
      case Action::kMask:
        mask_step(step, in);
        break;
      case Action::kCell:
        write(in, number(step.op == Opcode::kCellX ? Node::Kind::kColumn : Node::Kind::kRow));
        break;
      case Action::kArray:
        if (step.op == Opcode::kFilterDo)
          write(in, filtered(version(in.operands[0].index), program_.filters[step.table]));
        else
          write(in, near(step.op, version(in.operands[0].index), *step.scalars[1] == 8.0F));
        break;
      default:
        break;  // jumps: the trace went their way
    }
  }

  // ---- the end ----
  void finish() {
    for (auto& [reg, arg] : versions_) {
      const bool unchanged = arg.kind == Arg::Kind::kValue && !arg.shifted() &&
                             graph_.nodes[arg.index].kind == Node::Kind::kRegister &&
                             graph_.nodes[arg.index].reg == reg;
      if (unchanged || !flow_.live(trace_.exit, reg)) continue;
      const bool computed = arg.kind == Arg::Kind::kValue && !arg.shifted() &&
                            graph_.nodes[arg.index].kind == Node::Kind::kCompute;
      graph_.outputs.push_back({reg, computed ? arg.index : compute(Opcode::kCopy, arg).index});
    }
    for (const auto& [variable, slot] : written_) graph_.stores.emplace_back(variable, slot);
    drop_unread();
  }

  void drop_unread() {
    std::vector<bool> read(graph_.nodes.size(), false);
    for (const Graph::Output& output : graph_.outputs) read[output.value] = true;
    for (std::size_t i = graph_.nodes.size(); i-- > 0;)
      for (const Arg& arg : graph_.nodes[i].args)
        if (read[i] && arg.kind == Arg::Kind::kValue) read[arg.index] = true;
    std::vector<std::uint32_t> renamed(graph_.nodes.size());
    std::vector<Node> kept;
    for (std::size_t i = 0; i < graph_.nodes.size(); ++i) {
      if (!read[i]) continue;
      renamed[i] = static_cast<std::uint32_t>(kept.size());
      kept.push_back(graph_.nodes[i]);
      for (Arg& arg : kept.back().args)
        if (arg.kind == Arg::Kind::kValue) arg.index = renamed[arg.index];
    }
    graph_.nodes = std::move(kept);
    for (Graph::Output& output : graph_.outputs) output.value = renamed[output.value];
  }

  const program::Program& program_;
  const std::vector<Step>& steps_;
  const Flow& flow_;
  const Trace& trace_;
  MaybeArg entry_mask_, base_;
  std::vector<MaybeArg> levels_;
  std::map<std::uint32_t, Arg> versions_;
  std::map<std::tuple<Opcode, Arg, Arg, Arg>, std::uint32_t> computed_;
  std::unordered_map<const float*, std::uint32_t> slots_;
  std::map<float*, std::uint32_t> written_;
  std::optional<std::uint32_t> zero_slot_;
  std::map<std::uint32_t, std::uint32_t> element_slots_;  // by bits
  std::map<Node::Kind, std::uint32_t> numbers_;
  Graph graph_;
};

}  // namespace

Graph build_graph(const program::Program& program, const std::vector<Step>& steps, const Flow& flow,
                  const Trace& trace, bool masked) {
  return Builder(program, steps, flow, trace, masked).run();
}

}  // namespace apron::vm
