// Conditions, jumps and blocks.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "apron/compiler/Lowering.h"
#include "apron/program/LoopCheck.h"
#include "apron/program/ScalarArithmetic.h"

namespace apron::compiler {

using program::Opcode;
using syntax::ExpressionKind;

namespace {

std::string_view block_keyword(BlockKind kind) {
  static constexpr std::string_view kWords[] = {"if", "while", "for", "repeat", "where"};
  return kWords[static_cast<std::size_t>(kind)];
}

// The jump that is taken if the comparison holds, or unless it does. Because of NaN, "unless <" is not "jump
// >=".
Opcode jump_opcode(Opcode comparison, bool if_holds) {
  if (!if_holds && comparison == Opcode::kEq) return Opcode::kJumpNe;
  if (!if_holds && comparison == Opcode::kNe) return Opcode::kJumpEq;
  const Opcode first = if_holds ? Opcode::kJumpLt : Opcode::kUnlessLt;  // in the order of lt to ne
  return static_cast<Opcode>(static_cast<int>(first) + static_cast<int>(comparison) -
                             static_cast<int>(Opcode::kLt));
}

bool is_comparison(Opcode op) { return op >= Opcode::kLt && op <= Opcode::kNe; }

}  // namespace

std::uint32_t Lowering::current_where_region() const {
  return blocks_.empty() ? 0 : blocks_.back().where_region;
}

// jumpif(condition, #label) and callif(condition, #label).
void Lowering::lower_conditional_jump(const Builtin& builtin, const Expression& call) {
  const Expressions& arguments = call.children;
  const Comparison comparison = lower_condition({arguments.begin(), arguments.end() - 1}, call.location);
  if (builtin.form == BuiltinForm::kJumpIf)
    return emit_conditional_jump(comparison, true, reference_label(arguments.back(), false));
  const ProgramBuilder::Label skip = builder_.new_label();
  emit_conditional_jump(comparison, false, skip);
  emit_jump(Opcode::kCall, arguments.back());
  builder_.bind_label(skip);
}

void Lowering::lower_return(Location location) {
  if (current_where_region() != 0) fail(location, "'return' may not leave a 'where'");
  builder_.emit(Opcode::kReturn);
}

Lowering::Comparison Lowering::lower_condition(const Expressions& arguments, Location location) {
  if (arguments.size() == 1) return lower_expression_condition(arguments[0]);
  if (arguments.size() != 3 || arguments[1].kind != ExpressionKind::kOperator) {
    fail(location, "expected a condition: (a, op, b) with one of < <= > >= == !=, or one expression");
  }
  const Value left = lower_condition_operand(arguments[0]);
  const Value right = lower_condition_operand(arguments[2]);
  return {infix_opcode(arguments[1].text), left, right};
}

Lowering::Comparison Lowering::lower_expression_condition(const Expression& expression) {
  const Opcode op = expression.kind == ExpressionKind::kBinary ? infix_opcode(expression.text) : Opcode::kNop;
  if (!is_comparison(op))
    return {Opcode::kNe, lower_condition_operand(expression), Value::from_constant(0.0F)};
  const Value left = lower_condition_operand(expression.children[0]);
  const Value right = lower_condition_operand(expression.children[1]);
  return {op, left, right};
}

void Lowering::emit_conditional_jump(const Comparison& comparison, bool if_holds,
                                     ProgramBuilder::Label label) {
  const auto& [opcode, left, right] = comparison;
  builder_.release(left);
  builder_.release(right);
  if (left.is_constant() && right.is_constant()) {
    const bool holds = program::evaluate_scalar(opcode, left.constant, right.constant, 0.0) != 0.0;
    if (holds == if_holds) builder_.emit(Opcode::kJump, {}, {builder_.label_operand(label)});
    return;
  }
  builder_.emit(jump_opcode(opcode, if_holds), {},
                {builder_.operand(left), builder_.operand(right), builder_.label_operand(label)});
}

void Lowering::open_block(BlockKind kind, Location location) {
  Block block;
  block.kind = kind;
  block.location = location;
  block.opening = builder_.position() - 1;
  block.test_label = builder_.new_label();
  block.continue_label = builder_.new_label();
  block.end_label = builder_.new_label();
  block.where_region = kind == BlockKind::kWhere ? ++where_region_count_ : current_where_region();
  blocks_.push_back(block);
}

void Lowering::open_if(const Expressions& arguments, Location location) {
  const Comparison comparison = lower_condition(arguments, location);
  open_block(BlockKind::kIf, location);
  emit_conditional_jump(comparison, false, blocks_.back().continue_label);
}

void Lowering::open_while(const Expressions& arguments, Location location) {
  const ProgramBuilder::Label top = builder_.new_label();
  builder_.bind_label(top);
  const Comparison comparison = lower_condition(arguments, location);
  open_block(BlockKind::kWhile, location);
  blocks_.back().test_label = blocks_.back().continue_label = top;
  emit_conditional_jump(comparison, false, blocks_.back().end_label);
}

void Lowering::open_for(const Expressions& arguments, Location location) {
  const Expression& variable = arguments[0];
  const bool is_name = variable.kind == ExpressionKind::kName || variable.kind == ExpressionKind::kElement;
  if (!is_name) fail(variable.location, "expected the scalar that counts: for(i, from, to)");
  const Value from = lower_scalar(arguments[1], "'for'");
  const Value bound = loop_invariant(lower_scalar(arguments[2], "'for'"));
  const Value step = arguments.size() == 4 ? loop_invariant(lower_scalar(arguments[3], "'for'"))
                                           : Value::from_constant(1.0F);
  check_for(from, bound, step,
            step.is_constant() && step.constant == 0.0 ? arguments.back().location : location);
  ResultDestination destination{&variable, false};
  const Value counter = resolve_destination(destination, false, {});
  if (counter.is_register()) fail(variable.location, "'for' counts in a scalar, and this is a register");
  const bool may_be_fraction = !step.is_constant() || step.constant != std::trunc(step.constant);
  const Value first = may_be_fraction ? loop_invariant(from) : Value();
  builder_.emit(Opcode::kCopy, builder_.operand(counter), {builder_.operand(from)});
  open_block(BlockKind::kFor, location);
  Block& block = blocks_.back();
  block.counter = counter;
  block.bound = bound;
  block.step = step;
  if (!step.is_constant()) {
    block.direction = retained(builder_.allocate_scalar_temporary());
    builder_.emit(Opcode::kSign, builder_.operand(block.direction), {builder_.operand(step)});
    block.fraction = retained(builder_.allocate_scalar_temporary());
    builder_.emit(Opcode::kFloor, builder_.operand(block.fraction), {builder_.operand(step)});
    builder_.emit(Opcode::kSub, builder_.operand(block.fraction),
                  {builder_.operand(step), builder_.operand(block.fraction)});
  }
  for (const Value& value : {bound, step, block.direction, block.fraction})
    builder_.describe(value, "the 'for'");
  if (may_be_fraction) count_rounds(block, first);
  builder_.bind_label(block.test_label);
  emit_for_test(block);
}

// Here, as far as the numbers are constants, and before the loop's first round.
void Lowering::check_for(const Value& from, const Value& bound, const Value& step, Location location) {
  const auto constant_or = [](const Value& value, double other) {
    return value.is_constant() ? value.constant : other;
  };
  const std::string error =
      program::check_for(constant_or(from, 0.0), constant_or(bound, 0.0), constant_or(step, 1.0));
  if (!error.empty()) fail(location, "{}", error);
  if (!from.is_constant() || !bound.is_constant() || !step.is_constant())
    builder_.emit(Opcode::kCheckFor, {},
                  {builder_.operand(from), builder_.operand(bound), builder_.operand(step)});
}

// Sums of a fraction drift: ten times 0.1 are more than 1. A loop with such a step computes its counter from
// the number of rounds, which is known before the first one. Bounds and step stand for decimals that no float
// equals, so a last value that is beyond the bound by their rounding alone still has its round.
void Lowering::count_rounds(Block& block, const Value& first) {
  constexpr float kRounding = 0x1p-22F;  // of bounds and step, relative
  constexpr float kMaxSlack = 0.25F;     // of a round
  block.first = first;
  block.round = retained(builder_.allocate_scalar_temporary());
  builder_.emit(Opcode::kCopy, builder_.operand(block.round), {builder_.literal_operand(0.0F)});
  const Value from = borrowed(first), to = borrowed(block.bound), step = borrowed(block.step);
  const auto magnitude = [this](const Value& value) { return compute_scalar(Opcode::kAbs, {value}); };
  const Value sum = compute_scalar(Opcode::kAdd, {magnitude(to), magnitude(from)});
  const Value greatest = compute_scalar(Opcode::kDiv, {sum, magnitude(step)});
  const Value error = compute_scalar(Opcode::kMul, {greatest, Value::from_constant(kRounding)});
  const Value slack = compute_scalar(Opcode::kMin, {error, Value::from_constant(kMaxSlack)});
  const Value span = compute_scalar(Opcode::kSub, {to, from});
  const Value rounds = compute_scalar(Opcode::kAdd, {compute_scalar(Opcode::kDiv, {span, step}), slack});
  block.last_round = retained(compute_scalar(Opcode::kFloor, {rounds}));
  for (const Value& value : {block.first, block.round, block.last_round})
    builder_.describe(value, "the 'for'");
}

// A value that its owner releases.
Value Lowering::borrowed(Value value) {
  value.is_temporary = false;
  return value;
}

// The result of one or two scalars, which it releases.
Value Lowering::compute_scalar(Opcode op, const std::vector<Value>& operands) {
  if (std::ranges::all_of(operands, &Value::is_constant))
    return Value::from_constant(
        program::evaluate_scalar(op, operands.front().constant, operands.back().constant, 0.0));
  std::vector<program::Operand> read;
  for (const Value& value : operands) {
    builder_.release(value);
    read.push_back(builder_.operand(value));
  }
  const Value result = builder_.allocate_scalar_temporary();
  builder_.emit(op, builder_.operand(result), std::move(read));
  return result;
}

// For a step that is not constant.
void Lowering::jump_unless_fraction(const Block& block, ProgramBuilder::Label label) {
  emit_conditional_jump({Opcode::kGt, borrowed(block.fraction), Value::from_constant(0.0)}, false, label);
}

// A copy of the value that the loop's body cannot change; the caller releases it.
Value Lowering::loop_invariant(const Value& value) {
  if (value.is_constant() || value.is_temporary) return retained(value);
  const Value copy = retained(builder_.allocate_scalar_temporary());
  builder_.emit(Opcode::kCopy, builder_.operand(copy), {builder_.operand(value)});
  return copy;
}

void Lowering::emit_for_test(const Block& block) {
  const auto unless = [&](Opcode comparison, const Value& a, const Value& b) {
    emit_conditional_jump({comparison, a, b}, false, block.end_label);
  };
  const auto test_round = [&] { unless(Opcode::kLe, borrowed(block.round), borrowed(block.last_round)); };
  if (block.step.is_constant()) {
    if (block.counts_rounds()) return test_round();
    return unless(block.step.constant > 0.0 ? Opcode::kLe : Opcode::kGe, block.counter,
                  borrowed(block.bound));
  }
  const ProgramBuilder::Label of_whole_step = builder_.new_label(), body = builder_.new_label();
  jump_unless_fraction(block, of_whole_step);
  test_round();
  builder_.emit(Opcode::kJump, {}, {builder_.label_operand(body)});
  builder_.bind_label(of_whole_step);
  // Continues while (bound - counter) * direction >= 0, for steps of either sign.
  const Value remaining = builder_.allocate_scalar_temporary();
  builder_.emit(Opcode::kSub, builder_.operand(remaining),
                {builder_.operand(block.bound), builder_.operand(block.counter)});
  builder_.emit(Opcode::kMul, builder_.operand(remaining),
                {builder_.operand(remaining), builder_.operand(block.direction)});
  unless(Opcode::kGe, remaining, Value::from_constant(0.0));
  builder_.bind_label(body);
}

void Lowering::open_repeat(const Expressions& arguments, Location location) {
  const Value count = lower_scalar(arguments[0], "'repeat'");
  if (count.is_constant()) {
    if (const std::string error = program::check_repeat(count.constant); !error.empty())
      fail(arguments[0].location, "{}", error);
  } else {
    builder_.emit(Opcode::kCheckRepeat, {}, {builder_.operand(count)});
  }
  const Value remaining = retained(builder_.allocate_scalar_temporary());
  builder_.emit(Opcode::kCopy, builder_.operand(remaining), {builder_.operand(count)});
  open_block(BlockKind::kRepeat, location);
  Block& block = blocks_.back();
  block.counter = remaining;
  builder_.describe(remaining, "the 'repeat'");
  builder_.bind_label(block.test_label);
  builder_.emit(
      Opcode::kUnlessGt, {},
      {builder_.operand(remaining), builder_.literal_operand(0.0F), builder_.label_operand(block.end_label)});
}

void Lowering::open_where(const Expressions& arguments, Location location) {
  const Value mask =
      arguments.size() == 1 ? lower(arguments[0]) : lower_comparison(arguments, location, nullptr);
  std::size_t depth = 1;
  for (const Block& block : blocks_) depth += block.kind == BlockKind::kWhere ? 1U : 0U;
  if (depth > program::kMaxMaskDepth) {
    fail(location, "more than {} 'where' are open", program::kMaxMaskDepth);
  }
  const Shape shape = builder_.shape(mask);
  if (mask.is_register()) check_where_shape(shape, location, std::nullopt);
  const Value condition = where_condition(mask);
  open_block(BlockKind::kWhere, location);
  blocks_.back().where_shape = shape;
  blocks_.back().condition = condition;
  builder_.describe(condition, "the 'where'");
  builder_.emit(Opcode::kMaskPush, {}, {builder_.operand(mask)});
}

Lowering::Block& Lowering::require_innermost_block(BlockKind kind, Location location, std::string_view name) {
  if (blocks_.empty()) fail(location, "'{}' has no '{}'", name, block_keyword(kind));
  Block& block = blocks_.back();
  if (block.kind != kind) {
    fail(location, "'{}' comes before the end of the '{}' opened in line {}", name, block_keyword(block.kind),
         block.location.line);
  }
  return block;
}

void Lowering::lower_else(Location location) {
  Block& block = require_innermost_block(BlockKind::kIf, location, "else");
  if (block.has_else) fail(location, "this 'if' has an 'else' already");
  block.has_else = true;
  builder_.emit(Opcode::kJump, {}, {builder_.label_operand(block.end_label)});
  builder_.bind_label(block.continue_label);
}

void Lowering::lower_elsewhere(Location location) {
  Block& block = require_innermost_block(BlockKind::kWhere, location, "elsewhere");
  if (block.has_else) fail(location, "this 'where' has an 'elsewhere' already");
  block.has_else = true;
  block.where_region = ++where_region_count_;
  if (block.from_error) return;
  builder_.emit(Opcode::kMaskElse);
  if (block.condition.is_constant())
    block.condition = Value::from_constant(block.condition.constant == 0.0 ? 1.0 : 0.0);
  else if (block.condition.kind != Value::Kind::kNone)
    builder_.emit(Opcode::kNot, builder_.operand(block.condition), {builder_.operand(block.condition)},
                  false);
}

void Lowering::close_block(BlockKind kind, Location location) {
  const std::string name = fmt::format("end{}", block_keyword(kind));
  const Block block = require_innermost_block(kind, location, name);
  if (block.from_error) {
    // no block was opened
  } else if (kind == BlockKind::kIf) {
    if (!block.has_else) builder_.bind_label(block.continue_label);
  } else if (kind == BlockKind::kWhere) {
    builder_.emit(Opcode::kMaskPop);
  } else {
    close_loop(block);
  }
  builder_.bind_label(block.end_label);
  for (const Value& value : {block.condition, block.counter, block.bound, block.step, block.direction,
                             block.fraction, block.first, block.round})
    builder_.release(value);
  blocks_.pop_back();
}

void Lowering::close_loop(const Block& block) {
  if (block.kind != BlockKind::kWhile) builder_.bind_label(block.continue_label);
  if (block.kind == BlockKind::kFor) {
    advance_for(block);
  } else if (block.kind == BlockKind::kRepeat) {
    builder_.emit(Opcode::kSub, builder_.operand(block.counter),
                  {builder_.operand(block.counter), builder_.literal_operand(1.0F)});
  }
  builder_.emit(Opcode::kJump, {}, {builder_.label_operand(block.test_label)});
}

// Sets the counter of the next round.
void Lowering::advance_for(const Block& block) {
  const ProgramBuilder::Label of_whole_step = builder_.new_label();
  if (block.counts_rounds()) {
    builder_.emit(Opcode::kAdd, builder_.operand(block.round),
                  {builder_.operand(block.round), builder_.literal_operand(1.0F)});
    if (!block.step.is_constant()) jump_unless_fraction(block, of_whole_step);
    builder_.emit(
        Opcode::kMac, builder_.operand(block.counter),
        {builder_.operand(block.round), builder_.operand(block.step), builder_.operand(block.first)});
    if (block.step.is_constant()) return;
    builder_.emit(Opcode::kJump, {}, {builder_.label_operand(block.test_label)});
  }
  builder_.bind_label(of_whole_step);
  builder_.emit(Opcode::kAdd, builder_.operand(block.counter),
                {builder_.operand(block.counter), builder_.operand(block.step)});
}

void Lowering::emit_loop_exit(bool is_continue, Location location) {
  const std::string_view name = is_continue ? "continue" : "break";
  for (auto block = blocks_.rbegin(); block != blocks_.rend(); ++block) {
    if (block->kind == BlockKind::kIf) continue;
    if (block->kind == BlockKind::kWhere) fail(location, "'{}' may not leave a 'where'", name);
    builder_.emit(Opcode::kJump, {},
                  {builder_.label_operand(is_continue ? block->continue_label : block->end_label)});
    return;
  }
  fail(location, "'{}' stands outside of a loop", name);
}

ProgramBuilder::Label Lowering::reference_label(const Expression& label, bool call) {
  if (label.kind != ExpressionKind::kLabel) fail(label.location, "expected a label: #name");
  const auto [found, added] = labels_.try_emplace(label.text);
  if (added) found->second.label = builder_.new_label();
  jumps_.push_back({label.text, current_where_region(), label.location, builder_.position(), call});
  return found->second.label;
}

void Lowering::emit_jump(Opcode op, const Expression& label) {
  const ProgramBuilder::Label target = reference_label(label, op == Opcode::kCall);
  builder_.emit(op, {}, {builder_.label_operand(target)});
}

void Lowering::define_label(const std::string& name, Location location) {
  const auto [found, added] = labels_.try_emplace(name);
  JumpTarget& label = found->second;
  if (added) label.label = builder_.new_label();
  if (label.is_bound) {
    diagnostics_.error(location, fmt::format("the label '#{}' is there already", display_name(name)),
                       {{label.location, "it is"}});
    return;
  }
  label.is_bound = true;
  label.location = location;
  label.where_region = current_where_region();
  label.is_in_macro = !scopes_.empty();
  std::ranges::copy_if(blocks_, std::back_inserter(label.loops), [](const Block& block) {
    return block.kind == BlockKind::kFor || block.kind == BlockKind::kRepeat;
  });
  builder_.bind_label(label.label);
}

// Blocks that a macro within an expression leaves open.
void Lowering::report_open_blocks(std::size_t min_depth) {
  while (blocks_.size() > min_depth) {
    const Block& block = blocks_.back();
    const std::string_view name = block_keyword(block.kind);
    diagnostics_.error(
        block.location,
        fmt::format(
            "this '{0}' has no 'end{0}'; write it on a line of its own after the last line of the '{0}'",
            name));
    blocks_.pop_back();
  }
}

}  // namespace apron::compiler
