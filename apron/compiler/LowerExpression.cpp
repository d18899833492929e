// Names, operators and macros in expressions; destinations.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "apron/compiler/Fold.h"
#include "apron/compiler/Lowering.h"

namespace apron::compiler {

using program::Opcode;
using syntax::ExpressionKind;

namespace {

constexpr float kMaxOffset = 1'000'000.0F;


std::string show(Shape shape) { return fmt::format("{}x{}", shape.width, shape.height); }

}  // namespace

Value Lowering::lower(const Expression& expression, Destination* destination) {
  switch (expression.kind) {
    case ExpressionKind::kNumber:
      return Value::of(expression.number);
    case ExpressionKind::kName:
      return lower_name(expression, destination);
    case ExpressionKind::kElement: {
      const Symbol& symbol = element(expression);
      return symbol.value;
    }
    case ExpressionKind::kCall: {
      const Builtin* builtin = find_builtin(expression.text);
      if (builtin == nullptr) unknown_call(expression);
      return lower_call(*builtin, expression, expression.children, destination);
    }
    case ExpressionKind::kUnary:
      return lower_unary(expression, destination);
    case ExpressionKind::kBinary:
      return lower_binary(expression, destination);
    case ExpressionKind::kExpansion:
      return lower_expansion(expression);
    case ExpressionKind::kText:
      throw Failure{expression.at, "a text has no value here"};
    case ExpressionKind::kOperator:
      throw Failure{expression.at, "a comparison sign alone is for conditions: if(a, <, b)"};
    case ExpressionKind::kLabel:
      throw Failure{expression.at, "a label has no value"};
    case ExpressionKind::kModule:
      throw Failure{expression.at, "'?' stands for a module: plugin(?, n, …)"};
  }
  return {};
}

Value Lowering::lower_name(const Expression& name, Destination* destination) {
  const Symbol* symbol = names_.find(name.text);
  if (symbol == nullptr) {
    const Builtin* builtin = find_builtin(name.text);
    if (builtin != nullptr && builtin->least == 0) return lower_call(*builtin, name, {}, destination);
    if (builtin != nullptr) {
      throw Failure{name.at, fmt::format("'{}' is an instruction and needs its arguments", name.text)};
    }
    if (is_macro_name(name.text)) {
      throw Failure{name.at, fmt::format("'{}' is read before it is written", shown(name.text))};
    }
    if (written_.count(name.text) == 0) {
      std::vector<std::string> known = other_names_;
      for (const std::string& one : written_) {
        if (!is_macro_name(one)) known.push_back(one);
      }
      std::string advice = names_.suggestion(name.text, known);
      if (advice.empty())
        advice = fmt::format("; before it is read, !register({0}) or {0} = 0 makes it one", name.text);
      throw Failure{name.at, fmt::format("'{}' is not a register, and no line writes it as a scalar{}",
                                         name.text, advice)};
    }
    Symbol fresh{
        {Value::Kind::kVariable, emitter_.add_variable(name.text), 0.0F, false}, name.at, true, name.text};
    names_.add(name.text, fresh);
    symbol = names_.find(name.text);
  }
  Value value = symbol->value;
  if (value.kind == Value::Kind::kNothing) throw Failure{name.at, {}};
  if (value.kind == Value::Kind::kVariable && !value.temporary && !symbol->declared) {
    reads_.push_back({value.index, emitter_.position(), name.at});
  }
  value.temporary = false;  // whoever made it releases it
  return value;
}

const Symbol& Lowering::element(const Expression& expression) const {
  const Expression& index = expression.children.front();
  if (index.kind == ExpressionKind::kName) return names_.element(expression.text, index.text, index.at);
  if (index.kind == ExpressionKind::kNumber) return names_.element(expression.text, index.number, index.at);
  throw Failure{index.at,
                fmt::format("an element is named by its name or its number: {}[A]", expression.text)};
}

Value Lowering::lower_unary(const Expression& expression, Destination* destination) {
  const Value value = lower(expression.children.front());
  if (expression.text == "+") return value;
  return elementwise(expression.text == "-" ? Opcode::kNeg : Opcode::kNot, {value}, expression.at,
                     destination);
}

Value Lowering::lower_binary(const Expression& expression, Destination* destination) {
  const Value left = lower(expression.children[0]);
  const Value right = lower(expression.children[1]);
  return elementwise(infix_opcode(expression.text), {left, right}, expression.at, destination);
}

Value Lowering::elementwise(Opcode op, const std::vector<Value>& values, Location at,
                            Destination* destination) {
  if (std::all_of(values.begin(), values.end(), [](const Value& v) { return v.is_constant(); })) {
    std::array<float, program::kMaxSources> in{};
    for (std::size_t i = 0; i < values.size(); ++i) in[i] = values[i].constant;
    if (const auto folded = fold(op, in)) return Value::of(*folded);
  }
  check_shapes(values, at);
  const auto array_value =
      std::find_if(values.begin(), values.end(), [](const Value& v) { return v.is_register(); });
  const bool is_register = array_value != values.end();
  const Shape shape = is_register ? emitter_.shape(*array_value) : Shape{};
  std::vector<program::Operand> operands;
  for (const Value& value : values) operands.push_back(emitter_.operand(value));
  Value place;
  if (destination != nullptr) {
    place = target(*destination, is_register, shape);
    if (place.is_register() && is_register) check_shapes({place, *array_value}, at);
  }
  for (const Value& value : values) emitter_.release(value);
  if (destination == nullptr) place = is_register ? emitter_.temporary(shape) : emitter_.temporary_variable();
  emitter_.emit(op, emitter_.operand(place), operands, destination != nullptr);
  return place;
}

// The register or scalar that a statement writes, made by its first write if need be.
Value Lowering::target(Destination& destination, bool is_register, Shape shape) {
  const Expression& place = *destination.expression;
  destination.used = true;
  Value value = place_for(place, is_register, shape);
  value.temporary = false;  // a macro's own names live as long as the macro
  return value;
}

Value Lowering::place_for(const Expression& place, bool is_register, Shape shape) {
  const bool is_element = place.kind == ExpressionKind::kElement;
  const Symbol* symbol = is_element ? &element(place) : names_.find(place.text);
  if (symbol == nullptr && is_macro_name(place.text)) return local_target(place, is_register, shape);
  if (symbol == nullptr) return new_scalar(place, is_register);
  if (symbol->value.kind == Value::Kind::kNothing) throw Failure{place.at, {}};
  if (!symbol->writable) {
    throw Failure{place.at, fmt::format("'{}' is a value here and cannot be written", symbol->name)};
  }
  if (is_register && !symbol->value.is_register()) {
    throw Failure{place.at,
                  fmt::format("'{}' is a scalar, and the value is a register of {}; globalsum(…) and the "
                              "like make a number of it",
                              symbol->name, show(shape))};
  }
  if (symbol->value.is_register()) check_where(emitter_.shape(symbol->value), place.at);
  return symbol->value;
}

Value Lowering::new_scalar(const Expression& place, bool is_register) {
  const Builtin* builtin = find_builtin(place.text);
  if (builtin != nullptr && builtin->least == 0) {
    throw Failure{place.at, fmt::format("'{}' is the name of an instruction", place.text)};
  }
  if (is_register) {
    const std::string hint = names_.suggestion(place.text, {});
    throw Failure{
        place.at,
        fmt::format("'{}' is not a register, but the value is one{}", place.text,
                    hint.empty() ? fmt::format("; declare it with !register({})", place.text) : hint)};
  }
  Symbol fresh{
      {Value::Kind::kVariable, emitter_.add_variable(place.text), 0.0F, false}, place.at, true, place.text};
  names_.add(place.text, fresh);
  return fresh.value;
}

// A macro's own name takes the kind of what is first written to it, and lives until the macro ends.
Value Lowering::local_target(const Expression& place, bool is_register, Shape shape) {
  Symbol fresh{{}, place.at, true, shown(place.text), false};
  if (is_register) {
    check_where(shape, place.at);
    fresh.value = emitter_.temporary(shape);
    emitter_.keep(fresh.value);
    if (may_be_masked()) {
      emitter_.emit(Opcode::kCopy, emitter_.operand(fresh.value), {emitter_.literal(0.0F)}, false);
    }
  } else {
    fresh.value = kept(emitter_.temporary_variable());
  }
  names_.add(place.text, fresh);
  if (is_local(place.text)) {
    const auto expansion =
        static_cast<std::uint32_t>(std::stoul(place.text.substr(place.text.find(':') + 1)));
    scopes_[expansion].names.push_back(place.text);
    scopes_[expansion].values.push_back(fresh.value);
  }
  return fresh.value;
}

// The macro's result is a fresh register of zeros if an argument is a register, else what its first write
// makes it.
Value Lowering::lower_expansion(const Expression& expression) {
  const syntax::MacroExpansion& expansion = *expression.expansion;
  const std::size_t blocks = blocks_.size();
  const Location outer = emitter_.here();
  enter(expansion);
  written_.insert(expansion.result);
  Shape shape;
  bool found = false;
  for (const Expression& word : expansion.words) found = found || shape_of(word, shape);
  for (const syntax::Binding& binding : expansion.bindings) {
    const Symbol* symbol = names_.find(binding.name);
    if (found || symbol == nullptr || !symbol->value.is_register()) continue;
    shape = emitter_.shape(symbol->value);
    found = true;
  }
  if (found) {
    Expression place;
    place.kind = ExpressionKind::kName;
    place.at = expression.at;
    place.text = expansion.result;
    local_target(place, true, shape);
  }
  for (const Statement& one : expansion.body) statement(one);
  emitter_.at(outer, sources_.file(outer.file).name);
  finish_blocks(blocks);
  const Symbol* symbol = names_.find(expansion.result);
  if (symbol == nullptr) {
    throw Failure{expression.at, fmt::format("the macro '{}' does not write its result", expansion.macro)};
  }
  const Value value = symbol->value;
  names_.remove(expansion.result);
  if (value.kind == Value::Kind::kNothing) throw Failure{expression.at, {}};
  emitter_.unkeep(value);
  return value;
}

Value Lowering::kept(Value value) {
  emitter_.keep(value);
  return value;
}

Value Lowering::scalar(const Expression& expression, std::string_view what) {
  const Value value = lower(expression);
  if (value.is_register()) {
    const std::string_view advice =
        what == "a condition"
            ? "; write where(…) to act on the cells where it holds, or take one value of all: globalany(A)"
            : "";
    throw Failure{expression.at, fmt::format("{} takes a scalar, and this is a register{}", what, advice)};
  }
  return value;
}

Value Lowering::array(const Expression& expression, std::string_view what) {
  const Value value = lower(expression);
  if (!value.is_register()) {
    throw Failure{expression.at, fmt::format("{} takes a register, and this is a scalar", what)};
  }
  return value;
}

float Lowering::constant(const Expression& expression, std::string_view what) {
  const Value value = lower(expression);
  if (!value.is_constant()) throw Failure{expression.at, fmt::format("{} must be a constant", what)};
  return value.constant;
}

int Lowering::whole(const Expression& expression, std::string_view what) {
  const float value = constant(expression, what);
  if (!(std::fabs(value) <= kMaxOffset) || value != std::trunc(value)) {
    throw Failure{expression.at, fmt::format("{} must be a whole number, not {}", what, value)};
  }
  return static_cast<int>(value);
}

const std::string& Lowering::text(const Expression& expression, std::string_view what) const {
  if (expression.kind != ExpressionKind::kText) {
    throw Failure{expression.at, fmt::format("expected {} in single quotes", what)};
  }
  return expression.text;
}

std::string Lowering::describe(const Value& value) const {
  const Symbol* symbol = names_.find_register(value.index);
  return fmt::format("{} is {}", symbol == nullptr ? "another operand" : fmt::format("'{}'", symbol->name),
                     show(emitter_.shape(value)));
}

void Lowering::check_shapes(const std::vector<Value>& values, Location at) const {
  const Value* first = nullptr;
  for (const Value& value : values) {
    if (!value.is_register()) continue;
    if (first == nullptr) first = &value;
    if (emitter_.shape(*first) == emitter_.shape(value)) continue;
    throw Failure{at, fmt::format("the registers of one instruction have one shape, but {} and {}",
                                  describe(*first), describe(value))};
  }
}

void Lowering::check_where(Shape shape, Location at) const {
  for (auto block = blocks_.rbegin(); block != blocks_.rend(); ++block) {
    if (block->where_shape == Shape{}) continue;
    if (block->where_shape == shape) return;
    throw Failure{at, fmt::format("a register of {} is written inside a 'where' over {}", show(shape),
                                  show(block->where_shape))};
  }
}

// The shape that an expression's first register gives it, found without lowering it.
bool Lowering::shape_of(const Expression& expression, Shape& shape) const {
  const Symbol* symbol = nullptr;
  if (expression.kind == ExpressionKind::kName) symbol = names_.find(expression.text);
  if (expression.kind == ExpressionKind::kElement) {
    try {
      symbol = &element(expression);
    } catch (const Failure&) {
      return false;
    }
  }
  if (symbol != nullptr && symbol->value.is_register()) {
    shape = emitter_.shape(symbol->value);
    return true;
  }
  return std::any_of(expression.children.begin(), expression.children.end(),
                     [&](const Expression& child) { return shape_of(child, shape); });
}

bool Lowering::may_be_masked() const {
  return uses_mask_on_ || where_part() != 0 || (uses_where_ && uses_call_);
}

}  // namespace apron::compiler
