// Instructions that return a value.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "apron/compiler/Lowering.h"
#include "common/text/Suggestion.h"

namespace apron::compiler {

using program::Opcode;
using program::Operand;
using syntax::ExpressionKind;

Value Lowering::lower_call(const Builtin& builtin, const Expression& call, const Expressions& arguments,
                           ResultDestination* destination) {
  if (!builtin.returns_value())
    throw CompileError{call.location, fmt::format("'{}' gives no value", call.text)};
  if (arguments.size() < builtin.min_arguments || arguments.size() > builtin.max_arguments) {
    Expression shown_call = call;
    shown_call.children = arguments;
    fail_argument_count(builtin, shown_call);
  }
  const std::string quoted = fmt::format("'{}'", call.text);
  switch (builtin.form) {
    case BuiltinForm::kElementwise:
    case BuiltinForm::kMac: {
      std::vector<Value> values;
      for (const Expression& argument : arguments) values.push_back(lower(argument));
      return emit_elementwise(builtin.op, values, call.location, destination);
    }
    case BuiltinForm::kShift:
    case BuiltinForm::kShiftBy:
      return lower_shift(builtin, arguments, call.location, destination);
    case BuiltinForm::kNeighbourhood:
      return lower_neighbourhood(builtin, arguments, call.location, destination);
    case BuiltinForm::kMaskIf:
      return lower_comparison(arguments, call.location, destination);
    case BuiltinForm::kReduction: {
      const Value source = lower_register(arguments[0], quoted);
      builder_.release(source);
      return emit_to_scalar(builtin.op, {builder_.operand(source)}, destination);
    }
    case BuiltinForm::kPixelGet:
      return lower_pixel_get(arguments, destination);
    case BuiltinForm::kCellCoordinate:
      return emit_to_register(builtin.op, {}, destination);
    case BuiltinForm::kRegisterWidth:
    case BuiltinForm::kRegisterHeight:
    case BuiltinForm::kRegisterId:
      return lower_register_property(builtin, arguments);
    case BuiltinForm::kSurfaceScalar:
      return emit_to_scalar(builtin.op, {}, destination);
    case BuiltinForm::kSurfaceHas:
      return emit_to_scalar(
          builtin.op, {builder_.text_operand(string_literal(arguments[0], "a channel's name"))}, destination);
    case BuiltinForm::kSurfaceSense:
      return emit_to_register(
          builtin.op, {builder_.text_operand(string_literal(arguments[0], "a channel's name"))}, destination);
    case BuiltinForm::kFileOpen:
      return emit_to_register(
          builtin.op, {builder_.text_operand(string_literal(arguments[0], "a file name"))}, destination);
    case BuiltinForm::kParameterGet:
      return lower_parameter(arguments[0], destination);
    case BuiltinForm::kPropagate: {
      std::vector<Value> sources;
      for (const Expression& argument : arguments) sources.push_back(lower_register(argument, quoted));
      return emit_out_of_place(builtin.op, sources, {}, destination, call.location);
    }
    case BuiltinForm::kFilterDo:
    case BuiltinForm::kFilterGauss:
    case BuiltinForm::kFilterGaussAni:
    case BuiltinForm::kFilterEdge:
      return lower_filter(builtin, arguments, call.location, destination);
    case BuiltinForm::kRandom:
    case BuiltinForm::kRandomWhite:
    case BuiltinForm::kRandomRounded:
      return lower_random(builtin, arguments, call.location, destination);
    case BuiltinForm::kStackPop:
    case BuiltinForm::kFrameRead:
      return emit_to_register(builtin.op, {}, destination);
    case BuiltinForm::kElementGet:
      return lower_get_element(builtin, arguments, call.location, destination);
    case BuiltinForm::kElementMatch:
      return lower_element_match(arguments);
    case BuiltinForm::kPlugin:
      return lower_plugin(arguments, destination);
    case BuiltinForm::kNumberedOpen: {
      const std::string& name = string_literal(arguments[0], "a file name");
      const Value number = lower_scalar(arguments[1], quoted);
      builder_.release(number);
      return emit_to_register(builtin.op, {builder_.text_operand(name), builder_.operand(number)},
                              destination);
    }
    case BuiltinForm::kKey:
      return lower_key(arguments, destination);
    case BuiltinForm::kTimerRead:
      return emit_to_scalar(builtin.op, {timer_operand(arguments)}, destination);
    default:
      throw CompileError{call.location, fmt::format("'{}' gives no value", call.text)};
  }
}

Value Lowering::lower_pixel_get(const Expressions& arguments, ResultDestination* destination) {
  constexpr std::string_view kWhat = "'pixel.get'";
  const Value source = lower_register(arguments[0], kWhat);
  const Value x = lower_scalar(arguments[1], kWhat);
  const Value y = lower_scalar(arguments[2], kWhat);
  for (const Value& value : {source, x, y}) builder_.release(value);
  return emit_to_scalar(Opcode::kPixelGet,
                        {builder_.operand(source), builder_.operand(x), builder_.operand(y)}, destination);
}

Value Lowering::lower_parameter(const Expression& argument, ResultDestination* destination) {
  const std::string& name = string_literal(argument, "a name");
  std::vector<std::string> known;
  for (const program::Parameter& parameter : builder_.program().parameters) known.push_back(parameter.name);
  if (std::find(known.begin(), known.end(), name) == known.end()) {
    throw CompileError{argument.location, fmt::format("no slider or switch '{}' was added before{}", name,
                                                      common::did_you_mean(name, known))};
  }
  return emit_to_scalar(Opcode::kParameter, {builder_.text_operand(name)}, destination);
}

// A condition: (a, op, b), or one expression, as 0 or 1.
Value Lowering::lower_comparison(const Expressions& arguments, Location location,
                                 ResultDestination* destination) {
  if (arguments.size() == 1) {
    const Value zero = Value::from_constant(0.0F);
    return emit_elementwise(Opcode::kNe, {lower(arguments[0]), zero}, location, destination);
  }
  if (arguments.size() != 3 || arguments[1].kind != ExpressionKind::kOperator) {
    throw CompileError{location,
                       "expected a condition: (a, op, b) with one of < <= > >= == !=, or one expression"};
  }
  const Value left = lower(arguments[0]);
  const Value right = lower(arguments[2]);
  return emit_elementwise(infix_opcode(arguments[1].text), {left, right}, location, destination);
}

// For instructions that write scalars only: a register is filled from a temporary scalar.
Value Lowering::emit_to_scalar(Opcode op, std::vector<Operand> operands, ResultDestination* destination) {
  Value result;
  if (destination != nullptr) {
    const Value target = resolve_destination(*destination, false, {});
    if (target.is_register()) {
      result = builder_.allocate_scalar_temporary();
      builder_.emit(op, builder_.operand(result), std::move(operands));
      builder_.emit(Opcode::kCopy, builder_.operand(target), {builder_.operand(result)});
      builder_.release(result);
      return target;
    }
    result = target;
  } else {
    result = builder_.allocate_scalar_temporary();
  }
  builder_.emit(op, builder_.operand(result), std::move(operands));
  return result;
}

// For instructions that fill a register without a source of its shape.
Value Lowering::emit_to_register(Opcode op, std::vector<Operand> operands, ResultDestination* destination) {
  const Value result = destination != nullptr ? resolve_destination(*destination, true, shape_hint_)
                                              : builder_.allocate_temporary(shape_hint_);
  builder_.emit(op, builder_.operand(result), std::move(operands), destination != nullptr);
  return result;
}

}  // namespace apron::compiler
