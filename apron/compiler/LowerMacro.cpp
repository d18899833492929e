// Macros: their arguments, local names and results. What a body writes under the caller's masks is what it
// would write without them, selected by the masks: local registers ignore the masks that were in force when
// the body began, and so do the caller's registers until the body ends.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "apron/compiler/Lowering.h"

namespace apron::compiler {

using program::Opcode;
using syntax::ExpressionKind;

// The body of the macro that the current statement begins.
std::span<const Lowering::Statement> Lowering::body_of(std::uint32_t expansion) const {
  const auto end = std::ranges::find_if(following_, [&](const Statement& statement) {
    return statement.kind == syntax::StatementKind::kMacroEnd && statement.expansion_id == expansion;
  });
  return following_.first(end - following_.begin());
}

// The arguments of a function whose parameters state their types.
void Lowering::check_arguments(const syntax::MacroExpansion& expansion) const {
  using syntax::ArgumentType;
  for (const syntax::Argument& argument : expansion.arguments) {
    if (argument.type == ArgumentType::kAny) continue;
    const Expression& value = argument.value;
    const std::vector<Symbol>* array =
        value.kind == ExpressionKind::kName ? symbols_.find_array(value.text) : nullptr;
    const bool is_text = value.kind == ExpressionKind::kString || texts_.contains(value.text);
    const bool is_place = value.kind == ExpressionKind::kName || value.kind == ExpressionKind::kElement;
    const bool is_unknown = value.kind == ExpressionKind::kName && array == nullptr && !is_text &&
                            symbols_.find(value.text) == nullptr && find_builtin(value.text) == nullptr;
    if (is_unknown && argument.type != ArgumentType::kText) continue;  // reported where the body reads it
    const bool is_plane = array == nullptr && !is_text && !is_scalar(value);
    Shape shape;
    std::string expected;
    if (argument.is_array) {
      const bool of_numbers = argument.type == ArgumentType::kNumber;
      if (array == nullptr || array->front().value.is_register() == of_numbers)
        expected = of_numbers ? "an array of numbers" : "an array of registers";
    } else if (argument.type == ArgumentType::kText) {
      if (!is_text) expected = "a text";
    } else if (argument.type == ArgumentType::kNumber || argument.type == ArgumentType::kInteger) {
      if (is_plane || is_text || array != nullptr) expected = "a number";
    } else if (argument.type == ArgumentType::kPlane) {
      if (!is_plane) expected = "a plane";
    } else if (!is_place || array != nullptr || !find_shape(value, shape) ||
               (value.kind == ExpressionKind::kName && !symbols_.find(value.text)->is_writable)) {
      expected = "a register";
    }
    if (expected.empty()) continue;
    fail(value.location, "'{}' takes {} for '{}', and this is {}", expansion.macro, expected,
         argument.parameter,
         array != nullptr ? "an array"
         : is_text        ? "a text"
         : is_plane       ? "a plane"
                          : "a number");
  }
}

void Lowering::enter_macro(const syntax::MacroExpansion& expansion, std::span<const Statement> body) {
  MacroScope scope;
  scope.result_name = expansion.result_name;
  scope.results = expansion.results;
  scope.wheres = open_wheres();
  for (const syntax::ArgumentBinding& binding : expansion.bindings) {
    find_shape(binding.value, shape_hint_);
    Symbol symbol{{}, binding.value.location, false, display_name(binding.name), false};
    scope.names.push_back(binding.name);
    try {
      symbol.value = lower_argument(binding.value);
    } catch (const CompileError& error) {
      report(error);
    } catch (const AlreadyReported&) {
    }
    builder_.retain(symbol.value);
    builder_.describe(symbol.value, fmt::format("the argument '{}'", symbol.name));
    scope.values.push_back(symbol.value);
    symbols_.add(binding.name, symbol);
  }
  check_arguments(expansion);
  for (const syntax::Argument& argument : expansion.arguments) {
    const Expression& value = argument.value;
    scope.locals.push_back(local_argument((expansion.is_function ? "" : "$") + argument.parameter, value));
    if (value.kind == ExpressionKind::kName && symbols_.find(value.text) == nullptr)
      scope.unwritten[scope.locals.size() - 1] = value.text;
  }
  if (may_be_masked()) isolate_from_masks(scope, scan_macro_body(body), builder_.location());
  scope.body = builder_.begin_body();
  scopes_[expansion.id] = std::move(scope);
}

// A name or an element passes its register or scalar. Any other expression passes a value of its own, also
// one that computes nothing, such as `+A`: the body may write what it names.
Value Lowering::lower_argument(const Expression& argument) {
  const Value value = lower(argument);
  const bool is_place = argument.kind == ExpressionKind::kName || argument.kind == ExpressionKind::kElement;
  if (is_place || value.is_temporary || value.is_constant()) return value;
  const Value copy = value.is_register() ? builder_.allocate_temporary(builder_.shape(value))
                                         : builder_.allocate_scalar_temporary();
  builder_.emit(Opcode::kCopy, builder_.operand(copy), {builder_.operand(value)}, false);
  return copy;
}

program::LocalName Lowering::local_name(std::string name, const Value& value) {
  return {std::move(name), builder_.operand(value), static_cast<std::uint32_t>(builder_.position())};
}

program::LocalName Lowering::local_array(std::string name, const std::vector<Symbol>& elements) {
  program::LocalName local = local_name(std::move(name));
  for (const Symbol& element : elements) local.elements.push_back(builder_.operand(element.value));
  return local;
}

// A parameter that is replaced by its argument: a number, a name, or an element whose index may change.
program::LocalName Lowering::local_argument(std::string name, const Expression& argument) {
  program::LocalName local = local_name(std::move(name));
  const Symbol* symbol = argument.kind == ExpressionKind::kName ? symbols_.find(argument.text) : nullptr;
  const std::vector<Symbol>* array = symbol == nullptr ? symbols_.find_array(argument.text) : nullptr;
  local.text = display_name(argument.text);
  if (argument.kind == ExpressionKind::kNumber) {
    local.operand = builder_.literal_operand(argument.number);
  } else if (argument.kind == ExpressionKind::kString) {
    local.text = fmt::format("'{}'", argument.text);
  } else if (symbol != nullptr) {
    local.operand = builder_.operand(symbol->value);
  } else if (argument.kind == ExpressionKind::kName && array != nullptr) {
    local = local_array(std::move(local.name), *array);
  } else if (argument.kind == ExpressionKind::kElement) {
    const Expression& index = argument.children.front();
    const bool is_number = index.kind == ExpressionKind::kNumber;
    local.text += fmt::format("[{}]", is_number ? fmt::format("{}", index.number) : display_name(index.text));
    if (array == nullptr)
      symbol = find_element_or_null(argument);
    else if (is_number && index.number >= 0.0 && index.number < static_cast<double>(array->size()))
      symbol = &(*array)[static_cast<std::size_t>(index.number)];
    const Symbol* counter = array != nullptr && !is_number ? symbols_.find(index.text) : nullptr;
    if (symbol != nullptr) {
      local.operand = builder_.operand(symbol->value);
    } else if (counter != nullptr && !counter->value.is_register()) {
      local = local_array(std::move(local.name), *array);
      local.operand = builder_.operand(counter->value);
    }
  }
  return local;
}

void Lowering::leave_macro(std::uint32_t expansion) {
  const auto scope = scopes_.find(expansion);
  if (scope == scopes_.end()) return;
  std::vector<program::LocalName>& locals = scope->second.locals;
  for (auto argument = scope->second.unwritten.rbegin(); argument != scope->second.unwritten.rend();
       ++argument) {
    const auto& [number, name] = *argument;
    const Symbol* symbol = symbols_.find(name);
    if (symbol == nullptr) continue;
    program::LocalName written = locals[number];
    written.operand = builder_.operand(symbol->value);
    written.first =
        std::max(written.first, static_cast<std::uint32_t>(builder_.written_position(symbol->value)));
    locals.insert(locals.begin() + static_cast<std::ptrdiff_t>(number) + 1, std::move(written));
  }
  for (auto local = locals.rbegin(); local != locals.rend(); ++local) {
    local->last = static_cast<std::uint32_t>(builder_.position());
    builder_.program().local_names.push_back(std::move(*local));
  }
  merge_registers(scope->second);
  for (const Value& value : scope->second.values) {
    if (value.is_register() && value.is_temporary) set_mask_base(value, std::nullopt);
    builder_.release(value);
  }
  for (const std::string& name : scope->second.names) {
    symbols_.remove(name);
    symbols_.remove_array(name);
  }
  scopes_.erase(scope);
}

// ---- masks

// A register that the last statement alone writes needs no merging: nothing in the body sees what it wrote. A
// write to an array, of an index that is known at run time, ignores or obeys masks in all elements alike.
void Lowering::isolate_from_masks(MacroScope& scope, const MacroBody& body, Location location) {
  if (body.sets_base_mask) return;
  scope.mask_base = open_wheres();
  if (!body.is_self_contained) return;
  std::map<std::uint32_t, Value> written;
  const auto is_written = [&](const Value& value) { return written.contains(value.index); };
  for (const Expression* call : body.class_writes) {
    Shape shape = shape_hint_;
    find_shape(call->children[2], shape);
    for (const Value& value : registers_of_class(call->children[0].text, shape))
      written.emplace(value.index, value);
  }
  for (const Expression* target : body.targets) {
    const std::vector<Value> registers = written_registers(*target);
    if (target == body.last_target && std::ranges::none_of(registers, is_written)) continue;
    for (const Value& value : registers) written.emplace(value.index, value);
  }
  for (const auto& [index, value] : written) {
    const std::optional<std::size_t> outer_base = mask_base(value);
    if (outer_base && conditions_since(outer_base).empty()) continue;  // no mask is in force for it
    check_where_shape(builder_.shape(value), location, outer_base);
    const Value before = retained(builder_.allocate_temporary(builder_.shape(value)));
    builder_.emit(Opcode::kCopy, builder_.operand(before), {builder_.operand(value)}, false);
    scope.merged.push_back({value, before, outer_base});
    set_mask_base(value, scope.mask_base);
  }
}

void Lowering::merge_registers(MacroScope& scope) {
  for (const MergedRegister& merged : scope.merged) {
    set_mask_base(merged.value, merged.outer_base);
    if (std::vector<Value> conditions = conditions_since(merged.outer_base); !conditions.empty()) {
      emit_selection(merged.before, merged.value, std::move(conditions), builder_.location());
    } else {
      builder_.emit(Opcode::kCopy, builder_.operand(merged.before), {builder_.operand(merged.value)});
    }
    builder_.emit(Opcode::kCopy, builder_.operand(merged.value), {builder_.operand(merged.before)}, false);
    builder_.release(merged.before);
  }
}

void Lowering::set_mask_base(const Value& reg, std::optional<std::size_t> base) {
  builder_.obey_masks(reg, !base);
  if (base)
    mask_bases_[reg.index] = *base;
  else
    mask_bases_.erase(reg.index);
}

std::optional<std::size_t> Lowering::mask_base(const Value& value) const {
  const auto found = value.is_register() ? mask_bases_.find(value.index) : mask_bases_.end();
  return found == mask_bases_.end() ? std::nullopt : std::optional(found->second);
}

// Before its first write, a macro's local name has its macro's mask base.
std::optional<std::size_t> Lowering::mask_base(const Expression& target) const {
  const Symbol* symbol =
      target.kind == ExpressionKind::kElement ? find_element_or_null(target) : symbols_.find(target.text);
  if (symbol != nullptr) return mask_base(symbol->value);
  const auto scope = std::ranges::find_if(scopes_, [&](const auto& entry) {
    return entry.first == target.owner || entry.second.result_name == target.text;
  });
  return scope == scopes_.end() ? std::nullopt : scope->second.mask_base;
}

std::size_t Lowering::open_wheres() const {
  return std::ranges::count(blocks_, BlockKind::kWhere, &Block::kind);
}

// The conditions that restrict a write to a register with that mask base.
std::vector<Value> Lowering::conditions_since(std::optional<std::size_t> mask_base) const {
  std::vector<Value> conditions;
  std::size_t wheres = 0;
  if (!mask_base) return conditions;
  for (const Block& block : blocks_) {
    if (block.kind != BlockKind::kWhere || wheres++ < *mask_base ||
        block.condition.kind == Value::Kind::kNone)
      continue;
    conditions.push_back(block.condition);
    conditions.back().is_temporary = false;  // its block releases it
  }
  return conditions;
}

// target = value where all conditions hold.
void Lowering::emit_selection(const Value& target, const Value& value, std::vector<Value> conditions,
                              Location location) {
  const program::CellType type = builder_.shape(target).type;
  Value condition = truth_of_type(conditions.front(), type, location);
  for (std::size_t i = 1; i < conditions.size(); ++i)
    condition = emit_elementwise(Opcode::kAnd, {condition, truth_of_type(conditions[i], type, location)},
                                 location, nullptr);
  builder_.emit(Opcode::kSelect, builder_.operand(target),
                {builder_.operand(condition), builder_.operand(value), builder_.operand(target)}, false);
  builder_.release(condition);
}

// The condition, or where it holds as 0 and 1 of that type.
Value Lowering::truth_of_type(const Value& condition, program::CellType type, Location location) {
  if (!condition.is_register() || builder_.shape(condition).type == type) {
    if (condition.is_register() || type == program::CellType::kFloat32) return condition;
    return emit_elementwise(Opcode::kNe, {condition, Value::from_constant(0.0)}, location, nullptr);
  }
  const Value truth =
      emit_elementwise(Opcode::kNe, {condition, Value::from_constant(0.0)}, location, nullptr);
  const Value result = builder_.allocate_temporary(builder_.shape(truth).of_type(type));
  builder_.emit(Opcode::kConvert, builder_.operand(result), {builder_.operand(truth)}, false);
  builder_.release(truth);
  return result;
}

// A copy of a where's cells that the body cannot change, if a register that ignores outer masks may be
// written in it; its block releases it.
Value Lowering::where_condition(const Value& mask) {
  if (std::ranges::none_of(scopes_, [](const auto& entry) { return entry.second.mask_base.has_value(); }))
    return {};
  if (mask.is_constant()) return mask;
  if (mask.is_temporary) return retained(mask);
  const Value copy = retained(mask.is_register() ? builder_.allocate_temporary(builder_.shape(mask))
                                                 : builder_.allocate_scalar_temporary());
  builder_.emit(Opcode::kCopy, builder_.operand(copy), {builder_.operand(mask)}, false);
  return copy;
}

// ---- local names and results

// A macro's local name gets its kind from its first write and lives until the macro ends.
Value Lowering::create_macro_local(const Expression& target, bool is_register, Shape shape) {
  Symbol fresh{{}, target.location, true, display_name(target.text), false};
  const auto scope = std::ranges::find_if(scopes_, [&](const auto& entry) {
    return entry.first == target.owner || entry.second.result_name == target.text;
  });
  if (is_register) {
    const std::optional<std::size_t> base = mask_base(target);
    // In a loop it keeps the cells of earlier rounds, so that only the builder can set it to 0.
    const bool runs_once = scope == scopes_.end() || builder_.is_straight_since(scope->second.body);
    check_where_shape(shape, target.location, base);
    fresh.value = retained(builder_.allocate_temporary(shape));
    if (base) set_mask_base(fresh.value, base);
    if (runs_once && (base ? !conditions_since(base).empty() : may_be_masked()))
      builder_.emit(Opcode::kCopy, builder_.operand(fresh.value), {builder_.literal_operand(0.0F)}, false);
  } else {
    fresh.value = retained(builder_.allocate_scalar_temporary());
  }
  symbols_.add(target.text, fresh);
  builder_.describe(fresh.value, fmt::format("the local name '{}'", fresh.name));
  if (scope != scopes_.end()) {
    builder_.set_local(fresh.value, scope->second.body);
    program::LocalName unwritten = local_name(fresh.name);
    unwritten.first = static_cast<std::uint32_t>(scope->second.body);
    scope->second.locals.push_back(std::move(unwritten));
    program::LocalName written = local_name(fresh.name, fresh.value);
    written.first = static_cast<std::uint32_t>(builder_.written_position(fresh.value));
    scope->second.locals.push_back(std::move(written));
  }
  if (target.owner != 0) {
    scopes_[target.owner].names.push_back(target.text);
    scopes_[target.owner].values.push_back(fresh.value);
  }
  return fresh.value;
}

// A function's result that is a number is one for all cells.
void Lowering::check_unmasked_result(const Expression& target) const {
  const auto scope = scopes_.find(target.owner);
  if (scope == scopes_.end() || open_wheres() == scope->second.wheres) return;
  const std::string name(program::base_name(target.text));
  if (std::ranges::find(scope->second.results, name) != scope->second.results.end())
    fail(target.location,
         "the result '{}' is a scalar here, and 'where' masks registers only: begin with !register({})", name,
         name);
}

// True if the body only computes the result as a scalar from a register.
bool Lowering::is_reduction(const syntax::MacroExpansion& expansion) const {
  Shape shape;
  return !expansion.body.empty() && find_shape(expansion.body.front().value, shape) &&
         std::ranges::all_of(expansion.body, [&](const Statement& statement) {
           if (statement.kind == syntax::StatementKind::kMacroEnd) return true;
           return statement.kind == syntax::StatementKind::kAssign &&
                  statement.target.text == expansion.result_name && is_scalar(statement.value);
         });
}

// True if the last statement writes the result whole, and nothing before reads it.
bool Lowering::always_writes_result(const syntax::MacroExpansion& expansion, const MacroBody& body) const {
  return body.is_self_contained && body.last_target != nullptr &&
         body.last_target->kind == ExpressionKind::kName && body.last_target->text == expansion.result_name &&
         !mentions(expansion.body, expansion.result_name);
}

// The macro's result is a new register of zeros if an argument is a register that it does not reduce;
// otherwise its first write determines it.
Value Lowering::lower_expansion(const Expression& expression) {
  const syntax::MacroExpansion& expansion = *expression.expansion;
  const std::size_t blocks = blocks_.size();
  const Location saved_location = builder_.location();
  enter_macro(expansion, expansion.body);
  written_names_.insert(expansion.result_name);
  Shape shape;
  bool found = false;
  for (const syntax::Argument& argument : expansion.arguments)
    found = found || find_shape(argument.value, shape);
  if (found && !expansion.is_function && !is_reduction(expansion)) {
    Expression result_expression;
    result_expression.kind = ExpressionKind::kName;
    result_expression.location = expression.location;
    result_expression.text = expansion.result_name;
    const Value result = create_macro_local(result_expression, true, shape);
    if (!always_writes_result(expansion, scan_macro_body(expansion.body)))
      builder_.emit(Opcode::kCopy, builder_.operand(result), {builder_.literal_operand(0.0F)}, false);
  }
  lower_statements(expansion.body);
  builder_.set_location(saved_location, sources_.file(saved_location.file).name);
  report_open_blocks(blocks);
  const Symbol* symbol = symbols_.find(expansion.result_name);
  if (symbol == nullptr) {
    fail(expression.location, "the macro '{}' does not write its result", expansion.macro);
  }
  const Value value = symbol->value;
  symbols_.remove(expansion.result_name);
  if (value.kind == Value::Kind::kNone) throw AlreadyReported{};
  if (value.is_register()) set_mask_base(value, std::nullopt);
  builder_.unretain(value);
  return value;
}

}  // namespace apron::compiler
