// Functions and function-like macros of a C++ file: finding them, and translating those that are used.
#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <utility>

#include "apron/run/import/KernelSourceReader.h"

namespace apron::run {

using Kind = KernelTokenKind;

namespace {

// Reads of registers for the host, and calls that only the host's window sees.
bool is_output(const std::string& name) {
  static const std::set<std::string> kPrefixes = {"scamp5_output", "scamp5_display", "scamp5_scan",
                                                  "scamp5_read",   "scamp5_global",  "vs_"};
  return std::ranges::any_of(kPrefixes, [&](const std::string& prefix) { return name.starts_with(prefix); });
}

std::string no_instruction(const std::string& function) {
  return fmt::format("the function '{}' has no instruction of the chip", function);
}

}  // namespace

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
    parameter.node = flow_.add();
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
  function.signature.call = flow_.add();
  function.signature.value = flow_.add();
  function.signature.parameters = read_parameters(i, close);
  std::size_t at = 0;
  const KernelTokenList words(tokens_.begin() + first_of_type, tokens_.begin() + end_of_type);
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
  function.signature.call = flow_.add();
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
      const std::size_t end = behind_bracket(i + 1);
      // A count by way of an analogue register, and a pattern that an instruction reads, are written.
      if (tokens_[i].is_name("scamp5_global_count") && split_arguments(tokens_, i + 2, end - 1).size() > 1)
        return true;
      if (tokens_[i].is_name("scamp5_global_sum_sparse") && mentions(tokens_, "SELECT")) return true;
      i = end - 1;
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
  macro.body.assign(words.begin() + std::min(body + 1, words.size() - 1), words.end());
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
    has_references_ =
        has_references_ || std::ranges::any_of(function->signature.parameters, &Parameter::is_reference);
    all_functions_[function->name].push_back(std::move(*function));
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
        signature.parameters.push_back({.name = name, .is_any = true, .initial = {}, .node = flow_.add()});
      signature.call = flow_.add();
      functions_.emplace(macro->name, std::move(signature));
      found = true;
    }
    for (auto& [name, functions] : all_functions_)
      for (Function& function : functions) {
        if (function.has_instruction || name == "main") continue;
        if (!function.is_kernel && !has_instruction(tokens_, function.body, function.end)) continue;
        function.has_instruction = true;
        collect(function);
        found = true;
      }
  }
}

std::span<const KernelSourceReader::Function> KernelSourceReader::functions_of(
    const std::string& name) const {
  const auto found = all_functions_.find(name);
  if (found == all_functions_.end()) return {};
  return found->second;
}

bool KernelSourceReader::require_function(const std::string& name, std::size_t count) {
  if (is_in_definition_ || functions_of(name).empty()) return false;
  for (Function& function : all_functions_[name]) {
    if (!function.signature.accepts(count) || function.has_instruction) continue;
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
    variable.node = parameter.node;
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
    return &other != &function && other.is_translated &&
           other.signature.parameters.size() == function.signature.parameters.size();
  };
  if (!is_main && std::ranges::any_of(functions_of(function.name), same)) {
    position_ = function.body;
    note(line,
         fmt::format("another function '{}' has as many parameters: only their types tell them apart",
                     function.name),
         Severity::kError);
    position_ = function.end;
    return;
  }
  if (calls_itself(function))
    note(line,
         fmt::format("'{}' calls itself{}", function.name,
                     vocabulary_.statements.contains(function.name)
                         ? ": rename it if the chip's instruction is meant"
                         : ""),
         Severity::kError);
  ProgramLines body;
  position_ = function.body;
  in_kernel_ = function.is_kernel;
  in_macro_ = !is_main;
  current_ = &function;
  result_ = function.signature.result;
  returns_early_ = false;
  const ValueFlow::Body flow(flow_, function.signature.call);
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

void KernelSourceReader::forget_translated_functions() {
  for (const auto& [name, functions] : all_functions_)
    for (const Function& function : functions) {
      if (!function.is_translated) continue;
      const std::size_t line = tokens_[function.body].line;
      std::erase_if(notes_, [&](const ImportNote& note) {
        return note.line == line && note.text == no_instruction(name);
      });
    }
}

}  // namespace apron::run
