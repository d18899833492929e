#include "apron/compiler/Lowering.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <utility>

#include "common/text/Suggestion.h"

namespace apron::compiler {

using syntax::ExpressionKind;
using syntax::StatementKind;

namespace {

// The instruction of the call's group that does what a name of other languages says: io.image.open for
// io.image.load. "" if there is none.
std::string synonym_in_group(const std::string& name) {
  static constexpr std::pair<std::string_view, std::string_view> kSynonyms[] = {
      {"load", "open"}, {"read", "open"}, {"write", "save"}, {"store", "save"}};
  const std::size_t group = name.rfind('.') + 1;
  for (const auto& [foreign, own] : kSynonyms) {
    const std::string instruction = name.substr(0, group) + std::string(own);
    if (group > 0 && name.substr(group) == foreign && find_builtin(instruction) != nullptr)
      return instruction;
  }
  return "";
}

}  // namespace

Lowering::Lowering(Shape surface, const syntax::SourceManager& sources, syntax::Diagnostics& diagnostics,
                   const syntax::Preprocessor& preprocessor)
    : surface_(surface),
      sources_(sources),
      diagnostics_(diagnostics),
      macros_(preprocessor.macros()),
      other_names_(macros_.names()),
      original_(preprocessor.is_original()),
      shape_hint_(surface) {
  const std::vector<std::string> defines = preprocessor.define_names();
  other_names_.insert(other_names_.end(), defines.begin(), defines.end());
}

void Lowering::lower_program(const std::vector<Statement>& program) {
  collect_writes(program);
  lower_statements(program);
  if (diagnostics_.full()) return;
  report_open_blocks(0);
  check_jumps();
}

// The names that are written anywhere, to distinguish a name used before its write in a loop from a misspelt
// one.
void Lowering::collect_writes(const std::vector<Statement>& program) {
  for (const Statement& statement : program) {
    const Expression* target = written_target(statement);
    if (target != nullptr && target->kind == ExpressionKind::kName) written_names_.insert(target->text);
    const Builtin* builtin =
        statement.kind == StatementKind::kCall ? find_builtin(statement.value.text) : nullptr;
    if (builtin != nullptr) note_masks(*builtin);
    collect_writes(statement.value);
    if (statement.expansion == nullptr) continue;
    for (const syntax::ArgumentBinding& binding : statement.expansion->bindings)
      collect_writes(binding.value);
  }
}

void Lowering::note_masks(const Builtin& builtin) {
  uses_mask_on_ = uses_mask_on_ || builtin.op == program::Opcode::kMaskOn;
  uses_where_ = uses_where_ || builtin.form == BuiltinForm::kWhere;
  uses_call_ = uses_call_ || builtin.form == BuiltinForm::kCall || builtin.form == BuiltinForm::kCallIf;
}

void Lowering::collect_writes(const Expression& expression) {
  for (const Expression& child : expression.children) collect_writes(child);
  if (expression.expansion == nullptr) return;
  for (const syntax::ArgumentBinding& binding : expression.expansion->bindings) collect_writes(binding.value);
  collect_writes(expression.expansion->body);
}

void Lowering::lower_statements(std::span<const Statement> statements) {
  const std::span<const Statement> saved = following_;
  while (!statements.empty() && !diagnostics_.full()) {
    const Statement& statement = statements.front();
    following_ = statements.subspan(1);
    if (skipped_expansion_ == 0)
      lower_statement(statement);
    else if (statement.kind == StatementKind::kMacroEnd && statement.expansion_id == skipped_expansion_)
      skipped_expansion_ = 0;
    statements = statements.subspan(1);
  }
  following_ = saved;
}

void Lowering::lower_statement(const Statement& statement) {
  const std::size_t mark = builder_.mark();
  const Shape outer_hint = shape_hint_;
  const bool outer_array = is_register_statement_;
  if (statement.location.line > 0)
    builder_.set_location(statement.location, sources_.file(statement.location.file).name);
  builder_.set_may_be_masked(may_be_masked());
  try {
    dispatch_statement(statement);
  } catch (const CompileError& error) {
    report(error);
    if (statement.kind == StatementKind::kMacroBegin) skipped_expansion_ = statement.expansion_id;
    recover_from_error(statement);
  } catch (const AlreadyReported&) {
    recover_from_error(statement);
  }
  builder_.release_to(mark);
  shape_hint_ = outer_hint;
  is_register_statement_ = outer_array;
}

void Lowering::report(const CompileError& error) {
  if (error.is_final) return diagnostics_.final_error(error.location, error.message);
  diagnostics_.error(error.location, error.message);
}

void Lowering::dispatch_statement(const Statement& statement) {
  if (!texts_.empty() && mentions_text(statement.value)) {
    Statement resolved = statement;
    resolve_texts(resolved.value);
    return lower_resolved(resolved);
  }
  lower_resolved(statement);
}

void Lowering::lower_resolved(const Statement& statement) {
  switch (statement.kind) {
    case StatementKind::kAssign:
      return lower_assignment(statement.target, statement.value);
    case StatementKind::kCall:
      return lower_call_statement(statement.value);
    case StatementKind::kLabel:
      return define_label(statement.target.text, statement.location);
    case StatementKind::kDeclare:
      return lower_declaration(*statement.declaration);
    case StatementKind::kMacroBegin:
      return enter_macro(*statement.expansion, body_of(statement.expansion_id));
    case StatementKind::kMacroEnd:
      return leave_macro(statement.expansion_id);
    case StatementKind::kInvalid:
      return recover_from_error(statement);
  }
}

// Error recovery: opens, closes or declares what the faulty line would have, so that no further errors
// follow.
void Lowering::recover_from_error(const Statement& statement) {
  const bool assigns = statement.kind == StatementKind::kAssign || statement.assigns;
  const bool is_call = statement.kind == StatementKind::kCall;
  const std::string name = is_call ? statement.value.text : statement.target.text;
  if (assigns) {
    if (statement.target.kind == ExpressionKind::kElement) return;
    if (symbols_.find(name) == nullptr)
      symbols_.add(name, {{}, statement.location, true, display_name(name), false});
    return;
  }
  if (statement.kind != StatementKind::kInvalid && !is_call) return;
  const Builtin* builtin = find_builtin(name);
  if (builtin == nullptr) return;
  if (const auto opened = builtin->opened_block()) {
    open_block(*opened, statement.location);
    blocks_.back().from_error = true;
  } else if (const auto closed = builtin->closed_block();
             closed && statement.kind == StatementKind::kInvalid && !blocks_.empty() &&
             blocks_.back().kind == *closed) {
    blocks_.pop_back();
  }
}

void Lowering::lower_declaration(const syntax::Declaration& declaration) {
  using Kind = syntax::Declaration::Kind;
  if (declaration.kind == Kind::kClass) return symbols_.add_class(declaration);
  if (declaration.count > 0) return declare_array(declaration);
  const bool is_plain_register = declaration.kind == Kind::kRegister && !declaration.of_variables;
  const std::string class_name = is_plain_register                     ? "REGISTER"
                                 : declaration.kind == Kind::kRegister ? "VARIABLE"
                                                                       : declaration.class_name;
  const Symbol* existing = symbols_.find(declaration.name);
  const bool variables = symbols_.holds_variables(class_name, declaration.location);
  const bool is_unqualified = is_plain_register || class_name == "VARIABLE" || class_name == "v";
  if (is_unqualified && existing != nullptr) {
    fail(declaration.location, "'{}' is {} already", display_name(declaration.name),
         existing->value.is_register() ? "declared" : "a scalar");
  }
  if (is_unqualified) require_free_name(declaration.name, declaration.location);
  Symbol symbol = declare_element(declaration, display_name(declaration.name));
  if (declaration.owner != 0) {
    symbols_.add(declaration.name, symbol);
    scopes_[declaration.owner].names.push_back(declaration.name);
    scopes_[declaration.owner].locals.push_back(local_name(symbol.name, symbol.value));
    return;
  }
  if (declaration.is_machine_register) {
    symbol.machine_file = declaration.location.file;
    machine_registers_[symbol.value.index] = declaration.location.file;
  }
  symbols_.add_element(class_name, declaration.name, symbol, declaration.location);
  if (is_unqualified) symbols_.add(declaration.name, symbol);
  if (variables || declaration.palette.empty()) return;
  const program::Operand operand = builder_.operand(symbol.value);
  builder_.emit(program::Opcode::kSetPalette, {}, {operand, builder_.text_operand(declaration.palette)});
  builder_.emit(program::Opcode::kSetScale, {},
                {operand, builder_.literal_operand(0.0F), builder_.literal_operand(declaration.scale)});
}

void Lowering::require_free_name(const std::string& name, Location location) const {
  const Builtin* const builtin = find_builtin(name);
  if (builtin != nullptr && builtin->min_arguments == 0)
    fail(location, "'{}' is the name of an instruction", name);
  if (syntax::is_keyword(name)) fail(location, "'{}' is a keyword", name);
}

// The register or scalar of a declaration. A function's is zero from there on, and released at its end.
Symbol Lowering::declare_element(const syntax::Declaration& declaration, const std::string& name) {
  const bool is_scalar =
      declaration.of_variables || (declaration.kind == syntax::Declaration::Kind::kElement &&
                                   symbols_.holds_variables(declaration.class_name, declaration.location));
  const Shape shape{declaration.width, declaration.height,
                    program::find_cell_type(declaration.cell_type).value_or(program::CellType::kFloat32)};
  Symbol symbol{{}, declaration.location, true, name, true};
  if (declaration.owner == 0) {
    symbol.value.kind = is_scalar ? Value::Kind::kScalar : Value::Kind::kRegister;
    symbol.value.index = is_scalar ? builder_.add_variable(name) : builder_.add_register(name, shape);
    return symbol;
  }
  MacroScope& scope = scopes_[declaration.owner];
  symbol.value =
      retained(is_scalar ? builder_.allocate_scalar_temporary() : builder_.allocate_temporary(shape));
  scope.values.push_back(symbol.value);
  if (!is_scalar && scope.mask_base) set_mask_base(symbol.value, scope.mask_base);
  builder_.emit(program::Opcode::kCopy, builder_.operand(symbol.value), {builder_.literal_operand(0.0)},
                false);
  return symbol;
}

void Lowering::declare_array(const syntax::Declaration& declaration) {
  require_free_name(declaration.name, declaration.location);
  std::vector<Symbol> elements;
  for (std::uint32_t i = 0; i < declaration.count; ++i)
    elements.push_back(
        declare_element(declaration, fmt::format("{}[{}]", display_name(declaration.name), i)));
  symbols_.add_array(declaration.name, declaration.of_variables, elements, declaration.location);
  if (declaration.owner == 0) return;
  scopes_[declaration.owner].names.push_back(declaration.name);
  scopes_[declaration.owner].locals.push_back(local_array(display_name(declaration.name), elements));
}

// ---- texts: names that stand for a text from their assignment on

bool Lowering::mentions_text(const Expression& expression) const {
  return (expression.kind == ExpressionKind::kName && texts_.contains(expression.text)) ||
         std::ranges::any_of(expression.children,
                             [&](const Expression& child) { return mentions_text(child); });
}

void Lowering::resolve_texts(Expression& expression) const {
  if (const auto text = texts_.find(expression.text);
      expression.kind == ExpressionKind::kName && text != texts_.end()) {
    expression.kind = ExpressionKind::kString;
    expression.text = text->second;
  }
  for (Expression& child : expression.children) resolve_texts(child);
}

void Lowering::define_text(const Expression& target, const Expression& text) {
  if (symbols_.find(target.text) != nullptr)
    fail(text.location, "'{}' holds numbers, and no text", display_name(target.text));
  const auto [known, is_new] = texts_.emplace(target.text, text.text);
  if (!is_new && known->second != text.text)
    fail(text.location, "'{}' is the text '{}' already: texts do not change", display_name(target.text),
         known->second);
}

void Lowering::lower_assignment(const Expression& target, const Expression& value) {
  if (value.kind == ExpressionKind::kString && target.kind == ExpressionKind::kName)
    return define_text(target, value);
  if (target.kind == ExpressionKind::kName && texts_.contains(target.text))
    fail(target.location, "'{}' is the text '{}', and holds no number", display_name(target.text),
         texts_[target.text]);
  is_register_statement_ = find_shape(target, shape_hint_) || find_shape(value, shape_hint_);
  assign(target, value.location, [&](ResultDestination* destination) { return lower(value, destination); });
}

void Lowering::assign(const Expression& target, Location location,
                      const std::function<Value(ResultDestination*)>& lower_value) {
  const bool is_indexed = is_array_element(target) && array_element(target) == nullptr;
  if (is_indexed || !conditions_since(mask_base(target)).empty())
    return assign_copy(target, is_indexed, location, lower_value);
  ResultDestination destination{&target, false};
  const Value result = lower_value(&destination);
  if (!destination.used) store_result(destination, result, location);
}

// The value of all cells is computed before it is selected, or goes to an element that is known at run time.
// For registers of integers, whose type some instructions take from their destination, it has one of that
// type.
void Lowering::assign_copy(const Expression& target, bool is_indexed, Location location,
                           const std::function<Value(ResultDestination*)>& lower_value) {
  const auto store = [&](const Value& value) {
    ResultDestination destination{&target, false};
    is_indexed ? assign_array_element(target, value, location) : store_result(destination, value, location);
  };
  const Symbol* symbol = is_indexed ? &symbols_.find_array(target.text)->front()
                         : target.kind == ExpressionKind::kElement ? find_element_or_null(target)
                                                                   : symbols_.find(target.text);
  const Shape shape = symbol != nullptr ? builder_.shape(symbol->value) : Shape{};
  if (!shape.is_integer()) return store(lower_value(nullptr));
  const Value whole = builder_.allocate_temporary(shape);
  builder_.obey_masks(whole, false);
  ResultDestination typed{&target, false, whole};
  const Value result = lower_value(&typed);
  store(typed.used ? whole : result);
  builder_.obey_masks(whole, true);
  builder_.release(whole);
}

void Lowering::store_result(ResultDestination& destination, const Value& value, Location location) {
  check_shapes({value}, location);
  const Value target = resolve_destination(destination, value.is_register(), builder_.shape(value));
  if (value.is_register()) check_shapes({target, value}, location);
  check_cell_values(builder_.shape(target), {value}, location);
  check_machine_copy(target, value, location);
  if (std::vector<Value> conditions = conditions_since(mask_base(target)); !conditions.empty())
    return emit_selection(target, value, std::move(conditions), location);
  if (builder_.retarget_last(value, target)) return;
  builder_.emit(program::Opcode::kCopy, builder_.operand(target), {builder_.operand(value)});
}

// Returns true if the call is one of the original's windows and simulators, which we do not have, and warns
// once.
bool Lowering::ignores(const Expression& call) {
  static constexpr std::string_view kPrefixes[] = {"apron.", "host.", "sim.", "gui.",
                                                   "usb.",   "ipu.",  "pro.", "spi."};
  const bool foreign = original_ && std::any_of(std::begin(kPrefixes), std::end(kPrefixes),
                                                [&](auto prefix) { return call.text.starts_with(prefix); });
  if (foreign && ignored_.insert(call.text).second)
    diagnostics_.warning(call.location, fmt::format("'{}' is not implemented, and ignored", call.text));
  return foreign;
}

// A macro of the program that the call has not become is defined below it.
void Lowering::check_no_later_macro(const Expression& call) const {
  for (const syntax::MacroTable::Handle& macro : macros_.all())
    if (macro->name == call.text)
      fail(call.location, "the {} '{}' is defined below, at {}:{}, and must stand before its use",
           macro->is_function ? "function" : "macro", macro->name, sources_.file(macro->location.file).name,
           macro->location.line);
}

void Lowering::fail_unknown_call(const Expression& call) const {
  check_no_later_macro(call);
  static const std::map<std::string, std::string> kForeign = {
      {"elseif", "write 'else', and an 'if' with its own 'endif' after it"},
      {"elif", "write 'else', and an 'if' with its own 'endif' after it"},
      {"register", "directives begin with '!': !register(A)"},
      {"create", "directives begin with '!': !create('A', REGISTER)"},
      {"include", "directives begin with '!': !include('file.aps')"},
      {"define", "directives begin with '!': !define(NAME, words)"},
      {"goto", "write jump(#label)"},
      {"printf", "write print('text', a)"},
      {"wend", "write endwhile"},
      {"next", "write endfor"},
      {"sleep", "a program proceeds by surface.step, or by timer.wait(seconds)"},
      {"wait", "a program proceeds by surface.step, or by timer.wait(seconds)"},
      {"sum", "globalsum(A) adds up all cells, near.sum(A, 4) the neighbours"},
      {"mean", "globalmean(A) is the mean of all cells"},
      {"average", "globalmean(A) is the mean of all cells"},
      {"count", "globalcount(A) counts the cells that are not 0"},
      {"any", "globalany(A) is 1 if a cell is not 0, near.any(A, 4) if a neighbour is not 0"},
      {"up", "north(A) reads the northern neighbour, shift.north(A) moves the image north"},
      {"down", "south(A) reads the southern neighbour, shift.south(A) moves the image south"},
      {"left", "west(A) reads the western neighbour, shift.west(A) moves the image west"},
      {"right", "east(A) reads the eastern neighbour, shift.east(A) moves the image east"},
      {"convolve", "write filter.create, filter.fill3x3 and filter.do(A, name)"},
      {"blur", "write filter.gauss.fast, or box(A) of !include('filters.aps')"},
      {"ifelse", "write select(mask, a, b)"},
      {"function", "a function is defined by function y = f(plane a, number n) … endfunction"},
      {"def", "a function is defined by function y = f(plane a, number n) … endfunction"},
      {"erode", "it is a macro of the library: !include('morphology.aps')"},
      {"dilate", "it is a macro of the library: !include('morphology.aps')"},
      {"skeleton", "it is a macro of the library: !include('morphology.aps')"},
      {"label", "it is a macro of the library: !include('morphology.aps')"},
      {"outline", "it is a macro of the library: !include('morphology.aps')"},
      {"fill_holes", "it is a macro of the library: !include('morphology.aps')"},
      {"sobel", "it is a macro of the library: !include('filters.aps')"},
      {"median", "it is a macro of the library: !include('filters.aps')"},
      {"sharpen", "it is a macro of the library: !include('filters.aps')"},
      {"life", "it is a macro of the library: !include('automata.aps')"},
      {"threshold", "it is a macro of the library: !include('apron.aps'); or write A > t"},
      {"between", "it is a macro of the library: !include('apron.aps')"},
      {"swap", "it is a macro of the library: !include('apron.aps')"}};
  if (const auto found = kForeign.find(call.text); found != kForeign.end()) {
    fail(call.location, "there is no instruction or macro '{}'; {}", display_name(call.text), found->second);
  }
  if (const Symbol* symbol = symbols_.find(call.text); symbol != nullptr && symbol->value.is_register()) {
    fail(call.location, "'{0}' is a register and no instruction; one cell is pixel.get({0}, x, y)",
         display_name(call.text));
  }
  std::vector<std::string> known = builtin_names();
  known.insert(known.end(), other_names_.begin(), other_names_.end());
  const std::string own = synonym_in_group(call.text);
  fail(call.location, "there is no instruction or macro '{}'{}", display_name(call.text),
       own.empty() ? common::did_you_mean(call.text, known) : fmt::format("; did you mean '{}'?", own));
}

void Lowering::fail_argument_count(const Builtin& builtin, const Expression& call) const {
  std::string takes = fmt::format("{}", builtin.min_arguments);
  if (builtin.max_arguments == kVariadic) {
    takes = fmt::format("at least {}", builtin.min_arguments);
  } else if (builtin.max_arguments != builtin.min_arguments) {
    takes = fmt::format("{} to {}", builtin.min_arguments, builtin.max_arguments);
  }
  fail(call.location, "'{}' takes {} argument{}, not {}", call.text, takes,
       builtin.max_arguments == 1 ? "" : "s", call.children.size());
}

void Lowering::lower_call_statement(const Expression& call) {
  const Builtin* builtin = find_builtin(call.text);
  if (builtin == nullptr && ignores(call)) return;
  if (builtin == nullptr) {
    if (call.kind == ExpressionKind::kName && symbols_.find(call.text) != nullptr) {
      fail(call.location, "'{}' alone does nothing; expected '=' after it", display_name(call.text));
    }
    fail_unknown_call(call);
  }
  const std::size_t count = call.children.size();
  if (!builtin->returns_value()) {
    if (count < builtin->min_arguments || count > builtin->max_arguments) fail_argument_count(*builtin, call);
    return lower_builtin_statement(*builtin, call);
  }
  if (builtin->form == BuiltinForm::kPlugin) {
    if (count < builtin->min_arguments || count > builtin->max_arguments) fail_argument_count(*builtin, call);
    return lower_plugin_statement(call);
  }
  const bool accumulates = builtin->form == BuiltinForm::kMac && count == 3;
  if (!accumulates && (count < 1U + builtin->min_arguments || count > 1U + builtin->max_arguments)) {
    if (count < builtin->min_arguments || count > builtin->max_arguments) fail_argument_count(*builtin, call);
    fail(call.location, "the value of '{0}' goes nowhere: write y = {0}(…) or {0}(y, …)", call.text);
  }
  Expressions arguments = call.children;
  // surface.sense('name', D) is surface.sense(D, 'name').
  if (builtin->op == program::Opcode::kSurfaceSense && arguments[0].kind == ExpressionKind::kString)
    std::swap(arguments[0], arguments[1]);
  const Expression target = arguments.front();
  arguments.erase(arguments.begin());
  if (target.kind != ExpressionKind::kName && target.kind != ExpressionKind::kElement) {
    fail(target.location, "'{}' writes its first argument: expected a register or a scalar", call.text);
  }
  if (accumulates) arguments.push_back(target);
  is_register_statement_ = find_shape(target, shape_hint_);
  for (std::size_t i = 0; i < arguments.size() && !is_register_statement_; ++i)
    is_register_statement_ = find_shape(arguments[i], shape_hint_);
  assign(target, call.location,
         [&](ResultDestination* destination) { return lower_call(*builtin, call, arguments, destination); });
}

void Lowering::lower_builtin_statement(const Builtin& builtin, const Expression& call) {
  is_register_statement_ =
      builtin.form == BuiltinForm::kWhere || builtin.form == BuiltinForm::kSurfaceActuate;
  for (const Expression& argument : call.children) {
    if (!find_shape(argument, shape_hint_)) continue;
    is_register_statement_ = true;
    break;
  }
  const Expressions& arguments = call.children;
  if (const auto closed = builtin.closed_block()) return close_block(*closed, call.location);
  switch (builtin.form) {
    case BuiltinForm::kOperands:
      if (builtin.op == program::Opcode::kResSetReg) return lower_set_register(builtin, call);
      return builder_.emit(builtin.op, {}, lower_operands(builtin, call, arguments));
    case BuiltinForm::kFilterCreate:
      return lower_filter_create(call);
    case BuiltinForm::kFilterSet:
      return lower_filter_set_element(arguments);
    case BuiltinForm::kFilterFill:
      return lower_filter_fill(arguments);
    case BuiltinForm::kFilterGabor:
      return lower_gabor(arguments);
    case BuiltinForm::kTile:
      return lower_tile(arguments);
    case BuiltinForm::kColourMapping:
      return lower_colour_mapping(builtin, arguments);
    case BuiltinForm::kPixelSet:
      return lower_pixel_set(arguments);
    case BuiltinForm::kMatrixProduct:
      return lower_matrix_product(arguments, call.location);
    case BuiltinForm::kSurfaceActuate:
      return lower_actuate(builtin, call);
    case BuiltinForm::kBoundary:
      return lower_boundary(arguments[0]);
    case BuiltinForm::kPrint:
      return lower_print(builtin, arguments);
    case BuiltinForm::kSliderAdd:
      return lower_slider(arguments, call.location);
    case BuiltinForm::kSwitchAdd:
      return lower_switch(arguments, call.location);
    case BuiltinForm::kLabel:
      return lower_label(arguments);
    case BuiltinForm::kJump:
    case BuiltinForm::kCall:
      return emit_jump(builtin.op, arguments[0]);
    case BuiltinForm::kJumpIf:
    case BuiltinForm::kCallIf:
      return lower_conditional_jump(builtin, call);
    case BuiltinForm::kReturn:
      return lower_return(call.location);
    case BuiltinForm::kIf:
      return open_if(arguments, call.location);
    case BuiltinForm::kElse:
      return lower_else(call.location);
    case BuiltinForm::kWhile:
      return open_while(arguments, call.location);
    case BuiltinForm::kFor:
      return open_for(arguments, call.location);
    case BuiltinForm::kRepeat:
      return open_repeat(arguments, call.location);
    case BuiltinForm::kWhere:
      return open_where(arguments, call.location);
    case BuiltinForm::kElsewhere:
      return lower_elsewhere(call.location);
    default:
      return emit_loop_exit(builtin.form == BuiltinForm::kContinue, call.location);
  }
}

program::Program Lowering::finish() {
  for (const auto& [name, index] : group_indices_)
    builder_.program().groups[index].members = symbols_.element_indices(name);
  for (std::uint32_t i = 0; sources_.expansion_count() > 1 && i < sources_.expansion_count(); ++i) {
    const syntax::ExpansionInfo& expansion = sources_.expansion(i);
    builder_.add_expansion(expansion, sources_.file(expansion.call.file).name);
  }
  if (!diagnostics_.empty()) return {};
  try {
    program::Program program = builder_.finish();
    for (ScalarRead& read : scalar_reads_) read.instruction = builder_.final_position(read.instruction);
    return program;
  } catch (const CompileError& error) {
    report(error);
    return {};
  }
}

void Lowering::check_jumps() {
  for (const JumpSite& site : jumps_) {
    const JumpTarget& target = labels_.at(site.name);
    if (!target.is_bound) {
      std::vector<std::string> known;
      for (const auto& [name, label] : labels_) {
        if (label.is_bound && !is_macro_name(name)) known.push_back(fmt::format("#{}", name));
      }
      std::string hint = common::did_you_mean(fmt::format("#{}", site.name), known);
      if (hint.empty()) hint = fmt::format("; a line '#{}' makes one", display_name(site.name));
      diagnostics_.error(site.location,
                         fmt::format("there is no label '#{}'{}", display_name(site.name), hint));
    } else if (site.is_call ? target.where_region != 0 : target.where_region != site.where_region) {
      diagnostics_.error(
          site.location,
          fmt::format("a {} may not cross the edge of a 'where'", site.is_call ? "call" : "jump"),
          {{target.location, fmt::format("the label '#{}' is", display_name(site.name))}});
    } else {
      const std::string subject =
          fmt::format("the {} '#{}'", site.is_call ? "call of" : "jump to", display_name(site.name));
      for (const Block& loop : target.loops)
        builder_.require_opening(
            {site.position, site.location, target.label, loop.opening, loop.end_label,
             fmt::format("{} enters the '{}' of line {}, which is not running", subject,
                         loop.kind == BlockKind::kFor ? "for" : "repeat", loop.location.line)});
      if (target.is_in_macro)
        builder_.require_values({site.position, site.location, target.label, 0, 0, subject});
    }
  }
}

}  // namespace apron::compiler
