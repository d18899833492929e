#include "apron/vm/fusion/ValueGraph.h"

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

class ValueGraphBuilder {
 public:
  ValueGraphBuilder(const program::Program& program, const std::vector<DecodedInstruction>& decoded,
                    const FlowAnalysis& flow, const FilterPrediction& filters, const Trace& trace,
                    bool masked)
      : program_(program), decoded_(decoded), flow_(flow), filters_(filters), trace_(trace) {
    graph_.type = trace.type;
    if (const auto& boundary = flow.boundary_at(trace.entry)) graph_.boundary = *boundary;
    if (masked) entry_mask_ = value_ref(add_node(ValueNode{ValueNode::Kind::kMask}));
  }

  ValueGraph build() {
    for (const std::uint32_t at : trace_.instructions) lower(at);
    add_outputs();
    return std::move(graph_);
  }

 private:
  using MaybeValue = std::optional<ValueRef>;

  static ValueRef value_ref(std::uint32_t value) { return {ValueRef::Kind::kValue, 0, 0, value}; }

  std::uint32_t add_node(const ValueNode& node) {
    graph_.nodes.push_back(node);
    return static_cast<std::uint32_t>(graph_.nodes.size() - 1);
  }

  // Common-subexpression elimination: the same operation on the same operands is one node.
  ValueRef get_or_add_node(Opcode op, ValueRef a, ValueRef b = {}, ValueRef c = {}) {
    const auto [place, added] = value_numbers_.try_emplace(std::make_tuple(op, a, b, c), 0);
    if (added) {
      ValueNode node;
      node.op = op;
      node.operands = {a, b, c};
      place->second = add_node(node);
    }
    return value_ref(place->second);
  }

  // ---- scalars ----
  std::uint32_t add_slot(double value, bool is_literal = false) {
    graph_.scalar_slots.push_back(value);
    graph_.is_literal.push_back(is_literal);
    return static_cast<std::uint32_t>(graph_.scalar_slots.size() - 1);
  }

  std::uint32_t scalar_slot(const double* scalar, program::Operand operand) {
    const auto [place, added] = scalar_slots_.try_emplace(scalar, 0);
    if (added) {
      const bool literal = operand.kind == OperandKind::kLiteral;
      place->second = add_slot(literal ? *scalar : 0.0, literal);
      if (!literal) graph_.variable_loads.emplace_back(place->second, scalar);
    }
    return place->second;
  }

  void lower_scalar(const DecodedInstruction& decoded, const Instruction& in) {
    ScalarInstruction s{decoded.op, {}, 0};
    for (std::size_t k = 0; k < s.sources.size(); ++k)
      s.sources[k] =
          decoded.scalars[k] != nullptr ? scalar_slot(decoded.scalars[k], in.operands[k]) : zero_slot();
    s.destination = add_slot(0.0);
    graph_.scalar_instructions.push_back(s);
    scalar_slots_[decoded.destination_variable] = s.destination;
    written_variables_[decoded.destination_variable] = s.destination;
  }

  std::uint32_t zero_slot() {
    if (!zero_slot_) zero_slot_ = add_slot(0.0);
    return *zero_slot_;
  }

  // ---- registers ----

  ValueRef read_register(std::uint32_t reg) {
    const auto [place, added] = register_values_.try_emplace(reg);
    if (added) {
      ValueNode node;
      node.kind = ValueNode::Kind::kRegister;
      node.reg = reg;
      place->second = value_ref(add_node(node));
    }
    return place->second;
  }

  ValueRef lower_operand(const DecodedInstruction& decoded, const Instruction& in, std::size_t k) {
    if (decoded.planes[k] != nullptr) return read_register(in.operands[k].index);
    if (decoded.scalars[k] == nullptr) return {};
    const std::uint32_t slot = scalar_slot(decoded.scalars[k], in.operands[k]);
    if (program::is_integer(graph_.type)) graph_.cell_slots.push_back(slot);
    return {ValueRef::Kind::kScalar, 0, 0, slot};
  }

  void write_register(const Instruction& in, ValueRef value) {
    if (const MaybeValue mask = in.masked ? active_mask() : std::nullopt)
      value = get_or_add_node(Opcode::kSelect, *mask, value, read_register(in.destination.index));
    register_values_[in.destination.index] = value;
  }

