// Executes the controller's part of a program at compile time, and records what the cells do.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <set>

#include "apron/program/LocalityCheck.h"
#include "apron/program/LoopCheck.h"
#include "apron/program/Reachability.h"
#include "apron/program/ScalarArithmetic.h"
#include "apron/target_c/GraphBuilder.h"
#include "common/error/UserError.h"

namespace apron::target_c {
namespace {

using program::BoundaryRule;
using program::CellType;
using program::Instruction;
using program::Opcode;
using program::Operand;
using program::OperandKind;
using program::Program;

constexpr std::size_t kMaxRegions = 4096;
constexpr std::size_t kMaxNodes = 2'000'000;

// A program cannot run on boards. The location is added where it is caught.
struct Refusal {
  std::size_t instruction = 0;
  std::string reason;
};

std::string at(const Program& program, std::size_t instruction, const std::string& text) {
  const program::SourceLocation* source = program::find_location(program, instruction);
  return source == nullptr ? text : fmt::format("{}:{}: {}", program.files[source->file], source->line, text);
}

// The state that decides how a region runs, besides the values of scalars.
struct Place {
  bool is_start = false;
  bool fails = false;  // the instruction stops the program
  std::size_t instruction = 0;
  std::vector<std::uint32_t> calls;
  std::vector<bool> uniform_levels;  // of the nested blocks: the condition is a scalar
  bool has_base = false;
  BoundaryRule rule = BoundaryRule::kZero;
  std::vector<CellType> stacked;

