// Random numbers, the register stack, elements by index, plugins, image sequences, cameras and windows.

#include <algorithm>
#include <cmath>

#include "apron/compiler/Lowering.h"
#include "apron/compiler/PaletteCheck.h"

namespace apron::compiler {

using program::Opcode;
using program::Operand;
using program::OperandKind;
using syntax::ExpressionKind;

// For instructions that fill a register, if the statement reads or writes one, and otherwise a scalar: one
// random number per cell or a single one.
Value Lowering::emit_to_either(Opcode op, const std::vector<Operand>& operands,
                               ResultDestination* destination) {
  Shape shape = shape_hint_;
  const bool is_register =
      destination != nullptr ? find_shape(*destination->target, shape) : is_register_statement_;
  const Value result = destination != nullptr ? resolve_destination(*destination, is_register, shape)
                       : is_register ? builder_.allocate_temporary(shape.of_type(program::CellType::kFloat32))
                                     : builder_.allocate_scalar_temporary();
  emit_fill(op, result, operands, destination != nullptr);
  return result;
}

Value Lowering::emit_random(Opcode op, const Value& a, const Value& b, ResultDestination* destination) {
  const std::vector<Operand> operands{builder_.operand(a), builder_.operand(b)};
  builder_.release(a);
  builder_.release(b);
  return emit_to_either(op, operands, destination);
}

Value Lowering::lower_random(const Builtin& builtin, const Expressions& arguments, Location location,
                             ResultDestination* destination) {
  constexpr std::string_view kWhat = "a random number";
  if (builtin.form == BuiltinForm::kRandomWhite) {
    const bool is_whole = builtin.op == Opcode::kRandomInt;
    return emit_random(builtin.op, Value::from_constant(is_whole ? 0.0F : -1.0F), Value::from_constant(1.0F),
                       destination);
  }
  const Value a = lower_scalar(arguments[0], kWhat);
  const Value b = lower_scalar(arguments[1], kWhat);
  if (builtin.op == Opcode::kRandomInt && a.is_constant() && b.is_constant() &&
      !(std::ceil(a.constant) <= std::floor(b.constant)))
    fail(location, "there is no whole number from {} to {}", static_cast<float>(a.constant),
         static_cast<float>(b.constant));
  if (builtin.form == BuiltinForm::kRandom) return emit_random(builtin.op, a, b, destination);
  const bool saved = is_register_statement_;
  Shape shape;
  if (destination != nullptr) is_register_statement_ = find_shape(*destination->target, shape);
  const Value drawn = emit_random(builtin.op, a, b, nullptr);
  is_register_statement_ = saved;
  if (!drawn.is_register() || !shape.is_integer())
    return emit_elementwise(Opcode::kRound, {drawn}, location, destination);
  const Value rounded = emit_elementwise(Opcode::kRound, {drawn}, location, nullptr);
  return emit_conversion(Opcode::kConvert, rounded, shape.type, destination, location);
}

// reg.setPalette(A, 'name') or (A, scale, 'name'); reg.setScale(A, high) or (A, low, high).
void Lowering::lower_colour_mapping(const Builtin& builtin, const Expressions& arguments) {
  const Value target = lower_register(arguments[0], "this");
  Value low = Value::from_constant(0.0F);
  Value high;
  if (builtin.op == Opcode::kSetPalette) {
    const std::string& name = string_literal(arguments.back(), "a palette");
    const std::string error = palette_error(name);
    if (!error.empty() && original_) return diagnostics_.warning(arguments.back().location, error);
    if (!error.empty()) fail(arguments.back().location, "{}", error);
    builder_.emit(Opcode::kSetPalette, {}, {builder_.operand(target), builder_.text_operand(name)});
    if (arguments.size() == 2) return;
    high = lower_scalar(arguments[1], "a scale");
  } else {
    if (arguments.size() == 3) low = lower_scalar(arguments[1], "a scale");
    high = lower_scalar(arguments.back(), "a scale");
  }
  builder_.emit(Opcode::kSetScale, {},
                {builder_.operand(target), builder_.operand(low), builder_.operand(high)});
}

const std::string& Lowering::class_name(const Expression& expression) const {
  if (expression.kind != ExpressionKind::kName && expression.kind != ExpressionKind::kString) {
    fail(expression.location, "expected a class: REGISTER, VARIABLE or one made by !object");
  }
  return symbols_.resolve_class(expression.text, expression.location);
}

Operand Lowering::group_operand(const Expression& expression, bool of_variables) {
  const std::string& name = class_name(expression);
  if (symbols_.holds_variables(name, expression.location) != of_variables) {
    fail(expression.location, "the class {} is one of {}", name, of_variables ? "registers" : "scalars");
  }
  if (symbols_.find_array(name) != nullptr) return array_operand(name);
  std::vector<program::OperandGroup>& all = builder_.program().groups;
  const auto [found, added] = group_indices_.try_emplace(name, static_cast<std::uint32_t>(all.size()));
  if (added) all.push_back({name, of_variables, {}});
  return {OperandKind::kGroup, found->second};
}

// The number of the element of that name, known when the program is compiled, or -1.
Value Lowering::lower_element_match(const Expressions& arguments) {
  const std::string& name = class_name(arguments[0]);
  if (arguments[1].kind != ExpressionKind::kString && arguments[1].kind != ExpressionKind::kName) {
    fail(arguments[1].location, "expected an element's name");
  }
  const auto found = symbols_.element_number(name, arguments[1].text);
  return Value::from_constant(found ? static_cast<float>(*found) : -1.0F);
}

Operand Lowering::module_operand(const Expression& expression) {
  if (expression.kind != ExpressionKind::kModule && expression.kind != ExpressionKind::kString) {
    fail(expression.location, "expected '?', the module loaded last, or a module's name: plugin(?, n, …)");
  }
  return {OperandKind::kModule, add_module(expression.text, expression.location)};
}

std::uint32_t Lowering::add_module(const std::string& name, Location location) {
  std::vector<program::Module>& all = builder_.program().modules;
  const auto [found, added] = module_indices_.try_emplace(name, static_cast<std::uint32_t>(all.size()));
  if (added) all.push_back({name, builder_.make_source(location, sources_.file(location.file).name)});
  return found->second;
}

void Lowering::emit_plugin_arguments(const Expressions& arguments, std::size_t first) {
  if (arguments.size() - first > program::kMaxPluginArguments) {
    fail(arguments[first].location, "a plugin takes at most {} arguments", program::kMaxPluginArguments);
  }
  std::vector<Value> values;
  for (std::size_t i = first; i < arguments.size(); ++i) values.push_back(lower(arguments[i]));
  check_types(Opcode::kPluginWith, values, builder_.location());
  for (const Value& value : values) {
    builder_.emit(Opcode::kPluginWith, {}, {builder_.operand(value)});
    builder_.release(value);
  }
}

Value Lowering::lower_plugin(const Expressions& arguments, ResultDestination* destination) {
  const Operand module_index = module_operand(arguments[0]);
  const Value operation = lower_scalar(arguments[1], "a plugin's operation");
  emit_plugin_arguments(arguments, 2);
  const std::vector<Operand> operands{module_index, builder_.operand(operation)};
  builder_.release(operation);
  return emit_to_either(Opcode::kPlugin, operands, destination);
}

// plugin(?, n, y, a, b) is y = plugin(?, n, a, b); plugin(?, n) writes nothing, and neither does plugin(?, n,
// 5, a), whose third argument is a number.
void Lowering::lower_plugin_statement(const Expression& call) {
  const Expressions& arguments = call.children;
  if (arguments.size() == 2 || arguments[2].kind == ExpressionKind::kNumber) {
    const Operand module_index = module_operand(arguments[0]);
    const Value operation = lower_scalar(arguments[1], "a plugin's operation");
    emit_plugin_arguments(arguments, 2);
    return builder_.emit(Opcode::kPluginDo, {}, {module_index, builder_.operand(operation)});
  }
  const Expression& target = arguments[2];
  if (target.kind != ExpressionKind::kName && target.kind != ExpressionKind::kElement) {
    fail(target.location, "'plugin' writes its third argument: expected a register or a scalar");
  }
  Expressions rest(arguments.begin(), arguments.begin() + 2);
  rest.insert(rest.end(), arguments.begin() + 3, arguments.end());
  is_register_statement_ = find_shape(target, shape_hint_);
  assign(target, call.location,
         [&](ResultDestination* destination) { return lower_plugin(rest, destination); });
}

}  // namespace apron::compiler
