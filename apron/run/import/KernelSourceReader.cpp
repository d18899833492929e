#include "apron/run/import/KernelSourceReader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <tuple>
#include <utility>

namespace apron::run {

using Kind = KernelTokenKind;

namespace {

bool is_type_word(const KernelToken& token) {
  static const std::set<std::string> kWords = {
      "int",     "float",  "double",   "bool",    "char",     "unsigned", "signed",    "long",
      "short",   "const",  "static",   "auto",    "void",     "volatile", "constexpr", "inline",
      "uint8_t", "int8_t", "uint16_t", "int16_t", "uint32_t", "int32_t",  "size_t"};
  return token.kind == Kind::kName && kWords.contains(token.text);
}

bool mentions(const KernelTokenList& tokens, const std::string& name) {
  return std::ranges::any_of(tokens, [&](const KernelToken& token) { return token.is_name(name); });
}

}  // namespace

ImportedKernels KernelSourceReader::translate(KernelTokenList tokens) {
  tokens_ = std::move(tokens);
  collect_functions();
  translate_file();
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

std::optional<KernelSourceReader::Function> KernelSourceReader::function_at(std::size_t first) const {
  std::size_t i = first;
  while (tokens_[i].kind == Kind::kName || tokens_[i].is("*") || tokens_[i].is("&") || tokens_[i].is("::"))
    ++i;
  if (i == first || i < first + 2 || !tokens_[i].is("(") || tokens_[i - 1].kind != Kind::kName)
    return std::nullopt;
  const std::size_t close = behind_bracket(i);
  std::size_t body = close;
  while (tokens_[body].is_name("const") || tokens_[body].is_name("noexcept") ||
         tokens_[body].kind == Kind::kComment)
    ++body;
  if (!tokens_[body].is("{")) return std::nullopt;
  Function function{tokens_[i - 1].text, {}, body, behind_bracket(body), {}};
  std::string last;
  bool is_default = false;
  for (std::size_t k = i + 1; k < close; ++k) {
    if (tokens_[k].is(",") || k + 1 == close) {
      if (!last.empty() && last != "void") function.parameters.push_back(last);
      last.clear();
      is_default = false;
    } else if (tokens_[k].is("=")) {
      is_default = true;
      function.defaults.emplace_back();
    } else if (is_default) {
      function.defaults.back().push_back(tokens_[k]);
    } else if (tokens_[k].kind == Kind::kName) {
      last = tokens_[k].text;
    }
  }
  return function;
}

std::optional<KernelSourceReader::Function> KernelSourceReader::kernel_object_at(std::size_t i) const {
  if (!tokens_[i].is_name("scamp5_kernel") || i + 4 >= tokens_.size()) return std::nullopt;
  if (tokens_[i + 1].kind != Kind::kName || !(tokens_[i + 2].is("(") || tokens_[i + 2].is("{")))
    return std::nullopt;
  if (!tokens_[i + 3].is("[")) return std::nullopt;
  std::size_t body = behind_bracket(i + 3);
  if (tokens_[body].is("(")) body = behind_bracket(body);
  if (!tokens_[body].is("{")) return std::nullopt;
  return Function{tokens_[i + 1].text, {}, body, behind_bracket(i + 2), {}};
}

bool KernelSourceReader::has_instruction(const KernelTokenList& tokens, std::size_t first,
                                         std::size_t last) const {
  for (std::size_t i = first; i + 1 < last; ++i) {
    const std::string& name = tokens[i].text;
    if (tokens[i].is_name("scamp5_kernel_begin")) return true;
    if (tokens[i].kind == Kind::kName && tokens[i + 1].is("(") &&
        (vocabulary_.statements.contains(name) || vocabulary_.values.contains(name) ||
         functions_.contains(name)))
      return true;
  }
  return false;
}

std::optional<KernelSourceReader::FunctionMacro> KernelSourceReader::function_macro(
    const KernelToken& directive) const {
  if (!directive.text.starts_with("define ")) return std::nullopt;
  FunctionMacro macro{{}, {}, scan_kernel_source(directive.text.substr(7), directive.line), 0};
  const KernelTokenList& words = macro.words;
  if (words.size() < 3 || words[0].kind != Kind::kName || !words[1].is("(")) return std::nullopt;
  macro.name = words[0].text;
  // With a blank before it, the bracket belongs to the value.
  if (!directive.text.substr(directive.text.find(macro.name) + macro.name.size()).starts_with('('))
    return std::nullopt;
  for (macro.body = 2; macro.body < words.size() && !words[macro.body].is(")"); ++macro.body)
    if (words[macro.body].kind == Kind::kName) macro.parameters.push_back(words[macro.body].text);
  macro.body = std::min(macro.body + 1, words.size() - 1);
  return macro;
}

void KernelSourceReader::collect_functions() {
  for (bool found = true; found;) {  // until the functions that call functions are found, too
    found = false;
    for (std::size_t i = 0; i + 1 < tokens_.size(); ++i) {
      if (const auto kernel = kernel_object_at(i)) {
        found = functions_[kernel->name].insert(0).second || found;
        i = kernel->end - 1;
        continue;
      }
      if (tokens_[i].kind == Kind::kDirective) {
        const auto macro = function_macro(tokens_[i]);
        if (macro && has_instruction(macro->words, macro->body, macro->words.size()))
          found = functions_[macro->name].insert(macro->parameters.size()).second || found;
      }
      if (tokens_[i].kind != Kind::kName) continue;
      const auto function = function_at(i);
      if (!function) continue;
      if (function->name != "main" && has_instruction(tokens_, function->body, function->end)) {
        for (std::size_t left_out = 0; left_out <= function->defaults.size(); ++left_out)
          found = functions_[function->name].insert(function->parameters.size() - left_out).second || found;
        defaults_[function->name] = function->defaults;
      }
      i = function->end - 1;
    }
  }
}

void KernelSourceReader::translate_function(const Function& function, bool is_kernel) {
  const auto known = functions_.find(function.name);
  const bool is_main = function.name == "main";
  const std::size_t line = tokens_[function.body].line;
  if (!is_main && known == functions_.end()) {
    note(line, fmt::format("the function '{}' has no instruction of the chip", function.name));
    position_ = function.end;
    return;
  }
  has_main_ = has_main_ || is_main;
  const bool exists = vocabulary_.statements.contains(function.name) &&
                      vocabulary_.statements.at(function.name).contains(function.parameters.size());
  if (exists) {
    note(line, fmt::format("scamp5.aps has an instruction '{}' of {} arguments, which is used instead",
                           function.name, function.parameters.size()));
    position_ = function.end;
    return;
  }
  ProgramLines body;
  position_ = function.body;
  parameters_ = {function.parameters.begin(), function.parameters.end()};
  in_kernel_ = is_kernel;
  in_macro_ = !is_main;
  translate_statement(is_main ? main_ : body, 0);
  in_kernel_ = in_macro_ = false;
  parameters_.clear();
  position_ = function.end;
  if (is_main) return;
  uncalled_.push_back({function.name, function.parameters.size()});
  add_macro(function.name, function.parameters, body, line);
}

void KernelSourceReader::add_macro(const std::string& name, const std::vector<std::string>& parameters,
                                   const ProgramLines& body, std::size_t line) {
  macros_.push_back(fmt::format("// {}, line {}", name, line));
  macros_.emplace_back("!macro_def");
  std::string pattern = name;
  for (std::size_t i = 0; i < parameters.size(); ++i) pattern += (i == 0 ? "($" : ", $") + parameters[i];
  macros_.push_back(pattern + (parameters.empty() ? "" : ")"));
  macros_.emplace_back("!macro_begin");
  macros_.insert(macros_.end(), body.begin(), body.end());
  if (body.empty()) macros_.emplace_back("nop");
  macros_.emplace_back("!macro_end");
  macros_.emplace_back("");
}

void KernelSourceReader::translate_file() {
  while (!at_end()) {
    if (peek().kind == Kind::kDirective) {
      translate_directive();
    } else if (peek().kind == Kind::kComment || peek().is(";") || peek().is("}")) {
      ++position_;
    } else if (peek().is_name_of({"using", "typedef", "template"})) {
      skip_statement();
    } else if (peek().is_name_of({"namespace", "extern"})) {
      while (!at_end() && !peek().is("{") && !peek().is(";")) ++position_;
      ++position_;
    } else if (peek().is_name_of({"class", "struct", "enum"})) {
      note(peek().line, fmt::format("the {} '{}' is left out", peek().text, peek(1).text));
      skip_statement();
    } else if (const auto kernel = kernel_object_at(position_)) {
      translate_function(*kernel, true);
      consume(";");
    } else if (const auto function = function_at(position_)) {
      translate_function(*function, false);
    } else {
      translate_statement(main_, 0);
    }
  }
}

void KernelSourceReader::translate_directive() {
  const KernelToken directive = tokens_[position_++];
  if (!directive.text.starts_with("define ")) return;
  if (const auto macro = function_macro(directive)) return translate_function_macro(*macro, directive.line);
  const KernelTokenList words = scan_kernel_source(directive.text.substr(7), directive.line);
  if (words.size() < 3 || words[0].kind != Kind::kName) return;
  const std::string& name = words[0].text;
  try {
    defines_.push_back(
        fmt::format("!define({}, {})", name, expression({words.begin() + 1, words.end() - 1})));
    known_names_.insert(name);
    constants_.emplace(name, name);
  } catch (const Untranslatable& error) {
    note(directive.line, fmt::format("#define {}: {}", name, error.reason));
  }
}

void KernelSourceReader::translate_function_macro(const FunctionMacro& macro, std::size_t line) {
  if (!functions_.contains(macro.name))
    return note(line, fmt::format("the macro '{}' has no instruction of the chip", macro.name));
  const auto existing = vocabulary_.statements.find(macro.name);
  if (existing != vocabulary_.statements.end() && existing->second.contains(macro.parameters.size())) return;
  KernelTokenList saved_tokens = std::exchange(tokens_, macro.words);
  const std::size_t saved_position = std::exchange(position_, macro.body);
  ProgramLines body;
  parameters_ = {macro.parameters.begin(), macro.parameters.end()};
  in_kernel_ = in_macro_ = true;
  consume("(");  // of ({ … })
  while (!at_end()) {
    if (peek().is(")")) ++position_;
    if (!at_end()) translate_statement(body, 0);
  }
  in_kernel_ = in_macro_ = false;
  parameters_.clear();
  add_macro(macro.name, macro.parameters, body, line);
  tokens_ = std::move(saved_tokens);
  position_ = saved_position;
}

void KernelSourceReader::translate_statement(ProgramLines& out, int depth) {
  const std::size_t line = peek().line;
  const std::size_t start = position_;
  try {
    dispatch_statement(out, depth);
  } catch (const Untranslatable& error) {
    const bool is_block = tokens_[start].is_name_of({"for", "while", "if", "switch", "do"});
    note(line, error.reason);
    if (in_kernel_ || is_block)
      emit(out, depth, fmt::format("// not translated (line {}): {}", line, error.reason));
    position_ = start;
    if (is_block) position_ = behind_bracket(position_ + (tokens_[start].is_name("do") ? 0 : 1));
    skip_statement();
    if (position_ == start) ++position_;
  }
}

void KernelSourceReader::dispatch_statement(ProgramLines& out, int depth) {
  const KernelToken& first = peek();
  if (first.kind == Kind::kComment) return emit_comment(out, depth);
  if (first.kind == Kind::kDirective) return translate_directive();
  if (consume(";")) return;
  if (consume("{")) {
    while (!at_end() && !peek().is("}")) translate_statement(out, depth);
    ++position_;
    return;
  }
  if (first.is_name("for")) return translate_for(out, depth);
  if (first.is_name("while")) return translate_while(out, depth);
  if (first.is_name("if")) return translate_if(out, depth);
  if (first.is_name_of({"do", "switch", "case"})) give_up("'{}' has no counterpart", first.text);
  if (first.is_name_of({"break", "continue"}) && peek(1).is(";")) {
    emit(out, depth, first.text);
    position_ += 2;
    return;
  }
  if (first.is_name("return")) {
    skip_statement();
    return;
  }
  if (first.is_name("using")) return skip_statement();
  if (is_type_word(first)) return translate_declaration(out, depth);
  if (first.kind != Kind::kName) give_up("'{}' begins no statement", first.text);
  while (peek(1).is("::")) position_ += 2;
  if (peek(1).is("(")) return translate_call(out, depth);
  translate_assignment(out, depth, statement_end(position_));
  consume(";");
}

std::size_t KernelSourceReader::statement_end(std::size_t first) const {
  std::size_t i = first;
  while (i + 1 < tokens_.size() && !tokens_[i].is(";") && !tokens_[i].is("}"))
    i = tokens_[i].opens_bracket() ? behind_bracket(i) : i + 1;
  return i;
}

void KernelSourceReader::translate_declaration(ProgramLines& out, int depth) {
  while (is_type_word(peek()) || peek().is("*") || peek().is("&")) ++position_;
  if (peek().kind != Kind::kName) give_up("a declaration without a name");
  if (peek(1).is("(")) return skip_statement();  // a prototype
  const std::size_t end = statement_end(position_);
  do {
    while (peek().is("*") || peek().is("&")) ++position_;
    if (peek().kind != Kind::kName) give_up("a declaration without a name");
    if (peek(1).is("[")) arrays_.insert(peek().text);
    const std::size_t declarator_end = argument_end(position_, end);
    if (position_ + 1 < declarator_end) {
      translate_assignment(out, depth, declarator_end);
    } else {
      known_names_.insert(peek().text);
      constants_.emplace(peek().text, "0");
      emit(out, depth, fmt::format("{} = 0", peek().text));
      position_ = declarator_end;
    }
  } while (consume(","));
  consume(";");
}

// The next ',' outside brackets, at most end.
std::size_t KernelSourceReader::argument_end(std::size_t first, std::size_t end) const {
  std::size_t i = first;
  while (i < end && !tokens_[i].is(",")) i = tokens_[i].opens_bracket() ? behind_bracket(i) : i + 1;
  return std::min(i, end);
}

void KernelSourceReader::translate_assignment(ProgramLines& out, int depth, std::size_t end) {
  const std::string name = peek().text;
  const KernelToken op = peek(1);
  const std::string target = parameters_.contains(name) ? "$" + name : name;
  if ((op.is("++") || op.is("--")) && position_ + 2 == end) {
    emit(out, depth, fmt::format("{0} = {0} {1} 1", target, op.text.substr(1)));
  } else if (op.is("=") || op.is("+=") || op.is("-=") || op.is("*=")) {
    const KernelTokenList words = tokens_between(position_ + 2, end);
    const std::string value = expression(words);
    if (is_number(words)) constants_.emplace(name, value);
    const bool is_compound = op.text.size() == 2;
    emit(out, depth,
         is_compound ? fmt::format("{0} = {0} {1} ({2})", target, op.text.substr(0, 1), value)
                     : fmt::format("{} = {}", target, value));
  } else {
    give_up("'{} {} …' is code of the controller", name, op.text);
  }
  known_names_.insert(name);
  position_ = end;
}

void KernelSourceReader::translate_body(ProgramLines& out, int depth) {
  translate_statement(out, depth + 1);
  while (peek().kind == Kind::kComment && peek(1).is_name("else")) ++position_;
}

void KernelSourceReader::translate_for(ProgramLines& out, int depth) {
  const std::size_t close = behind_bracket(position_ + 1);
  const bool is_endless = close == position_ + 5 && peek(2).is(";") && peek(3).is(";");
  if (is_endless) {
    position_ = close;
    return translate_frames(out, depth);
  }
  const CountedLoop loop = counted_loop(tokens_between(position_ + 2, close - 1));
  position_ = close;
  known_names_.insert(loop.variable);
  const std::size_t body_end = peek().is("{") ? behind_bracket(position_) : statement_end(position_);
  const bool is_plain =
      !loop.repetitions.empty() && !mentions(tokens_between(position_, body_end), loop.variable);
  if (is_plain) {
    emit(out, depth, fmt::format("repeat({})", loop.repetitions));
  } else {
    const std::string stride = loop.stride == "1" ? "" : ", " + loop.stride;
    emit(out, depth, fmt::format("for({}, {}, {}{})", loop.variable, loop.first, loop.last, stride));
  }
  translate_body(out, depth);
  emit(out, depth, is_plain ? "endrepeat" : "endfor");
}

KernelSourceReader::CountedLoop KernelSourceReader::counted_loop(const KernelTokenList& header) {
  const Untranslatable other{"this 'for' is not for(i = a; i < b; i++)"};
  std::vector<KernelTokenList> parts(1);
  for (const KernelToken& token : header) {
    if (token.is(";")) {
      parts.emplace_back();
    } else if (!is_type_word(token)) {
      parts.back().push_back(token);
    }
  }
  if (parts.size() != 3) throw other;
  const auto& [init, test, step] = std::tie(parts[0], parts[1], parts[2]);
  if (init.size() < 3 || init[0].kind != Kind::kName || !init[1].is("=")) throw other;
  CountedLoop loop;
  loop.variable = init[0].text;
  if (test.size() < 3 || !test[0].is_name(loop.variable) || step.size() < 2 || !mentions(step, loop.variable))
    throw other;
  if (step.size() == 2)
    loop.stride = plain_text(step).find("++") != std::string::npos ? "1" : "-1";
  else if (step[1].is("+=") || step[1].is("-="))
    loop.stride = (step[1].is("-=") ? "-" : "") + expression({step.begin() + 2, step.end()});
  else
    throw other;
  const bool upward = loop.stride[0] != '-';
  const KernelToken& op = test[1];
  const bool fits = upward ? op.is("<") || op.is("<=") || op.is("!=") : op.is(">") || op.is(">=");
  if (!fits) throw other;
  loop.first = expression({init.begin() + 2, init.end()});
  const KernelTokenList bound(test.begin() + 2, test.end());
  const std::string end = expression(bound);
  const bool exclusive = op.is("<") || op.is(">") || op.is("!=");
  if (!exclusive)
    loop.last = end;
  else if (is_number(bound))
    loop.last = std::to_string(std::strtol(end.c_str(), nullptr, 0) + (upward ? -1 : 1));
  else
    loop.last = end + (upward ? " - 1" : " + 1");
  // A variable that is declared outside may be read by a function.
  if (is_type_word(header.front()) && loop.stride == "1" && loop.first == "0")
    loop.repetitions = end + (exclusive ? "" : " + 1");
  return loop;
}

void KernelSourceReader::translate_frames(ProgramLines& out, int depth) {
  uses_frames_ = true;
  emit(out, depth, "repeat(FRAMES)");
  if (!options_.picture.empty())
    emit(out, depth + 1, fmt::format("PIX = io.image.open('{}')", options_.picture));
  translate_body(out, depth);
  emit(out, depth, "endrepeat");
}

void KernelSourceReader::translate_while(ProgramLines& out, int depth) {
  ++position_;
  const std::size_t open = position_;
  const std::size_t close = behind_bracket(open);
  const KernelTokenList condition = tokens_between(open + 1, close - 1);
  const bool endless = condition.size() == 1 && (condition[0].is_name("true") || condition[0].text == "1");
  if (endless) {
    position_ = close;
    return translate_frames(out, depth);
  }
  const std::string text = expression(condition);
  position_ = close;
  emit(out, depth, fmt::format("while({})", text));
  translate_body(out, depth);
  emit(out, depth, "endwhile");
}

void KernelSourceReader::translate_if(ProgramLines& out, int depth) {
  ++position_;
  const std::size_t open = position_;
  const std::size_t close = behind_bracket(open);
  const std::string text = expression(tokens_between(open + 1, close - 1));
  position_ = close;
  emit(out, depth, fmt::format("if({})", text));
  translate_body(out, depth);
  if (peek().is_name("else")) {
    ++position_;
    emit(out, depth, "else");
    translate_body(out, depth);
  }
  emit(out, depth, "endif");
}

}  // namespace apron::run
