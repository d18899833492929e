// Names, operators and macros in expressions; destinations.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "apron/compiler/Lowering.h"
#include "apron/program/ScalarArithmetic.h"
#include "common/text/Words.h"

namespace apron::compiler {

using program::Opcode;
using syntax::ExpressionKind;

namespace {

constexpr float kMaxOffset = 1'000'000.0F;

std::string file_name(const syntax::SourceFile& file) {
  return file.name.substr(file.name.find_last_of('/') + 1);
}

std::string show(Shape shape) { return fmt::format("{}x{}", shape.width, shape.height); }

}  // namespace

Value Lowering::lower(const Expression& expression, ResultDestination* destination) {
  switch (expression.kind) {
    case ExpressionKind::kNumber:
      return Value::from_constant(expression.number);
    case ExpressionKind::kName:
      return lower_name(expression, destination);
    case ExpressionKind::kElement: {
      if (is_array_element(expression)) return lower_array_element(expression);
      const Symbol& symbol = find_element(expression);
      return symbol.value;
    }
    case ExpressionKind::kCall: {
      const Builtin* builtin = find_builtin(expression.text);
      if (builtin == nullptr && ignores(expression)) return Value::from_constant(0.0F);
      if (builtin == nullptr) fail_unknown_call(expression);
      return lower_call(*builtin, expression, expression.children, destination);
    }
    case ExpressionKind::kUnary:
      return lower_unary(expression, destination);
    case ExpressionKind::kBinary:
      return lower_binary(expression, destination);
    case ExpressionKind::kExpansion:
      return lower_expansion(expression);
    case ExpressionKind::kString:
      fail(expression.location, "a text has no value here");
    case ExpressionKind::kOperator:
      fail(expression.location, "a comparison sign alone is for conditions: if(a, <, b)");
    case ExpressionKind::kLabel:
      fail(expression.location, "a label has no value");
    case ExpressionKind::kModule:
      fail(expression.location, "'?' stands for a module: plugin(?, n, …)");
  }
  return {};
}

void Lowering::check_no_array(const Expression& name) const {
  if (symbols_.find_array(name.text) != nullptr)
    fail(name.location, "'{0}' is an array; {0}[0] is its first element", display_name(name.text));
}

Value Lowering::lower_name(const Expression& name, ResultDestination* destination) {
  const Symbol* symbol = symbols_.find(name.text);
  if (symbol == nullptr) check_no_array(name);
  if (symbol == nullptr) {
    const Builtin* builtin = find_builtin(name.text);
    if (builtin != nullptr && builtin->min_arguments == 0) return lower_call(*builtin, name, {}, destination);
    if (builtin != nullptr) {
      fail(name.location, "'{}' is an instruction and needs its arguments", name.text);
    }
    if (ignores(name)) return Value::from_constant(0.0F);
    if (is_macro_name(name.text)) {
      const std::string own = display_name(name.text);
      fail(name.location, "'{}' is read before it is written{}", own,
           syntax::is_function_local(name.text) && symbols_.find(own) != nullptr
               ? ", as a name that the function writes is local: pass the program's as 'register'"
               : "");
    }
    if (written_names_.count(name.text) == 0) {
      if (macros_.find(name.text, 0, true) != nullptr) check_no_later_macro(name);
      std::vector<std::string> known = other_names_;
      for (const std::string& one : written_names_) {
        if (!is_macro_name(one)) known.push_back(one);
      }
      for (const std::string& one : builtin_names()) {
        if (const Builtin* value = find_builtin(one); value->returns_value() && value->min_arguments == 0)
          known.push_back(one);
      }
      std::string hint = symbols_.did_you_mean(name.text, known);
      const std::string word = common::lower_case(name.text);
      if (hint.empty() && (word == "true" || word == "false"))
        hint = fmt::format("; write {}, or !include('apron.aps') and {}", word == "true" ? 1 : 0,
                           word == "true" ? "TRUE" : "FALSE");
      if (hint.empty())
        hint = fmt::format("; before it is read, !register({0}) or {0} = 0 makes it one", name.text);
      fail(name.location, "'{}' is not a register, and no line writes it as a scalar{}", name.text, hint);
    }
    symbol = &add_scalar(name);
  }
  Value value = symbol->value;
  if (value.kind == Value::Kind::kNone) throw AlreadyReported{};
  if (value.kind == Value::Kind::kScalar && !value.is_temporary && !symbol->is_declared) {
    scalar_reads_.push_back({value.index, builder_.position(), name.location});
  }
  value.is_temporary = false;  // its owner releases it
  return value;
}

const Symbol& Lowering::find_element(const Expression& expression) const {
  if (is_array_element(expression)) {
    if (const Symbol* element = array_element(expression)) return *element;
    fail(expression.location, "the index of an array is a constant here");
  }
  const Expression& index = expression.children.front();
  if (index.kind == ExpressionKind::kName)
    return symbols_.find_element(expression.text, index.text, index.location);
  if (index.kind == ExpressionKind::kNumber)
    return symbols_.find_element(expression.text, index.number, index.location);
  fail(index.location, "an element is named by its name or its number: {}[A]", display_name(expression.text));
}

// The element, or null if there is none of that name or number.
const Symbol* Lowering::find_element_or_null(const Expression& expression) const {
  if (is_array_element(expression)) return array_element(expression);
  const Expression& index = expression.children.front();
  if (index.kind == ExpressionKind::kName) return symbols_.find_element_or_null(expression.text, index.text);
  if (index.kind == ExpressionKind::kNumber)
    return symbols_.find_element_or_null(expression.text, index.number);
  return nullptr;
}

Value Lowering::lower_unary(const Expression& expression, ResultDestination* destination) {
  const Value value = lower(expression.children.front());
  if (expression.text == "+") return value;
  const Opcode op = expression.text == "-"   ? Opcode::kNeg
                    : expression.text == "~" ? Opcode::kBitNot
                                             : Opcode::kNot;
  return emit_elementwise(op, {value}, expression.location, destination);
}

Value Lowering::lower_binary(const Expression& expression, ResultDestination* destination) {
  const Opcode op = infix_opcode(expression.text);
  if ((op == Opcode::kAnd || op == Opcode::kOr) && has_calls(expression.children[1]) &&
      is_scalar(expression.children[0]) && is_scalar(expression.children[1]))
    return lower_short_circuit(op, expression);
  const Value left = lower(expression.children[0]);
  const Value right = lower(expression.children[1]);
  return emit_elementwise(infix_opcode(expression.text), {left, right}, expression.location, destination);
}

// True if the expression calls an instruction that can fail or depends on more than its operands.
bool Lowering::has_calls(const Expression& expression) const {
  const Builtin* builtin =
      expression.kind == ExpressionKind::kCall || expression.kind == ExpressionKind::kName
          ? find_builtin(expression.text)
          : nullptr;
  const bool is_call = builtin != nullptr && symbols_.find(expression.text) == nullptr &&
                       builtin->form != BuiltinForm::kElementwise && builtin->form != BuiltinForm::kMac &&
                       builtin->form != BuiltinForm::kMaskIf;
  return is_call ||
         std::ranges::any_of(expression.children, [&](const Expression& child) { return has_calls(child); });
}

// True if the expression is known to be a scalar without lowering it.
bool Lowering::is_scalar(const Expression& expression) const {
  const auto all_children = [&] {
    return std::ranges::all_of(expression.children,
                               [&](const Expression& child) { return is_scalar(child); });
  };
  switch (expression.kind) {
    case ExpressionKind::kNumber:
    case ExpressionKind::kOperator:
      return true;
    case ExpressionKind::kUnary:
    case ExpressionKind::kBinary:
      return all_children();
    case ExpressionKind::kElement: {
      Shape shape;
      return !find_shape(expression, shape);
    }
    case ExpressionKind::kName:
      if (const Symbol* symbol = symbols_.find(expression.text)) return !symbol->value.is_register();
      break;
    case ExpressionKind::kCall:
      break;
    default:
      return false;
  }
  const Builtin* builtin = find_builtin(expression.text);
  if (builtin == nullptr) return expression.kind == ExpressionKind::kName;
  switch (builtin->form) {
    case BuiltinForm::kOperands:
      return program::opcode_info(builtin->op).signature.front() == 'V';
    case BuiltinForm::kParameterGet:
    case BuiltinForm::kKey:
    case BuiltinForm::kRegisterWidth:
    case BuiltinForm::kRegisterHeight:
    case BuiltinForm::kRegisterId:
    case BuiltinForm::kElementMatch:
      return true;
    case BuiltinForm::kRandom:
    case BuiltinForm::kRandomWhite:
    case BuiltinForm::kRandomRounded:
      return !is_register_statement_;
    case BuiltinForm::kElementwise:
    case BuiltinForm::kMac:
    case BuiltinForm::kMaskIf:
      return all_children();
    default:
      return false;
  }
}

// `and` and `or` of scalars: the right side is evaluated only if the left one does not decide.
Value Lowering::lower_short_circuit(Opcode op, const Expression& expression) {
  const Value zero = Value::from_constant(0.0F);
  const Value left = lower(expression.children[0]);
  if (left.is_constant()) {
    if ((left.constant != 0.0F) == (op == Opcode::kOr))
      return Value::from_constant(op == Opcode::kOr ? 1.0F : 0.0F);
    return emit_elementwise(Opcode::kNe, {lower(expression.children[1]), zero}, expression.location, nullptr);
  }
  const Value result = builder_.allocate_scalar_temporary();
  const auto emit_truth = [&](const Value& value) {
    builder_.emit(Opcode::kNe, builder_.operand(result), {builder_.operand(value), builder_.operand(zero)});
    builder_.release(value);
  };
  emit_truth(left);
  const ProgramBuilder::Label end = builder_.new_label();
  builder_.emit(op == Opcode::kAnd ? Opcode::kJumpEq : Opcode::kJumpNe, {},
                {builder_.operand(result), builder_.operand(zero), builder_.label_operand(end)});
  emit_truth(lower(expression.children[1]));
  builder_.bind_label(end);
  return result;
}

Value Lowering::emit_elementwise(Opcode op, const std::vector<Value>& values, Location location,
                                 ResultDestination* destination) {
  const bool is_saturated = op == Opcode::kAddSaturated || op == Opcode::kSubSaturated;
  if (is_saturated && std::ranges::none_of(values, &Value::is_register))
    fail(location, "'{}' takes a register of integers, and these are numbers",
         program::opcode_info(op).mnemonic);
  if (op >= Opcode::kBitAnd && op <= Opcode::kBitRight && std::ranges::none_of(values, &Value::is_register))
    for (const Value& value : values)
      if (value.is_constant() && value.constant != std::floor(value.constant))
        fail(location, "'{}' takes whole numbers, and {} has a fraction{}", program::opcode_info(op).mnemonic,
             static_cast<float>(value.constant), op == Opcode::kBitXor ? "; a power is pow(a, b)" : "");
  if (std::ranges::all_of(values, &Value::is_constant)) {
    std::array<double, program::kMaxOperands> in{};
    std::ranges::transform(values, in.begin(), &Value::constant);
    return Value::from_constant(program::evaluate_scalar(op, in[0], in[1], in[2]));
  }
  check_machine_read(op, values, location);
  check_shapes(values, location);
  const auto array_value = std::ranges::find_if(values, &Value::is_register);
  const bool is_register = array_value != values.end();
  const Shape shape = is_register ? builder_.shape(*array_value) : Shape{};
  check_types(op, values, location);
  check_cell_values(shape, values, location);
  std::vector<program::Operand> operands;
  for (const Value& value : values) operands.push_back(builder_.operand(value));
  Value result;
  if (destination != nullptr) {
    result = resolve_destination(*destination, is_register, shape);
    if (result.is_register() && is_register) check_shapes({result, *array_value}, location);
  }
  for (const Value& value : values) builder_.release(value);
  if (destination == nullptr)
    result = is_register ? builder_.allocate_temporary(shape) : builder_.allocate_scalar_temporary();
  if (!is_register &&
      builder_.shape(result).is_integer()) {  // computed as a number, of which a cell must hold the value
    const Value number = builder_.allocate_scalar_temporary();
    builder_.emit(op, builder_.operand(number), operands, false);
    builder_.emit(Opcode::kCopy, builder_.operand(result), {builder_.operand(number)});
    builder_.release(number);
    return result;
  }
  builder_.emit(op, builder_.operand(result), operands, destination != nullptr);
  return result;
}

// uint8(A) and the like. What is converted has a type of its own.
Value Lowering::lower_conversion(const Builtin& builtin, const Expression& argument, Location location,
                                 ResultDestination* destination) {
  const Shape outer_hint = shape_hint_;
  shape_hint_ = shape_hint_.of_type(program::CellType::kFloat32);
  find_shape(argument, shape_hint_);
  const Value value = lower(argument);
  shape_hint_ = outer_hint;
  if (!value.is_register())
    fail(location, "'{}' converts registers; a number takes the type of the registers that it meets",
         builtin.name);
  check_machine_read(builtin.op, {value}, location);
  if (builder_.shape(value).type == builtin.type) return value;
  return emit_conversion(builtin.op, value, builtin.type, destination, location);
}

Value Lowering::emit_conversion(Opcode op, const Value& value, program::CellType type,
                                ResultDestination* destination, Location location) {
  const Shape shape = builder_.shape(value).of_type(type);
  Value result;
  if (destination != nullptr) {
    result = resolve_destination(*destination, true, shape);
    if (builder_.shape(result) != shape) {
      const Value converted = builder_.allocate_temporary(shape);
      check_shapes({result, converted}, location);
    }
  } else {
    result = builder_.allocate_temporary(shape);
  }
  builder_.emit(op, builder_.operand(result), {builder_.operand(value)}, destination != nullptr);
  builder_.release(value);
  return result;
}

// The register or scalar that a statement writes; a first write creates it.
Value Lowering::resolve_destination(ResultDestination& destination, bool is_register, Shape shape) {
  destination.used = true;
  Value value = destination.whole.kind != Value::Kind::kNone
                    ? destination.whole
                    : resolve_target(*destination.target, is_register, shape);
  value.is_temporary = false;  // a macro's local names live until the macro ends
  return value;
}

Value Lowering::resolve_target(const Expression& target, bool is_register, Shape shape) {
  const bool is_element = target.kind == ExpressionKind::kElement;
  const Symbol* symbol = is_element ? &find_element(target) : symbols_.find(target.text);
  if (symbol == nullptr && !is_element) check_no_array(target);
  if (!is_register && (symbol == nullptr || !symbol->value.is_register())) check_unmasked_result(target);
  if (symbol == nullptr && is_macro_name(target.text)) return create_macro_local(target, is_register, shape);
  if (symbol == nullptr) return create_scalar(target, is_register);
  if (symbol->value.kind == Value::Kind::kNone) throw AlreadyReported{};
  if (symbol->machine_file && is_foreign(*symbol->machine_file)) {
    fail(target.location, "'{}' is a register of {}, which only its instructions write{}", symbol->name,
         file_name(sources_.file(*symbol->machine_file)), machine_hint({"mov", "in"}));
  }
  if (!symbol->is_writable) {
    fail(target.location, "'{}' is a value here and cannot be written", symbol->name);
  }
  if (is_register && !symbol->value.is_register()) {
    std::string hint = same_name_hint(target.text);
    if (syntax::is_function_local(target.text))
      hint = fmt::format("; begin with !register({})", display_name(target.text));
    fail(target.location, "'{}' is a scalar, and the value is a register of {}{}", symbol->name, show(shape),
         hint.empty() ? "; globalsum(…) and the like make a number of it" : hint);
  }
  if (symbol->value.is_register())
    check_where_shape(builder_.shape(symbol->value), target.location, mask_base(symbol->value));
  return symbol->value;
}

Value Lowering::create_scalar(const Expression& target, bool is_register) {
  require_free_name(target.text, target.location);
  if (is_register) {
    const std::string hint = symbols_.did_you_mean(target.text, {});
    fail(target.location, "'{}' is not a register, but the value is one{}", target.text,
         hint.empty() ? fmt::format("; declare it with !register({})", target.text) : hint);
  }
  return add_scalar(target).value;
}

const Symbol& Lowering::add_scalar(const Expression& name) {
  const Symbol fresh{
      {Value::Kind::kScalar, builder_.add_variable(name.text)}, name.location, true, name.text};
  symbols_.add_element("VARIABLE", name.text, fresh, name.location);
  symbols_.add(name.text, fresh);
  return *symbols_.find(name.text);
}

Value Lowering::retained(Value value) {
  builder_.retain(value);
  return value;
}

Value Lowering::lower_scalar(const Expression& expression, std::string_view subject, std::string_view hint) {
  const Value value = lower(expression);
  if (value.is_register())
    fail(expression.location, "{} takes a scalar, and this is a register{}", subject, hint);
  return value;
}

// An operand of a condition.
Value Lowering::lower_condition_operand(const Expression& expression) {
  return lower_scalar(
      expression, "a condition",
      "; write where(…) to act on the cells where it holds, or take one value of all: globalany(A)");
}

Value Lowering::lower_register(const Expression& expression, std::string_view subject) {
  const Value value = lower(expression);
  if (!value.is_register()) {
    fail(expression.location, "{} takes a register, and this is a scalar{}", subject,
         same_name_hint(expression.text));
  }
  return value;
}

// A suggestion for an unknown scalar: the register class's element of that name.
std::string Lowering::same_name_hint(const std::string& name) const {
  const std::string element_name = symbols_.find_register_element(name);
  return element_name.empty() ? "" : fmt::format("; the register of that name is {}", element_name);
}

float Lowering::number_constant(const Expression& expression, std::string_view subject) {
  const Value value = lower(expression);
  if (!value.is_constant()) fail(expression.location, "{} must be a constant", subject);
  return value.constant;
}

int Lowering::integer_constant(const Expression& expression, std::string_view subject) {
  const float value = number_constant(expression, subject);
  if (value != std::trunc(value))
    fail(expression.location, "{} must be a whole number, not {}", subject, value);
  if (std::fabs(value) > kMaxOffset)
    fail(expression.location, "{0} must be from -{1:.0f} to {1:.0f}, not {2}", subject, kMaxOffset, value);
  return static_cast<int>(value);
}

const std::string& Lowering::string_literal(const Expression& expression, std::string_view subject) const {
  if (expression.kind != ExpressionKind::kString) {
    fail(expression.location, "expected {} in single quotes", subject);
  }
  return expression.text;
}

std::string Lowering::describe_name(const Value& value, std::string_view unnamed) const {
  const Symbol* symbol = symbols_.find_register(value.index);
  return symbol == nullptr ? fmt::format("{} is", unnamed) : fmt::format("'{}' is", symbol->name);
}

std::string Lowering::describe_shape(const Value& value) const {
  return fmt::format("{} {}", describe_name(value), show(builder_.shape(value)));
}

void Lowering::check_shapes(const std::vector<Value>& values, Location location) const {
  const Value* first = nullptr;
  for (const Value& value : values) {
    if (!value.is_register()) continue;
    if (first == nullptr) first = &value;
    const Shape a = builder_.shape(*first), b = builder_.shape(value);
    if (a == b) continue;
    if (a.has_size_of(b))
      fail(location,
           "the registers of one instruction have one type, but {} {} and {} {}: convert one, {}(…) or {}(…)",
           describe_name(*first, "one operand"), program::cell_type_name(a.type), describe_name(value),
           program::cell_type_name(b.type), program::cell_type_name(a.type), program::cell_type_name(b.type));
    fail(location, "the registers of one instruction have one shape, but {} and {}", describe_shape(*first),
         describe_shape(value));
  }
}

// Refuses registers of integers or of floats where the instruction does not take them.
void Lowering::check_types(Opcode op, const std::vector<Value>& registers, Location location) const {
  for (const Value& value : registers) {
    if (!value.is_register()) continue;
    const bool is_integer = builder_.shape(value).is_integer();
    if (is_integer ? program::takes_integers(op) : !program::takes_only_integers(op)) continue;
    fail(location, "'{}' takes registers of {}, and {} {}: {}", program::opcode_info(op).mnemonic,
         is_integer ? "floats" : "integers", describe_name(value),
         program::cell_type_name(builder_.shape(value).type),
         is_integer              ? "write float(…)"
         : op == Opcode::kBitXor ? "write int32(…); a power is pow(a, b)"
                                 : "write int32(…)");
  }
}

void Lowering::check_result_type(Opcode op, const Value& result) const {
  if (!builder_.shape(result).is_integer() || program::takes_integers(op)) return;
  const std::string_view type = program::cell_type_name(builder_.shape(result).type);
  const std::string_view mnemonic = program::opcode_info(op).mnemonic;
  fail(builder_.location(), "'{}' gives floats, and {} {}: write {}({}…)", mnemonic, describe_name(result),
       type, type, mnemonic);
}

// Numbers that meet registers of integers are values of their cells. Others are checked when the program
// runs.
void Lowering::check_cell_values(Shape shape, const std::vector<Value>& values, Location location) const {
  for (const Value& value : values) {
    if (!value.is_constant() || program::is_cell_value(shape.type, value.constant)) continue;
    fail(location, "{} is no {}, the type of the registers that it meets: a whole number from {} to {}",
         value.constant, program::cell_type_name(shape.type), program::lowest_cell(shape.type),
         program::highest_cell(shape.type));
  }
}

void Lowering::check_where_shape(Shape shape, Location location, std::optional<std::size_t> mask_base) const {
  std::size_t wheres = open_wheres();
  for (auto block = blocks_.rbegin(); block != blocks_.rend() && wheres > mask_base.value_or(0); ++block) {
    if (block->kind == BlockKind::kWhere) --wheres;
    if (block->where_shape.has_size_of({})) continue;
    if (block->where_shape.has_size_of(shape)) return;
    fail(location, "a register of {} is written inside a 'where' over {}", show(shape),
         show(block->where_shape));
  }
}

// The shape of an expression's first register, found without lowering the expression.
bool Lowering::find_shape(const Expression& expression, Shape& shape) const {
  const Symbol* symbol = nullptr;
  if (expression.kind == ExpressionKind::kName) symbol = symbols_.find(expression.text);
  if (expression.kind == ExpressionKind::kElement) {
    const std::vector<Symbol>* array = symbols_.find_array(expression.text);
    symbol = array != nullptr ? &array->front() : find_element_or_null(expression);
    if (symbol == nullptr) return false;
  }
  if (symbol != nullptr && symbol->value.is_register()) {
    shape = builder_.shape(symbol->value);
    return true;
  }
  return std::ranges::any_of(expression.children,
                             [&](const Expression& child) { return find_shape(child, shape); });
}

bool Lowering::may_be_masked() const {
  return uses_mask_on_ || current_where_region() != 0 || (uses_where_ && uses_call_);
}

// True if the current line is outside the file that declares a machine's registers.
bool Lowering::is_foreign(std::uint32_t machine_file) const {
  return builder_.location().file != machine_file;
}

// "; write add(…)" with those of the names that are macros of the program.
std::string Lowering::machine_hint(std::initializer_list<std::string_view> mnemonics) const {
  std::string hint;
  for (const std::string_view mnemonic : mnemonics) {
    if (std::ranges::find(other_names_, mnemonic) == other_names_.end()) continue;
    hint += fmt::format("{}{}(…)", hint.empty() ? "; write " : " or ", mnemonic);
  }
  return hint;
}

// The file of the machine whose register this is, or nullptr if the current line may compute with it.
const std::uint32_t* Lowering::foreign_machine(const Value& value) const {
  const auto found = value.is_register() ? machine_registers_.find(value.index) : machine_registers_.end();
  return found == machine_registers_.end() || !is_foreign(found->second) ? nullptr : &found->second;
}

// The macros of a machine model its instructions' masks and errors, which an operator of the language would
// skip. Copies to registers that are not the machine's and whole-array values are host reads.
void Lowering::check_machine_read(Opcode op, const std::vector<Value>& values, Location location) const {
  for (const Value& value : values) {
    const std::uint32_t* machine = foreign_machine(value);
    if (machine == nullptr) continue;
    const Symbol* symbol = symbols_.find_register(value.index);
    const std::string_view mnemonic = program::opcode_info(op).mnemonic;
    const bool is_condition = (op >= Opcode::kLt && op <= Opcode::kNot) || op == Opcode::kSelect;
    const std::string hint = is_condition           ? machine_hint({"where"})
                             : op == Opcode::kDiv   ? machine_hint({"div2", "divq"})
                             : op == Opcode::kShift ? machine_hint({"movx"})
                                                    : machine_hint({mnemonic});
    fail(location,
         "'{}' is a register of {}, with which only its instructions "
         "compute{}; a copy in a register of your own is free of this",
         symbol == nullptr ? "this" : symbol->name, file_name(sources_.file(*machine)), hint);
  }
}

void Lowering::check_machine_copy(const Value& target, const Value& value, Location location) const {
  const std::uint32_t* machine = foreign_machine(value);
  const Symbol* symbol = target.is_register() ? symbols_.find_register(target.index) : nullptr;
  if (machine == nullptr || symbol == nullptr || symbol->location.file != *machine) return;
  fail(location,
       "'{}' is a register of {} too: only instructions pass values "
       "between its registers{}",
       symbol->name, file_name(sources_.file(*machine)), machine_hint({"where", "MOV"}));
}

}  // namespace apron::compiler
