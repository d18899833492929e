#include "apron/compiler/Lowering.h"

#include <fmt/format.h>

#include <utility>

#include "apron/syntax/Suggestion.h"

namespace apron::compiler {

using syntax::ExpressionKind;
using syntax::StatementKind;

Lowering::Lowering(Shape surface, const syntax::Sources& sources, syntax::Diagnostics& diagnostics,
                   std::vector<std::string> other_names)
    : surface_(surface),
      sources_(sources),
      diagnostics_(diagnostics),
      other_names_(std::move(other_names)),
      hint_(surface) {}

void Lowering::run(const std::vector<Statement>& program) {
  survey(program);
  for (const Statement& one : program) {
    if (diagnostics_.full()) return;
    statement(one);
  }
  finish_blocks(0);
  check_jumps();
}

// What is written anywhere, so that a name in a loop can be told from a misspelt one.
void Lowering::survey(const std::vector<Statement>& program) {
  for (const Statement& one : program) {
    if (one.kind == StatementKind::kAssign && one.target.kind == ExpressionKind::kName)
      written_.insert(one.target.text);
    if (one.kind == StatementKind::kCall) survey_call(one.value);
    survey(one.value);
    if (one.expansion == nullptr) continue;
    for (const syntax::Binding& binding : one.expansion->bindings) survey(binding.value);
  }
}

void Lowering::survey_call(const Expression& call) {
  const Builtin* builtin = find_builtin(call.text);
  if (builtin == nullptr) return;
  uses_mask_on_ = uses_mask_on_ || builtin->form == Form::kMaskOn;
  uses_where_ = uses_where_ || builtin->form == Form::kWhere;
  uses_call_ = uses_call_ || builtin->form == Form::kCall || builtin->form == Form::kCallIf;
  const bool writes = builtin->gives_value() || builtin->form == Form::kFor;
  const std::size_t place = builtin->form == Form::kPlugin ? 2 : 0;
  if (writes && call.children.size() > place && call.children[place].kind == ExpressionKind::kName) {
    written_.insert(call.children[place].text);
  }
}

void Lowering::survey(const Expression& expression) {
  for (const Expression& child : expression.children) survey(child);
  if (expression.expansion == nullptr) return;
  for (const syntax::Binding& binding : expression.expansion->bindings) survey(binding.value);
  survey(expression.expansion->body);
}

void Lowering::statement(const Statement& one) {
  const std::size_t mark = emitter_.mark();
  const Shape outer_hint = hint_;
  const bool outer_array = in_array_;
  if (one.at.line > 0) emitter_.at(one.at, sources_.file(one.at.file).name);
  try {
    dispatch(one);
  } catch (const Failure& failure) {
    if (!failure.text.empty()) diagnostics_.error(failure.at, failure.text);
    invalid(one);
  }
  emitter_.release_to(mark);
  hint_ = outer_hint;
  in_array_ = outer_array;
}

void Lowering::dispatch(const Statement& one) {
  switch (one.kind) {
    case StatementKind::kAssign:
      return assign(one.target, one.value);
    case StatementKind::kCall:
      return call_statement(one.value);
    case StatementKind::kLabel:
      return place_label(one.target.text, one.at);
    case StatementKind::kDeclare:
      return declare(*one.declaration);
    case StatementKind::kEnter:
      return enter(*one.expansion);
    case StatementKind::kLeave:
      return leave(one.expansion_id);
    case StatementKind::kInvalid:
      return invalid(one);
  }
}

// What a line with an error would have opened, closed or written, so that the error does not cause others.
void Lowering::invalid(const Statement& one) {
  const bool assigns = one.kind == StatementKind::kAssign || one.assigns;
  const bool is_call = one.kind == StatementKind::kCall;
  const std::string name = is_call ? one.value.text : one.target.text;
  if (assigns) {
    if (one.target.kind == ExpressionKind::kElement) return;
    if (names_.find(name) == nullptr) names_.add(name, {{}, one.at, true, shown(name), false});
    return;
  }
  if (one.kind != StatementKind::kInvalid && !is_call) return;
  const Builtin* builtin = find_builtin(name);
  if (builtin == nullptr) return;
  static const std::map<Form, BlockKind> kOpens = {{Form::kIf, BlockKind::kIf},
                                                   {Form::kWhile, BlockKind::kWhile},
                                                   {Form::kFor, BlockKind::kFor},
                                                   {Form::kRepeat, BlockKind::kRepeat},
                                                   {Form::kWhere, BlockKind::kWhere}};
  const auto opens = kOpens.find(builtin->form);
  if (opens != kOpens.end()) {
    open(opens->second, one.at);
    blocks_.back().endless = true;
    return;
  }
  static const std::map<Form, BlockKind> kCloses = {{Form::kEndIf, BlockKind::kIf},
                                                    {Form::kEndWhile, BlockKind::kWhile},
                                                    {Form::kEndFor, BlockKind::kFor},
                                                    {Form::kEndRepeat, BlockKind::kRepeat},
                                                    {Form::kEndWhere, BlockKind::kWhere}};
  const auto closes = kCloses.find(builtin->form);
  const bool ours = closes != kCloses.end() && !blocks_.empty() && blocks_.back().kind == closes->second;
  if (ours && one.kind == StatementKind::kInvalid) blocks_.pop_back();
}

void Lowering::declare(const syntax::Declaration& wanted) {
  using Kind = syntax::Declaration::Kind;
  if (wanted.kind == Kind::kClass) return names_.add_class(wanted);
  const bool bare = wanted.kind == Kind::kRegister;
  const std::string class_name = bare ? "REGISTER" : wanted.class_name;
  const Symbol* taken = names_.find(wanted.name);
  const bool variables = names_.holds_variables(class_name, wanted.at);
  const bool both = bare || class_name == "VARIABLE" || class_name == "v";
  if (both && taken != nullptr) {
    throw Failure{wanted.at, fmt::format("'{}' is {} already", shown(wanted.name),
                                         taken->value.is_register() ? "declared" : "a scalar")};
  }
  const Builtin* builtin = find_builtin(wanted.name);
  if (both && builtin != nullptr && builtin->least == 0) {
    throw Failure{wanted.at, fmt::format("'{}' is the name of an instruction", wanted.name)};
  }
  Symbol symbol{{}, wanted.at, true, shown(wanted.name), true};
  symbol.value.kind = variables ? Value::Kind::kVariable : Value::Kind::kRegister;
  symbol.value.index = variables ? emitter_.add_variable(symbol.name)
                                 : emitter_.add_register(symbol.name, {wanted.width, wanted.height});
  names_.add_element(class_name, wanted.name, symbol, wanted.at);
  if (both) names_.add(wanted.name, symbol);
  if (variables || wanted.palette.empty()) return;
  const program::Operand place = emitter_.operand(symbol.value);
  emitter_.emit(program::Opcode::kSetPalette, {}, {place, emitter_.text(wanted.palette)});
  emitter_.emit(program::Opcode::kSetScale, {},
                {place, emitter_.literal(0.0F), emitter_.literal(wanted.scale)});
}

void Lowering::assign(const Expression& target, const Expression& value) {
  in_array_ = shape_of(target, hint_) || shape_of(value, hint_);
  Destination destination{&target, false};
  const Value result = lower(value, &destination);
  if (!destination.used) store(destination, result, value.at);
}

void Lowering::store(Destination& destination, const Value& value, Location at) {
  check_shapes({value}, at);
  const Value place = target(destination, value.is_register(), emitter_.shape(value));
  if (value.is_register()) check_shapes({place, value}, at);
  if (emitter_.redirect(value, place)) return;
  emitter_.emit(program::Opcode::kCopy, emitter_.operand(place), {emitter_.operand(value)});
}

void Lowering::enter(const syntax::MacroExpansion& expansion) {
  Scope& scope = scopes_[expansion.id];
  for (const syntax::Binding& binding : expansion.bindings) {
    shape_of(binding.value, hint_);
    Symbol symbol{{}, binding.value.at, false, shown(binding.name), false};
    scope.names.push_back(binding.name);
    try {
      symbol.value = lower(binding.value);
    } catch (const Failure& failure) {
      if (!failure.text.empty()) diagnostics_.error(failure.at, failure.text);
    }
    emitter_.keep(symbol.value);
    scope.values.push_back(symbol.value);
    names_.add(binding.name, symbol);
  }
}

void Lowering::leave(std::uint32_t expansion) {
  const auto scope = scopes_.find(expansion);
  if (scope == scopes_.end()) return;
  for (const Value& value : scope->second.values) emitter_.release(value);
  for (const std::string& name : scope->second.names) names_.remove(name);
  scopes_.erase(scope);
}

void Lowering::unknown_call(const Expression& call) const {
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
      {"next", "write endfor"}};
  if (const auto found = kForeign.find(call.text); found != kForeign.end()) {
    throw Failure{call.at,
                  fmt::format("there is no instruction or macro '{}'; {}", call.text, found->second)};
  }
  if (const Symbol* symbol = names_.find(call.text); symbol != nullptr && symbol->value.is_register()) {
    throw Failure{call.at,
                  fmt::format("'{0}' is a register and no instruction; one cell is pixel.get({0}, x, y)",
                              shown(call.text))};
  }
  std::vector<std::string> known = builtin_names();
  known.insert(known.end(), other_names_.begin(), other_names_.end());
  throw Failure{call.at, fmt::format("there is no instruction or macro '{}'{}", call.text,
                                     syntax::did_you_mean(call.text, known))};
}