  // Shifts a. The shift is folded into the operand's offset if reading from further away gives the same
  // values; otherwise a copy of a is shifted, so that its boundary cells are formed from the intermediate
  // value.
  ValueRef shift_value(ValueRef a, Offset by) {
    const auto dx = static_cast<int>(-by.dx), dy = static_cast<int>(-by.dy);
    if (dx == 0 && dy == 0) return a;
    const bool reflect = graph_.boundary.rule == BoundaryRule::kReflect;
    const auto joins = [&](int had, int more) {
      if (had == 0 || more == 0) return true;
      return !reflect && (had > 0) == (more > 0) && std::abs(had + more) <= kMaxFusedShift;
    };
    const auto within = [](int d, std::uint32_t n) { return std::abs(d) < static_cast<int>(n); };
    const bool foldable = a.kind == ValueRef::Kind::kValue && joins(a.dx, dx) && joins(a.dy, dy) &&
                          within(a.dx + dx, trace_.width) && within(a.dy + dy, trace_.height);
    if (!foldable) a = get_or_add_node(Opcode::kCopy, a);
    a.dx = static_cast<std::int8_t>(a.dx + dx);
    a.dy = static_cast<std::int8_t>(a.dy + dy);
    return a;
  }

  // Uses the order of operations that opcodes.def specifies.
  ValueRef lower_neighbours(Opcode op, ValueRef a, bool eight_connected) {
    const Opcode combine = op == Opcode::kNearSum   ? Opcode::kAdd
                           : op == Opcode::kNearMin ? Opcode::kMin
                           : op == Opcode::kNearMax ? Opcode::kMax
                           : op == Opcode::kNearAny ? Opcode::kOr
                                                    : Opcode::kAnd;
    const ValueRef sides = get_or_add_node(combine, shift_value(a, {1, 0}), shift_value(a, {-1, 0}));
    const ValueRef row = eight_connected ? get_or_add_node(combine, sides, a) : a;
    return get_or_add_node(combine, sides,
                           get_or_add_node(combine, shift_value(row, {0, 1}), shift_value(row, {0, -1})));
  }

  // Uses the order of operations that opcodes.def specifies.
  ValueRef lower_filter(ValueRef a, const program::Filter& filter) {
    ValueRef sum{ValueRef::Kind::kScalar, 0, 0, zero_slot()};
    bool empty = true;
    for (std::uint32_t i = 0; i < filter.coefficients.size(); ++i) {
      if (filter.coefficients[i] == 0.0F) continue;
      const Offset by{(static_cast<std::int64_t>(filter.width) - 1) / 2 - i % filter.width,
                      (static_cast<std::int64_t>(filter.height) - 1) / 2 - i / filter.width};
      sum = get_or_add_node(Opcode::kMac, shift_value(a, by),
                            {ValueRef::Kind::kScalar, 0, 0, constant_slot(filter.coefficients[i])}, sum);
      empty = false;
    }
    return empty ? get_or_add_node(Opcode::kCopy, sum) : sum;
  }

  std::uint32_t constant_slot(float value) {
    const auto [place, added] = constant_slots_.try_emplace(std::bit_cast<std::uint32_t>(value), 0);
    if (added) place->second = add_slot(value);
    return place->second;
  }

  ValueRef index_node(ValueNode::Kind kind) {
    const auto [place, added] = index_nodes_.try_emplace(kind, 0);
    if (added) {
      ValueNode node;
      node.kind = kind;
      place->second = add_node(node);
    }
    return value_ref(place->second);
  }

  // ---- masks ----
  MaybeValue combine_masks(const MaybeValue& a, const MaybeValue& b) {
    if (!a) return b;
    if (!b) return a;
    return get_or_add_node(Opcode::kAnd, *a, *b);
  }
  MaybeValue enclosing_mask(std::size_t level) const {
    return level == 0 ? entry_mask_ : mask_levels_[level - 1];
  }
  MaybeValue active_mask() { return combine_masks(base_mask_, enclosing_mask(mask_levels_.size())); }

  void lower_mask_op(const DecodedInstruction& decoded, const Instruction& in) {
    switch (decoded.op) {
      case Opcode::kMaskOn:
        base_mask_ = read_register(in.operands[0].index);
        break;
      case Opcode::kMaskOff:
        base_mask_.reset();
        break;
      case Opcode::kMaskPush: {
        const MaybeValue outside = enclosing_mask(mask_levels_.size());
        mask_levels_.push_back(combine_masks(read_register(in.operands[0].index), outside));
        break;
      }
      case Opcode::kMaskElse:
        mask_levels_.back() = combine_masks(get_or_add_node(Opcode::kNot, *mask_levels_.back()),
                                            enclosing_mask(mask_levels_.size() - 1));
        break;
      default:
        mask_levels_.pop_back();
        break;
    }
  }

