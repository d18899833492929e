// Shifts, neighbourhoods and single cells.
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
  constexpr std::string_view kSubject = "the distance of a shift";
  std::vector<Value> distances;
  for (std::size_t i = 1; i < arguments.size(); ++i)
    distances.push_back(lower_scalar(arguments[i], kSubject));
  if (std::ranges::any_of(distances, [](const Value& v) { return !v.is_constant(); }))
    return lower_variable_shift(builtin, arguments[0], distances, destination, location);
  int dx = builtin.dx;
  int dy = builtin.dy;
  if (builtin.form == BuiltinForm::kShiftBy) {
    dx = integer_constant(arguments[1], kSubject);
    dy = integer_constant(arguments[2], kSubject);
  } else if (arguments.size() == 2) {
    const int distance = integer_constant(arguments[1], kSubject);
    dx *= distance;
    dy *= distance;
  }
  const Value source = lower_register(arguments[0], "a shift");
  const Value moved = emit_shift(builtin.op, source, dx, dy, destination, location);
  if (moved.index != source.index) builder_.release(source);
  return moved;
}

// A shift whose distance is computed at run time.
Value Lowering::lower_variable_shift(const Builtin& builtin, const Expression& source_expression,
                                     const std::vector<Value>& distances, ResultDestination* destination,
                                     Location location) {
  const Value zero = Value::from_constant(0.0F);
  const auto signed_distance = [&](int sign) {
    if (sign == 0) return zero;
    return sign > 0 ? distances[0] : emit_elementwise(Opcode::kNeg, {distances[0]}, location, nullptr);
  };
  const bool is_vector = builtin.form == BuiltinForm::kShiftBy;
  const Value dx = is_vector ? distances[0] : signed_distance(builtin.dx);
  const Value dy = is_vector ? distances[1] : signed_distance(builtin.dy);
  const Value source = lower_register(source_expression, "a shift");
  const Value moved = emit_out_of_place(builtin.op, {source}, {builder_.operand(dx), builder_.operand(dy)},
                                        destination, location);
  builder_.release(dx);
  builder_.release(dy);
  return moved;
}

Value Lowering::lower_neighbourhood(const Builtin& builtin, const Expressions& arguments, Location location,
                                    ResultDestination* destination) {
  const int count = arguments.size() == 2 ? integer_constant(arguments[1], "the neighbourhood") : 4;
  if (count != 4 && count != 8) {
    fail(arguments[1].location, "a neighbourhood is 4 or 8 cells, not {}", count);
  }
  const Value centre = lower_register(arguments[0], "a neighbourhood");
  return emit_out_of_place(builtin.op, {centre}, {builder_.literal_operand(static_cast<float>(count))},
                           destination, location);
}

// Seeds and masks are truths of any type; flood and distance give registers of the mask's type, and what
// spreads is of its own.
Value Lowering::lower_propagation(const Builtin& builtin, const Expressions& arguments, Location location,
                                  ResultDestination* destination) {
  using program::CellType;
  std::vector<Value> sources;
  for (const Expression& argument : arguments)
    sources.push_back(lower_register(argument, fmt::format("'{}'", builtin.name)));
  const bool spreads = builtin.op == Opcode::kSpreadMax || builtin.op == Opcode::kSpreadSum;
  const Shape shape = builder_.shape(spreads ? sources.front() : sources.back());
  if (builtin.op == Opcode::kSpreadNumber)
    return emit_out_of_place(builtin.op, sources, {}, destination, location, shape.of_type(CellType::kInt32));
  if (builtin.op != Opcode::kDistance || !shape.is_integer())
    return emit_out_of_place(builtin.op, sources, {}, destination, location, shape);
  // Computed with floats, which hold all distances.
  sources[0] = truth_of_type(sources[0], CellType::kFloat32, location);
  const Value result = emit_out_of_place(builtin.op, sources, {}, nullptr, location);
  return emit_conversion(Opcode::kConvert, result, shape.type, destination, location);
}

// The sums have the type of what is added. Numbers add up in the destination, or in floats; a histogram
// counts 1 for each cell.
Value Lowering::lower_scatter(const Builtin& builtin, const Expressions& arguments, Location location,
                              ResultDestination* destination) {
  const Shape outer_hint = shape_hint_;  // operands have a shape of their own
  for (const Expression& argument : arguments)
    if (find_shape(argument, shape_hint_)) break;
  const Value at = lower_register(arguments[0], fmt::format("'{}'", builtin.name));
  const Value added = arguments.size() > 1 ? lower(arguments[1]) : Value::from_constant(1.0F);
  if (added.is_register() && !builder_.shape(at).has_size_of(builder_.shape(added)))
    check_shapes({at, added}, location);
  const std::vector<program::Operand> operands{builder_.operand(at), builder_.operand(added)};
  builder_.release(at);
  builder_.release(added);
  shape_hint_ = outer_hint;
  const Shape shape =
      shape_hint_.of_type(added.is_register() ? builder_.shape(added).type : program::CellType::kFloat32);
  const Value result = destination != nullptr ? resolve_destination(*destination, true, shape)
                                              : builder_.allocate_temporary(shape);
  const Shape written = builder_.shape(result);
  if (added.is_register() && written.type != shape.type)
    check_shapes({result, builder_.allocate_temporary(written.of_type(shape.type))}, location);
  check_cell_values(written, {added}, location);
  builder_.emit(builtin.op, builder_.operand(result), operands, destination != nullptr);
  return result;
}

Value Lowering::emit_out_of_place(Opcode op, const std::vector<Value>& sources,
                                  std::vector<program::Operand> extra_operands,
                                  ResultDestination* destination, Location location,
                                  std::optional<Shape> of_any_types) {
  check_machine_read(op, sources, location);
  check_types(op, sources, location);
  const Shape shape = of_any_types.value_or(builder_.shape(sources.front()));
  for (const Value& source : sources)
    if (!of_any_types || !shape.has_size_of(builder_.shape(source)))
      check_shapes({sources.front(), source}, location);
  Value result;
  bool in_destination = false;
  if (destination != nullptr) {
    result = resolve_destination(*destination, true, shape);
    if (builder_.shape(result) != shape)
      check_shapes({result, of_any_types ? builder_.allocate_temporary(shape) : sources.front()}, location);
    in_destination =
        std::ranges::none_of(sources, [&](const Value& source) { return source.index == result.index; });
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
  if (!number) fail(location, "only a register that was created has a number");
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
    fail(target.location, "'pixel.set' writes its first argument: expected a register");
  }
  const Value x = lower_scalar(arguments[1], "'pixel.set'");
  const Value y = lower_scalar(arguments[2], "'pixel.set'");
  const Value value = lower_scalar(arguments[3], "'pixel.set'");
  const Value written = resolve_destination(destination, true, builder_.shape(lower(target)));
  check_cell_values(builder_.shape(written), {value}, arguments[3].location);
  const std::vector<program::Operand> operands{builder_.operand(x), builder_.operand(y),
                                               builder_.operand(value)};
  std::vector<Value> conditions = conditions_since(mask_base(written));
  if (conditions.empty()) return builder_.emit(Opcode::kPixelSet, builder_.operand(written), operands);
  const Value changed = builder_.allocate_temporary(builder_.shape(written));
  builder_.emit(Opcode::kCopy, builder_.operand(changed), {builder_.operand(written)}, false);
  builder_.emit(Opcode::kPixelSet, builder_.operand(changed), operands, false);
  emit_selection(written, changed, std::move(conditions), target.location);
}

}  // namespace apron::compiler
