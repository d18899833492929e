// Arrays of registers and of scalars: ch[i]. An index that is a constant names an element; any other is
// computed when the program runs.
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
  if (is_array_element(target) && !constant_value(target.children.front())) {
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

}  // namespace apron::compiler
