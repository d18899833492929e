// Conditions, jumps and blocks.
#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "apron/compiler/Fold.h"
#include "apron/compiler/Lowering.h"

namespace apron::compiler {

using program::Opcode;
using syntax::ExpressionKind;

namespace {

constexpr float kMaxCount = 16'777'216.0F;  // whole numbers above step over themselves in 32-bit floats

std::string_view word(int kind) {
  static constexpr std::string_view kWords[] = {"if", "while", "for", "repeat", "where"};
  return kWords[kind];
}

Opcode jump_opcode(Opcode compare) {
  switch (compare) {
    case Opcode::kLt:
      return Opcode::kJumpLt;
    case Opcode::kLe:
      return Opcode::kJumpLe;
    case Opcode::kGt:
      return Opcode::kJumpGt;
    case Opcode::kGe:
      return Opcode::kJumpGe;
    case Opcode::kEq:
      return Opcode::kJumpEq;
    default:
      return Opcode::kJumpNe;
  }
}

Opcode unless_opcode(Opcode compare) {
  switch (compare) {
    case Opcode::kLt:
      return Opcode::kUnlessLt;
    case Opcode::kLe:
      return Opcode::kUnlessLe;
    case Opcode::kGt:
      return Opcode::kUnlessGt;
    case Opcode::kGe:
      return Opcode::kUnlessGe;
    case Opcode::kEq:
      return Opcode::kJumpNe;
    default:
      return Opcode::kJumpEq;
  }
}

bool is_comparison(Opcode op) { return op >= Opcode::kLt && op <= Opcode::kNe; }

}  // namespace

std::uint32_t Lowering::where_part() const {
  for (auto block = blocks_.rbegin(); block != blocks_.rend(); ++block) {
    if (block->kind == BlockKind::kWhere) return block->where_part;
  }
  return 0;
}

// Whether the statement is one of flow.
bool Lowering::flow(const Builtin& builtin, const Expression& call, const Expressions& arguments) {
  const Location at = call.at;
  switch (builtin.form) {
    case Form::kJump:
    case Form::kCall:
      jump(builtin.op, arguments[0]);
      return true;
    case Form::kJumpIf:
    case Form::kCallIf: {
      const Condition wanted = condition({arguments.begin(), arguments.end() - 1}, at);
      if (builtin.form == Form::kJumpIf) {
        jump_if(wanted, label_for(arguments.back(), false));
      } else {
        const Emitter::Label over = emitter_.new_label();
        jump_unless(wanted, over);
        jump(Opcode::kCall, arguments.back());
        emitter_.place(over);
      }
      return true;
    }
    case Form::kReturn:
      if (where_part() != 0) throw Failure{at, "'return' may not leave a 'where'"};
      emitter_.emit(Opcode::kReturn);
      return true;
    case Form::kIf:
      return open_if(arguments, at), true;
    case Form::kElse:
      return turn_if(at), true;
    case Form::kEndIf:
      return close(BlockKind::kIf, at), true;
    case Form::kWhile:
      return open_while(arguments, at), true;
    case Form::kEndWhile:
      return close(BlockKind::kWhile, at), true;
    case Form::kFor:
      return open_for(arguments, at), true;
    case Form::kEndFor:
      return close(BlockKind::kFor, at), true;
    case Form::kRepeat:
      return open_repeat(arguments, at), true;
    case Form::kEndRepeat:
      return close(BlockKind::kRepeat, at), true;
    case Form::kBreak:
    case Form::kContinue:
      return leave_loop(builtin.form == Form::kContinue, at), true;
    case Form::kWhere:
      return open_where(arguments, at), true;
    case Form::kElsewhere:
      return turn_where(at), true;
    case Form::kEndWhere:
      return close(BlockKind::kWhere, at), true;
    default:
      return false;
  }
}

Lowering::Condition Lowering::condition(const Expressions& arguments, Location at) {
  if (arguments.size() == 1) return expression_condition(arguments[0]);
  if (arguments.size() != 3 || arguments[1].kind != ExpressionKind::kOperator) {
    throw Failure{at, "expected a condition: (a, op, b) with one of < <= > >= == !=, or one expression"};
  }
  constexpr std::string_view kWhat = "a condition";
  const Value left = scalar(arguments[0], kWhat);
  const Value right = scalar(arguments[2], kWhat);
  return {infix_opcode(arguments[1].text), left, right};
}

Lowering::Condition Lowering::expression_condition(const Expression& expression) {
  constexpr std::string_view kWhat = "a condition";
  const Opcode op = expression.kind == ExpressionKind::kBinary ? infix_opcode(expression.text) : Opcode::kNop;
  if (!is_comparison(op)) return {Opcode::kNe, scalar(expression, kWhat), Value::of(0.0F)};
  const Value left = scalar(expression.children[0], kWhat);
  const Value right = scalar(expression.children[1], kWhat);
  return {op, left, right};
}

void Lowering::jump_unless(const Condition& wanted, Emitter::Label label) {
  emitter_.release(wanted.left);
  emitter_.release(wanted.right);
  if (wanted.left.is_constant() && wanted.right.is_constant()) {
    const bool holds = *fold(wanted.compare, {wanted.left.constant, wanted.right.constant}) != 0.0F;
    if (!holds) emitter_.emit(Opcode::kJump, {}, {emitter_.label(label)});
    return;
  }
  emitter_.emit(unless_opcode(wanted.compare), {},
                {emitter_.operand(wanted.left), emitter_.operand(wanted.right), emitter_.label(label)});
}

void Lowering::jump_if(const Condition& wanted, Emitter::Label label) {
  emitter_.release(wanted.left);
  emitter_.release(wanted.right);
  if (wanted.left.is_constant() && wanted.right.is_constant()) {
    const bool holds = *fold(wanted.compare, {wanted.left.constant, wanted.right.constant}) != 0.0F;
    if (holds) emitter_.emit(Opcode::kJump, {}, {emitter_.label(label)});
    return;
  }
  emitter_.emit(jump_opcode(wanted.compare), {},
                {emitter_.operand(wanted.left), emitter_.operand(wanted.right), emitter_.label(label)});
}

void Lowering::open(BlockKind kind, Location at) {
  Block block;
  block.kind = kind;
  block.at = at;
  block.top = emitter_.new_label();
  block.next = emitter_.new_label();
  block.end = emitter_.new_label();
  if (kind == BlockKind::kWhere) block.where_part = ++where_parts_;
  blocks_.push_back(block);
}

void Lowering::open_if(const Expressions& arguments, Location at) {
  const Condition wanted = condition(arguments, at);
  open(BlockKind::kIf, at);
  jump_unless(wanted, blocks_.back().next);
}

void Lowering::open_while(const Expressions& arguments, Location at) {
  const Emitter::Label top = emitter_.new_label();
  emitter_.place(top);
  const Condition wanted = condition(arguments, at);
  open(BlockKind::kWhile, at);
  blocks_.back().top = blocks_.back().next = top;
  jump_unless(wanted, blocks_.back().end);
}

void Lowering::open_for(const Expressions& arguments, Location at) {
  const Expression& variable = arguments[0];
  const bool is_name = variable.kind == ExpressionKind::kName || variable.kind == ExpressionKind::kElement;
  if (!is_name) throw Failure{variable.at, "expected the scalar that counts: for(i, from, to)"};
  const Value from = scalar(arguments[1], "'for'");
  const Value bound = held(scalar(arguments[2], "'for'"));
  const Value step = arguments.size() == 4 ? held(scalar(arguments[3], "'for'")) : Value::of(1.0F);
  if (step.is_constant() && !(step.constant > 0.0F || step.constant < 0.0F)) {
    throw Failure{arguments.back().at, "the step of a 'for' cannot be zero"};
  }
  for (const Value& end : {from, bound}) {
    if (end.is_constant() && std::abs(end.constant) > kMaxCount) {
      throw Failure{at, fmt::format("'for' counts up to {} at most", kMaxCount)};
    }
  }
  Destination destination{&variable, false};
  const Value counter = target(destination, false, {});
  if (counter.is_register()) throw Failure{variable.at, "'for' counts in a scalar, and this is a register"};
  emitter_.emit(Opcode::kCopy, emitter_.operand(counter), {emitter_.operand(from)});
  open(BlockKind::kFor, at);
  Block& block = blocks_.back();
  block.counter = counter;
  block.bound = bound;
  block.step = step;
  emitter_.place(block.top);
  test_for(block);
}

// A value that no statement of a loop's body can change, until it is released.
Value Lowering::held(const Value& value) {
  if (value.is_constant() || value.temporary) return kept(value);
  const Value copy = kept(emitter_.temporary_variable());
  emitter_.emit(Opcode::kCopy, emitter_.operand(copy), {emitter_.operand(value)});
  return copy;
}

void Lowering::test_for(const Block& block) {
  if (block.step.is_constant()) {
    Value limit = block.bound;
    limit.temporary = false;  // released when the loop ends
    return jump_unless({block.step.constant > 0.0F ? Opcode::kLe : Opcode::kGe, block.counter, limit},
                       block.end);
  }
  // Goes on while (bound - counter) * step >= 0, whichever way the step goes.
  const Value ahead = emitter_.temporary_variable();
  emitter_.emit(Opcode::kSub, emitter_.operand(ahead),
                {emitter_.operand(block.bound), emitter_.operand(block.counter)});
  emitter_.emit(Opcode::kMul, emitter_.operand(ahead),
                {emitter_.operand(ahead), emitter_.operand(block.step)});
  jump_unless({Opcode::kGe, ahead, Value::of(0.0F)}, block.end);
}

void Lowering::open_repeat(const Expressions& arguments, Location at) {
  const Value count = scalar(arguments[0], "'repeat'");
  if (count.is_constant() && !(count.constant <= kMaxCount)) {
    throw Failure{arguments[0].at, fmt::format("'repeat' counts up to {} at most", kMaxCount)};
  }
  const Value left = kept(emitter_.temporary_variable());
  emitter_.emit(Opcode::kCopy, emitter_.operand(left), {emitter_.operand(count)});
  open(BlockKind::kRepeat, at);
  Block& block = blocks_.back();
  block.counter = left;
  emitter_.place(block.top);
  emitter_.emit(Opcode::kUnlessGt, {},
                {emitter_.operand(left), emitter_.literal(0.0F), emitter_.label(block.end)});
}

void Lowering::open_where(const Expressions& arguments, Location at) {
  const Value wanted = arguments.size() == 1 ? lower(arguments[0]) : comparison(arguments, at, nullptr);
  std::size_t depth = 1;
  for (const Block& block : blocks_) depth += block.kind == BlockKind::kWhere ? 1U : 0U;
  if (depth > program::kMaxMaskDepth) {
    throw Failure{at, fmt::format("more than {} 'where' are open", program::kMaxMaskDepth)};
  }
  const Shape shape = emitter_.shape(wanted);
  if (wanted.is_register()) check_where(shape, at);
  open(BlockKind::kWhere, at);
  blocks_.back().where_shape = shape;
  emitter_.emit(Opcode::kMaskPush, {}, {emitter_.operand(wanted)});
}

Lowering::Block& Lowering::innermost(BlockKind kind, Location at, std::string_view name) {
  if (blocks_.empty()) throw Failure{at, fmt::format("'{}' has no '{}'", name, word(static_cast<int>(kind)))};
  Block& block = blocks_.back();
  if (block.kind != kind) {
    throw Failure{at, fmt::format("'{}' comes before the end of the '{}' opened in line {}", name,
                                  word(static_cast<int>(block.kind)), block.at.line)};
  }
  return block;
}

void Lowering::turn_if(Location at) {
  Block& block = innermost(BlockKind::kIf, at, "else");
  if (block.else_seen) throw Failure{at, "this 'if' has an 'else' already"};
  block.else_seen = true;
  emitter_.emit(Opcode::kJump, {}, {emitter_.label(block.end)});
  emitter_.place(block.next);
}

void Lowering::turn_where(Location at) {
  Block& block = innermost(BlockKind::kWhere, at, "elsewhere");
  if (block.else_seen) throw Failure{at, "this 'where' has an 'elsewhere' already"};
  block.else_seen = true;
  block.where_part = ++where_parts_;
  if (!block.endless) emitter_.emit(Opcode::kMaskElse);
}

void Lowering::close(BlockKind kind, Location at) {
  const std::string name = fmt::format("end{}", word(static_cast<int>(kind)));
  const Block block = innermost(kind, at, name);
  if (block.endless) {
    // nothing was opened
  } else if (kind == BlockKind::kIf) {
    if (!block.else_seen) emitter_.place(block.next);
  } else if (kind == BlockKind::kWhere) {
    emitter_.emit(Opcode::kMaskPop);
  } else {
    close_loop(block);
  }
  emitter_.place(block.end);
  for (const Value& value : {block.counter, block.bound, block.step}) emitter_.release(value);
  blocks_.pop_back();
}

void Lowering::close_loop(const Block& block) {
  if (block.kind != BlockKind::kWhile) emitter_.place(block.next);
  if (block.kind == BlockKind::kFor) {
    emitter_.emit(Opcode::kAdd, emitter_.operand(block.counter),
                  {emitter_.operand(block.counter), emitter_.operand(block.step)});
  } else if (block.kind == BlockKind::kRepeat) {
    emitter_.emit(Opcode::kSub, emitter_.operand(block.counter),
                  {emitter_.operand(block.counter), emitter_.literal(1.0F)});
  }
  emitter_.emit(Opcode::kJump, {}, {emitter_.label(block.top)});
}

void Lowering::leave_loop(bool again, Location at) {
  const std::string_view name = again ? "continue" : "break";
  for (auto block = blocks_.rbegin(); block != blocks_.rend(); ++block) {
    if (block->kind == BlockKind::kIf) continue;
    if (block->kind == BlockKind::kWhere)
      throw Failure{at, fmt::format("'{}' may not leave a 'where'", name)};
    emitter_.emit(Opcode::kJump, {}, {emitter_.label(again ? block->next : block->end)});
    return;
  }
  throw Failure{at, fmt::format("'{}' stands outside of a loop", name)};
}

Emitter::Label Lowering::label_for(const Expression& label, bool call) {
  if (label.kind != ExpressionKind::kLabel) throw Failure{label.at, "expected a label: #name"};
  const auto [found, added] = labels_.try_emplace(label.text);
  if (added) found->second.label = emitter_.new_label();
  jumps_.push_back({label.text, where_part(), label.at, call});
  return found->second.label;
}

void Lowering::jump(Opcode op, const Expression& label) {
  const Emitter::Label wanted = label_for(label, op == Opcode::kCall);
  emitter_.emit(op, {}, {emitter_.label(wanted)});
}

void Lowering::place_label(const std::string& name, Location at) {
  const auto [found, added] = labels_.try_emplace(name);
  Target& label = found->second;
  if (added) label.label = emitter_.new_label();
  if (label.placed) {
    diagnostics_.error(at, fmt::format("the label '#{}' is there already", shown(name)),
                       {{label.at, "it is"}});
    return;
  }
  label.placed = true;
  label.at = at;
  label.where_part = where_part();
  emitter_.place(label.label);
}

// Blocks that a text or a macro in an expression leaves open.
void Lowering::finish_blocks(std::size_t floor) {
  while (blocks_.size() > floor) {
    const Block& block = blocks_.back();
    const std::string_view name = word(static_cast<int>(block.kind));
    diagnostics_.error(
        block.at,
        fmt::format(
            "this '{0}' has no 'end{0}'; write it on a line of its own after the last line of the '{0}'",
            name));
    blocks_.pop_back();
  }
}

}  // namespace apron::compiler
