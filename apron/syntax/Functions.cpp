// Functions: `function y, z = f(plane a, number n)` … `endfunction`. A function becomes a macro whose
// parameters are the function's, and whose local names are all those that its lines write.
#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "apron/syntax/Preprocessor.h"

namespace apron::syntax {
namespace {

const std::map<std::string_view, ArgumentType> kTypes = {{"plane", ArgumentType::kPlane},
                                                         {"number", ArgumentType::kNumber},
                                                         {"integer", ArgumentType::kInteger},
                                                         {"text", ArgumentType::kText},
                                                         {"register", ArgumentType::kRegister}};

bool is_line(const Line& line, std::string_view word) {
  return line.tokens.size() == 1 && line.tokens.front().is_name(word);
}

Token make_token(TokenKind kind, std::string text, Location location) {
  return {kind, location, std::move(text), 0.0};
}

Line copy_line(TokenKind to_kind, const std::string& to, TokenKind from_kind, const std::string& from,
               Location location) {
  return {location,
          {make_token(to_kind, to, location), make_token(TokenKind::kPunctuator, "=", location),
           make_token(from_kind, from, location)}};
}

bool mentions(const Tokens& tokens, const std::string& name) {
  return std::ranges::any_of(tokens, [&](const Token& token) { return token.is_name(name); });
}

// True if the last line alone has the name, as its target: that line may write the caller's register.
bool is_written_at_the_end(const std::vector<Line>& body, const std::string& name) {
  const Tokens& last = body.back().tokens;
  if (last.size() < 3 || !last[0].is_name(name) || !last[1].is("=")) return false;
  return !mentions(Tokens(last.begin() + 1, last.end()), name) &&
         std::none_of(body.begin(), body.end() - 1,
                      [&](const Line& line) { return mentions(line.tokens, name); });
}

// A name that two of the function's results and parameters have, or "".
std::string repeated_name(const Macro& function) {
  std::vector<std::string> names = function.further_results;
  if (!function.result_parameter.empty()) names.push_back(function.result_parameter);
  for (const MacroParameter& parameter : function.parameters) names.push_back(parameter.name);
  std::ranges::sort(names);
  const auto repeated = std::adjacent_find(names.begin(), names.end());
  return repeated == names.end() ? "" : *repeated;
}

}  // namespace

void Preprocessor::handle_function(const Tokens& tokens) {
  Macro function;
  function.is_function = true;
  function.location = tokens.front().location;
  bool is_valid = parse_function_signature(tokens, function);
  if (!is_valid) {
    report(tokens.front().location, "expected a function's pattern: function y = f(plane a, number n)");
  } else if (const std::string repeated = repeated_name(function); !repeated.empty()) {
    report(tokens.front().location, "'{}' occurs twice: results and parameters have different names",
           repeated);
    is_valid = false;
  }
  const bool is_nested = frames_.back().macro != nullptr;
  if (is_nested) report(tokens.front().location, "a function is defined outside of macros and functions");
  if (read_function_body(tokens.front().location, function.body) && is_valid && !is_nested)
    define_function(std::move(function));
}

bool Preprocessor::parse_function_signature(const Tokens& tokens, Macro& function) {
  Tokens::const_iterator at = tokens.begin() + 1;
  if (const auto equals = find_equals(tokens.begin(), tokens.end()); equals != tokens.end()) {
    std::vector<std::string> results;
    for (const Tokens& result : split_arguments(at, equals)) {
      if (result.size() != 1 || result.front().kind != TokenKind::kName) return false;
      results.push_back(result.front().text);
    }
    function.result_parameter = results.front();
    function.further_results.assign(results.begin() + 1, results.end());
    at = equals + 1;
  }
  if (at == tokens.end() || at->kind != TokenKind::kName) return false;
  function.name = at->text;
  function.location = at->location;
  if (++at == tokens.end()) return true;
  if (!at->is("(") || !tokens.back().is(")")) return false;
  for (const Tokens& words : split_arguments(at + 1, tokens.end() - 1)) {
    MacroParameter parameter;
    if (!parse_function_parameter(words, parameter)) return false;
    function.parameters.push_back(std::move(parameter));
  }
  return true;
}

// "a", "plane a" or "register a[]".
bool Preprocessor::parse_function_parameter(const Tokens& words, MacroParameter& parameter) {
  std::size_t at = 0;
  if (words.size() > 1 && words[1].kind == TokenKind::kName) {
    const auto type = kTypes.find(words[0].text);
    if (type == kTypes.end()) return false;
    parameter.type = type->second;
    at = 1;
  }
  if (at >= words.size() || words[at].kind != TokenKind::kName) return false;
  parameter.name = words[at++].text;
  if (at == words.size()) return true;
  parameter.is_array = words.size() == at + 2 && words[at].is("[") && words[at + 1].is("]");
  return parameter.is_array && at == 2 &&
         (parameter.type == ArgumentType::kRegister || parameter.type == ArgumentType::kPlane ||
          parameter.type == ArgumentType::kNumber);
}

// Extracts the lines up to `endfunction` from the current text.
bool Preprocessor::read_function_body(Location location, std::vector<Line>& body) {
  InputFrame& frame = frames_.back();
  for (; frame.next_line < frame.lines->size(); ++frame.next_line) {
    const Line& line = (*frame.lines)[frame.next_line];
    if (is_line(line, "endfunction")) {
      ++frame.next_line;
      return true;
    }
    body.push_back(line);
  }
  report(location, "this function has no 'endfunction'");
  return false;
}

// How the call writes the argument of that number, through macros of any depth that can be expanded. A
// macro's name within its own body is the instruction of that name, if there is one.
WriteKind Preprocessor::write_kind(const BodyWrites::Call& call, std::size_t argument, const Macro* caller) {
  WriteKind result = WriteKind::kNone;
  std::set<std::tuple<MacroTable::Handle, std::size_t, bool>> seen, next;
  const auto visit = [&](const BodyWrites::Call& at, std::size_t index, bool is_element,
                         const Macro* within) {
    const auto defined = defines_.find(at.name);
    const bool is_renamed = defined != defines_.end() && defined->second.size() == 1;
    const std::string& name = is_renamed ? defined->second.front().text : at.name;
    const MacroTable::Handle macro = macros_.find(name, at.argument_count, at.has_result);
    if (macro != nullptr && !(macro.get() == within && is_builtin(name))) {
      next.emplace(macro, index, is_element);
    } else if (!is_builtin(name)) {
      result = std::max(result, WriteKind::kUnknown);
    } else if (!at.has_result && options_.written_argument) {
      int written = options_.written_argument(name, at.argument_count);
      if (written == 0 && at.begins_with_text) ++written;  // surface.sense('name', D)
      if (written == static_cast<int>(index))
        result = std::max(result, is_element ? WriteKind::kElement : WriteKind::kWhole);
    }
  };
  visit(call, argument, false, caller);
  for (std::size_t depth = 0; depth < kMaxMacroDepth && !next.empty(); ++depth) {
    for (const auto& key : std::exchange(next, {})) {
      if (!seen.insert(key).second) continue;
      const auto& [macro, index, is_element] = key;
      const std::string& parameter = macro->parameters[index].name;
      const auto is_parameter = [&](const BodyWrites::Place& place) {
        return place.name.kind == TokenKind::kParameter && place.name.text == parameter;
      };
      const BodyWrites& writes = writes_of(macro);
      for (const BodyWrites::Place& target : writes.targets)
        if (is_parameter(target))
          result =
              std::max(result, is_element || target.is_element ? WriteKind::kElement : WriteKind::kWhole);
      for (const BodyWrites::Call& inner : writes.calls)
        for (const auto& [number, place] : inner.places)
          if (is_parameter(place)) visit(inner, number, is_element || place.is_element, macro.get());
    }
  }
  return result;
}

const BodyWrites& Preprocessor::writes_of(const MacroTable::Handle& macro) {
  const auto [found, is_new] = body_writes_.try_emplace(macro);
  if (is_new) found->second = find_writes(macro->body);
  return found->second;
}

Preprocessor::FunctionWrites Preprocessor::writes_of_function(const Macro& function) {
  const BodyWrites writes = find_writes(function.body);
  FunctionWrites result;
  std::set<std::string> declared;
  const auto add = [&](const BodyWrites::Place& place, WriteKind kind) {
    if (place.name.kind != TokenKind::kName || kind == WriteKind::kNone) return;
    const bool is_element = kind == WriteKind::kElement || (place.is_element && kind == WriteKind::kWhole);
    (kind == WriteKind::kUnknown ? result.unknown
     : is_element                ? result.elements
                                 : result.names)
        .insert(place.name.text);
  };
  // A function that calls itself writes its own registers.
  const auto kind_of = [&](const BodyWrites::Call& call, std::size_t argument) {
    if (call.name != function.name || call.argument_count != function.parameters.size() ||
        call.has_result == function.result_parameter.empty() || is_builtin(call.name))
      return write_kind(call, argument, nullptr);
    const MacroParameter& parameter = function.parameters[argument];
    if (parameter.type != ArgumentType::kRegister) return WriteKind::kNone;
    return parameter.is_array ? WriteKind::kElement : WriteKind::kWhole;
  };
  for (const BodyWrites::Place& place : writes.declared) {
    declared.insert(place.name.text);
    add({place.name, false}, WriteKind::kWhole);
  }
  for (const BodyWrites::Place& place : writes.targets) add(place, WriteKind::kWhole);
  for (const BodyWrites::Call& call : writes.calls)
    for (const auto& [number, place] : call.places) add(place, kind_of(call, number));
  for (const std::string& name : declared) result.elements.erase(name);
  for (const Line& line : function.body)
    if (line.tokens.front().kind == TokenKind::kLabel) result.labels.insert(line.tokens.front().text);
  return result;
}

void Preprocessor::define_function(Macro function) {
  const Location location = function.location;
  std::vector<Line>& body = function.body;
  FunctionWrites writes = writes_of_function(function);
  const bool returns = std::ranges::any_of(body, [](const Line& line) { return is_line(line, "return"); });
  std::vector<std::string> results = function.further_results;
  if (!function.result_parameter.empty()) results.insert(results.begin(), function.result_parameter);

  for (const std::string& result : results)
    if (writes.unknown.contains(result)) writes.names.insert(result);
  std::map<std::string, TokenKind> meaning;  // of the names: parameters of the macro, or local
  for (const std::string& name : writes.names) meaning[name] = TokenKind::kLocalName;
  const auto require_name = [&](const std::string& name) {
    if (is_keyword(name))
      report(location, "the function '{}' has a keyword as a name: '{}'", function.name, name);
  };
  for (const std::string& name : writes.names) require_name(name);
  for (const MacroParameter& parameter : function.parameters)
    if (!writes.names.contains(parameter.name)) require_name(parameter.name);
  std::vector<Line> before, after;
  for (const std::string& result : results) {
    if (!writes.names.contains(result)) {
      report(location, "the function '{}' does not write its result '{}'", function.name, result);
    } else if (results.size() == 1 && !returns && is_written_at_the_end(body, result)) {
      meaning[result] = TokenKind::kParameter;
    } else {
      after.push_back(copy_line(TokenKind::kParameter, result, TokenKind::kLocalName, result, location));
    }
  }
  const bool has_registers = std::ranges::any_of(function.parameters, [](const MacroParameter& parameter) {
    return parameter.type == ArgumentType::kRegister;
  });
  const bool may_write_any = may_write_program(body);
  for (const MacroParameter& parameter : function.parameters) {
    const bool is_element_written = writes.elements.contains(parameter.name);
    const bool is_written = writes.names.contains(parameter.name) || is_element_written;
    const bool is_copied = parameter.type == ArgumentType::kAny || parameter.type == ArgumentType::kPlane ||
                           parameter.type == ArgumentType::kNumber;
    // A register that the function writes may be given as a plane as well, and so may a name of the program
    // that a macro or routine writes.
    if (is_copied && !parameter.is_array && !is_element_written &&
        (is_written || writes.unknown.contains(parameter.name) || has_registers || may_write_any)) {
      meaning[parameter.name] = TokenKind::kLocalName;
      before.push_back(
          copy_line(TokenKind::kLocalName, parameter.name, TokenKind::kParameter, parameter.name, location));
      continue;
    }
    if (is_written && parameter.type != ArgumentType::kRegister)
      report(location, "the function '{}' writes '{}', which is {}", function.name, parameter.name,
             is_copied                                  ? "an array of the caller: declare it 'register'"
             : parameter.type == ArgumentType::kInteger ? "a constant"
                                                        : "a text");
    meaning[parameter.name] = TokenKind::kParameter;
    writes.elements.erase(parameter.name);
  }
  for (const std::string& array : writes.elements)
    report(location,
           "the function '{}' writes elements of '{}', which is the program's: pass it as 'register'",
           function.name, array);
  for (Line& line : body) {
    const Tokens& words = line.tokens;
    if (words.front().is_name("call") || words.front().is_name("callif")) {
      const auto own = std::ranges::find_if(words, [&](const Token& token) {
        return token.kind == TokenKind::kLabel && writes.labels.contains(token.text);
      });
      if (own != words.end())
        report(
            own->location,
            "the label '#{}' of the function '{}' cannot be called, as 'return' ends the function: write a "
            "function of its own before this one",
            own->text, function.name);
    }
    if (is_line(line, "return")) {
      const Location at = line.location;
      line.tokens = {make_token(TokenKind::kName, "jump", at), make_token(TokenKind::kPunctuator, "(", at),
                     make_token(TokenKind::kLocalLabel, "return", at),
                     make_token(TokenKind::kPunctuator, ")", at)};
    }
    for (std::size_t i = 0; i < line.tokens.size(); ++i) {
      Token& token = line.tokens[i];
      const bool is_call = i + 1 < line.tokens.size() && line.tokens[i + 1].is("(");
      if (token.kind == TokenKind::kLabel && writes.labels.contains(token.text))
        token.kind = TokenKind::kLocalLabel;
      if (token.kind != TokenKind::kName || is_call) continue;
      if (const auto found = meaning.find(token.text); found != meaning.end()) token.kind = found->second;
    }
  }
  if (returns)
    after.insert(after.begin(), {location, {make_token(TokenKind::kLocalLabel, "return", location)}});
  body.insert(body.begin(), before.begin(), before.end());
  body.insert(body.end(), after.begin(), after.end());
  add_macro(std::move(function));
}

}  // namespace apron::syntax
