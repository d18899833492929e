#include "apron/run/import/KernelSourceReader.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>

namespace apron::run {

using Kind = KernelTokenKind;

namespace {

// Reads of registers for the host, and calls that only the host's window sees.
bool is_output(const std::string& name) {
  static const std::set<std::string> kPrefixes = {"scamp5_output", "scamp5_display", "scamp5_scan",
                                                  "scamp5_read",   "scamp5_global",  "vs_"};
  return std::ranges::any_of(kPrefixes, [&](const std::string& prefix) { return name.starts_with(prefix); });
}

// `unsigned char` and its kin as one word, so that byte(x) remains a conversion.
KernelTokenList one_word(KernelTokenList type) {
  static const std::map<std::string, std::string> kWords = {{"unsigned char", "uint8_t"},
                                                            {"signed char", "int8_t"},
                                                            {"unsigned short", "uint16_t"},
                                                            {"unsigned int", "uint32_t"},
                                                            {"unsigned long", "uint32_t"}};
  if (type.size() != 2) return type;
  const auto found = kWords.find(type[0].text + " " + type[1].text);
  if (found == kWords.end()) return type;
  type.pop_back();
  type.front().text = found->second;
  return type;
}

// Replaces the names of types, `typedef unsigned char byte;`, `using byte = uint8_t;` and `enum class Mode {
// … };`, by the types.
KernelTokenList without_aliases(const KernelTokenList& tokens) {
  std::map<std::string, KernelTokenList> aliases;
  KernelTokenList out;
  const auto add = [&](KernelTokenList& list, std::size_t i) {
    const auto alias = aliases.find(tokens[i].text);
    const bool is_member = i > 0 && (tokens[i - 1].is(".") || tokens[i - 1].is("->"));
    const bool is_scope = i + 1 < tokens.size() && tokens[i + 1].is("::");
    if (tokens[i].kind != Kind::kName || is_member || is_scope || alias == aliases.end())
      return list.push_back(tokens[i]);
    for (KernelToken word : alias->second) {
      word.line = tokens[i].line;
      word.file = tokens[i].file;
      list.push_back(std::move(word));
    }
  };
  const auto stays = [](const KernelToken& token) {
    return token.opens_bracket() || token.is("<") || token.kind == Kind::kDirective ||
           token.is_name_of({"struct", "class", "union", "enum", "typename", "decltype"});
  };
  // Takes `enum` at i: of a definition all before its '{', in `enum Mode m` the word. Returns the last token
  // taken.
  const auto take_enum = [&](std::size_t i) {
    std::size_t name = i + 1;
    if (name < tokens.size() && tokens[name].is_name_of({"class", "struct"})) ++name;
    std::size_t k = name;
    if (k < tokens.size() && tokens[k].kind == Kind::kName) ++k;
    KernelTokenList type;
    if (k < tokens.size() && tokens[k].is(":"))
      for (++k; k < tokens.size() && !tokens[k].is("{") && !tokens[k].is(";"); ++k) add(type, k);
    if (k >= tokens.size() || (!tokens[k].is("{") && !tokens[k].is(";"))) return i;
    if (type.empty()) {
      type = {tokens[i]};
      type.front().text = "int";
    }
    type = one_word(std::move(type));
    if (tokens[name].kind == Kind::kName) aliases[tokens[name].text] = type;
    std::size_t end = k;
    if (!out.empty() && out.back().is_name("typedef") && tokens[k].is("{")) {
      out.pop_back();
      end = behind_bracket(tokens, k);
      if (end < tokens.size() && tokens[end].kind == Kind::kName) aliases[tokens[end].text] = type;
    }
    out.insert(out.end(), tokens.begin() + static_cast<std::ptrdiff_t>(i),
               tokens.begin() + static_cast<std::ptrdiff_t>(end));
    return end > k ? end : end - 1;
  };
  for (std::size_t i = 0; i < tokens.size(); ++i) {
    if (tokens[i].is_name("enum")) {
      i = take_enum(i);
      continue;
    }
    const bool is_typedef = tokens[i].is_name("typedef");
    const bool is_using = tokens[i].is_name("using") && i + 2 < tokens.size() && tokens[i + 2].is("=");
    if (is_typedef || is_using) {
      std::size_t end = i + 1;
      while (end < tokens.size() && !tokens[end].is(";") && !stays(tokens[end])) ++end;
      const std::size_t first = is_typedef ? i + 1 : i + 3, last = is_typedef ? end - 1 : end;
      if (end < tokens.size() && tokens[end].is(";") && first < last) {
        KernelTokenList type;
        for (std::size_t k = first; k < last; ++k) add(type, k);
        aliases[tokens[is_typedef ? last : i + 1].text] = one_word(std::move(type));
        i = end;
        continue;
      }
    }
    add(out, i);
  }
  return out;
}

std::string no_instruction(const std::string& function) {
  return fmt::format("the function '{}' has no instruction of the chip", function);
}

}  // namespace

ImportedKernels KernelSourceReader::translate(std::string_view text) {
  KernelPreprocessor preprocessor(vocabulary_, options_);
  tokens_ = preprocessor.run(text);
  files_ = preprocessor.files();
  notes_ = preprocessor.notes();
  tokens_ = without_aliases(tokens_);
  collect_functions();
  translate_file();
  // A function that an expression below it needed is not left out.
  for (const Function& function : all_functions_) {
    if (!function.is_translated) continue;
    const std::size_t line = tokens_[function.body].line;
    std::erase_if(notes_, [&](const ImportNote& note) {
      return note.line == line && note.text == no_instruction(function.name);
    });
  }
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

// ---- functions

std::vector<KernelSourceReader::Parameter> KernelSourceReader::read_parameters(std::size_t open,
                                                                               std::size_t close) const {
  std::vector<Parameter> parameters;
  for (const KernelTokenList& words : split_arguments(tokens_, open + 1, close - 1)) {
    Parameter parameter;
    bool is_const = false;
    std::size_t i = 0;
    const auto type = read_type(words, i, &is_const);
    parameter.type = type.value_or(CppType::kOther);
    if (parameter.type == CppType::kVoid && words.size() == 1) continue;
    if (!type && !words.empty() && words[0].kind == Kind::kName) ++i;
    while (i < words.size() && (words[i].is("&") || words[i].is("*") || words[i].is_name("const"))) {
      if (words[i].is("*")) parameter.type = CppType::kOther;
      if (words[i].is("&") && !is_const && is_scalar(parameter.type)) parameter.is_reference = true;
      ++i;
    }
    if (i < words.size() && words[i].kind == Kind::kName) parameter.name = words[i++].text;
    if (i < words.size() && words[i].is("[")) parameter.type = CppType::kOther;
    const auto equals = std::ranges::find_if(words, [](const KernelToken& word) { return word.is("="); });
    if (equals != words.end()) parameter.initial = KernelTokenList(equals + 1, words.end());
    if (parameter.name.empty()) parameter.name = fmt::format("unnamed{}", parameters.size());
    parameters.push_back(std::move(parameter));
  }
  return parameters;
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
  std::size_t first_of_type = first, end_of_type = i - 1;
  if (tokens_[body].is("->")) {
    first_of_type = ++body;
    while (!tokens_[body].is("{") && !tokens_[body].is(";") && body + 1 < tokens_.size()) ++body;
    end_of_type = body;
  }
  if (!tokens_[body].is("{")) return std::nullopt;
  Function function;
  function.name = tokens_[i - 1].text;
  function.signature.name = function.name;
  function.signature.parameters = read_parameters(i, close);
  std::size_t at = 0;
  const KernelTokenList words(tokens_.begin() + static_cast<long>(first_of_type),
                              tokens_.begin() + static_cast<long>(end_of_type));
  const auto type = read_type(words, at);
  function.deduces_result = mentions(words, "auto") && !mentions(words, "*");
  function.signature.result = type && is_scalar(*type) && !mentions(words, "*") ? *type : CppType::kVoid;
  function.body = body;
  function.end = behind_bracket(body);
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
  Function function;
  function.name = tokens_[i + 1].text;
  function.signature.name = function.name;
  function.body = body;
  function.end = behind_bracket(i + 2);
  function.is_kernel = true;
  return function;
}

bool KernelSourceReader::has_instruction(const KernelTokenList& tokens, std::size_t first,
                                         std::size_t last) const {
  for (std::size_t i = first; i + 1 < last; ++i) {
    const std::string& name = tokens[i].text;
    if (tokens[i].is_name("scamp5_kernel_begin")) return true;
    if (tokens[i].kind == Kind::kName && tokens[i + 1].is("(") && (i == first || !tokens[i - 1].is(".")) &&
        ((vocabulary_.statements.contains(name) && name != "abs") || vocabulary_.values.contains(name) ||
         functions_.contains(name)))
      return true;
  }
  return false;
}

bool KernelSourceReader::concerns_registers(std::size_t first, std::size_t last) const {
  for (std::size_t i = first; i + 1 < last; ++i) {
    if (tokens_[i].kind != Kind::kName || !tokens_[i + 1].is("(")) continue;
    if (is_output(tokens_[i].text)) {
      i = behind_bracket(i + 1) - 1;
      continue;
    }
    if (has_instruction(tokens_, i, i + 2)) return true;
    for (const KernelTokenList& argument : split_arguments(tokens_, i + 2, behind_bracket(i + 1) - 1))
      if (argument.size() == 1 && argument[0].kind == Kind::kName && is_register(argument[0].text))
        return true;
  }
  return false;
}

std::optional<KernelSourceReader::FunctionMacro> KernelSourceReader::function_macro(
    const KernelToken& directive) const {
  if (!directive.text.starts_with("define ")) return std::nullopt;
  KernelTokenList words = scan_kernel_source(directive.text.substr(7), directive.line, directive.file);
  if (words.size() < 3 || words[0].kind != Kind::kName || !words[1].is("(")) return std::nullopt;
  FunctionMacro macro;
  macro.name = words[0].text;
  // With a blank before it, the bracket belongs to the value.
  if (!directive.text.substr(directive.text.find(macro.name, 7) + macro.name.size()).starts_with('('))
    return std::nullopt;
  std::size_t body = 2;
  for (; body < words.size() && !words[body].is(")"); ++body)
    if (words[body].kind == Kind::kName) macro.parameters.push_back(words[body].text);
  macro.body.assign(words.begin() + static_cast<long>(std::min(body + 1, words.size() - 1)), words.end());
  return macro;
}

void KernelSourceReader::collect(const Function& function) {
  const auto [first, last] = functions_.equal_range(function.name);
  for (auto one = first; one != last; ++one)
    if (one->second.parameters.size() == function.signature.parameters.size()) return;
  functions_.emplace(function.name, function.signature);
}

void KernelSourceReader::collect_functions() {
  for (std::size_t i = 0; i + 1 < tokens_.size(); ++i) {
    auto function = kernel_object_at(i);
    if (!function && tokens_[i].kind == Kind::kName && (i == 0 || !tokens_[i - 1].is(".")))
      function = function_at(i);
    if (!function) continue;
    const bool exists =
        vocabulary_.statements.contains(function->name) || vocabulary_.values.contains(function->name);
    if (exists) function->signature.name = function->name + "_";
    i = (function->is_kernel ? function->end : function->end) - 1;
    all_functions_.push_back(std::move(*function));
  }
  for (bool found = true; found;) {  // until the functions that call functions are found, too
    found = false;
    for (const KernelToken& token : tokens_) {
      if (token.kind != Kind::kDirective) continue;
      const auto macro = function_macro(token);
      if (!macro || functions_.contains(macro->name) || !has_instruction(macro->body, 0, macro->body.size()))
        continue;
      Signature signature;
      signature.name = macro->name;
      for (const std::string& name : macro->parameters)
        signature.parameters.push_back({name, CppType::kOther, false, true, {}});
      functions_.emplace(macro->name, std::move(signature));
      found = true;
    }
    for (Function& function : all_functions_) {
      if (function.has_instruction || function.name == "main") continue;
      if (!function.is_kernel && !has_instruction(tokens_, function.body, function.end)) continue;
      function.has_instruction = true;
      collect(function);
      found = true;
    }
  }
}

bool KernelSourceReader::require_function(const std::string& name, std::size_t count) {
  if (is_in_definition_) return false;
  for (Function& function : all_functions_) {
    if (function.name != name || !function.signature.accepts(count) || function.has_instruction) continue;
    if (function.is_translated) return false;
    collect(function);
    const std::size_t notes = notes_.size();
    auto scopes = std::exchange(scopes_, {scopes_.front()});
    auto loops = std::exchange(loops_, {});
    const std::size_t position = position_;
    const bool in_macro = in_macro_, in_kernel = in_kernel_, returns_early = returns_early_;
    const CppType result = result_;
    const Function* const current = current_;
    translate_function(function);
    current_ = current;
    result_ = result;
    in_macro_ = in_macro;
    in_kernel_ = in_kernel;
    returns_early_ = returns_early;
    position_ = position;
    scopes.front() = scopes_.front();
    scopes_ = std::move(scopes);
    loops_ = std::move(loops);
    if (notes_.size() == notes) return true;
    const std::string reason = notes_.back().text;
    notes_.resize(notes);
    functions_.erase(name);
    give_up("'{}' runs on the controller: {}", name, reason);
  }
  return false;
}

bool KernelSourceReader::calls_itself(const Function& function) const {
  for (std::size_t i = function.body; i + 1 < function.end; ++i)
    if (tokens_[i].is_name(function.name) && tokens_[i + 1].is("(") && !tokens_[i - 1].is(".") &&
        function.signature.accepts(split_arguments(tokens_, i + 2, behind_bracket(i + 1) - 1).size()))
      return true;
  return false;
}

// Parameters are values: one that the function, or what it calls, may change has a variable of its own.
void KernelSourceReader::declare_parameters(const Function& function, ProgramLines& body) {
  bool may_change_globals = false;
  for (const auto& [name, variable] : scopes_.front())
    may_change_globals =
        may_change_globals || (is_scalar(variable.type) && may_change(name, function.body, function.end));
  const bool has_references =
      std::ranges::any_of(function.signature.parameters, [](const Parameter& p) { return p.is_reference; });
  for (const Parameter& parameter : function.signature.parameters) {
    Variable variable;
    variable.type = parameter.type;
    variable.range = range_of(parameter.type);
    variable.text = "$" + parameter.name;
    const bool is_value = is_scalar(parameter.type) && !parameter.is_reference;
    if (is_value &&
        (may_change_globals || has_references || may_change(parameter.name, function.body, function.end))) {
      variable.text = new_name(parameter.name);
      emit(body, 0, fmt::format("{} = ${}", variable.text, parameter.name));
    }
    scopes_.back()[parameter.name] = variable;
  }
}

void KernelSourceReader::translate_function(Function& function) {
  const bool is_main = function.name == "main";
  const std::size_t line = tokens_[function.body].line;
  const bool is_known = find_function(function.name, function.signature.parameters.size()) != nullptr;
  if (std::exchange(function.is_translated, true)) {
    position_ = function.end;
    return;
  }
  if (!is_main && !is_known) {
    function.is_translated = false;  // it is translated when an expression needs it
    position_ = function.body;
    note(line, no_instruction(function.name));
    position_ = function.end;
    return;
  }
  has_main_ = has_main_ || is_main;
  const auto same = [&](const Function& other) {
    return &other != &function && other.is_translated && other.name == function.name &&
           other.signature.parameters.size() == function.signature.parameters.size();
  };
  if (!is_main && std::ranges::any_of(all_functions_, same)) {
    position_ = function.body;
    note(line,
         fmt::format("another function '{}' has as many parameters: only their types tell them apart",
                     function.name),
         true);
    position_ = function.end;
    return;
  }
  if (calls_itself(function))
    note(line,
         fmt::format("'{}' calls itself{}", function.name,
                     vocabulary_.statements.contains(function.name)
                         ? ": rename it if the chip's instruction is meant"
                         : ""),
         true);
  ProgramLines body;
  position_ = function.body;
  in_kernel_ = function.is_kernel;
  in_macro_ = !is_main;
  current_ = &function;
  result_ = function.signature.result;
  returns_early_ = false;
  scopes_.emplace_back();
  if (!is_main) declare_parameters(function, body);
  translate_block(is_main ? main_ : body, 0);
  scopes_.pop_back();
  if (returns_early_) body.emplace_back(":#return");
  in_kernel_ = in_macro_ = false;
  current_ = nullptr;
  position_ = function.end;
  if (is_main) return;
  if (function.deduces_result) {
    function.signature.result = result_;
    const auto [begin, end] = functions_.equal_range(function.name);
    for (auto one = begin; one != end; ++one)
      if (one->second.accepts(function.signature.parameters.size())) one->second.result = result_;
  }
  std::string pattern = function.signature.name;
  for (std::size_t i = 0; i < function.signature.parameters.size(); ++i)
    pattern += (i == 0 ? "($" : ", $") + function.signature.parameters[i].name;
  if (!function.signature.parameters.empty()) pattern += ')';
  if (is_scalar(function.signature.result)) {
    body.insert(body.begin(), "$result = 0");
    pattern = "$result = " + pattern;
  } else {
    uncalled_.push_back({function.signature.name, function.signature.parameters.size()});
  }
  add_macro(pattern, function.name, line, body);
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
             fmt::format("'{}' with instructions of the chip has no counterpart", tokens_[start].text), true);
    } else if (peek().is_name_of({"namespace", "extern"})) {
      while (!at_end() && !peek().is("{") && !peek().is(";")) ++position_;
      ++position_;
    } else if (peek().is_name("enum")) {
      translate_enum();
    } else if (peek().is_name_of({"class", "struct"})) {
      const std::string what = peek().text, name = peek(1).text;
      skip_statement();
      note(tokens_[start].line, fmt::format("the {} '{}' is left out", what, name),
           has_instruction(tokens_, start, position_));
    } else {
      auto kernel = kernel_object_at(position_);
      if (!kernel) kernel = function_at(position_);
      const auto known = std::ranges::find_if(
          all_functions_, [&](const Function& function) { return kernel && function.body == kernel->body; });
      if (known != all_functions_.end()) {
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
        note(words[0].line, fmt::format("the enumerator '{}': {}", words[0].text, error.reason), true);
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
    // What an operand is, is known where the macro is called.
    scopes_.back()[name] = {"$" + name, CppType::kRegister, {}, std::nullopt, true};
    pattern += (&name == &macro.parameters.front() ? "($" : ", $") + name;
  }
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
  note(line, reason, is_error);
  position_ = end;
  if (in_kernel_ || is_block) emit(out, depth, fmt::format("// not translated (line {}): {}", line, reason));
}

void KernelSourceReader::translate_statement(ProgramLines& out, int depth) {
  const std::size_t start = position_, lines = out.size(), scopes = scopes_.size(), loops = loops_.size();
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
  if (first.is_name_of({"switch", "case", "goto", "struct", "class"}))
    give_up("'{}' has no counterpart", first.text);
  if (first.is_name_of({"break", "continue"}) && peek(1).is(";")) {
    position_ += 2;
    if (first.text == "continue" && !loops_.empty() && !loops_.back().continue_label.empty()) {
      loops_.back().is_used = true;
      return emit(out, depth, fmt::format("jump({})", loops_.back().continue_label));
    }
    return emit(out, depth, first.text);
  }
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
  if (type == CppType::kOther || type == CppType::kRegister) {  // auto, or a name for a register
    if (words.empty()) give_up("'{}' names no register", name);
    if (words.size() > 1 && words[0].is("&")) words.erase(words.begin());
    const CppValue value = settle(expression(words, out, depth), out, depth);
    if (value.type == CppType::kRegister) {
      if (!is_const && !is_reference && may_change(name, position_, tokens_.size() - 1))
        give_up("'{}' names another register later", name);
      scopes_.back()[name] = {value.text, CppType::kRegister, {}, std::nullopt, true};
      return;
    }
    if (type == CppType::kRegister) give_up("'{}' names no register", name);
    type = value.type == CppType::kBool || value.type == CppType::kFloat
               ? value.type
               : cpp_common_type(value.type, CppType::kInt);
  }
  CppValue value = words.empty() ? cpp_constant(0, type) : expression(words, out, depth);
  if (!is_scalar(value.type)) give_up("'{}' is no number", plain_text(words));
  value = cpp_convert(
      value.is_call && value.type != type ? settle(std::move(value), out, depth) : std::move(value), type);
  Variable& variable = declare(name, type);
  if (is_const && value.constant && *value.constant == value.range.low) {
    variable.constant = value.constant;
    variable.is_const = true;
  }
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
  if (counts) {
    const std::string op = words[0].kind == Kind::kName ? words[1].text : words[0].text;
    CppValue value;
    value.text = variable->text;
    value.type = variable->type;
    value.range = range_of(variable->type);
    variable->range = value.range;
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
      emit(out, depth,
           fmt::format("{0} = {0} {1} ({2})", variable->text, words[1].text.substr(0, 1), value.text));
    }
  } else {
    const CppValue value = expression(words, out, depth);
    if (assigns && is_number({words.begin() + 2, words.end()})) constants_.emplace(words[0].text, value.text);
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
