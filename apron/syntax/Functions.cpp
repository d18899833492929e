// Functions: `function y, z = f(plane a, number n)` … `endfunction`. A function becomes a macro whose
// parameters are the function's, and whose local names are all those that its lines write.
#include <algorithm>
#include <map>
#include <string>
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

// The names that a body's lines write or declare, each as often as it is.
class Writes {
 public:
  Writes(const std::vector<Line>& body,
         const std::function<int(std::string_view, std::size_t)>& written_argument) {
    for (const Line& line : body) visit(line, written_argument);
  }
  std::size_t count(const std::string& name) const {
    const auto found = counts_.find(name);
    return found == counts_.end() ? 0 : found->second;
  }
  const std::map<std::string, std::size_t>& counts() const { return counts_; }
  const std::set<std::string>& labels() const { return labels_; }

 private:
  void visit(const Line& line, const std::function<int(std::string_view, std::size_t)>& written_argument) {
    const Tokens& tokens = line.tokens;
    const Token& first = tokens.front();
    if (first.kind == TokenKind::kLabel) labels_.insert(first.text);
    const auto equals = find_equals(tokens.begin(), tokens.end());
    const bool has_list = tokens.size() > 2 && tokens[1].is("(") && tokens.back().is(")");
    if (first.kind == TokenKind::kName && equals != tokens.end()) {
      for (const Tokens& target : split_arguments(tokens.begin(), equals)) add(target);
    } else if (first.kind == TokenKind::kName && has_list && written_argument) {
      const std::vector<Tokens> arguments = split_arguments(tokens.begin() + 2, tokens.end() - 1);
      const int index = written_argument(first.text, arguments.size());
      if (index >= 0 && index < std::ssize(arguments)) add(arguments[index]);
    } else if (first.kind == TokenKind::kDirective && has_list &&
               (first.text == "register" || first.text == "scalar")) {
      for (const Tokens& name : split_arguments(tokens.begin() + 2, tokens.end() - 1))
        if (!name.empty()) ++counts_[name.front().text];
    }
  }
  void add(const Tokens& target) {
    if (target.size() == 1 && target.front().kind == TokenKind::kName) ++counts_[target.front().text];
  }

  std::map<std::string, std::size_t> counts_;
  std::set<std::string> labels_;
};

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

void Preprocessor::define_function(Macro function) {
  const Location location = function.location;
  std::vector<Line>& body = function.body;
  const Writes writes(body, options_.written_argument);
  const bool returns = std::ranges::any_of(body, [](const Line& line) { return is_line(line, "return"); });
  std::vector<std::string> results = function.further_results;
  if (!function.result_parameter.empty()) results.insert(results.begin(), function.result_parameter);

  std::map<std::string, TokenKind> meaning;  // of the names: parameters of the macro, or local
  for (const auto& [name, count] : writes.counts()) meaning[name] = TokenKind::kLocalName;
  const auto require_name = [&](const std::string& name) {
    if (is_keyword(name))
      report(location, "the function '{}' has a keyword as a name: '{}'", function.name, name);
  };
  for (const auto& [name, count] : writes.counts()) require_name(name);
  for (const MacroParameter& parameter : function.parameters)
    if (writes.count(parameter.name) == 0) require_name(parameter.name);
  std::vector<Line> before, after;
  for (const std::string& result : results) {
    if (writes.count(result) == 0) {
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
  const bool may_call = may_call_routine(body);
  for (const MacroParameter& parameter : function.parameters) {
    const bool is_written = writes.count(parameter.name) > 0;
    const bool is_copied = parameter.type == ArgumentType::kAny || parameter.type == ArgumentType::kPlane ||
                           parameter.type == ArgumentType::kNumber;
    // A register that the function writes may be given as a plane as well; a routine may write any name.
    if (is_copied && !parameter.is_array && (is_written || has_registers || may_call)) {
      meaning[parameter.name] = TokenKind::kLocalName;
      before.push_back(
          copy_line(TokenKind::kLocalName, parameter.name, TokenKind::kParameter, parameter.name, location));
      continue;
    }
    if (is_written && parameter.type != ArgumentType::kRegister)
      report(location, "the function '{}' writes '{}', which is {}", function.name, parameter.name,
             parameter.is_array                         ? "an array of the caller: declare it 'register'"
             : parameter.type == ArgumentType::kInteger ? "a constant"
                                                        : "a text");
    meaning[parameter.name] = TokenKind::kParameter;
  }
  for (Line& line : body) {
    const Tokens& words = line.tokens;
    if (words.front().is_name("call") || words.front().is_name("callif")) {
      const auto own = std::ranges::find_if(words, [&](const Token& token) {
        return token.kind == TokenKind::kLabel && writes.labels().contains(token.text);
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
      if (token.kind == TokenKind::kLabel && writes.labels().contains(token.text))
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
