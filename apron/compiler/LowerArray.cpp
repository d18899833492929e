// Shifts, neighbourhoods and single cells.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "apron/compiler/Lowering.h"

namespace apron::compiler {

using program::Opcode;
using syntax::ExpressionKind;

// The source stays as it is and is not released: the destination is never the source.
Value Lowering::move(Opcode op, const Value& source, int dx, int dy, Destination* destination, Location at) {
  if (dx == 0 && dy == 0) return source;
  const Shape shape = emitter_.shape(source);
  Value place;
  bool direct = false;
  if (destination != nullptr) {
    place = target(*destination, true, shape);
    check_shapes({place, source}, at);
    direct = place.index != source.index;
    destination->used = direct;
  }
  if (!direct) place = emitter_.temporary(shape);
  emitter_.emit(op, emitter_.operand(place),
                {emitter_.operand(source), emitter_.literal(static_cast<float>(dx)),
                 emitter_.literal(static_cast<float>(dy))},
                direct);
  return place;
}

Value Lowering::shift(const Builtin& builtin, const Expressions& arguments, Location at,
                      Destination* destination) {
  int dx = builtin.dx;
  int dy = builtin.dy;
  if (builtin.form == Form::kShiftBy) {
    dx = whole(arguments[1], "the distance of a shift");
    dy = whole(arguments[2], "the distance of a shift");
  } else if (arguments.size() == 2) {
    const int distance = whole(arguments[1], "the distance of a shift");
    dx *= distance;
    dy *= distance;
  }
  const Value source = array(arguments[0], "a shift");
  const Value moved = move(builtin.op, source, dx, dy, destination, at);
  if (moved.index != source.index) emitter_.release(source);
  return moved;
}

// The neighbours only, never the own cell.
Value Lowering::near(const Builtin& builtin, const Expressions& arguments, Location at,
                     Destination* destination) {
  const int count = arguments.size() == 2 ? whole(arguments[1], "the neighbourhood") : 4;
  if (count != 4 && count != 8) {
    throw Failure{arguments[1].at, fmt::format("a neighbourhood is 4 or 8 cells, not {}", count)};
  }
  const Value own = array(arguments[0], "a neighbourhood");
  return apart(builtin.op, {own}, {emitter_.literal(static_cast<float>(count))}, destination, at);
}

Value Lowering::apart(Opcode op, const std::vector<Value>& sources, std::vector<program::Operand> more,
                      Destination* destination, Location at) {
  check_shapes(sources, at);
  const Shape shape = emitter_.shape(sources.front());
  Value place;
  bool direct = false;
  if (destination != nullptr) {
    place = target(*destination, true, shape);
    check_shapes({place, sources.front()}, at);
    direct = std::none_of(sources.begin(), sources.end(),
                          [&](const Value& source) { return source.index == place.index; });
    destination->used = direct;
  }
  if (!direct) place = emitter_.temporary(shape);
  std::vector<program::Operand> operands;
  for (const Value& source : sources) operands.push_back(emitter_.operand(source));
  operands.insert(operands.end(), more.begin(), more.end());
  emitter_.emit(op, emitter_.operand(place), std::move(operands), direct);
  for (const Value& source : sources) emitter_.release(source);
  return place;
}

std::uint32_t Lowering::register_number(const Value& value, Location at) const {
  const auto number = names_.register_number(value.index);
  if (!number) throw Failure{at, "only a register that was created has a number"};
  return static_cast<std::uint32_t>(*number);
}

Value Lowering::register_size(const Builtin& builtin, const Expressions& arguments) {
  const Value value = array(arguments[0], "this");
  emitter_.release(value);
  const Shape shape = emitter_.shape(value);
  const std::uint32_t number = builtin.form == Form::kRegisterWidth ? shape.width
                               : builtin.form == Form::kRegisterHeight
                                   ? shape.height
                                   : register_number(value, arguments[0].at);
  return Value::of(static_cast<float>(number));
}

void Lowering::pixel_set(const Expressions& arguments) {
  const Expression& place = arguments[0];
  Destination destination{&place, false};
  const bool named = place.kind == ExpressionKind::kName || place.kind == ExpressionKind::kElement;
  if (!named || !array(place, "'pixel.set'").is_register()) {
    throw Failure{place.at, "'pixel.set' writes its first argument: expected a register"};
  }
  const Value x = scalar(arguments[1], "'pixel.set'");
  const Value y = scalar(arguments[2], "'pixel.set'");
  const Value value = scalar(arguments[3], "'pixel.set'");
  const Value wanted = target(destination, true, emitter_.shape(lower(place)));
  emitter_.emit(Opcode::kPixelSet, emitter_.operand(wanted),
                {emitter_.operand(x), emitter_.operand(y), emitter_.operand(value)});
}

}  // namespace apron::compiler
