// Random numbers, the stack, elements by number, plugins, numbered pictures, cameras and windows.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "apron/compiler/Lowering.h"
#include "apron/compiler/PaletteName.h"

namespace apron::compiler {

using program::Opcode;
using program::Operand;
using program::OperandKind;
using syntax::ExpressionKind;

// One number a cell where a register is written or read in the statement, else one number.
Value Lowering::draw(Opcode op, const Value& a, const Value& b, Destination* destination) {
  Shape shape = hint_;
  const bool is_register = destination != nullptr ? shape_of(*destination->expression, shape) : in_array_;
  Value place;
  if (destination != nullptr) {
    place = target(*destination, is_register, shape);
  }
  emitter_.release(a);
  emitter_.release(b);
  if (destination == nullptr) place = is_register ? emitter_.temporary(shape) : emitter_.temporary_variable();
  emitter_.emit(op, emitter_.operand(place), {emitter_.operand(a), emitter_.operand(b)},
                destination != nullptr);
  return place;
}

Value Lowering::random(const Builtin& builtin, const Expressions& arguments, Location at,
                       Destination* destination) {
  constexpr std::string_view kWhat = "a random number";
  if (builtin.form == Form::kRandomWhite) {
    const bool is_whole = builtin.op == Opcode::kRandomInt;
    return draw(builtin.op, Value::of(is_whole ? 0.0F : -1.0F), Value::of(1.0F), destination);
  }
  const Value a = scalar(arguments[0], kWhat);
  const Value b = scalar(arguments[1], kWhat);
  if (builtin.form == Form::kRandom) return draw(builtin.op, a, b, destination);
  const bool outer = in_array_;
  Shape shape;
  if (destination != nullptr) in_array_ = shape_of(*destination->expression, shape);
  const Value drawn = draw(builtin.op, a, b, nullptr);
  in_array_ = outer;
  return elementwise(Opcode::kRound, {drawn}, at, destination);
}

// Whether the statement is one of these.
bool Lowering::data_statement(const Builtin& builtin, const Expression& call, const Expressions& arguments) {
  const std::string quoted = fmt::format("'{}'", call.text);
  switch (builtin.form) {
    case Form::kRandomSeed:
      emitter_.emit(builtin.op, {}, {emitter_.operand(scalar(arguments[0], quoted))});
      return true;
    case Form::kStackPush:
      emitter_.emit(builtin.op, {}, {emitter_.operand(array(arguments[0], quoted))});
      return true;
    case Form::kResSet: {
      const bool variables = builtin.op == Opcode::kResSetVar;
      const Operand place = group(arguments[0], variables);
      const Value index = scalar(arguments[1], quoted);
      const Value value = variables ? scalar(arguments[2], quoted) : lower(arguments[2]);
      emitter_.emit(builtin.op, {}, {place, emitter_.operand(index), emitter_.operand(value)});
      return true;
    }
    case Form::kSaveCount: {
      const Value source = array(arguments[0], quoted);
      const Operand name = emitter_.text(text(arguments[1], "a file name"));
      emitter_.emit(builtin.op, {},
                    {emitter_.operand(source), name, emitter_.operand(scalar(arguments[2], quoted))});
      return true;
    }
    case Form::kClipOpen:
      emitter_.emit(builtin.op, {}, {emitter_.text(text(arguments[0], "a file name"))});
      return true;
    case Form::kWebcamOpen:
      emitter_.emit(builtin.op, {},
                    {emitter_.operand(arguments.empty() ? Value::of(0.0F) : scalar(arguments[0], quoted))});
      return true;
    case Form::kShow: {
      const Value shown_register = array(arguments[0], quoted);
      const Operand title = emitter_.text(arguments.size() == 2 ? text(arguments[1], "a title") : "");
      emitter_.emit(builtin.op, {}, {emitter_.operand(shown_register), title});
      return true;
    }
    case Form::kSetPalette:
    case Form::kSetScale:
      return set_colours(builtin, arguments, call.at), true;
    default:
      return false;
  }
}

// reg.setPalette(A, 'name') or (A, scale, 'name'); reg.setScale(A, high) or (A, low, high).
void Lowering::set_colours(const Builtin& builtin, const Expressions& arguments, Location at) {
  const Value place = array(arguments[0], "this");
  Value low = Value::of(0.0F);
  Value high;
  if (builtin.form == Form::kSetPalette) {
    const std::string& name = text(arguments.back(), "a palette");
    const std::string wrong = wrong_palette(name);
    if (!wrong.empty()) throw Failure{arguments.back().at, wrong};
    emitter_.emit(Opcode::kSetPalette, {}, {emitter_.operand(place), emitter_.text(name)});
    if (arguments.size() == 2) return;
    high = scalar(arguments[1], "a scale");
  } else {
    if (arguments.size() == 3) low = scalar(arguments[1], "a scale");
    high = scalar(arguments.back(), "a scale");
  }
  if (!place.is_register()) throw Failure{at, "expected a register"};
  emitter_.emit(Opcode::kSetScale, {},
                {emitter_.operand(place), emitter_.operand(low), emitter_.operand(high)});
}

const std::string& Lowering::class_of(const Expression& expression) const {
  if (expression.kind != ExpressionKind::kName && expression.kind != ExpressionKind::kText) {
    throw Failure{expression.at, "expected a class: REGISTER, VARIABLE or one made by !object"};
  }
  return names_.class_name(expression.text, expression.at);
}

Operand Lowering::group(const Expression& expression, bool of_variables) {
  const std::string& name = class_of(expression);
  if (names_.holds_variables(name, expression.at) != of_variables) {
    throw Failure{expression.at,
                  fmt::format("the class {} is one of {}", name, of_variables ? "registers" : "scalars")};
  }
  std::vector<program::Group>& all = emitter_.program().groups;
  const auto [found, added] = groups_.try_emplace(name, static_cast<std::uint32_t>(all.size()));
  if (added) all.push_back({name, of_variables, {}});
  return {OperandKind::kGroup, found->second};
}

Value Lowering::get_element(const Builtin& builtin, const Expressions& arguments, Location,
                            Destination* destination) {
  const bool variables = builtin.op == Opcode::kResGetVar;
  const Operand place = group(arguments[0], variables);
  const Value index = scalar(arguments[1], "an element's number");
  emitter_.release(index);
  const std::vector<Operand> operands{place, emitter_.operand(index)};
  return variables ? to_variable(builtin.op, operands, destination)
                   : to_register(builtin.op, operands, destination);
}

// The number of the element of that name, or -1: known while compiling.
Value Lowering::match(const Expressions& arguments) {
  const std::string& name = class_of(arguments[0]);
  if (arguments[1].kind != ExpressionKind::kText && arguments[1].kind != ExpressionKind::kName) {
    throw Failure{arguments[1].at, "expected an element's name"};
  }
  const auto found = names_.number(name, arguments[1].text);
  return Value::of(found ? static_cast<float>(*found) : -1.0F);
}

Operand Lowering::module(const Expression& expression) {
  if (expression.kind != ExpressionKind::kModule && expression.kind != ExpressionKind::kText) {
    throw Failure{expression.at, "expected '?', the module loaded last, or a module's name: plugin(?, n, …)"};
  }
  std::vector<std::string>& all = emitter_.program().modules;
  const auto found = std::find(all.begin(), all.end(), expression.text);
  const auto index = static_cast<std::uint32_t>(found - all.begin());
  if (found == all.end()) all.push_back(expression.text);
  return {OperandKind::kModule, index};
}

void Lowering::plugin_arguments(const Expressions& arguments, std::size_t first) {
  if (arguments.size() - first > program::kMaxPluginArguments) {
    throw Failure{arguments[first].at,
                  fmt::format("a plugin takes at most {} arguments", program::kMaxPluginArguments)};
  }
  std::vector<Value> values;
  for (std::size_t i = first; i < arguments.size(); ++i) values.push_back(lower(arguments[i]));
  for (const Value& value : values) {
    emitter_.emit(Opcode::kPluginWith, {}, {emitter_.operand(value)});
    emitter_.release(value);
  }
}

// A register where the statement has one, else a scalar.
Value Lowering::plugin(const Expressions& arguments, Destination* destination) {
  const Operand where = module(arguments[0]);
  const Value operation = scalar(arguments[1], "a plugin's operation");
  plugin_arguments(arguments, 2);
  Shape shape = hint_;
  const bool is_register = destination != nullptr ? shape_of(*destination->expression, shape) : in_array_;
  Value place;
  if (destination != nullptr) {
    place = target(*destination, is_register, shape);
  } else {
    place = is_register ? emitter_.temporary(shape) : emitter_.temporary_variable();
  }
  emitter_.release(operation);
  emitter_.emit(Opcode::kPlugin, emitter_.operand(place), {where, emitter_.operand(operation)},
                destination != nullptr);
  return place;
}

// plugin(?, n, y, a, b) is y = plugin(?, n, a, b); plugin(?, n) writes nothing.
void Lowering::plugin_statement(const Expression& call) {
  const Expressions& arguments = call.children;
  if (arguments.size() == 2) {
    const Operand where = module(arguments[0]);
    const Value operation = scalar(arguments[1], "a plugin's operation");
    return emitter_.emit(Opcode::kPluginDo, {}, {where, emitter_.operand(operation)});
  }
  const Expression& place = arguments[2];
  if (place.kind != ExpressionKind::kName && place.kind != ExpressionKind::kElement) {
    throw Failure{place.at, "'plugin' writes its third argument: expected a register or a scalar"};
  }
  Expressions rest(arguments.begin(), arguments.begin() + 2);
  rest.insert(rest.end(), arguments.begin() + 3, arguments.end());
  in_array_ = shape_of(place, hint_);
  Destination destination{&place, false};
  plugin(rest, &destination);
}

}  // namespace apron::compiler