void Lowering::wrong_count(const Builtin& builtin, const Expression& call) const {
  std::string takes = fmt::format("{}", builtin.least);
  if (builtin.most == kAnyNumber) {
    takes = fmt::format("at least {}", builtin.least);
  } else if (builtin.most != builtin.least) {
    takes = fmt::format("{} to {}", builtin.least, builtin.most);
  }
  throw Failure{call.at, fmt::format("'{}' takes {} argument{}, not {}", call.text, takes,
                                     builtin.most == 1 ? "" : "s", call.children.size())};
}

void Lowering::call_statement(const Expression& call) {
  const Builtin* builtin = find_builtin(call.text);
  if (builtin == nullptr) {
    if (call.kind == ExpressionKind::kName && names_.find(call.text) != nullptr) {
      throw Failure{call.at, fmt::format("'{}' alone does nothing; expected '=' after it", shown(call.text))};
    }
    unknown_call(call);
  }
  const std::size_t count = call.children.size();
  if (!builtin->gives_value()) {
    if (count < builtin->least || count > builtin->most) wrong_count(*builtin, call);
    return perform(*builtin, call);
  }
  if (builtin->form == Form::kPlugin) {
    if (count < builtin->least || count > builtin->most) wrong_count(*builtin, call);
    return plugin_statement(call);
  }
  const bool accumulates = builtin->form == Form::kMac && count == 3;
  if (!accumulates && (count < 1U + builtin->least || count > 1U + builtin->most)) {
    if (count < builtin->least || count > builtin->most) wrong_count(*builtin, call);
    throw Failure{call.at,
                  fmt::format("the value of '{0}' goes nowhere: write y = {0}(…) or {0}(y, …)", call.text)};
  }
  const Expression& place = call.children.front();
  if (place.kind != ExpressionKind::kName && place.kind != ExpressionKind::kElement) {
    throw Failure{place.at,
                  fmt::format("'{}' writes its first argument: expected a register or a scalar", call.text)};
  }
  Expressions arguments(call.children.begin() + 1, call.children.end());
  if (accumulates) arguments.push_back(place);
  in_array_ = shape_of(place, hint_);
  for (std::size_t i = 0; i < arguments.size() && !in_array_; ++i) in_array_ = shape_of(arguments[i], hint_);
  Destination destination{&place, false};
  const Value result = lower_call(*builtin, call, arguments, &destination);
  if (!destination.used) store(destination, result, call.at);
}

