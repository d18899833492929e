#include "apron/run/import/KernelSourceReader.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "apron/run/import/TypeNames.h"

namespace apron::run {

using Kind = KernelTokenKind;

ImportedKernels KernelSourceReader::translate(std::string_view text) {
  KernelPreprocessor preprocessor(vocabulary_, options_);
  tokens_ = preprocessor.run(text);
  files_ = preprocessor.files();
  notes_ = preprocessor.notes();
  tokens_ = without_aliases(tokens_);
  collect_functions();
  translate_file();
  forget_translated_functions();
  return finish();
}

void KernelSourceReader::skip_statement() {
  while (!at_end()) {
    if (peek().opens_bracket()) {
      const bool is_block = peek().is("{");
      position_ = behind_bracket(position_);
      if (is_block && !peek().is(";") && !peek().is(")") && !peek().is(",")) return;
    } else if (peek().is("}")) {
      return;
    } else if (consume(";")) {
      return;
    } else {
      ++position_;
    }
  }
}

void KernelSourceReader::add_macro(const std::string& pattern, const std::string& name, std::size_t line,
                                   const ProgramLines& body) {
  macros_.push_back(fmt::format("// {}, line {}", name, line));
  macros_.emplace_back("!macro_def");
  macros_.push_back(pattern);
  macros_.emplace_back("!macro_begin");
  macros_.insert(macros_.end(), body.begin(), body.end());
  if (body.empty()) macros_.emplace_back("nop");
  macros_.emplace_back("!macro_end");
  macros_.emplace_back("");
}

// ---- the file

void KernelSourceReader::translate_file() {
  while (!at_end()) {
    const std::size_t start = position_;
    if (peek().kind == Kind::kDirective) {
      translate_directive();
    } else if (peek().kind == Kind::kComment || peek().is(";") || peek().is("}")) {
      ++position_;
    } else if (peek().is_name_of({"using", "typedef", "template"})) {
      skip_statement();
      if (has_instruction(tokens_, start, position_))
        note(tokens_[start].line,
             fmt::format("'{}' with instructions of the chip has no counterpart", tokens_[start].text),
             Severity::kError);
    } else if (peek().is_name_of({"namespace", "extern"})) {
      while (!at_end() && !peek().is("{") && !peek().is(";")) ++position_;
      ++position_;
    } else if (peek().is_name("enum")) {
      translate_enum();
    } else if (peek().is_name_of({"class", "struct"})) {
      const std::string what = peek().text, name = peek(1).text;
      skip_statement();
      note(tokens_[start].line, fmt::format("the {} '{}' is left out", what, name),
           has_instruction(tokens_, start, position_) ? Severity::kError : Severity::kNote);
    } else {
      auto kernel = kernel_object_at(position_);
      if (!kernel) kernel = function_at(position_);
      std::vector<Function> none;
      std::vector<Function>& named = kernel ? all_functions_[kernel->name] : none;
      const auto known = std::ranges::find_if(
          named, [&](const Function& function) { return function.body == kernel->body; });
      if (known != named.end()) {
        translate_function(*known);
        if (known->is_kernel) consume(";");
      } else {
        translate_statement(main_, 0);
      }
    }
  }
}

void KernelSourceReader::translate_enum() {
  // The names of an `enum class` are no names of registers: NAME::A.
  const bool is_scoped = peek(1).is_name("class") || peek(1).is_name("struct");
  const std::string scope = is_scoped ? peek(2).text + "::" : "";
  while (!at_end() && !peek().is("{") && !peek().is(";")) ++position_;
  if (!peek().is("{")) return skip_statement();
  const std::size_t end = behind_bracket(position_);
  double next = 0;
  for (const KernelTokenList& words : split_arguments(tokens_, position_ + 1, end - 1)) {
    if (words.empty() || words[0].kind != Kind::kName) continue;
    if (words.size() > 2) {
      try {
        if (const auto value = plain_expression({words.begin() + 2, words.end()}); value && value->constant)
          next = *value->constant;
      } catch (const Untranslatable& error) {
        note(words[0].line, fmt::format("the enumerator '{}': {}", words[0].text, error.reason),
             Severity::kError);
      }
    }
    scopes_.back()[scope + words[0].text] = {
        fmt::format("{:.0f}", next), CppType::kInt, {next, next}, next, true};
    ++next;
  }
  position_ = end;
  consume(";");
}

void KernelSourceReader::translate_directive() {
  const KernelToken directive = tokens_[position_++];
  if (!directive.text.starts_with("define ")) return;
  if (const auto macro = function_macro(directive)) return translate_function_macro(*macro, directive.line);
  KernelTokenList words = scan_kernel_source(directive.text.substr(7), directive.line, directive.file);
  std::erase_if(words, [](const KernelToken& word) { return word.kind == Kind::kComment; });
  if (words.size() < 3 || words[0].kind != Kind::kName) return;
  const std::string& name = words[0].text;
  try {
    ProgramLines lines;
    const CppValue value = expression({words.begin() + 1, words.end() - 1}, lines, 0);
    if (!value.constant) give_up("it is no number");
    const std::string text = new_name(name);
    defines_.push_back(fmt::format("!define({}, {})", text, value.text));
    scopes_.front()[name] = {text, value.type, value.range, value.constant, true};
    constants_.emplace(name, text);
  } catch (const Untranslatable& error) {
    note(directive.line, fmt::format("#define {}: {}", name, error.reason));
  }
}

void KernelSourceReader::translate_function_macro(const FunctionMacro& macro, std::size_t line) {
  if (!functions_.contains(macro.name))
    return note(line, fmt::format("the macro '{}' has no instruction of the chip", macro.name));
  KernelTokenList saved_tokens = std::exchange(tokens_, macro.body);
  const std::size_t saved_position = std::exchange(position_, 0);
  ProgramLines body;
  const bool in_kernel = std::exchange(in_kernel_, true), in_macro = std::exchange(in_macro_, true);
  scopes_.emplace_back();
  std::string pattern = macro.name;
  for (const std::string& name : macro.parameters) {
    // The kind of an operand is known where the macro is called.
    const std::size_t index = &name - macro.parameters.data();
    const auto signature = functions_.find(macro.name);
    scopes_.back()[name] = {
        "$" + name, CppType::kRegister, {}, std::nullopt, true, signature->second.parameters[index].node};
    pattern += (&name == &macro.parameters.front() ? "($" : ", $") + name;
  }
  const ValueFlow::Body flow(flow_, functions_.find(macro.name)->second.call);
  is_in_definition_ = true;
  consume("(");  // of ({ … })
  while (!at_end()) {
    if (peek().is(")")) ++position_;
    if (!at_end()) translate_statement(body, 0);
  }
  is_in_definition_ = false;
  scopes_.pop_back();
  in_kernel_ = in_kernel;
  in_macro_ = in_macro;
  add_macro(macro.parameters.empty() ? pattern : pattern + ")", macro.name, line, body);
  tokens_ = std::move(saved_tokens);
  position_ = saved_position;
}

// ---- statements

void KernelSourceReader::leave_out(std::size_t start, const std::string& reason, ProgramLines& out,
                                   int depth) {
  const KernelToken& first = tokens_[start];
  const bool is_block = first.is_name_of({"for", "while", "if", "switch", "do"});
  position_ = start;
  const std::size_t line = first.line;
  if (is_block && first.text != "do") position_ = behind_bracket(position_ + 1);
  if (is_block && first.text == "do") ++position_;
  skip_statement();
  if (first.is_name("do") && peek().is_name("while")) skip_statement();
  while (first.is_name("if") && peek().is_name("else")) {
    ++position_;
    if (peek().is_name("if")) position_ = behind_bracket(position_ + 1);
    skip_statement();
  }
  if (position_ == start) ++position_;
  const bool is_error = !in_kernel_ && (first.is_name("goto") || concerns_registers(start, position_));
  const std::size_t end = std::exchange(position_, start);
  note(line, reason, is_error ? Severity::kError : Severity::kNote);
  position_ = end;
  leave_out_values(start, end, out, depth);
  if (in_kernel_ || is_block) emit(out, depth, fmt::format("// not translated (line {}): {}", line, reason));
}

// The values that a text gives, and the ways that it leaves loops and functions, are the controller's.
void KernelSourceReader::leave_out_values(std::size_t first, std::size_t last, ProgramLines& out, int depth) {
  if (tokens_[first].text.starts_with("vs_on_")) return;  // the host's events do not occur
  const std::size_t position = std::exchange(position_, first);
  const std::string reason = fmt::format("the value of line {}, which is left out,", tokens_[first].line);
  std::size_t name = first;
  if (is_declaration() && read_type(tokens_, name)) {
    while (tokens_[name].is("*") || tokens_[name].is("&")) ++name;
    // It hides another variable of the name.
    if (find_variable(tokens_[name].text) != nullptr && scopes_.back().count(tokens_[name].text) == 0) {
      const Variable& variable = declare(tokens_[name].text, CppType::kInt);
      emit(out, depth, variable.text + " = 0");
      flow_.leave_out(variable.node, reason);
    }
  }
  position_ = position;
  std::set<std::string> seen;
  const std::vector<bool> changed = changed_brackets(first, last);
  std::size_t inner_end = first;  // of a loop within the text
  for (std::size_t i = first; i < last; ++i) {
    const KernelToken& token = tokens_[i];
    if (token.kind != Kind::kName) continue;
    if (token.is_name_of({"for", "while", "do", "switch"}) && i >= inner_end)
      inner_end = std::min(last, statement_end(token.is_name("do") ? i + 1 : behind_bracket(i + 1)) + 1);
    if (token.is_name("return") && current_ != nullptr && current_->name != "main")
      flow_.leave_out(current_->signature.call, reason);
    if (token.is_name_of({"break", "continue"}) && i >= inner_end && !loops_.empty()) {
      if (token.is_name("continue"))
        flow_.leave_out(loops_.back().node, reason);
      else
        loops_.back().left_out_break = reason;
    }
    const bool is_bracketed = changed[i - first];
    if (!is_bracketed && !seen.insert(token.text).second) continue;
    const Variable* variable = find_variable(token.text);
    if (variable != nullptr && is_scalar(variable->type) &&
        (may_change(token.text, first, last) || is_bracketed))
      flow_.leave_out(variable->node, reason);
  }
}

// Which tokens of the text stand in brackets that are assigned or counted: (a), (test ? a : b).
std::vector<bool> KernelSourceReader::changed_brackets(std::size_t first, std::size_t last) const {
  const auto counts = [](const KernelToken& one) { return one.is("++") || one.is("--"); };
  std::vector<bool> changed(last - first, false);
  std::vector<std::size_t> open;
  for (std::size_t i = first; i < last; ++i) {
    if (tokens_[i].is("(")) open.push_back(i);
    if (!tokens_[i].is(")") || open.empty()) continue;
    const std::size_t begin = open.back();
    open.pop_back();
    const bool is_changed = is_assignment(tokens_[i + 1]) || counts(tokens_[i + 1]) ||
                            (begin > first && counts(tokens_[begin - 1]));
    if (!is_changed) continue;
    std::fill(changed.begin() + (begin - first), changed.begin() + (i - first), true);
  }
  return changed;
}

void KernelSourceReader::translate_statement(ProgramLines& out, int depth) {
  const std::size_t start = position_, lines = out.size(), scopes = scopes_.size(), loops = loops_.size();
  const ValueFlow::Part part(flow_);
  place_ = {tokens_[start].line, files_[std::min(tokens_[start].file, files_.size() - 1)]};
  try {
    const Nesting nesting(statement_depth_, "the statement");
    dispatch_statement(out, depth);
  } catch (const Untranslatable& error) {
    scopes_.resize(scopes);
    loops_.resize(loops);
    out.resize(std::min(out.size(), lines));
    leave_out(start, error.reason, out, depth);
  }
}

void KernelSourceReader::translate_block(ProgramLines& out, int depth) {
  consume("{");
  scopes_.emplace_back();
  while (!at_end() && !peek().is("}")) translate_statement(out, depth);
  ++position_;
  scopes_.pop_back();
}

void KernelSourceReader::dispatch_statement(ProgramLines& out, int depth) {
  const KernelToken& first = peek();
  if (first.kind == Kind::kComment) return emit_comment(out, depth);
  if (first.kind == Kind::kDirective) return translate_directive();
  if (consume(";")) return;
  if (first.is("{")) return translate_block(out, depth);
  if (first.is_name("for")) return translate_for(out, depth);
  if (first.is_name("while")) return translate_while(out, depth);
  if (first.is_name("do")) return translate_do(out, depth);
  if (first.is_name("if")) return translate_if(out, depth);
  if (first.is_name("enum")) return translate_enum();
  if (first.is_name("switch")) return translate_switch(out, depth);
  if (first.is_name_of({"case", "default", "goto", "struct", "class"}))
    give_up("'{}' has no counterpart", first.text);
  if (first.is_name_of({"break", "continue"}) && peek(1).is(";")) return translate_leaving(out, depth);
  if (first.is_name("return")) return translate_return(out, depth);
  if (first.is_name("using")) return skip_statement();
  if (is_declaration()) return translate_declaration(out, depth);
  if (first.kind != Kind::kName && !first.is("++") && !first.is("--") && !first.is("("))
    give_up("'{}' begins no statement", first.text);
  while (peek().kind == Kind::kName && peek(1).is("::")) position_ += 2;
  if (peek(1).is("(") && peek().kind == Kind::kName) return translate_call(out, depth);
  translate_expression(out, depth);
}

std::size_t KernelSourceReader::statement_end(std::size_t first) const {
  std::size_t i = first;
  while (i + 1 < tokens_.size() && !tokens_[i].is(";") && !tokens_[i].is("}"))
    i = tokens_[i].opens_bracket() ? behind_bracket(i) : i + 1;
  return i;
}

bool KernelSourceReader::is_declaration() const {
  std::size_t i = position_;
  if (!read_type(tokens_, i)) return false;
  while (tokens_[i].is("*") || tokens_[i].is("&") || tokens_[i].is_name("const")) ++i;
  return tokens_[i].kind == Kind::kName || i > position_ + 1;
}

void KernelSourceReader::translate_declaration(ProgramLines& out, int depth) {
  const bool is_static = peek().is_name("static") || peek(1).is_name("static");
  bool is_const = false;
  CppType type = *read_type(tokens_, position_, &is_const);
  if (peek().is("*")) type = CppType::kOther;
  bool is_reference = false;
  const auto read_declarator_signs = [&] {
    for (is_reference = false; peek().is("*") || peek().is("&"); ++position_) is_reference = peek().is("&");
    if (peek().kind != Kind::kName) give_up("a declaration without a name");
  };
  read_declarator_signs();
  if (peek(1).is("(") && (scopes_.size() == 1 || !is_scalar(type))) {
    std::size_t inside = position_ + 2;
    if (tokens_[inside].is(")") || read_type(tokens_, inside)) return skip_statement();  // a prototype
  }
  const std::size_t end = statement_end(position_);
  for (bool is_pointer = false;; read_declarator_signs()) {
    translate_declarator(is_pointer ? CppType::kOther : type, {is_const, is_static, is_reference},
                         argument_end(position_, end), out, depth);
    if (!consume(",")) break;
    is_pointer = peek().is("*");
  }
  consume(";");
}

void KernelSourceReader::translate_declarator(CppType type, Qualifiers qualifiers, std::size_t end,
                                              ProgramLines& out, int depth) {
  const auto [is_const, is_static, is_reference] = qualifiers;
  const std::string name = peek().text;
  const auto known = scopes_.front().find(name);
  if (scopes_.size() == 1 && known != scopes_.front().end() && !is_unset(name) &&
      known->second.type != CppType::kOther)
    note(peek().line, fmt::format("another '{}' is declared: only their namespaces tell them apart", name),
         Severity::kError);
  if (peek(1).is("[")) {
    scopes_.back()[name] = {name, CppType::kOther, {}, std::nullopt, true};
    give_up("'{} [ …' is code of the controller", name);
  }
  KernelTokenList words = tokens_between(position_ + 1, end);
  position_ = end;
  if (!words.empty() && words[0].is("=")) words.erase(words.begin());
  // int n{5}, int n(5)
  while (words.size() > 1 && (words.front().is("{") || words.front().is("(")) &&
         run::behind_bracket(words, 0) >= words.size() - 1 && words.back().closes_bracket())
    words = KernelTokenList(words.begin() + 1, words.end() - 1);
  if (add_control(name, words)) return;
  // Another name for a variable.
  if (is_reference && words.size() == 1) {
    if (const Variable* variable = find_variable(words[0].text); variable && is_scalar(variable->type)) {
      if (type != variable->type && type != CppType::kOther) {
        if (!is_const) give_up("'{}' names a variable of another type, '{}'", name, words[0].text);
      } else {
        Variable same = *variable;
        same.is_const = same.is_const || is_const;
        scopes_.back()[name] = same;
        return;
      }
    }
  }
  CppValue value;
  const bool is_deduced = type == CppType::kOther || type == CppType::kRegister;
  if (is_deduced) {  // auto, or a name for a register
    if (words.empty()) give_up("'{}' names no register", name);
    if (words.size() > 1 && words[0].is("&")) words.erase(words.begin());
    value = settle(expression(words, out, depth), out, depth);
    if (value.type == CppType::kRegister) {
      if (!is_const && !is_reference && may_change(name, position_, tokens_.size() - 1))
        give_up("'{}' names another register later", name);
      scopes_.back()[name] = {value.text, CppType::kRegister, {}, std::nullopt, true};
      return;
    }
    if (type == CppType::kRegister) give_up("'{}' names no register", name);
    type = value.type;
  }
  if (!is_deduced) value = words.empty() ? cpp_constant(0, type) : expression(words, out, depth);
  if (!is_scalar(value.type)) give_up("'{}' is no number", plain_text(words));
  value = cpp_convert(
      value.is_call && value.type != type ? settle(std::move(value), out, depth) : std::move(value), type);
  Variable& variable = declare(name, type);
  if (is_const && value.constant && *value.constant == value.range.low) {
    variable.constant = value.constant;
    variable.is_const = true;
  }
  constants_.erase(name);
  if (is_number(words)) constants_.emplace(name, value.text);
  if (is_static && in_macro_) {  // keeps its value between the calls
    if (!value.constant) give_up("the first value of the static '{}' is known at run time only", name);
    const bool in_macro = std::exchange(in_macro_, false);
    variable.text = new_name(name + "_" + (current_ != nullptr ? current_->name : "static"));
    in_macro_ = in_macro;
    statics_.push_back(fmt::format("{} = {}", variable.text, value.text));
    return;
  }
  if (is_static && !value.constant && scopes_.size() > 1)
    give_up("the first value of the static '{}' is known at run time only", name);
  if (is_static && scopes_.size() > 1) {
    statics_.push_back(fmt::format("{} = {}", variable.text, value.text));
    return;
  }
  flow_.write(variable.node);
  emit(out, depth, fmt::format("{} = {}", variable.text, value.text));
  if (variable.constant) variable.text = value.text;
}

// The next ',' outside brackets, at most end.
std::size_t KernelSourceReader::argument_end(std::size_t first, std::size_t end) const {
  std::size_t i = first;
  while (i < end && !tokens_[i].is(",")) i = tokens_[i].opens_bracket() ? behind_bracket(i) : i + 1;
  return std::min(i, end);
}

void KernelSourceReader::translate_expression(ProgramLines& out, int depth) {
  const std::size_t start = position_, end = statement_end(position_);
  const KernelTokenList words = tokens_between(start, end);
  if (words.empty()) {
    if (consume(";")) return;
    give_up("'{}' where an expression is expected", peek().text);
  }
  const bool counts =
      words.size() == 2 && (words[1].is("++") || words[1].is("--") || words[0].is("++") || words[0].is("--"));
  const KernelToken& name = words[0].kind == Kind::kName ? words[0] : words.back();
  Variable* variable = name.kind == Kind::kName ? find_variable(name.text) : nullptr;
  const bool assigns = words.size() > 2 && is_assignment(words[1]);
  if (assigns && words[1].is("=") && add_control(words[0].text, {words.begin() + 2, words.end()})) {
    position_ = end;
    consume(";");
    return;
  }
  if ((counts || assigns) && (variable == nullptr || !is_scalar(variable->type)) &&
      !(variable == nullptr && assigns && scopes_.size() > 1 && words[1].is("=")))
    give_up("'{} {} …' is code of the controller", words[0].text, words[1].text);
  if (assigns && variable == nullptr)
    give_up("'{} {} …' is code of the controller", words[0].text, words[1].text);
  if (counts || assigns) constants_.erase(name.text);
  if (counts) {
    const std::string op = words[0].kind == Kind::kName ? words[1].text : words[0].text;
    CppValue value;
    value.text = variable->text;
    value.type = variable->type;
    value.range = range_of(variable->type);
    variable->range = value.range;
    flow_.write(variable->node);
    if (variable->is_const) give_up("'{}' is const", name.text);
    emit(out, depth,
         fmt::format(
             "{} = {}", value.text,
             cpp_convert(*cpp_binary(value, op.substr(1), cpp_constant(1, CppType::kInt)), value.type).text));
  } else if (assigns && (words[1].is("+=") || words[1].is("-=") || words[1].is("*=")) &&
             variable->type == CppType::kInt && !variable->is_const) {
    CppValue value = settle(expression({words.begin() + 2, words.end()}, out, depth), out, depth);
    if (!is_integer(value.type) || value.type == CppType::kUint) {
      expression(words, out, depth);
    } else {
      variable = find_variable(name.text);  // a function that the expression needs has been translated
      variable->range = range_of(variable->type);
      flow_.write(variable->node);
      emit(out, depth,
           fmt::format("{0} = {0} {1} ({2})", variable->text, words[1].text.substr(0, 1), value.text));
    }
  } else {
    expression(words, out, depth);
    if (assigns && words[1].is("=") && is_number({words.begin() + 2, words.end()}))
      constants_.emplace(words[0].text, plain_text({words.begin() + 2, words.end()}));
  }
  position_ = end;
  consume(";");
}

void KernelSourceReader::translate_body(ProgramLines& out, int depth) {
  scopes_.emplace_back();
  translate_statement(out, depth + 1);
  scopes_.pop_back();
  while (peek().kind == Kind::kComment && peek(1).is_name("else")) ++position_;
}

}  // namespace apron::run
