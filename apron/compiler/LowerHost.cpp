// Statements for the world beside the array: masks, edges, console, files, parameters, the surface.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "apron/compiler/Lowering.h"
#include "apron/syntax/Suggestion.h"

namespace apron::compiler {

using program::BoundaryRule;
using program::Opcode;
using syntax::ExpressionKind;

// Whether the statement is one of these.
bool Lowering::host(const Builtin& builtin, const Expression& call, const Expressions& arguments) {
  switch (builtin.form) {
    case Form::kMaskOn:
      emitter_.emit(builtin.op, {}, {emitter_.operand(array(arguments[0], "'mask.on'"))});
      return true;
    case Form::kPixelSet:
      return pixel_set(arguments), true;
    case Form::kSave:
      emitter_.emit(builtin.op, {},
                    {emitter_.operand(array(arguments[0], fmt::format("'{}'", call.text))),
                     emitter_.text(text(arguments[1], "a file name"))});
      return true;
    case Form::kActuate: {
      const std::string& channel = text(arguments[0], "a channel's name");
      const Value frame = lower(arguments[1]);
      emitter_.emit(builtin.op, {}, {emitter_.text(channel), emitter_.operand(frame)});
      return true;
    }
    case Form::kBoundary:
      return boundary(arguments[0]), true;
    case Form::kPrint:
      return print(builtin, arguments), true;
    case Form::kSliderAdd:
      return add_slider(arguments, call.at), true;
    case Form::kSwitchAdd:
      return add_switch(arguments, call.at), true;
    case Form::kLabelShow:
      return show_label(arguments), true;
    case Form::kNoEffect:
      return no_effect(arguments), true;
    default:
      return false;
  }
}

void Lowering::print(const Builtin& builtin, const Expressions& arguments) {
  for (const Expression& argument : arguments) {
    if (argument.kind == ExpressionKind::kText) {
      emitter_.emit(Opcode::kPrintText, {}, {emitter_.text(argument.text)});
    } else {
      const Value value = lower(argument);
      emitter_.emit(Opcode::kPrintValue, {}, {emitter_.operand(value)});
      emitter_.release(value);
    }
  }
  if (builtin.op == Opcode::kPrintLine) emitter_.emit(Opcode::kPrintLine);
}

void Lowering::boundary(const Expression& rule) {
  static const std::vector<std::string> kRules = {"zero", "replicate", "wrap", "reflect"};
  BoundaryRule code = BoundaryRule::kValue;
  Value value = Value::of(0.0F);
  if (rule.kind == ExpressionKind::kText) {
    const auto found = std::find(kRules.begin(), kRules.end(), rule.text);
    if (found == kRules.end()) {
      throw Failure{rule.at,
                    fmt::format("the boundary is 'zero', 'replicate', 'wrap', 'reflect' or a number{}",
                                syntax::did_you_mean(rule.text, kRules))};
    }
    code = static_cast<BoundaryRule>(found - kRules.begin());
  } else {
    value = scalar(rule, "'boundary'");
  }
  emitter_.emit(Opcode::kBoundary, {}, {emitter_.literal(static_cast<float>(code)), emitter_.operand(value)});
}

void Lowering::add_parameter(program::Parameter wanted, Location at) {
  std::vector<program::Parameter>& all = emitter_.program().parameters;
  const bool there =
      std::any_of(all.begin(), all.end(), [&](const auto& known) { return known.name == wanted.name; });
  if (there) throw Failure{at, fmt::format("there is a slider or switch '{}' already", wanted.name)};
  const bool ordered = wanted.low <= wanted.initial && wanted.initial <= wanted.high;
  if (!ordered || !std::isfinite(wanted.low) || !std::isfinite(wanted.high)) {
    throw Failure{at, fmt::format("the first value of '{}', {}, is not within {} and {}", wanted.name,
                                  wanted.initial, wanted.low, wanted.high)};
  }
  all.push_back(std::move(wanted));
}

void Lowering::add_slider(const Expressions& arguments, Location at) {
  constexpr std::string_view kWhat = "a slider's range";
  program::Parameter wanted;
  wanted.name = text(arguments[0], "a name");
  wanted.low = constant(arguments[1], kWhat);
  wanted.high = constant(arguments[2], kWhat);
  wanted.initial = arguments.size() == 4 ? constant(arguments[3], kWhat) : wanted.low;
  add_parameter(std::move(wanted), at);
}

void Lowering::add_switch(const Expressions& arguments, Location at) {
  program::Parameter wanted;
  wanted.is_switch = true;
  wanted.name = text(arguments[0], "a name");
  if (arguments.size() == 2)
    wanted.initial = constant(arguments[1], "a switch's first value") != 0.0F ? 1.0F : 0.0F;
  add_parameter(std::move(wanted), at);
}

// sim.label('text'), sim.label('name', 'text') and sim.label('name', number); other forms have no effect.
void Lowering::show_label(const Expressions& arguments) {
  const bool named =
      !arguments.empty() && arguments.size() <= 2 && arguments[0].kind == ExpressionKind::kText;
  if (!named) return no_effect(arguments);
  const program::Operand name = emitter_.text(arguments[0].text);
  if (arguments.size() == 1 || arguments[1].kind == ExpressionKind::kText) {
    const program::Operand text = emitter_.text(arguments.size() == 2 ? arguments[1].text : "");
    return emitter_.emit(Opcode::kLabelText, {}, {name, text});
  }
  const Value value = lower(arguments[1]);
  if (!value.is_register()) emitter_.emit(Opcode::kLabel, {}, {name, emitter_.operand(value)});
  emitter_.release(value);
}

// Windows and timers: nothing is done, but the names must exist.
void Lowering::no_effect(const Expressions& arguments) {
  for (const Expression& argument : arguments) {
    if (argument.kind == ExpressionKind::kName) lower_name(argument);
    if (argument.kind == ExpressionKind::kElement) element(argument);
  }
}

}  // namespace apron::compiler