  void lower(std::uint32_t at) {
    const DecodedInstruction& decoded = decoded_[at];
    const Instruction& in = program_.code[at];
    switch (decoded.dispatch) {
      case DispatchKind::kScalar:
        lower_scalar(decoded, in);
        break;
      case DispatchKind::kElementwise: {
        const ValueRef a = lower_operand(decoded, in, 0), b = lower_operand(decoded, in, 1),
                       c = lower_operand(decoded, in, 2);
        write_register(in, decoded.op == Opcode::kCopy ? a : get_or_add_node(decoded.op, a, b, c));
        break;
      }
      case DispatchKind::kShift:
        write_register(in, shift_value(read_register(in.operands[0].index), decoded.offset));
        break;
      case DispatchKind::kMask:
        lower_mask_op(decoded, in);
        break;
      case DispatchKind::kCellAccess:
        write_register(in, index_node(decoded.op == Opcode::kCellX ? ValueNode::Kind::kColumnIndex
                                                                   : ValueNode::Kind::kRowIndex));
        break;
      case DispatchKind::kArrayOp:
        if (decoded.op == Opcode::kFilterDo)
          write_register(
              in, lower_filter(read_register(in.operands[0].index), *filters_.find(decoded.table_index)));
        else
          write_register(in, lower_neighbours(decoded.op, read_register(in.operands[0].index),
                                              *decoded.scalars[1] == 8.0));
        break;
      default:
        break;  // the trace has resolved all jumps
    }
  }

  // ---- outputs ----
  void add_outputs() {
    for (auto& [reg, arg] : register_values_) {
      const bool unchanged = arg.kind == ValueRef::Kind::kValue && !arg.is_shifted() &&
                             graph_.nodes[arg.index].kind == ValueNode::Kind::kRegister &&
                             graph_.nodes[arg.index].reg == reg;
      if (unchanged || !flow_.is_live(trace_.exit, reg)) continue;
      const bool computed = arg.kind == ValueRef::Kind::kValue && !arg.is_shifted() &&
                            graph_.nodes[arg.index].kind == ValueNode::Kind::kCompute;
      graph_.outputs.push_back(
          {reg, writer_for(computed ? arg.index : get_or_add_node(Opcode::kCopy, arg).index)});
    }
    for (const auto& [variable, slot] : written_variables_)
      graph_.variable_stores.emplace_back(variable, slot);
    eliminate_dead_nodes();
  }

  // The value itself, or a copy of it: a stage writes kMaxResults rows, and one value may go to many
  // registers.
  std::uint32_t writer_for(std::uint32_t value) {
    auto& [writer, count] = writers_.try_emplace(value, value, 0U).first->second;
    if (++count <= kMaxResults) return writer;
    ValueNode copy;
    copy.op = Opcode::kCopy;
    copy.operands[0] = value_ref(value);
    writer = add_node(copy);
    count = 1;
    return writer;
  }

  void eliminate_dead_nodes() {
    std::vector<bool> live(graph_.nodes.size(), false);
    for (const ValueGraph::Output& output : graph_.outputs) live[output.value] = true;
    for (std::size_t i = graph_.nodes.size(); i-- > 0;)
      for (const ValueRef& arg : graph_.nodes[i].operands)
        if (live[i] && arg.kind == ValueRef::Kind::kValue) live[arg.index] = true;
    std::vector<std::uint32_t> new_index(graph_.nodes.size());
    std::vector<ValueNode> live_nodes;
    for (std::size_t i = 0; i < graph_.nodes.size(); ++i) {
      if (!live[i]) continue;
      new_index[i] = static_cast<std::uint32_t>(live_nodes.size());
      live_nodes.push_back(graph_.nodes[i]);
      for (ValueRef& arg : live_nodes.back().operands)
        if (arg.kind == ValueRef::Kind::kValue) arg.index = new_index[arg.index];
    }
    graph_.nodes = std::move(live_nodes);
    for (ValueGraph::Output& output : graph_.outputs) output.value = new_index[output.value];
  }

  std::map<std::uint32_t, std::pair<std::uint32_t, std::size_t>> writers_;  // of values, and their outputs
  const program::Program& program_;
  const std::vector<DecodedInstruction>& decoded_;
  const FlowAnalysis& flow_;
  const FilterPrediction& filters_;
  const Trace& trace_;
  MaybeValue entry_mask_, base_mask_;
  std::vector<MaybeValue> mask_levels_;
  std::map<std::uint32_t, ValueRef> register_values_;
  std::map<std::tuple<Opcode, ValueRef, ValueRef, ValueRef>, std::uint32_t> value_numbers_;
  std::unordered_map<const double*, std::uint32_t> scalar_slots_;
  std::map<double*, std::uint32_t> written_variables_;
  std::optional<std::uint32_t> zero_slot_;
  std::map<std::uint32_t, std::uint32_t> constant_slots_;  // keyed by bit pattern
  std::map<ValueNode::Kind, std::uint32_t> index_nodes_;
  ValueGraph graph_;
};

}  // namespace

ValueGraph build_value_graph(const program::Program& program, const std::vector<DecodedInstruction>& decoded,
                             const FlowAnalysis& flow, const FilterPrediction& filters, const Trace& trace,
                             bool masked) {
  return ValueGraphBuilder(program, decoded, flow, filters, trace, masked).build();
}

}  // namespace apron::vm