  auto operator<=>(const Place&) const = default;
};

// The values that are known wherever a region begins; nullopt: known at run time only.
using Known = std::vector<std::optional<double>>;

bool same_bits(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

// The slots in which scalars live between regions.
struct Slots {
  explicit Slots(const Program& program) : variables(static_cast<std::uint32_t>(program.variables.size())) {
    std::uint32_t next = levels() + static_cast<std::uint32_t>(program::kMaxMaskDepth);
    for (const program::Filter& filter : program.filters) {
      filters.push_back(next);
      next += static_cast<std::uint32_t>(filter.coefficients.size());
    }
    count = next;
  }
  std::uint32_t boundary() const { return variables; }
  std::uint32_t seed() const { return variables + 1; }
  std::uint32_t draws() const { return variables + 2; }
  std::uint32_t levels() const { return variables + 3; }

  std::uint32_t variables, count = 0;
  std::vector<std::uint32_t> filters;  // the first element of each
};

class Tracer {
 public:
  Tracer(const Program& program, const Options& options)
      : program_(program), options_(options), slots_(program) {
    for (const program::Register& reg : program.registers) result_.homes.registers.push_back(reg.type);
    for (const program::Variable& v : program.variables) result_.scalar_start.push_back(v.initial_value);
    result_.scalar_start.resize(slots_.count, 0.0F);
    for (std::size_t f = 0; f < program.filters.size(); ++f)
      std::ranges::copy(program.filters[f].coefficients, result_.scalar_start.begin() + slots_.filters[f]);
  }

  TileProgram run() {
    Known known;
    for (const float value : result_.scalar_start) known.emplace_back(value);
    Place start;
    start.is_start = true;
    enter(start, known);
    while (!work_.empty()) {
      const std::uint32_t index = *work_.begin();
      work_.erase(work_.begin());
      if (places_.size() > kMaxRegions)
        throw Refusal{regions_[index].first_instruction,
                      fmt::format("the program branches into more than {} regions", kMaxRegions)};
      regions_[index] = trace_region(index);
    }
    result_.regions = std::move(regions_);
    return std::move(result_);
  }

 private:
  // A nested block: its own condition if that is a scalar, and the mask that it puts in force.
  struct Level {
    bool is_uniform = false;
    NodeId enabled = kNoNode;
    NodeId mask = kNoNode;  // kNoNode: all cells
  };

  std::uint32_t enter(const Place& place, const Known& known) {
    const auto [found, is_new] = places_.try_emplace(place, static_cast<std::uint32_t>(entries_.size()));
    const std::uint32_t index = found->second;
    if (is_new) {
      entries_.push_back({place, known});
      regions_.emplace_back();
      work_.insert(index);
      return index;
    }
    bool changed = false;
    for (std::size_t i = 0; i < known.size(); ++i) {
      std::optional<double>& before = entries_[index].known[i];
      if (!before || (known[i] && same_bits(*before, *known[i]))) continue;
      before.reset();
      changed = true;
    }
    if (changed) work_.insert(index);
    return index;
  }

  // ---- the state in a region ----

  [[noreturn]] void refuse(const std::string& reason) const { throw Refusal{at_, reason}; }

  NodeId entry_scalar(std::uint32_t slot) {
    Node node;
    node.kind = NodeKind::kScalarEntry;
    node.index = slot;
    return graph_->add(node);
  }
  NodeId home(std::uint32_t index) {
    const auto found = homes_.find(index);
    if (found != homes_.end()) return found->second;
    Node node;
    node.kind = NodeKind::kHome;
    node.index = index;
    node.type = result_.homes.type(index);
    const NodeId id =
        is_start_ ? graph_->apply_plane(node.type, Opcode::kCopy, graph_->literal(0.0)) : graph_->add(node);
    homes_[index] = id;
    return id;
  }
  NodeId register_value(std::uint32_t index) {
    const program::Register& reg = program_.registers[index];
    if (reg.width != options_.columns || reg.height != options_.rows)
      refuse(fmt::format("the register {} of {}x{} has not the size of the table, {}x{}", reg.name, reg.width,
                         reg.height, options_.columns, options_.rows));
    return home(index);
  }
  NodeId source(const Operand& operand) {
    switch (operand.kind) {
      case OperandKind::kRegister:
        return register_value(operand.index);
      case OperandKind::kVariable:
        return scalars_[operand.index];
      case OperandKind::kLiteral:
        return graph_->literal(program_.literals[operand.index]);
      default:
        return kNoNode;
    }
  }

  NodeId both(NodeId mask, NodeId condition) {
    if (mask == kNoNode) return graph_->apply(Opcode::kNe, condition, graph_->literal(0.0));
    return graph_->apply(Opcode::kAnd, condition, mask);
  }
  void inherit(std::size_t depth) {
    Level& level = levels_[depth];
    level.mask = both(depth == 0 ? kNoNode : levels_[depth - 1].mask, level.enabled);
    if (const auto value = graph_->value(level.mask); value && *value != 0.0) level.mask = kNoNode;
  }
  NodeId mask_in_force() {
    const NodeId top = levels_.empty() ? kNoNode : levels_.back().mask;
    if (!has_base_) return top;
    return top == kNoNode ? base_ : graph_->apply(Opcode::kAnd, base_, top);
  }
  void write_register(const Operand& to, NodeId value, bool masked) {
    register_value(to.index);  // checks its size
    write_home(to.index, value, masked);
  }
  void write_home(std::uint32_t index, NodeId value, bool masked) {
    const CellType type = result_.homes.type(index);
    if (graph_->is_scalar(value)) value = graph_->apply_plane(type, Opcode::kCopy, value);
    const NodeId mask = masked ? mask_in_force() : kNoNode;
    if (mask != kNoNode) {
      const auto known = graph_->value(mask);
      if (known && *known == 0.0) return;
      if (!known) value = graph_->apply_plane(type, Opcode::kSelect, mask, value, home(index));
    }
    homes_[index] = value;
  }

  NodeId read(NodeId a, int dx, int dy) {
    if (dx == 0 && dy == 0) return a;
    Node node;
    node.kind = NodeKind::kRead;
    node.type = graph_->node(a).type;
    node.operands = {a,
                     rule_ == BoundaryRule::kValue ? cell_number(scalars_[slots_.boundary()], node.type)
                                                   : graph_->literal(0.0),
                     kNoNode};
    node.dx = static_cast<std::int8_t>(dx);
    node.dy = static_cast<std::int8_t>(dy);
    node.rule = rule_ == BoundaryRule::kZero ? BoundaryRule::kValue : rule_;
    // A step along a row and one along a column are one to the diagonal neighbour: the rules treat rows and
    // columns alike.
    if (const Node& from = graph_->node(a); from.kind == NodeKind::kRead && from.rule == node.rule &&
                                            from.operands[1] == node.operands[1] &&
                                            ((from.dx == 0 && dy == 0) || (from.dy == 0 && dx == 0))) {
      node.operands[0] = from.operands[0];
      node.dx = static_cast<std::int8_t>(dx + from.dx);
      node.dy = static_cast<std::int8_t>(dy + from.dy);
    }
    return graph_->add(node);
  }
  // In the order of opcodes.def.
  NodeId neighbours(Opcode near, NodeId a, bool eight) {
    static constexpr Opcode kOps[] = {Opcode::kAdd, Opcode::kMin, Opcode::kMax, Opcode::kOr, Opcode::kAnd};
    const Opcode op = kOps[index_of(near) - index_of(Opcode::kNearSum)];
    const auto join = [&](NodeId x, NodeId y) { return graph_->apply(op, x, y); };
    const NodeId sides = join(read(a, -1, 0), read(a, 1, 0));
    if (!eight) return join(sides, join(read(a, 0, -1), read(a, 0, 1)));
    const auto row = [&](int dy) { return join(join(read(a, -1, dy), read(a, 1, dy)), read(a, 0, dy)); };
    return join(sides, join(row(-1), row(1)));
  }
  NodeId filtered(std::uint32_t filter_index, NodeId a, CellType type) {
    const program::Filter& filter = program_.filters[filter_index];
    const int west = (static_cast<int>(filter.width) - 1) / 2,
              north = (static_cast<int>(filter.height) - 1) / 2;
    NodeId sum = graph_->literal(0.0);
    for (std::uint32_t j = 0; j < filter.height; ++j) {
      for (std::uint32_t i = 0; i < filter.width; ++i) {
        NodeId element = scalars_[slots_.filters[filter_index] + j * filter.width + i];
        const auto value = graph_->value(element);
        if (type != CellType::kFloat32) element = integer_element(filter, type, value);
        if (value && static_cast<float>(*value) == 0.0F) continue;
        const NodeId cell = read(a, static_cast<int>(i) - west, static_cast<int>(j) - north);
        if (type != CellType::kFloat32) {
          sum = graph_->apply_plane(type, Opcode::kMac, cell, element, sum);
          continue;
        }
        const NodeId next = graph_->apply(Opcode::kAdd, sum, graph_->apply(Opcode::kMul, element, cell));
        sum = value ? next : graph_->apply(Opcode::kSelect, element, next, sum);
      }
    }
    return sum;
  }
  // The element as a cell of the type, modulo 2^n.
  NodeId integer_element(const program::Filter& filter, CellType type, std::optional<double> value) {
    if (!value)
      refuse(fmt::format("an element of the filter '{}' of integers is only known at run time", filter.name));
    if (!program::is_cell_value(CellType::kInt32, *value))
      refuse(fmt::format(
          "{}, an element of the filter '{}', is no int32: filters of integers have whole elements", *value,
          filter.name));
    const double lowest = program::lowest_cell(type), count = program::highest_cell(type) - lowest + 1.0;
    return graph_->literal(*value - count * std::floor((*value - lowest) / count));
  }
  void set_filter(const Instruction& instruction) {
    const std::uint32_t index = instruction.operands[0].index;
    const program::Filter& filter = program_.filters[index];
    const auto element = graph_->value(source(instruction.operands[1]));
    if (!element) refuse("the number of the filter's element is only known at run time");
    if (!(*element >= 0.0 && *element < static_cast<double>(filter.coefficients.size())))
      refuse(fmt::format("the filter '{}' has no element number {}", filter.name, *element));
    scalars_[slots_.filters[index] + static_cast<std::uint32_t>(*element)] = source(instruction.operands[2]);
  }

  NodeId draw(const Instruction& instruction, bool plane) {
    result_.uses_random = true;
    Node node;
    node.kind = plane ? NodeKind::kRandom : NodeKind::kScalarRandom;
    node.op = instruction.op;
    if (plane) node.type = program_.registers[instruction.destination.index].type;
    node.operands = {source(instruction.operands[0]), source(instruction.operands[1]),
                     scalars_[slots_.seed()]};
    node.draws_follow = draws_follow_;
    node.draw = draws_++;
    return graph_->add(node);
  }

  std::uint32_t channel(const std::string& name, bool is_sensor) {
    if (options_.channels && !is_declared(name))
      refuse(fmt::format("the surface has no channel '{}'; --channels names {}", name,
                         fmt::join(*options_.channels, ", ")));
    auto& channels = result_.channels;
    for (std::uint32_t i = 0; i < channels.size(); ++i)
      if (channels[i].name == name && channels[i].is_sensor == is_sensor) return i;
    channels.push_back({name, is_sensor});
    return static_cast<std::uint32_t>(channels.size() - 1);
  }
  // Without the component: 'colour.r' and 'colour[0]' are of the channel 'colour'.
  static std::string base_name(const std::string& name) { return name.substr(0, name.find_first_of(".[")); }
  // True if --channels names the channel, with or without its component.
  bool is_declared(const std::string& name) const {
    const auto is_named = [&](const std::string& channel) {
      return std::ranges::find(*options_.channels, channel) != options_.channels->end();
    };
    return is_named(name) || is_named(base_name(name));
  }
  bool has_channel(const std::string& name) const {
    if (options_.channels) return is_declared(name);
    return std::ranges::any_of(program_.code, [&](const Instruction& i) {
      if (i.op != Opcode::kSurfaceSense && i.op != Opcode::kSurfaceActuate) return false;
      const std::string& used = program_.texts[i.operands[0].index];
      return used == name || base_name(used) == name;
    });
  }

  const Operand& group_member(const Instruction& instruction) {
    const program::OperandGroup& group = program_.groups[instruction.operands[0].index];
    const auto number = graph_->value(source(instruction.operands[1]));
    if (!number) refuse(fmt::format("the number of an element of {} is only known at run time", group.name));
    if (!(*number >= 0.0 && *number < static_cast<double>(group.members.size()) &&
          *number == std::floor(*number)))
      refuse(fmt::format("'{}' has {} elements, numbered from 0; there is no number {}", group.name,
                         group.members.size(), *number));
    member_ = {group.is_variable_group ? OperandKind::kVariable : OperandKind::kRegister,
               group.members[static_cast<std::size_t>(*number)]};
    return member_;
  }

  // ---- instructions ----

  void push_plane(NodeId value) {
    if (stacked_.size() == program::kMaxStackDepth)
      refuse(fmt::format("more than {} registers are on the stack", program::kMaxStackDepth));
    const CellType type = graph_->node(value).type;
    homes_[result_.homes.stacked(stacked_.size(), type)] = value;
    stacked_.push_back(type);
  }
  NodeId pop_plane(const Operand& to) {
    if (stacked_.empty()) refuse("stack.pop_reg finds the stack empty");
    const CellType type = stacked_.back();
    stacked_.pop_back();
    return same_type(home(result_.homes.stacked(stacked_.size(), type)), to);
  }
  // The value, which goes into a register of its own type only.
  NodeId same_type(NodeId value, const Operand& to) const {
    const CellType from = graph_->node(value).type, type = program_.registers[to.index].type;
    if (!graph_->is_scalar(value) && from != type)
      refuse(fmt::format("a register of {} does not go into one of {}", program::cell_type_name(from),
                         program::cell_type_name(type)));
    return value;
  }

  // An operand of an element-wise instruction.
  NodeId number(const Instruction& instruction, std::size_t operand) {
    return cell_number(source(instruction.operands[operand]),
                       program_.registers[instruction.destination.index].type);
  }
  // A number that the type does not hold is limited, where the virtual machine stops the program.
  NodeId cell_number(NodeId id, CellType type) {
    if (id == kNoNode || !graph_->is_scalar(id) || !program::is_integer(type)) return id;
    if (const auto value = graph_->value(id); value && !program::is_cell_value(type, *value))
      warn(fmt::format("warning: {:g} is not of type {}: a board limits it to the type's values", *value,
                       program::cell_type_name(type)));
    return id;
  }
  void warn(const std::string& text) {
    const std::string warning = at(program_, at_, text);
    if (warned_.insert(warning).second) result_.warnings.push_back(warning);
  }

  void execute_data(const Instruction& instruction) {
    const Opcode op = instruction.op;
    const auto& from = instruction.operands;
    const Operand& to = instruction.destination;
    switch (op) {
      case Opcode::kShift: {
        // The image moves by the offset: a cell reads from where it came.
        const auto dx = graph_->value(source(from[1])), dy = graph_->value(source(from[2]));
        return write_register(to, read(source(from[0]), -static_cast<int>(*dx), -static_cast<int>(*dy)),
                              instruction.masked);
      }
      case Opcode::kNearSum:
      case Opcode::kNearMin:
      case Opcode::kNearMax:
      case Opcode::kNearAny:
      case Opcode::kNearAll:
        return write_register(to, neighbours(op, source(from[0]), *graph_->value(source(from[1])) == 8.0),
                              instruction.masked);
      case Opcode::kFilterDo:
        return write_register(
            to, filtered(from[1].index, source(from[0]), program_.registers[from[0].index].type),
            instruction.masked);
      case Opcode::kFilterSet:
        return set_filter(instruction);
      case Opcode::kBoundary:
        rule_ = static_cast<BoundaryRule>(*graph_->value(source(from[0])));
        if (rule_ == BoundaryRule::kWrap) refuse("boundary('wrap') joins opposite edges of the table");
        scalars_[slots_.boundary()] = source(from[1]);
        return;
      case Opcode::kCellX:
      case Opcode::kCellY: {
        Node node;
        node.kind = op == Opcode::kCellX ? NodeKind::kCellX : NodeKind::kCellY;
        return write_register(to, graph_->add(node), instruction.masked);
      }
      case Opcode::kRandomFloat:
      case Opcode::kRandomGauss:
      case Opcode::kRandomInt: {
        const bool plane = to.kind == OperandKind::kRegister;
        const NodeId value = draw(instruction, plane);
        if (plane) return write_register(to, value, instruction.masked);
        scalars_[to.index] = value;
        return;
      }
      case Opcode::kRandomSeed:
        scalars_[slots_.seed()] = source(from[0]);
        draws_follow_ = false;
        draws_ = 0;
        return;
      case Opcode::kStackPush:
        push_plane(source(from[0]));
        return;
      case Opcode::kStackPop:
        return write_register(to, pop_plane(to), instruction.masked);
      case Opcode::kStackClear:
        stacked_.clear();
        return;
      case Opcode::kResGetVar:
        scalars_[to.index] = source(group_member(instruction));
        return;
      case Opcode::kResSetVar:
        scalars_[group_member(instruction).index] = source(from[2]);
        return;
      case Opcode::kResGetReg:
        return write_register(to, same_type(source(group_member(instruction)), to), instruction.masked);
      case Opcode::kResSetReg: {
        const Operand member = group_member(instruction);
        const NodeId value = same_type(source(from[2]), member);
        return write_register(member, cell_number(value, program_.registers[member.index].type),
                              instruction.masked);
      }
      case Opcode::kMatrixProduct:
        return multiply_matrix(instruction);
      default:
        break;
    }
    if (to.kind == OperandKind::kVariable)
      scalars_[to.index] = graph_->apply(op, source(from[0]), source(from[1]), source(from[2]));
    else
      write_register(to,
                     graph_->apply_plane(program_.registers[to.index].type, op, number(instruction, 0),
                                         number(instruction, 1), number(instruction, 2)),
                     instruction.masked);
  }

  void multiply_matrix(const Instruction& instruction) {
    const auto members = [&](std::size_t k) -> const std::vector<std::uint32_t>& {
      return program_.groups[instruction.operands[k].index].members;
    };
    const auto &y = members(0), &x = members(1), &weights = members(2);
    for (std::size_t k = 0; k < y.size(); ++k) {
      NodeId sum = graph_->literal(0.0);
      for (std::size_t j = 0; j < x.size(); ++j)
        sum = graph_->apply_plane(CellType::kFloat32, Opcode::kMac, source({OperandKind::kRegister, x[j]}),
                                  source({OperandKind::kVariable, weights[k * x.size() + j]}), sum);
      write_register({OperandKind::kRegister, y[k]}, sum, instruction.masked);
    }
  }

  // 1 where program::check_for() or check_repeat() finds no error; refuses the program where it is known to
  // find one.
  NodeId loop_condition(const Instruction& instruction) {
    const bool is_for = instruction.op == Opcode::kCheckFor;
    std::array<NodeId, 3> numbers{};
    std::array<double, 3> known{1.0, 1.0, 1.0};
    NodeId condition = graph_->literal(1.0);
    const auto require = [&](Opcode op, NodeId number, double end) {
      condition = graph_->apply(Opcode::kAnd, condition, graph_->apply(op, number, graph_->literal(end)));
    };
    for (std::size_t k = 0; k < (is_for ? 3 : 1); ++k) {
      numbers[k] = source(instruction.operands[k]);
      if (const auto value = graph_->value(numbers[k])) {
        known[k] = *value;
        continue;
      }
      require(Opcode::kLe, is_for ? graph_->apply(Opcode::kAbs, numbers[k]) : numbers[k],
              program::kMaxLoopCount);
      if (k == 2) require(Opcode::kNe, numbers[k], 0.0);
    }
    const std::string error =
        is_for ? program::check_for(known[0], known[1], known[2]) : program::check_repeat(known[0]);
    if (!error.empty()) refuse(error);
    return condition;
  }

  void execute_mask(const Instruction& instruction) {
    switch (instruction.op) {
      case Opcode::kMaskOn:
        base_ = graph_->apply(Opcode::kNe, source(instruction.operands[0]), graph_->literal(0.0));
        has_base_ = true;
        return;
      case Opcode::kMaskOff:
        has_base_ = false;
        return;
      case Opcode::kMaskPush: {
        if (levels_.size() == program::kMaxMaskDepth)
          refuse(fmt::format("where is nested more than {} deep", program::kMaxMaskDepth));
        const NodeId condition = source(instruction.operands[0]);
        Level& level = levels_.emplace_back();
        level.is_uniform = graph_->is_scalar(condition);
        if (level.is_uniform) {
          level.enabled = graph_->apply(Opcode::kNe, condition, graph_->literal(0.0));
          inherit(levels_.size() - 1);
        } else {
          level.mask = both(levels_.size() < 2 ? kNoNode : levels_[levels_.size() - 2].mask, condition);
        }
        return;
      }
      case Opcode::kMaskElse: {
        Level& level = levels_.back();
        if (level.is_uniform) {
          level.enabled = graph_->apply(Opcode::kNot, level.enabled);
          return inherit(levels_.size() - 1);
        }
        // Both masks are 0 or 1 and the level is a subset of the enclosing one.
        const NodeId enclosing = levels_.size() < 2 ? kNoNode : levels_[levels_.size() - 2].mask;
        level.mask = enclosing == kNoNode ? graph_->apply(Opcode::kNot, level.mask)
                                          : graph_->apply(Opcode::kNe, level.mask, enclosing);
        return;
      }
      default:
        levels_.pop_back();
        return;
    }
  }

  // Frames are floats.
  NodeId converted(NodeId value, CellType type) {
    if (graph_->is_scalar(value) || graph_->node(value).type == type) return value;
    return graph_->apply_plane(type, Opcode::kConvert, value);
  }

  NodeId clock(std::uint32_t index) {
    result_.uses_clock[index] = true;
    Node node;
    node.kind = NodeKind::kClock;
    node.index = index;
    return graph_->add(node);
  }

  void execute_host(const Instruction& instruction) {
    const auto text = [&] { return program_.texts[instruction.operands[0].index]; };
    const std::uint32_t to = instruction.destination.index;
    switch (instruction.op) {
      case Opcode::kSurfaceSense: {
        Node node;
        node.kind = NodeKind::kSense;
        node.index = channel(text(), true);
        return write_register(instruction.destination, converted(graph_->add(node), result_.homes.type(to)),
                              instruction.masked);
      }
      case Opcode::kSurfaceActuate:
        actuations_[channel(text(), false)] = converted(source(instruction.operands[1]), CellType::kFloat32);
        return;
      case Opcode::kSurfaceTick:
      case Opcode::kSurfaceTime:
      case Opcode::kSurfaceDt:
        scalars_[to] = clock(instruction.op == Opcode::kSurfaceTick   ? 0
                             : instruction.op == Opcode::kSurfaceTime ? 1
                                                                      : 2);
        return;
      case Opcode::kSurfaceHas:
        scalars_[to] = graph_->literal(has_channel(text()) ? 1.0 : 0.0);
        return;
      case Opcode::kParameter: {
        const std::string name = text();
        const auto given = options_.parameters.find(name);
        const auto declared = std::ranges::find(program_.parameters, name, &program::Parameter::name);
        scalars_[to] = graph_->literal(given != options_.parameters.end()      ? given->second
                                       : declared != program_.parameters.end() ? declared->default_value
                                                                               : 0.0F);
        return;
      }
      case Opcode::kTimerRead:  // a board has no wall clock
        scalars_[to] = graph_->literal(0.0);
        return;
      case Opcode::kPrintText:
      case Opcode::kPrintValue:
      case Opcode::kPrintLine: {
        warn("warning: a board has no console: print is left out");
        return;
      }
      case Opcode::kShow:
      case Opcode::kDisplay:
      case Opcode::kTile:
      case Opcode::kLabel:
      case Opcode::kLabelText:
      case Opcode::kSetPalette:
      case Opcode::kSetScale:
      case Opcode::kTimerStart:
      case Opcode::kTimerStop:
      case Opcode::kTimerReset:
      case Opcode::kTimerWait:
        return;
      default:
        refuse(fmt::format("{} needs a host, which a board has not",
                           program::opcode_info(instruction.op).mnemonic));
    }
  }

  // ---- regions ----

  void begin(std::uint32_t index, Region& region) {
    const Place& place = entries_[index].place;
    graph_.emplace(region.nodes);
    is_start_ = place.is_start;
    homes_.clear();
    scalars_.clear();
    actuations_.clear();
    levels_.clear();
    const Known& known = entries_[index].known;
    for (std::uint32_t slot = 0; slot < known.size(); ++slot)
      scalars_.push_back(known[slot] ? graph_->literal(*known[slot]) : entry_scalar(slot));
    draws_follow_ = !known[slots_.draws()];
    draws_ = draws_follow_ ? 0 : static_cast<std::uint64_t>(*known[slots_.draws()]);
    rule_ = place.rule;
    stacked_ = place.stacked;
    has_base_ = place.has_base;
    if (has_base_) base_ = home(result_.homes.base());
    for (std::size_t depth = 0; depth < place.uniform_levels.size(); ++depth) {
      Level& level = levels_.emplace_back();
      level.is_uniform = place.uniform_levels[depth];
      if (level.is_uniform) {
        level.enabled = scalars_[slots_.levels() + depth];
        inherit(depth);
      } else {
        level.mask = home(result_.homes.level(depth));
      }
    }
    calls_ = place.calls;
  }

  // Records what the region leaves in the homes, and enters the region that begins at `instruction`.
  std::uint32_t leave_to(std::size_t instruction, bool fails = false) {
    Place place;
    place.fails = fails;
    place.instruction = instruction;
    place.calls = calls_;
    place.has_base = has_base_;
    place.rule = rule_;
    place.stacked = stacked_;
    for (const Level& level : levels_) place.uniform_levels.push_back(level.is_uniform);
    Known known;
    for (const NodeId id : scalars_) known.push_back(graph_->value(id));
    known[slots_.draws()] = draws_follow_ ? std::nullopt : std::optional(static_cast<double>(draws_));
    return enter(place, known);
  }
  void settle(Region& region) {
    for (std::size_t depth = 0; depth < levels_.size(); ++depth) {
      if (levels_[depth].is_uniform) {
        scalars_[slots_.levels() + depth] = levels_[depth].enabled;
      } else {
        NodeId mask = levels_[depth].mask;
        if (graph_->is_scalar(mask)) mask = graph_->apply_plane(CellType::kFloat32, Opcode::kCopy, mask);
        homes_[result_.homes.level(depth)] = mask;
      }
    }
    if (has_base_) homes_[result_.homes.base()] = base_;
    for (const auto& [index, id] : homes_) {
      const Node& node = region.nodes[id];
      if (node.kind != NodeKind::kHome || node.index != index) region.homes_out[index] = id;
    }
    for (std::uint32_t slot = 0; slot < scalars_.size(); ++slot) {
      const Node& node = region.nodes[scalars_[slot]];
      if (slot != slots_.draws() && (node.kind != NodeKind::kScalarEntry || node.index != slot))
        region.scalars_out[slot] = scalars_[slot];
    }
    for (const auto& [index, value] : actuations_) {
      Node node;
      node.kind = NodeKind::kActuate;
      node.operands[0] = value;
      node.index = index;
      region.actuations.push_back(graph_->add(node));
    }
    region.draws_follow = draws_follow_;
    region.draws = draws_;
  }

  Region trace_region(std::uint32_t index) {
    Region region;
    begin(index, region);
    region.is_start = is_start_;
    std::size_t next = entries_[index].place.instruction;
    region.first_instruction = next;
    if (entries_[index].place.fails) {
      const Instruction& check = program_.code[next];
      region.ending = Ending::kFail;
      region.error =
          at(program_, next,
             check.op == Opcode::kCheckFor
                 ? fmt::format("error: 'for' counts from -{0:.0f} to {0:.0f} at most, in steps "
                               "that are not 0",
                               program::kMaxLoopCount)
                 : fmt::format("error: 'repeat' counts up to {:.0f} at most", program::kMaxLoopCount));
      return region;
    }
    for (std::size_t executed = 0;; ++executed) {
      at_ = next;
      if (graph_->size() > kMaxNodes)
        refuse("a tick has more operations than the compiler unrolls: lower --unroll");
      const Instruction& instruction = program_.code[next++];
      const Opcode op = instruction.op;
      if (op >= Opcode::kJump && op <= Opcode::kUnlessGe) {
        const std::size_t target = instruction.operands[op == Opcode::kJump ? 0 : 2].index;
        bool jump = op == Opcode::kJump;
        if (!jump) {
          const bool is_unless = op >= Opcode::kUnlessLt;
          const auto first = static_cast<int>(is_unless ? Opcode::kUnlessLt : Opcode::kJumpLt);
          const auto comparison =
              static_cast<Opcode>(static_cast<int>(Opcode::kLt) + static_cast<int>(op) - first);
          const NodeId a = source(instruction.operands[0]), b = source(instruction.operands[1]);
          const auto x = graph_->value(a), y = graph_->value(b);
          if (!x || !y) {
            region.ending = Ending::kBranch;
            region.comparison = comparison;
            region.expected = !is_unless;
            region.a = a;
            region.b = b;
            settle(region);
            region.next = {leave_to(target), leave_to(next)};
            return region;
          }
          jump = (program::evaluate_scalar(comparison, *x, *y, 0.0) != 0.0) != is_unless;
        }
        if (!jump) continue;
        const bool is_back = target < next;
        next = target;
        if (!is_back || executed < options_.unroll) continue;
        settle(region);
        region.ending = Ending::kJump;
        region.next[0] = leave_to(next);
        return region;
      }
      switch (op) {
        case Opcode::kNop:
          continue;
        case Opcode::kCheckFor:
        case Opcode::kCheckRepeat: {
          const NodeId valid = loop_condition(instruction);
          if (graph_->value(valid)) continue;
          region.ending = Ending::kBranch;
          region.comparison = Opcode::kNe;
          region.a = valid;
          region.b = graph_->literal(0.0);
          settle(region);
          region.next = {leave_to(next), leave_to(at_, true)};
          return region;
        }
        case Opcode::kCall:
          if (calls_.size() == program::kMaxCallDepth)
            refuse(fmt::format("calls are nested more than {} deep: does a routine call itself?",
                               program::kMaxCallDepth));
          calls_.push_back(static_cast<std::uint32_t>(next));
          next = instruction.operands[0].index;
          continue;
        case Opcode::kReturn:
          if (!calls_.empty()) {
            next = calls_.back();
            calls_.pop_back();
            continue;
          }
          [[fallthrough]];
        case Opcode::kEnd:
          settle(region);
          region.ending = Ending::kEnd;
          return region;
        case Opcode::kSurfaceStep:
          settle(region);
          region.ending = Ending::kStep;
          region.next[0] = leave_to(next);
          return region;
        default:
          break;
      }
      if (op >= Opcode::kMaskOn && op <= Opcode::kMaskPop)
        execute_mask(instruction);
      else if (program::opcode_info(op).locality == program::Locality::Host)
        execute_host(instruction);
      else
        execute_data(instruction);
    }
  }

  struct Entry {
    Place place;
    Known known;
  };

  const Program& program_;
  const Options& options_;
  const Slots slots_;
  TileProgram result_;
  std::map<Place, std::uint32_t> places_;
  std::vector<Entry> entries_;
  std::vector<Region> regions_;
  std::set<std::uint32_t> work_;
  std::set<std::string> warned_;

  std::optional<GraphBuilder> graph_;
  bool is_start_ = false;
  std::size_t at_ = 0;  // the instruction
  std::map<std::uint32_t, NodeId> homes_;
  std::vector<NodeId> scalars_;
  std::map<std::uint32_t, NodeId> actuations_;
  std::vector<Level> levels_;
  bool has_base_ = false;
  NodeId base_ = kNoNode;
  std::vector<std::uint32_t> calls_;
  BoundaryRule rule_ = BoundaryRule::kZero;
  std::vector<CellType> stacked_;
  bool draws_follow_ = false;
  std::uint64_t draws_ = 0;
  Operand member_;
};

}  // namespace

TileProgram trace(const Program& program, const Options& options) {
  std::string errors;
  for (const program::NonLocalInstruction& nonlocal : program::find_nonlocal_instructions(program))
    errors += (errors.empty() ? "" : "\n") +
              at(program, nonlocal.instruction, "error: not local: " + nonlocal.reason);
  if (!errors.empty()) throw common::UserError(errors);
  if (const auto loop = program::find_loop_without_step(program))
    throw common::UserError(
        at(program, *loop, "error: from here the program repeats forever without surface.step"));
  try {
    return Tracer(program, options).run();
  } catch (const Refusal& refusal) {
    throw common::UserError(at(program, refusal.instruction, "error: " + refusal.reason));
  }
}

}  // namespace apron::target_c
