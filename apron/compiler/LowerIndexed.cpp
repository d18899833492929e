// Arrays of registers and of scalars: ch[i]. An index that is a constant names an element; any other is
// computed when the program runs.
#include <algorithm>
#include <cmath>

#include "apron/compiler/Lowering.h"
#include "apron/program/ScalarArithmetic.h"

namespace apron::compiler {

using program::Opcode;
using syntax::ExpressionKind;

bool Lowering::is_array_element(const Expression& expression) const {
  return expression.kind == ExpressionKind::kElement && symbols_.find_array(expression.text) != nullptr;
}

std::optional<double> Lowering::constant_value(const Expression& expression) const {
  if (expression.kind == ExpressionKind::kNumber) return expression.number;
  std::vector<double> operands;
  for (const Expression& child : expression.children) {
    const std::optional<double> value = constant_value(child);
    if (!value) return std::nullopt;
    operands.push_back(*value);
  }
  if (expression.kind == ExpressionKind::kBinary)
    return program::evaluate_scalar(infix_opcode(expression.text), operands[0], operands[1], 0.0);
  if (expression.kind == ExpressionKind::kUnary && expression.text == "-") return -operands[0];
  if (expression.kind == ExpressionKind::kUnary && expression.text == "+") return operands[0];
  return std::nullopt;
}

// The element that a constant index names, or null. Throws a CompileError if there is none of that number.
const Symbol* Lowering::array_element(const Expression& expression) const {
  const std::optional<double> index = constant_value(expression.children.front());
  if (!index) return nullptr;
  const std::vector<Symbol>& elements = *symbols_.find_array(expression.text);
  if (!(*index >= 0.0 && *index < static_cast<double>(elements.size()) && *index == std::floor(*index)))
    fail(expression.location, "the array '{}' has {} element{}, numbered from 0; there is no number {}",
         display_name(expression.text), elements.size(), elements.size() == 1 ? "" : "s", *index);
  return &elements[static_cast<std::size_t>(*index)];
}

// The registers that a write to the target can change.
std::vector<Value> Lowering::written_registers(const Expression& target) const {
  std::vector<Value> registers;
  const bool is_array = target.kind == ExpressionKind::kName && symbols_.find_array(target.text) != nullptr;
  if (is_array || (is_array_element(target) && !constant_value(target.children.front()))) {
    for (const Symbol& element : *symbols_.find_array(target.text)) registers.push_back(element.value);
  } else {
    const Symbol* symbol =
        target.kind == ExpressionKind::kElement ? find_element_or_null(target) : symbols_.find(target.text);
    if (symbol != nullptr && symbol->is_writable) registers.push_back(symbol->value);
  }
  std::erase_if(registers, [](const Value& value) { return !value.is_register(); });
  return registers;
}

program::Operand Lowering::array_operand(const std::string& name) {
  std::vector<program::OperandGroup>& all = builder_.program().groups;
  const auto [found, added] = array_groups_.try_emplace(name, static_cast<std::uint32_t>(all.size()));
  if (added) {
    const std::vector<Symbol>& elements = *symbols_.find_array(name);
    all.push_back({display_name(name), !elements.front().value.is_register(), {}});
    for (const Symbol& element : elements) all.back().members.push_back(element.value.index);
  }
  return {program::OperandKind::kGroup, found->second};
}

Value Lowering::lower_array_element(const Expression& expression) {
  if (const Symbol* element = array_element(expression)) {
    Value value = element->value;
    value.is_temporary = false;  // its owner releases it
    return value;
  }
  const Value index = lower_scalar(expression.children.front(), "the index of an array");
  const Value first = symbols_.find_array(expression.text)->front().value;
  builder_.release(index);
  const Value value = first.is_register() ? builder_.allocate_temporary(builder_.shape(first))
                                          : builder_.allocate_scalar_temporary();
  builder_.emit(first.is_register() ? Opcode::kResGetReg : Opcode::kResGetVar, builder_.operand(value),
                {array_operand(expression.text), builder_.operand(index)}, false);
  return value;
}

void Lowering::assign_array_element(const Expression& target, const Value& value, Location location) {
  const Value first = symbols_.find_array(target.text)->front().value;
  const Value index = lower_scalar(target.children.front(), "the index of an array");
  std::vector<program::Operand> operands{array_operand(target.text), builder_.operand(index),
                                         builder_.operand(value)};
  if (!first.is_register()) {
    if (value.is_register())
      fail(location, "'{}' is an array of numbers, and the value is a register", display_name(target.text));
    return builder_.emit(Opcode::kResSetVar, {}, std::move(operands));
  }
  check_shapes({first, value}, location);
  check_cell_values(builder_.shape(first), {value}, location);
  const std::optional<std::size_t> base = mask_base(first);
  check_where_shape(builder_.shape(first), location, base);
  if (std::vector<Value> conditions = conditions_since(base); !conditions.empty()) {
    const Value kept = lower_array_element(target);
    emit_selection(kept, value, std::move(conditions), location);
    operands.back() = builder_.operand(kept);
  }
  builder_.emit(Opcode::kResSetReg, {}, std::move(operands), !base);
}

// res.setreg(CLASS, n, A). All registers of the class that it may write ignore or obey masks alike.
void Lowering::lower_set_register(const Builtin& builtin, const Expression& call) {
  std::vector<program::Operand> operands = lower_operands(builtin, call, call.children);
  const Value written{Value::Kind::kRegister, operands[2].index};
  const bool is_register = operands[2].kind == program::OperandKind::kRegister;
  const std::vector<Value> registers =
      registers_of_class(call.children[0].text, is_register ? builder_.shape(written) : shape_hint_);
  const std::optional<std::size_t> base = registers.empty() ? std::nullopt : mask_base(registers.front());
  std::vector<Value> conditions = conditions_since(base);
  if (conditions.empty()) return builder_.emit(builtin.op, {}, std::move(operands), !base);
  const Shape shape = builder_.shape(is_register ? written : registers.front());
  const Value value = builder_.allocate_temporary(shape), kept = builder_.allocate_temporary(shape);
  builder_.emit(Opcode::kCopy, builder_.operand(value), {operands[2]}, false);
  builder_.emit(Opcode::kResGetReg, builder_.operand(kept), {operands[0], operands[1]}, false);
  emit_selection(kept, value, std::move(conditions), call.location);
  operands[2] = builder_.operand(kept);
  builder_.emit(builtin.op, {}, std::move(operands), false);
}

std::vector<Value> Lowering::registers_of_class(const std::string& name, Shape shape) const {
  std::vector<Value> registers;
  for (const Symbol* element : symbols_.elements(name))
    if (element->value.is_register() && builder_.shape(element->value).has_size_of(shape))
      registers.push_back(element->value);
  return registers;
}

const std::vector<Symbol>& Lowering::array_argument(const Expression& expression, bool of_registers) const {
  const std::vector<Symbol>* array =
      expression.kind == ExpressionKind::kName ? symbols_.find_array(expression.text) : nullptr;
  const auto is_stored = [&](const Symbol& element) {
    return of_registers ? element.value.is_register() : element.value.kind == Value::Kind::kScalar;
  };
  if (array == nullptr || !std::ranges::all_of(*array, is_stored))
    fail(expression.location,
         "'matrix.product' takes two arrays of registers and one of scalars: expected an array of {}",
         of_registers ? "registers" : "scalars");
  return *array;
}

void Lowering::fail_conditionally(Location location, std::string message) {
  diagnostics_.conditional_error(location, std::move(message));
  throw AlreadyReported();
}

void Lowering::lower_matrix_product(const Expressions& arguments, Location location) {
  const std::vector<Symbol>&y = array_argument(arguments[0], true), &x = array_argument(arguments[1], true),
        &weights = array_argument(arguments[2], false);
  if (weights.size() != x.size() * y.size())
    fail_conditionally(
        arguments[2].location,
        fmt::format("'matrix.product' of {} and {} registers takes {} scalars, and '{}' has {}", y.size(),
                    x.size(), x.size() * y.size(), display_name(arguments[2].text), weights.size()));
  std::vector<Value> all;
  for (const std::vector<Symbol>* array : {&y, &x})
    for (const Symbol& element : *array) all.push_back(element.value);
  check_types(Opcode::kMatrixProduct, all, location);
  check_shapes(all, location);
  for (const Symbol& element : y) {
    if (!element.is_writable)
      fail(arguments[0].location, "'{}' is a value here and cannot be written",
           display_name(arguments[0].text));
    if (std::ranges::any_of(x, [&](const Symbol& other) { return other.value.index == element.value.index; }))
      fail_conditionally(location,
                         fmt::format("'matrix.product' writes '{}' and reads it: write another array",
                                     display_name(arguments[0].text)));
  }
  const Value first = y.front().value;
  const std::optional<std::size_t> base = mask_base(first);
  check_where_shape(builder_.shape(first), location, base);
  std::vector<program::Operand> operands{array_operand(arguments[0].text), array_operand(arguments[1].text),
                                         array_operand(arguments[2].text)};
  if (conditions_since(base).empty())
    return builder_.emit(Opcode::kMatrixProduct, {}, std::move(operands), !base);
  std::vector<std::uint32_t> members;
  std::vector<Value> products;
  for (std::size_t k = 0; k < y.size(); ++k) {
    products.push_back(builder_.allocate_temporary(builder_.shape(first)));
    members.push_back(products.back().index);
  }
  std::vector<program::OperandGroup>& groups = builder_.program().groups;
  operands[0] = {program::OperandKind::kGroup, static_cast<std::uint32_t>(groups.size())};
  groups.push_back({display_name(arguments[0].text), false, std::move(members)});
  builder_.emit(Opcode::kMatrixProduct, {}, std::move(operands), false);
  for (std::size_t k = 0; k < y.size(); ++k) {
    emit_selection(y[k].value, products[k], conditions_since(base), location);
    builder_.release(products[k]);
  }
}

}  // namespace apron::compiler
