// Instructions that return a value, and operands.
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
  if (!builtin.returns_value()) fail(call.location, "'{}' gives no value", call.text);
  if (arguments.size() < builtin.min_arguments || arguments.size() > builtin.max_arguments) {
    Expression shown_call = call;
    shown_call.children = arguments;
    fail_argument_count(builtin, shown_call);
  }
  switch (builtin.form) {
    case BuiltinForm::kOperands: {
      std::vector<Operand> operands = lower_operands(builtin, call, arguments);
      return program::opcode_info(builtin.op).signature.front() == 'V'
                 ? emit_to_scalar(builtin.op, std::move(operands), destination)
                 : emit_to_register(builtin.op, std::move(operands), destination);
    }
    case BuiltinForm::kElementwise:
    case BuiltinForm::kMac: {
      std::vector<Value> values;
      for (const Expression& argument : arguments) values.push_back(lower(argument));
      return emit_elementwise(builtin.op, values, call.location, destination);
    }
    case BuiltinForm::kConvert:
      return lower_conversion(builtin, arguments[0], call.location, destination);
    case BuiltinForm::kShift:
    case BuiltinForm::kShiftBy:
      return lower_shift(builtin, arguments, call.location, destination);
    case BuiltinForm::kNeighbourhood:
      return lower_neighbourhood(builtin, arguments, call.location, destination);
    case BuiltinForm::kMaskIf:
      return lower_comparison(arguments, call.location, destination);
    case BuiltinForm::kRegisterWidth:
    case BuiltinForm::kRegisterHeight:
    case BuiltinForm::kRegisterId:
      return lower_register_property(builtin, arguments);
    case BuiltinForm::kParameterGet:
      return lower_parameter(arguments[0], destination);
    case BuiltinForm::kPropagate:
      return lower_propagation(builtin, arguments, call.location, destination);
    case BuiltinForm::kScatter:
      return lower_scatter(builtin, arguments, call.location, destination);
    case BuiltinForm::kFilterDo:
    case BuiltinForm::kFilterGauss:
    case BuiltinForm::kFilterGaussAni:
    case BuiltinForm::kFilterEdge:
      return lower_filter(builtin, arguments, call.location, destination);
    case BuiltinForm::kRandom:
    case BuiltinForm::kRandomWhite:
    case BuiltinForm::kRandomRounded:
      return lower_random(builtin, arguments, call.location, destination);
    case BuiltinForm::kElementMatch:
      return lower_element_match(arguments);
    case BuiltinForm::kPlugin:
      return lower_plugin(arguments, destination);
    case BuiltinForm::kKey:
      return lower_key(arguments, destination);
    default:
      fail(call.location, "'{}' gives no value", call.text);
  }
}

// Lowers the arguments as the instruction's signature lists its operands. Those that are left out are 0 or an
// empty text.
std::vector<Operand> Lowering::lower_operands(const Builtin& builtin, const Expression& call,
                                              const Expressions& arguments) {
  const bool reads_element = builtin.op == Opcode::kResGetVar || builtin.op == Opcode::kResGetReg;
  const bool of_variables = builtin.op == Opcode::kResGetVar || builtin.op == Opcode::kResSetVar;
  const std::string subject = reads_element ? "an element's number" : fmt::format("'{}'", call.text);
  const std::string_view letters = program::opcode_info(builtin.op).signature.substr(1);
  std::vector<Operand> operands;
  std::vector<Value> values;
  for (std::size_t i = 0; i < letters.size(); ++i) {
    const Expression* argument = i < arguments.size() ? &arguments[i] : nullptr;
    if (letters[i] == 't') {
      operands.push_back(
          builder_.text_operand(argument ? string_literal(*argument, builtin.text_meaning) : ""));
    } else if (letters[i] == 'g') {
      operands.push_back(group_operand(*argument, of_variables));
    } else {
      values.push_back(argument == nullptr ? Value::from_constant(0.0)
                       : letters[i] == 'r' ? lower_register(*argument, subject)
                       : letters[i] == 's' ? lower_scalar(*argument, subject)
                                           : lower(*argument));
      operands.push_back(builder_.operand(values.back()));
    }
  }
  check_types(builtin.op, values, call.location);
  for (const Value& value : values) builder_.release(value);
  return operands;
}

Value Lowering::lower_parameter(const Expression& argument, ResultDestination* destination) {
  const std::string& name = string_literal(argument, "a name");
  std::vector<std::string> known;
  for (const program::Parameter& parameter : builder_.program().parameters) known.push_back(parameter.name);
  if (std::ranges::find(known, name) == known.end()) {
    fail(argument.location, "no slider or switch '{}' was added before{}", name,
         common::did_you_mean(name, known));
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
    fail(location, "expected a condition: (a, op, b) with one of < <= > >= == !=, or one expression");
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
  // Within an expression, what the host and cell.x give is float.
  const bool is_stored = op == Opcode::kStackPop || op == Opcode::kResGetReg;
  const Shape shape = is_stored ? shape_hint_ : shape_hint_.of_type(program::CellType::kFloat32);
  const Value result = destination != nullptr ? resolve_destination(*destination, true, shape)
                                              : builder_.allocate_temporary(shape);
  emit_fill(op, result, std::move(operands), destination != nullptr);
  return result;
}

// Whole numbers become cells of a register of integers, of which the constant ones must be values.
void Lowering::emit_fill(Opcode op, const Value& result, std::vector<Operand> operands, bool masked) {
  const Shape shape = builder_.shape(result);
  const bool is_whole = op == Opcode::kCellX || op == Opcode::kCellY || op == Opcode::kRandomInt;
  if (!shape.is_integer() || !is_whole) {
    check_result_type(op, result);
    return builder_.emit(op, builder_.operand(result), std::move(operands), masked);
  }
  std::vector<Value> numbers;
  for (const Operand& operand : operands)
    if (operand.kind == program::OperandKind::kLiteral)
      numbers.push_back(Value::from_constant(builder_.program().literals[operand.index]));
  if (op != Opcode::kRandomInt)
    numbers.push_back(Value::from_constant((op == Opcode::kCellX ? shape.width : shape.height) - 1));
  check_cell_values(shape, numbers, builder_.location());
  if (op == Opcode::kRandomInt)
    return builder_.emit(op, builder_.operand(result), std::move(operands), masked);
  const Value filled = builder_.allocate_temporary(shape.of_type(program::CellType::kFloat32));
  builder_.emit(op, builder_.operand(filled), std::move(operands), false);
  builder_.emit(Opcode::kConvert, builder_.operand(result), {builder_.operand(filled)}, masked);
  builder_.release(filled);
}

}  // namespace apron::compiler
