// The `!` directives of the preprocessor.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <string>
#include <unordered_set>
#include <utility>

#include "apron/syntax/Constant.h"
#include "apron/syntax/Lexer.h"
#include "apron/syntax/Preprocessor.h"
#include "common/text/Suggestion.h"
#include "common/text/Words.h"

namespace apron::syntax {
namespace {

constexpr std::string_view kOperators[] = {"=",   "+",    "-",   "*",  "/",  "%",  "<",   "<=",
                                           ">",   ">=",   "==",  "!=", "&&", "||", "and", "or",
                                           "xor", "nand", "nor", "&",  "|",  "^",  "<<",  ">>"};

std::string normalize_path(const std::string& path) {
  return std::filesystem::path(path).lexically_normal().string();
}

}  // namespace

// Returns whether it was !if, !else or !endif, which are processed in skipped lines too.
bool Preprocessor::handle_conditional(const Tokens& tokens) {
  const Token& directive = tokens.front();
  std::vector<ConditionalBlock>& conditions = frames_.back().conditionals;
  const bool is_else = directive.text == "else";
  if (directive.text == "if") {
    handle_if(tokens);
    return true;
  }
  if (!is_else && directive.text != "endif") return false;
  if (conditions.empty()) {
    report(directive.location, "this '!{}' has no '!if'", directive.text);
  } else if (is_else) {
    ConditionalBlock& condition = conditions.back();
    if (condition.has_else) report(directive.location, "this '!if' has an '!else' already");
    condition.has_else = true;
    condition.is_active = condition.enclosing_active && !condition.branch_taken;
    condition.branch_taken = true;
  } else {
    conditions.pop_back();
  }
  return true;
}

void Preprocessor::handle_if(const Tokens& line) {
  ConditionalBlock condition;
  condition.location = line.front().location;
  condition.enclosing_active = is_active();
  condition.is_active = false;
  if (condition.enclosing_active) {
    Tokens tokens = line;
    substitute(tokens, frames_.back());
    condition.is_active = expand_defines(tokens) && evaluate_condition(tokens);
  }
  condition.branch_taken = condition.is_active;
  frames_.back().conditionals.push_back(condition);
}

bool Preprocessor::evaluate_condition(const Tokens& tokens) {
  Arguments list;
  if (!parse_arguments(tokens, 1, 3, list)) return false;
  const Location location = tokens.front().location;
  if (list.size() == 2) {
    report(location, "'!if' takes (a, op, b) or one condition");
    return false;
  }
  if (list.size() == 1) return syntax::evaluate_condition(list[0], location, diagnostics_).value_or(false);
  const std::optional<Constant> left = evaluate_constant(list[0], location, diagnostics_);
  if (!left) return false;
  const std::optional<Constant> right = evaluate_constant(list[2], location, diagnostics_);
  if (!right) return false;
  const std::string op = list[1].size() == 1 ? list[1].front().text : "";
  const std::optional<bool> result = compare(*left, op, *right);
  if (!result) {
    diagnostics_.error(list[1].empty() ? location : list[1].front().location,
                       left->is_string || right->is_string
                           ? fmt::format("'{}' is not a number: texts and names compare by == and != only",
                                         display_name(left->is_string ? left->text : right->text))
                           : "expected one of < <= > >= == !=");
  }
  return result.value_or(false);
}

// Splits the parenthesised list after the directive's name.
bool Preprocessor::parse_arguments(const Tokens& tokens, std::size_t min_count, std::size_t max_count,
                                   Arguments& list) {
  const Token& directive = tokens.front();
  const bool has_parentheses = tokens.size() > 2 && tokens[1].is("(") && tokens.back().is(")");
  if (has_parentheses) list = split_arguments(tokens.begin() + 2, tokens.end() - 1);
  const bool has_empty = std::ranges::any_of(list, [](const Tokens& argument) { return argument.empty(); });
  if (has_parentheses && !has_empty && list.size() >= min_count && list.size() <= max_count) return true;
  const std::string count = min_count == max_count ? fmt::format("{}", min_count)
                            : max_count > 100      ? fmt::format("{} or more", min_count)
                                                   : fmt::format("{} to {}", min_count, max_count);
  report(directive.location, "'!{}' takes {} argument{} in brackets", directive.text, count,
         max_count == 1 ? "" : "s");
  return false;
}

bool Preprocessor::parse_string_argument(const Tokens& tokens, std::string& text, std::string_view subject) {
  const bool valid =
      tokens.size() == 1 && tokens.front().kind == TokenKind::kString && !tokens.front().text.empty();
  if (valid) {
    text = tokens.front().text;
  } else {
    report(tokens.front().location, "expected {} in single quotes", subject);
  }
  return valid;
}

struct Preprocessor::Directive {
  std::string_view name;
  void (Preprocessor::*handle)(const Tokens&);  // null: handle_conditional() has taken it
  bool expands_defines = true;
};

std::span<const Preprocessor::Directive> Preprocessor::directives() {
  static const Directive kDirectives[] = {{"if", nullptr},
                                          {"else", nullptr},
                                          {"endif", nullptr},
                                          {"macro_def", &Preprocessor::handle_macro_def, false},
                                          {"define", &Preprocessor::handle_define, false},
                                          {"for", &Preprocessor::handle_for},
                                          {"endfor", &Preprocessor::handle_stray_macro_line},
                                          {"include", &Preprocessor::handle_include, false},
                                          {"register", &Preprocessor::handle_register, false},
                                          {"int32", &Preprocessor::handle_register, false},
                                          {"uint16", &Preprocessor::handle_register, false},
                                          {"uint8", &Preprocessor::handle_register, false},
                                          {"scalar", &Preprocessor::handle_register, false},
                                          {"machine_register", &Preprocessor::handle_register, false},
                                          {"error", &Preprocessor::handle_error, false},
                                          {"operand_kind", &Preprocessor::handle_operand_kind, false},
                                          {"create", &Preprocessor::handle_create},
                                          {"object", &Preprocessor::handle_object},
                                          {"operator", &Preprocessor::handle_operator},
                                          {"max_addr", &Preprocessor::handle_max_addr},
                                          {"default_palette", &Preprocessor::handle_default_palette},
                                          {"module", &Preprocessor::handle_module},
                                          {"compatibility", &Preprocessor::handle_compatibility},
                                          {"sim_core", &Preprocessor::ignore_directive},
                                          {"macro_begin", &Preprocessor::handle_stray_macro_line},
                                          {"macro_end", &Preprocessor::handle_stray_macro_line}};
  return kDirectives;
}

std::vector<std::string> Preprocessor::directive_names() {
  std::vector<std::string> names;
  for (const Directive& directive : directives()) names.push_back("!" + std::string(directive.name));
  return names;
}

void Preprocessor::handle_directive(Line& line) {
  const Token name = line.tokens.front();
  const auto directive = std::ranges::find(directives(), name.text, &Directive::name);
  // A macro's body is skipped even if its first line has an error.
  if (line.has_error && name.text != "macro_def") return;
  if (directive == directives().end())
    return report(name.location, "there is no directive '!{}'{}", name.text,
                  common::did_you_mean(spelling(name), directive_names()));
  if (!directive->expands_defines || expand_defines(line.tokens)) (this->*directive->handle)(line.tokens);
}

// `!sim_core` of the original selects its simulator. We have one.
void Preprocessor::ignore_directive(const Tokens&) {}

void Preprocessor::handle_stray_macro_line(const Tokens& tokens) {
  report(tokens.front().location, "this '!{}' has no '!{}'", tokens.front().text,
         tokens.front().text == "endfor" ? "for" : "macro_def");
}

// Repeats the lines up to `!endfor`, in which the loop's name stands for a number.
void Preprocessor::handle_for(const Tokens& tokens) {
  InputFrame loop;
  loop.expansion = frames_.back().expansion;
  auto lines = std::make_shared<std::vector<Line>>();
  int depth = 1;
  for (InputFrame& frame = frames_.back(); frame.next_line < frame.lines->size(); ++frame.next_line) {
    Line line = (*frame.lines)[frame.next_line];
    const Token& first = line.tokens.front();
    if (first.kind == TokenKind::kDirective)
      depth += first.text == "for" ? 1 : first.text == "endfor" ? -1 : 0;
    if (depth == 0) break;
    if (depth > kMaxLoopDepth) {
      report(first.location, "'!for' is nested deeper than {}", kMaxLoopDepth);
      return abort_input();
    }
    substitute(line.tokens, frame);
    lines->push_back(std::move(line));
  }
  if (depth > 0) return report(tokens.front().location, "this '!for' has no '!endfor'");
  ++frames_.back().next_line;
  Arguments list;
  if (!parse_arguments(tokens, 3, 4, list)) return;
  if (list[0].size() != 1 || list[0].front().kind != TokenKind::kName)
    return report(list[0].front().location, "expected the name that counts: !for(i, from, to)");
  loop.loop_variable = list[0].front().text;
  std::vector<double> numbers;
  for (std::size_t i = 1; i < list.size(); ++i) {
    const std::optional<Constant> value = evaluate_constant(list[i], list[i].front().location, diagnostics_);
    if (!value) return;
    if (value->is_string || value->number != std::floor(value->number) || std::abs(value->number) > 1e9)
      return report(list[i].front().location, "'!for' counts in whole numbers that are constants");
    numbers.push_back(value->number);
  }
  loop.loop_value = numbers[0];
  loop.loop_end = numbers[1];
  loop.loop_step = numbers.size() == 3 ? numbers[2] : 1.0;
  if (loop.loop_step == 0.0) return report(list[3].front().location, "the step of a '!for' cannot be zero");
  if (lines->empty() || (loop.loop_end - loop.loop_value) * loop.loop_step < 0.0) return;
  loop.lines = std::move(lines);
  frames_.push_back(std::move(loop));
}

void Preprocessor::handle_include(const Tokens& tokens) {
  Arguments list;
  std::string name;
  if (!parse_arguments(tokens, 1, 1, list) || !parse_string_argument(list[0], name, "a file name")) return;
  include_file(name, tokens.front().location, list[0].front().location);
}

void Preprocessor::include_file(const std::string& name, Location location, Location argument) {
  const std::filesystem::path including_file = sources_.file(location.file).name;
  std::vector<std::string> candidates{normalize_path((including_file.parent_path() / name).string())};
  for (const std::string& directory : options_.include_paths) {
    candidates.push_back(normalize_path((std::filesystem::path(directory) / name).string()));
  }
  if (!options_.library_path.empty()) {
    candidates.push_back(normalize_path((std::filesystem::path(options_.library_path) / name).string()));
  }
  for (const std::string& path : candidates) {
    if (std::optional<std::string> text = reader_.read(path))
      return push_file(path, std::move(*text), location);
  }
  report(argument, "there is no file '{}' (looked for {})", name, common::join(candidates));
}

void Preprocessor::push_file(const std::string& path, std::string text, Location from) {
  std::string chain;
  std::size_t depth = 0;
  bool is_recursive = false;
  for (const InputFrame& frame : frames_) {
    if (frame.macro != nullptr) continue;
    ++depth;
    is_recursive = is_recursive || frame.path == normalize_path(path);
    if (is_recursive) chain += frame.path + " -> ";
  }
  if (is_recursive) {
    report(from, "'{}' includes itself: {}{}", normalize_path(path), chain, normalize_path(path));
    return;
  }
  if (depth >= kMaxIncludeDepth || ++include_count_ > kMaxIncludes) {
    diagnostics_.error(from, depth >= kMaxIncludeDepth
                                 ? fmt::format("files include each other more than {} deep", kMaxIncludeDepth)
                                 : fmt::format("more than {} files are included", kMaxIncludes));
    return abort_input();
  }
  const std::uint32_t file = sources_.add_file(path, std::move(text), from);
  InputFrame frame;
  frame.lines = std::make_shared<const std::vector<Line>>(lex(sources_, file, diagnostics_));
  frame.path = normalize_path(path);
  frames_.push_back(std::move(frame));
}

void Preprocessor::handle_define(const Tokens& tokens) {
  // The name, or name[index].
  const bool is_indexed = tokens.size() > 6 && tokens[3].is("[") && tokens[5].is("]");
  const std::size_t comma = is_indexed ? 6 : 3;
  const bool valid = tokens.size() > comma + 2 && tokens[1].is("(") && tokens[2].kind == TokenKind::kName &&
                     tokens[comma].is(",") && tokens.back().is(")") &&
                     tokens.size() - comma - 2 < kMaxLineTokens;
  if (!valid) {
    report(tokens.front().location,
           "'!define' takes a name and the words it stands for: !define(NAME, words)");
    return;
  }
  const std::string name = is_indexed ? indexed_name(tokens[2], tokens[4]) : tokens[2].text;
  defines_[name] = Tokens(tokens.begin() + comma + 1, tokens.end() - 1);
}

void Preprocessor::handle_macro_def(const Tokens& tokens) {
  Macro macro;
  macro.location = tokens.front().location;
  InputFrame& frame = frames_.back();
  Tokens signature_tokens(tokens.begin() + 1, tokens.end());
  const bool own_line = signature_tokens.empty() && frame.next_line < frame.lines->size() &&
                        (*frame.lines)[frame.next_line].tokens.front().kind != TokenKind::kDirective;
  if (own_line) signature_tokens = (*frame.lines)[frame.next_line++].tokens;
  const bool signature_valid = parse_macro_signature(signature_tokens, macro);
  if (!signature_valid) {
    report(signature_tokens.empty() ? macro.location : signature_tokens.front().location,
           "expected a macro's pattern: name($a, $b) or $y = name($a, $b)");
  }
  for (const MacroParameter& parameter : macro.parameters) {
    if (parameter.kind.empty() || operand_kinds_.contains(parameter.kind)) continue;
    report(macro.location,
           "there is no operand kind '{0}': !operand_kind({0}, 'a "
           "description', A, B) defines one",
           parameter.kind);
  }
  if (parse_macro_body(macro, macro.location) && signature_valid) add_macro(std::move(macro));
}

// True if a routine or macro that the lines call may write a name of the program.
bool Preprocessor::may_write_program(const std::vector<Line>& body) const {
  return std::ranges::any_of(body, [&](const Line& line) {
    for (std::size_t i = 0; i < line.tokens.size(); ++i) {
      const Token& token = line.tokens[i];
      if (token.is_name("call") || token.is_name("callif")) return true;
      const bool is_operator =
          is_keyword(token.text) && (i + 1 == line.tokens.size() || !line.tokens[i + 1].is("("));
      if (token.kind == TokenKind::kName && !is_operator && writing_macros_.contains(token.text)) return true;
    }
    return false;
  });
}

bool Preprocessor::writes_program(const Macro& macro) {
  const auto is_program_name = [](const BodyWrites::Place& place) {
    return place.name.kind == TokenKind::kName;
  };
  const BodyWrites writes = find_writes(macro.body);
  return may_write_program(macro.body) || std::ranges::any_of(writes.targets, is_program_name) ||
         std::ranges::any_of(writes.calls, [&](const BodyWrites::Call& call) {
           return std::ranges::any_of(call.places, [&](const auto& numbered) {
             return is_program_name(numbered.second) &&
                    write_kind(call, numbered.first, &macro) > WriteKind::kUnknown;
           });
         });
}

void Preprocessor::add_macro(Macro macro) {
  if (writes_program(macro)) writing_macros_.insert(macro.name);
  if (macro.parameters.size() > kMaxParameters) {
    report(macro.location, "the {} '{}' has {} parameters: {} at most",
           macro.is_function ? "function" : "macro", macro.name, macro.parameters.size(), kMaxParameters);
    return;
  }
  const Macro copy = macro;
  const MacroTable::Handle previous = macros_.add(std::move(macro));
  if (previous != nullptr && !same_definition(*previous, copy)) {
    diagnostics_.error(copy.location,
                       fmt::format("the {} '{}' is defined already", copy.is_function ? "function" : "macro",
                                   signature(copy)),
                       {{previous->location, "it is defined"}});
  }
}

bool Preprocessor::parse_macro_signature(const Tokens& tokens, Macro& macro) {
  std::size_t index = 0;
  const auto parse_parameter = [&](std::string& name) {
    if (index >= tokens.size() || tokens[index].kind != TokenKind::kParameter) return false;
    name = tokens[index++].text;
    return true;
  };
  const auto parse_kind = [&] {
    const bool is_kind = index < tokens.size() && tokens[index].kind == TokenKind::kName;
    return is_kind ? tokens[index++].text : "";
  };
  const auto consume = [&](std::string_view text) {
    const bool found = index < tokens.size() && tokens[index].is(text);
    if (found) ++index;
    return found;
  };
  if (parse_parameter(macro.result_parameter) && !consume("=")) return false;
  if (index >= tokens.size() || tokens[index].kind != TokenKind::kName) return false;
  macro.name = tokens[index].text;
  macro.location = tokens[index++].location;
  if (index == tokens.size()) return true;
  if (!consume("(")) return false;
  if (consume(")")) return index == tokens.size();
  std::unordered_set<std::string> names{macro.result_parameter};
  do {
    MacroParameter parameter;
    parameter.kind = parse_kind();
    if (!parse_parameter(parameter.name)) return false;
    if (!names.insert(parameter.name).second) return false;
    macro.parameters.push_back(std::move(parameter));
  } while (consume(","));
  return consume(")") && index == tokens.size();
}

// Extracts the lines from !macro_begin to its !macro_end from the current text.
bool Preprocessor::parse_macro_body(Macro& macro, Location location) {
  InputFrame& frame = frames_.back();
  const auto directive_name = [&] {
    const Token& token = (*frame.lines)[frame.next_line].tokens.front();
    return token.kind == TokenKind::kDirective ? token.text : "";
  };
  if (frame.next_line >= frame.lines->size() || directive_name() != "macro_begin") {
    report(location, "expected '!macro_begin' on the line after the macro's pattern");
    return false;
  }
  ++frame.next_line;
  for (int depth = 1; frame.next_line < frame.lines->size(); ++frame.next_line) {
    depth += directive_name() == "macro_def" ? 1 : directive_name() == "macro_end" ? -1 : 0;
    if (depth == 0) {
      ++frame.next_line;
      return true;
    }
    macro.body.push_back((*frame.lines)[frame.next_line]);
    if (module_.empty()) continue;
    for (Token& token : macro.body.back().tokens) {
      if (token.is("?")) token = {TokenKind::kString, token.location, module_, 0.0F};
    }
  }
  report(location, "this macro has no '!macro_end'");
  return false;
}

// The declaration has the default size and palette.
Declaration Preprocessor::make_declaration(Declaration::Kind kind, Location location) const {
  Declaration result;
  result.kind = kind;
  result.location = location;
  result.width = options_.width;
  result.height = options_.height;
  result.palette = palette_;
  result.scale = scale_;
  return result;
}

void Preprocessor::handle_register(const Tokens& tokens) {
  Arguments list;
  if (!parse_arguments(tokens, 1, SIZE_MAX, list)) return;
  const std::string& directive = tokens.front().text;
  const bool is_local = frames_.back().expansion != 0 && is_in_function();
  for (auto argument = list.rbegin(); argument != list.rend(); ++argument) {
    const Token token = argument->front();
    const bool is_array = directive != "machine_register" && argument->size() > 3 && (*argument)[1].is("[") &&
                          argument->back().is("]");
    if ((argument->size() != 1 && !is_array) || token.kind != TokenKind::kName) {
      report(token.location, "'!{0}' takes names: !{0}(A, B)", directive);
      continue;
    }
    if (const std::string constant = constant_of(token.text); !constant.empty()) {
      report(token.location, "'{}' is a constant, {}: choose another name", token.text, constant);
      continue;
    }
    Declaration request = make_declaration(Declaration::Kind::kRegister, token.location);
    request.name = token.text;
    request.of_variables = directive == "scalar";
    if (directive == "int32" || directive == "uint16" || directive == "uint8") request.cell_type = directive;
    request.is_machine_register = directive == "machine_register";
    request.owner = is_local ? token.owner : 0;
    if (is_array && !parse_array_size({argument->begin() + 2, argument->end() - 1}, request.count)) continue;
    pending_declarations_.push_back(std::move(request));
  }
}

void Preprocessor::handle_operand_kind(const Tokens& tokens) {
  Arguments list;
  OperandKind kind;
  if (!parse_arguments(tokens, 2, SIZE_MAX, list) ||
      !parse_string_argument(list[1], kind.description, "a description of the kind"))
    return;
  list.erase(list.begin() + 1);
  for (const Tokens& argument : list) {
    if (argument.size() != 1 || argument.front().kind != TokenKind::kName)
      return report(argument.front().location, "expected a name: !operand_kind(kind, 'a description', A, B)");
    if (&argument != &list.front()) kind.names.insert(argument.front().text);
  }
  const Token& name = list.front().front();
  if (!operand_kinds_.emplace(name.text, std::move(kind)).second)
    report(name.location, "the operand kind '{}' is defined already", name.text);
}

const OperandKind* Preprocessor::find_operand_kind(const std::string& operand) const {
  const OperandKind* narrowest = nullptr;
  for (const auto& [name, kind] : operand_kinds_)
    if (kind.names.contains(operand) && (narrowest == nullptr || kind.names.size() < narrowest->names.size()))
      narrowest = &kind;
  return narrowest;
}

std::string Preprocessor::operand_of_kind(const std::string& kind, std::size_t number) const {
  const auto found = operand_kinds_.find(kind);
  if (found == operand_kinds_.end() || found->second.names.empty()) return {};
  return *std::next(found->second.names.begin(), number % found->second.names.size());
}

std::string Preprocessor::check_operand(const std::string& kind_name, const Tokens& operand) const {
  const auto found = operand_kinds_.find(kind_name);
  if (found == operand_kinds_.end()) return {};  // reported at the pattern
  const OperandKind& kind = found->second;
  const bool is_name = operand.size() == 1 && operand.front().kind == TokenKind::kName;
  const OperandKind* actual = is_name ? find_operand_kind(operand.front().text) : nullptr;
  if (kind.names.empty() ? actual == nullptr : is_name && kind.names.contains(operand.front().text))
    return {};
  std::string text;
  for (const Token& token : operand) text += spelling(token);
  return fmt::format("must be {}, not '{}'{}", kind.description, display_name(text),
                     actual != nullptr ? fmt::format(", {}", actual->description)
                     : is_name         ? common::did_you_mean(text, {kind.names.begin(), kind.names.end()})
                                       : "");
}

// Inside a macro the error is reported at the call, with the chain of expansions.
void Preprocessor::handle_error(const Tokens& tokens) {
  Arguments list;
  std::string text;
  if (!parse_arguments(tokens, 1, SIZE_MAX, list)) return;
  for (const Tokens& argument : list)
    for (const Token& token : argument)
      text += token.kind == TokenKind::kString ? token.text : display_name(spelling(token));
  const std::uint32_t expansion = frames_.back().expansion;
  diagnostics_.conditional_error(
      frames_.back().macro != nullptr ? sources_.expansion(expansion).call : tokens.front().location, text);
}

// True in the lines of a function, those of a `!for` included.
bool Preprocessor::is_in_function() const {
  const auto frame = std::find_if(frames_.rbegin(), frames_.rend(),
                                  [](const InputFrame& one) { return one.loop_variable.empty(); });
  return frame != frames_.rend() && frame->macro != nullptr && frame->macro->is_function;
}

bool Preprocessor::parse_array_size(Tokens tokens, std::uint32_t& count) {
  constexpr double kMaxElements = 4096;
  const Location location = tokens.front().location;
  if (!expand_defines(tokens)) return false;
  const std::optional<Constant> value = evaluate_constant(tokens, location, diagnostics_);
  if (!value) return false;
  const bool valid = !value->is_string && value->number >= 1 && value->number <= kMaxElements &&
                     value->number == std::floor(value->number);
  if (valid) count = static_cast<std::uint32_t>(value->number);
  if (!valid) report(location, "an array has a whole number of elements, from 1 to {:.0f}", kMaxElements);
  return valid;
}

bool Preprocessor::parse_size_argument(const Tokens& tokens, Location location, std::uint32_t& size) {
  const std::optional<Constant> value = evaluate_constant(tokens, location, diagnostics_);
  if (!value) return false;
  const bool valid = !value->is_string && value->number >= 1 && value->number <= 67'108'864 &&
                     value->number == std::floor(value->number);
  if (valid) size = static_cast<std::uint32_t>(value->number);
  if (!valid) report(tokens.front().location, "a register's width and height are whole numbers from 1");
  return valid;
}

void Preprocessor::handle_create(const Tokens& tokens) {
  Arguments list;
  Declaration request = make_declaration(Declaration::Kind::kElement, tokens.front().location);
  if (!parse_arguments(tokens, 2, 5, list) || !parse_string_argument(list[0], request.name, "a name")) return;
  if (list.size() == 3) return report(request.location, "'!create' takes a width and a height, or neither");
  const Token& token = list[1].front();
  if (list[1].size() != 1 || (token.kind != TokenKind::kName && token.kind != TokenKind::kString))
    return report(token.location, "expected a class: REGISTER, VARIABLE or one made by !object");
  request.class_name = token.text;
  request.location = list[0].front().location;
  if (list.size() == 5) {
    static constexpr std::string_view kTypes[] = {"float", "int32", "uint16", "uint8"};
    request.cell_type = list[4].front().text;
    if (list[4].size() != 1 || std::ranges::find(kTypes, request.cell_type) == std::end(kTypes))
      return report(list[4].front().location, "the type of a register is float, int32, uint16 or uint8");
  }
  if (list.size() >= 4 && (!parse_size_argument(list[2], request.location, request.width) ||
                           !parse_size_argument(list[3], request.location, request.height)))
    return;
  pending_declarations_.push_back(std::move(request));
}

void Preprocessor::handle_object(const Tokens& tokens) {
  Arguments list;
  std::string kind;
  Declaration request = make_declaration(Declaration::Kind::kClass, tokens.front().location);
  if (!parse_arguments(tokens, 4, 4, list) || !parse_string_argument(list[0], request.name, "a class name") ||
      !parse_string_argument(list[1], request.alias, "an alias") ||
      !parse_string_argument(list[3], kind, "'SIM_REGISTER' or 'SIM_VARIABLE'"))
    return;
  if (kind != "SIM_REGISTER" && kind != "SIM_VARIABLE")
    return report(list[3].front().location, "expected 'SIM_REGISTER' or 'SIM_VARIABLE'");
  request.of_variables = kind == "SIM_VARIABLE";
  pending_declarations_.push_back(std::move(request));
}

void Preprocessor::handle_operator(const Tokens& tokens) {
  Arguments list;
  if (!parse_arguments(tokens, 2, 2, list)) return;
  const Token& symbol = list[0].front();
  const Token& target = list[1].front();
  if (list[0].size() != 1 || std::ranges::find(kOperators, symbol.text) == std::end(kOperators)) {
    report(symbol.location, "expected an infix operator, as in !operator(+, core.add)");
  } else if (list[1].size() != 1 || target.kind != TokenKind::kName) {
    report(target.location, "expected the name of an instruction or macro, as in !operator(+, core.add)");
  } else {
    operators_[symbol.text] = target.text;
    if (symbol.is("=")) assigning_plainly_ = macros_.all();
  }
}

void Preprocessor::handle_max_addr(const Tokens& tokens) {
  Arguments list;
  if (!parse_arguments(tokens, 1, 1, list)) return;
  const std::optional<Constant> value = evaluate_constant(list[0], tokens.front().location, diagnostics_);
  if (!value) return;
  if (value->is_string || !(value->number >= 1 && value->number <= 1e9)) {
    report(list[0].front().location, "'!max_addr' takes a number of instructions from 1");
    return;
  }
  max_addr_ = static_cast<std::size_t>(value->number);
}

void Preprocessor::handle_default_palette(const Tokens& tokens) {
  Arguments list;
  std::string name;
  if (!parse_arguments(tokens, 2, 2, list) || !parse_string_argument(list[1], name, "a palette's name"))
    return;
  const std::optional<Constant> scale = evaluate_constant(list[0], tokens.front().location, diagnostics_);
  if (!scale) return;
  if (scale->is_string || !std::isfinite(scale->number)) {
    report(list[0].front().location, "expected a number: the value that has the palette's last colour");
    return;
  }
  const std::string palette_error = options_.check_palette ? options_.check_palette(name) : "";
  if (!palette_error.empty()) {
    if (original_)
      diagnostics_.warning(list[1].front().location, palette_error);
    else
      diagnostics_.error(list[1].front().location, palette_error);
    return;
  }
  palette_ = name;
  scale_ = static_cast<float>(scale->number);
}

void Preprocessor::handle_compatibility(const Tokens& tokens) {
  Arguments list;
  std::string name;
  if (!parse_arguments(tokens, 1, 1, list) || !parse_string_argument(list[0], name, "a dialect's name"))
    return;
  if (name != "original")
    return report(list[0].front().location, "there is no dialect '{}'; there is 'original'", name);
  original_ = true;
}

void Preprocessor::handle_module(const Tokens& tokens) {
  Arguments list;
  std::string name;
  if (!parse_arguments(tokens, 1, 1, list) || !parse_string_argument(list[0], name, "a module's name"))
    return;
  module_ = name;
  modules_.push_back({std::move(name), list[0].front().location});
}

}  // namespace apron::syntax
