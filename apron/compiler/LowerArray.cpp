// Shifts, neighbourhoods and single cells.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "apron/compiler/Lowering.h"

namespace apron::compiler {

using program::Opcode;
using syntax::ExpressionKind;

// The source is neither overwritten nor released: the destination must be another register.
Value Lowering::emit_shift(Opcode op, const Value& source, int dx, int dy, ResultDestination* destination,
                           Location location) {
  check_machine_read(op, {source}, location);
  if (dx == 0 && dy == 0) return source;
  const Shape shape = builder_.shape(source);
  Value result;
  bool in_destination = false;
  if (destination != nullptr) {
    result = resolve_destination(*destination, true, shape);
    check_shapes({result, source}, location);
    in_destination = result.index != source.index;
    destination->used = in_destination;
  }
  if (!in_destination) result = builder_.allocate_temporary(shape);
  builder_.emit(op, builder_.operand(result),
                {builder_.operand(source), builder_.literal_operand(static_cast<float>(dx)),
                 builder_.literal_operand(static_cast<float>(dy))},
                in_destination);
  return result;
}

Value Lowering::lower_shift(const Builtin& builtin, const Expressions& arguments, Location location,
                            ResultDestination* destination) {
  int dx = builtin.dx;
  int dy = builtin.dy;
  if (builtin.form == BuiltinForm::kShiftBy) {
    dx = integer_constant(arguments[1], "the distance of a shift");
    dy = integer_constant(arguments[2], "the distance of a shift");
  } else if (arguments.size() == 2) {
    const int distance = integer_constant(arguments[1], "the distance of a shift");
    dx *= distance;
    dy *= distance;
  }
  const Value source = lower_register(arguments[0], "a shift");
  const Value moved = emit_shift(builtin.op, source, dx, dy, destination, location);
  if (moved.index != source.index) builder_.release(source);
  return moved;
}

// The neighbours without the cell itself.
Value Lowering::lower_neighbourhood(const Builtin& builtin, const Expressions& arguments, Location location,
                                    ResultDestination* destination) {
  const int count = arguments.size() == 2 ? integer_constant(arguments[1], "the neighbourhood") : 4;
  if (count != 4 && count != 8) {
    throw CompileError{arguments[1].location, fmt::format("a neighbourhood is 4 or 8 cells, not {}", count)};
  }
  const Value centre = lower_register(arguments[0], "a neighbourhood");
  return emit_out_of_place(builtin.op, {centre}, {builder_.literal_operand(static_cast<float>(count))},
                           destination, location);
}

Value Lowering::emit_out_of_place(Opcode op, const std::vector<Value>& sources,
                                  std::vector<program::Operand> extra_operands,
                                  ResultDestination* destination, Location location) {
  check_machine_read(op, sources, location);
  check_shapes(sources, location);
  const Shape shape = builder_.shape(sources.front());
  Value result;
  bool in_destination = false;
  if (destination != nullptr) {
    result = resolve_destination(*destination, true, shape);
    check_shapes({result, sources.front()}, location);
    in_destination = std::none_of(sources.begin(), sources.end(),
                                  [&](const Value& source) { return source.index == result.index; });
    destination->used = in_destination;
  }
  if (!in_destination) result = builder_.allocate_temporary(shape);
  std::vector<program::Operand> operands;
  for (const Value& source : sources) operands.push_back(builder_.operand(source));
  operands.insert(operands.end(), extra_operands.begin(), extra_operands.end());
  builder_.emit(op, builder_.operand(result), std::move(operands), in_destination);
  for (const Value& source : sources) builder_.release(source);
  return result;
}

std::uint32_t Lowering::register_number(const Value& value, Location location) const {
  const auto number = symbols_.register_number(value.index);
  if (!number) throw CompileError{location, "only a register that was created has a number"};
  return static_cast<std::uint32_t>(*number);
}

Value Lowering::lower_register_property(const Builtin& builtin, const Expressions& arguments) {
  const Value value = lower_register(arguments[0], "this");
  builder_.release(value);
  const Shape shape = builder_.shape(value);
  const std::uint32_t number = builtin.form == BuiltinForm::kRegisterWidth ? shape.width
                               : builtin.form == BuiltinForm::kRegisterHeight
                                   ? shape.height
                                   : register_number(value, arguments[0].location);
  return Value::from_constant(static_cast<float>(number));
}

void Lowering::lower_pixel_set(const Expressions& arguments) {
  const Expression& target = arguments[0];
  ResultDestination destination{&target, false};
  const bool named = target.kind == ExpressionKind::kName || target.kind == ExpressionKind::kElement;
  if (!named || !lower_register(target, "'pixel.set'").is_register()) {
    throw CompileError{target.location, "'pixel.set' writes its first argument: expected a register"};
  }
  const Value x = lower_scalar(arguments[1], "'pixel.set'");
  const Value y = lower_scalar(arguments[2], "'pixel.set'");
  const Value value = lower_scalar(arguments[3], "'pixel.set'");
  const Value target_register = resolve_destination(destination, true, builder_.shape(lower(target)));
  builder_.emit(Opcode::kPixelSet, builder_.operand(target_register),
                {builder_.operand(x), builder_.operand(y), builder_.operand(value)});
}

}  // namespace apron::compiler