void Lowering::perform(const Builtin& builtin, const Expression& call) {
  in_array_ = builtin.form == Form::kWhere || builtin.form == Form::kActuate;
  for (const Expression& argument : call.children) {
    if (!shape_of(argument, hint_)) continue;
    in_array_ = true;
    break;
  }
  if (builtin.form == Form::kPlain) return emitter_.emit(builtin.op);
  if (flow(builtin, call, call.children) || host(builtin, call, call.children)) return;
  if (!filter_statement(builtin, call, call.children)) data_statement(builtin, call, call.children);
}

program::Program Lowering::finish() {
  for (const auto& [name, index] : groups_) emitter_.program().groups[index].elements = names_.numbers(name);
  for (std::uint32_t i = 0; sources_.expansion_count() > 1 && i < sources_.expansion_count(); ++i) {
    const syntax::Expansion& one = sources_.expansion(i);
    emitter_.add_expansion(one.macro, one.call, sources_.file(one.call.file).name);
  }
  return emitter_.finish();
}

void Lowering::check_jumps() {
  for (const JumpSite& site : jumps_) {
    const Target& target = labels_.at(site.name);
    if (!target.placed) {
      std::vector<std::string> known;
      for (const auto& [name, label] : labels_) {
        if (label.placed && !is_macro_name(name)) known.push_back(fmt::format("#{}", name));
      }
      std::string advice = syntax::did_you_mean(fmt::format("#{}", site.name), known);
      if (advice.empty()) advice = fmt::format("; a line '#{}' makes one", shown(site.name));
      diagnostics_.error(site.at, fmt::format("there is no label '#{}'{}", shown(site.name), advice));
    } else if (site.call ? target.where_part != 0 : target.where_part != site.where_part) {
      diagnostics_.error(site.at,
                         fmt::format("a {} may not cross the edge of a 'where'", site.call ? "call" : "jump"),
                         {{target.at, fmt::format("the label '#{}' is", shown(site.name))}});
    }
  }
}

}  // namespace apron::compiler
