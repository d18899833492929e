// Instructions that give a value.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "apron/compiler/Lowering.h"
#include "apron/syntax/Suggestion.h"

namespace apron::compiler {

using program::Opcode;
using program::Operand;
using syntax::ExpressionKind;

Value Lowering::lower_call(const Builtin& builtin, const Expression& call, const Expressions& arguments,
                           Destination* destination) {
  if (!builtin.gives_value()) throw Failure{call.at, fmt::format("'{}' gives no value", call.text)};
  if (arguments.size() < builtin.least || arguments.size() > builtin.most) {
    Expression shown_call = call;
    shown_call.children = arguments;
    wrong_count(builtin, shown_call);
  }
  const std::string quoted = fmt::format("'{}'", call.text);
  switch (builtin.form) {
    case Form::kElementwise:
    case Form::kMac: {
      std::vector<Value> values;
      for (const Expression& argument : arguments) values.push_back(lower(argument));
      return elementwise(builtin.op, values, call.at, destination);
    }
    case Form::kShift:
    case Form::kShiftBy:
      return shift(builtin, arguments, call.at, destination);
    case Form::kNear:
      return near(builtin, arguments, call.at, destination);
    case Form::kMaskIf:
      return comparison(arguments, call.at, destination);
    case Form::kGlobal: {
      const Value source = array(arguments[0], quoted);
      emitter_.release(source);
      return to_variable(builtin.op, {emitter_.operand(source)}, destination);
    }
    case Form::kPixelGet:
      return pixel_get(arguments, destination);
    case Form::kCell:
      return to_register(builtin.op, {}, destination);
    case Form::kRegisterWidth:
    case Form::kRegisterHeight:
    case Form::kRegisterId:
      return register_size(builtin, arguments);
    case Form::kSurfaceScalar:
      return to_variable(builtin.op, {}, destination);
    case Form::kHas:
      return to_variable(builtin.op, {emitter_.text(text(arguments[0], "a channel's name"))}, destination);
    case Form::kSense:
      return to_register(builtin.op, {emitter_.text(text(arguments[0], "a channel's name"))}, destination);
    case Form::kOpen:
      return to_register(builtin.op, {emitter_.text(text(arguments[0], "a file name"))}, destination);
    case Form::kParameterGet:
      return parameter(arguments[0], destination);
    case Form::kPropagate: {
      std::vector<Value> sources;
      for (const Expression& argument : arguments) sources.push_back(array(argument, quoted));
      return apart(builtin.op, sources, {}, destination, call.at);
    }
    case Form::kFilterDo:
    case Form::kFilterGauss:
    case Form::kFilterGaussAni:
    case Form::kFilterEdge:
      return filtered(builtin, arguments, call.at, destination);
    case Form::kRandom:
    case Form::kRandomWhite:
    case Form::kRandomRounded:
      return random(builtin, arguments, call.at, destination);
    case Form::kStackPop:
    case Form::kRead:
      return to_register(builtin.op, {}, destination);
    case Form::kResGet:
      return get_element(builtin, arguments, call.at, destination);
    case Form::kResMatch:
      return match(arguments);
    case Form::kPlugin:
      return plugin(arguments, destination);
    case Form::kOpenCount: {
      const std::string& name = text(arguments[0], "a file name");
      const Value number = scalar(arguments[1], quoted);
      emitter_.release(number);
      return to_register(builtin.op, {emitter_.text(name), emitter_.operand(number)}, destination);
    }
    case Form::kZero:
      return Value::of(0.0F);
    default:
      throw Failure{call.at, fmt::format("'{}' gives no value", call.text)};
  }
}

Value Lowering::pixel_get(const Expressions& arguments, Destination* destination) {
  constexpr std::string_view kWhat = "'pixel.get'";
  const Value source = array(arguments[0], kWhat);
  const Value x = scalar(arguments[1], kWhat);
  const Value y = scalar(arguments[2], kWhat);
  for (const Value& value : {source, x, y}) emitter_.release(value);
  return to_variable(Opcode::kPixelGet, {emitter_.operand(source), emitter_.operand(x), emitter_.operand(y)},
                     destination);
}

Value Lowering::parameter(const Expression& argument, Destination* destination) {
  const std::string& name = text(argument, "a name");
  std::vector<std::string> known;
  for (const program::Parameter& parameter : emitter_.program().parameters) known.push_back(parameter.name);
  if (std::find(known.begin(), known.end(), name) == known.end()) {
    throw Failure{argument.at, fmt::format("no slider or switch '{}' was added before{}", name,
                                           syntax::did_you_mean(name, known))};
  }
  return to_variable(Opcode::kParameter, {emitter_.text(name)}, destination);
}

// (a, op, b), or one expression as a truth of 0 or 1.
Value Lowering::comparison(const Expressions& arguments, Location at, Destination* destination) {
  if (arguments.size() == 1) {
    const Value zero = Value::of(0.0F);
    return elementwise(Opcode::kNe, {lower(arguments[0]), zero}, at, destination);
  }
  if (arguments.size() != 3 || arguments[1].kind != ExpressionKind::kOperator) {
    throw Failure{at, "expected a condition: (a, op, b) with one of < <= > >= == !=, or one expression"};
  }
  const Value left = lower(arguments[0]);
  const Value right = lower(arguments[2]);
  return elementwise(infix_opcode(arguments[1].text), {left, right}, at, destination);
}

// For instructions that write a scalar only: into a register it goes by way of a scalar.
Value Lowering::to_variable(Opcode op, std::vector<Operand> operands, Destination* destination) {
  Value place;
  if (destination != nullptr) {
    const Value wanted = target(*destination, false, {});
    if (wanted.is_register()) {
      place = emitter_.temporary_variable();
      emitter_.emit(op, emitter_.operand(place), std::move(operands));
      emitter_.emit(Opcode::kCopy, emitter_.operand(wanted), {emitter_.operand(place)});
      emitter_.release(place);
      return wanted;
    }
    place = wanted;
  } else {
    place = emitter_.temporary_variable();
  }
  emitter_.emit(op, emitter_.operand(place), std::move(operands));
  return place;
}

// For instructions that fill a register from nothing of its shape.
Value Lowering::to_register(Opcode op, std::vector<Operand> operands, Destination* destination) {
  const Value place = destination != nullptr ? target(*destination, true, hint_) : emitter_.temporary(hint_);
  emitter_.emit(op, emitter_.operand(place), std::move(operands), destination != nullptr);
  return place;
}

}  // namespace apron::compiler
