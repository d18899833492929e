// Statements about the host: boundaries, console, parameters, the surface.

#include <algorithm>
#include <cmath>
#include <utility>

#include "apron/compiler/Lowering.h"
#include "apron/program/Keys.h"
#include "common/text/Suggestion.h"

namespace apron::compiler {

using program::BoundaryRule;
using program::Opcode;
using syntax::ExpressionKind;

// surface.actuate('name', A) and surface.actuate(A, 'name').
void Lowering::lower_actuate(const Builtin& builtin, const Expression& call) {
  Expressions arguments = call.children;
  if (arguments[1].kind == ExpressionKind::kString) std::swap(arguments[0], arguments[1]);
  builder_.emit(builtin.op, {}, lower_operands(builtin, call, arguments));
}

void Lowering::lower_print(const Builtin& builtin, const Expressions& arguments) {
  // A register and a value beside it stand on lines of their own.
  Value::Kind before = Value::Kind::kNone;
  for (const Expression& argument : arguments) {
    if (argument.kind == ExpressionKind::kString) {
      builder_.emit(Opcode::kPrintText, {}, {builder_.text_operand(argument.text)});
      before = Value::Kind::kNone;
    } else {
      const Value value = lower(argument);
      const bool is_beside_register = before == Value::Kind::kRegister || value.is_register();
      if (before != Value::Kind::kNone && is_beside_register) builder_.emit(Opcode::kPrintLine);
      before = value.kind;
      builder_.emit(Opcode::kPrintValue, {}, {builder_.operand(value)});
      builder_.release(value);
    }
  }
  if (builtin.op == Opcode::kPrintLine) builder_.emit(Opcode::kPrintLine);
}

void Lowering::lower_boundary(const Expression& rule) {
  static const std::vector<std::string> kRules = {"zero", "replicate", "wrap", "reflect"};
  BoundaryRule code = BoundaryRule::kValue;
  Value value = Value::from_constant(0.0F);
  if (rule.kind == ExpressionKind::kString) {
    const auto found = std::ranges::find(kRules, rule.text);
    if (found == kRules.end()) {
      fail(rule.location, "the boundary is 'zero', 'replicate', 'wrap', 'reflect' or a number{}",
           common::did_you_mean(rule.text, kRules));
    }
    code = static_cast<BoundaryRule>(found - kRules.begin());
  } else {
    value = lower_scalar(rule, "'boundary'");
  }
  builder_.emit(Opcode::kBoundary, {},
                {builder_.literal_operand(static_cast<float>(code)), builder_.operand(value)});
}

void Lowering::add_parameter(program::Parameter parameter, Location location) {
  std::vector<program::Parameter>& all = builder_.program().parameters;
  const bool exists =
      std::ranges::any_of(all, [&](const auto& known) { return known.name == parameter.name; });
  if (exists) fail(location, "there is a slider or switch '{}' already", parameter.name);
  const bool ordered = parameter.low <= parameter.default_value && parameter.default_value <= parameter.high;
  if (!ordered || !std::isfinite(parameter.low) || !std::isfinite(parameter.high)) {
    fail(location, "the first value of '{}', {}, is not within {} and {}", parameter.name,
         parameter.default_value, parameter.low, parameter.high);
  }
  all.push_back(std::move(parameter));
}

void Lowering::lower_slider(const Expressions& arguments, Location location) {
  constexpr std::string_view kWhat = "a slider's range";
  program::Parameter parameter;
  parameter.name = string_literal(arguments[0], "a name");
  parameter.low = number_constant(arguments[1], kWhat);
  parameter.high = number_constant(arguments[2], kWhat);
  parameter.default_value = arguments.size() == 4 ? number_constant(arguments[3], kWhat) : parameter.low;
  add_parameter(std::move(parameter), location);
}

void Lowering::lower_switch(const Expressions& arguments, Location location) {
  program::Parameter parameter;
  parameter.is_switch = true;
  parameter.name = string_literal(arguments[0], "a name");
  if (arguments.size() == 2)
    parameter.default_value = number_constant(arguments[1], "a switch's first value");
  if (parameter.default_value != 0.0F && parameter.default_value != 1.0F)
    fail(location, "the first value of the switch '{}' is 0 or 1, not {}", parameter.name,
         parameter.default_value);
  add_parameter(std::move(parameter), location);
}

// sim.label('text'), sim.label('name', 'text') and sim.label('name', number). Further arguments, a position
// in the windows of the original APRON, and registers have no effect.
void Lowering::lower_label(const Expressions& arguments) {
  const bool named =
      !arguments.empty() && arguments.size() <= 2 && arguments[0].kind == ExpressionKind::kString;
  if (!named) return check_names(arguments);
  const program::Operand name = builder_.text_operand(arguments[0].text);
  if (arguments.size() == 1 || arguments[1].kind == ExpressionKind::kString) {
    const program::Operand text = builder_.text_operand(arguments.size() == 2 ? arguments[1].text : "");
    return builder_.emit(Opcode::kLabelText, {}, {name, text});
  }
  const Value value = lower(arguments[1]);
  if (!value.is_register()) builder_.emit(Opcode::kLabel, {}, {name, builder_.operand(value)});
  builder_.release(value);
}

void Lowering::check_names(const Expressions& arguments) {
  for (const Expression& argument : arguments) {
    if (argument.kind == ExpressionKind::kName) lower_name(argument);
    if (argument.kind == ExpressionKind::kElement) find_element(argument);
  }
}

// sim.tile, sim.tile(columns) and sim.tile(columns, rows): the rows follow from the number of tiles.
void Lowering::lower_tile(const Expressions& arguments) {
  Value columns = Value::from_constant(0.0F);
  if (!arguments.empty()) columns = lower_scalar(arguments[0], "'sim.tile'");
  if (arguments.size() == 2) builder_.release(lower_scalar(arguments[1], "'sim.tile'"));
  builder_.emit(Opcode::kTile, {}, {builder_.operand(columns)});
  builder_.release(columns);
}

// io.key: the oldest press that was not read. io.key('left') and io.key(code): whether that key is down.
Value Lowering::lower_key(const Expressions& arguments, ResultDestination* destination) {
  if (arguments.empty()) return emit_to_scalar(Opcode::kKeyPressed, {}, destination);
  const Expression& key = arguments[0];
  Value code;
  if (key.kind == ExpressionKind::kString) {
    const std::optional<int> known = program::key_code(key.text);
    if (!known) fail(key.location, "{}", program::unknown_key_message(key.text));
    code = Value::from_constant(static_cast<float>(*known));
  } else {
    code = lower_scalar(key, "'io.key'");
  }
  builder_.release(code);
  return emit_to_scalar(Opcode::kKeyDown, {builder_.operand(code)}, destination);
}

}  // namespace apron::compiler
