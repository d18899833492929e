// The `!` directives of the preprocessor.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "apron/syntax/Constant.h"
#include "apron/syntax/Lexer.h"
#include "apron/syntax/Preprocessor.h"
#include "apron/syntax/Suggestion.h"

namespace apron::syntax {
namespace {

const std::vector<std::string> kDirectives = {"!include", "!define",    "!if",          "!else",
                                              "!endif",   "!macro_def", "!macro_begin", "!macro_end",
                                              "!object",  "!create",    "!operator",    "!default_palette",
                                              "!module",  "!max_addr",  "!register"};

constexpr std::string_view kOperators[] = {
    "+", "-", "*", "/", "%", "<", "<=", ">", ">=", "==", "!=", "&&", "||", "and", "or", "xor", "nand", "nor"};

std::string normal(const std::string& path) {
  return std::filesystem::path(path).lexically_normal().string();
}

}  // namespace

// Whether it was one of !if, !else, !endif, which are followed in skipped lines too.
bool Preprocessor::condition_directive(const Tokens& tokens) {
  const Token& word = tokens.front();
  std::vector<Condition>& conditions = frames_.back().conditions;
  if (word.text == "if") {
    begin_if(tokens);
  } else if (word.text == "else") {
    if (conditions.empty()) return diagnostics_.error(word.at, "this '!else' has no '!if'"), true;
    Condition& condition = conditions.back();
    if (condition.else_seen) diagnostics_.error(word.at, "this '!if' has an '!else' already");
    condition.else_seen = true;
    condition.active = condition.outer && !condition.taken;
    condition.taken = true;
  } else if (word.text == "endif") {
    if (conditions.empty()) return diagnostics_.error(word.at, "this '!endif' has no '!if'"), true;
    conditions.pop_back();
  } else {
    return false;
  }
  return true;
}

void Preprocessor::begin_if(const Tokens& line) {
  Condition condition;
  condition.at = line.front().at;
  condition.outer = active();
  condition.active = false;
  if (condition.outer) {
    Tokens tokens = line;
    substitute(tokens, frames_.back());
    condition.active = replace_defines(tokens) && holds(tokens);
  }
  condition.taken = condition.active;
  frames_.back().conditions.push_back(condition);
}

bool Preprocessor::holds(const Tokens& tokens) {
  Arguments list;
  if (!arguments(tokens, 1, 3, list)) return false;
  const Location at = tokens.front().at;
  if (list.size() == 2) return diagnostics_.error(at, "'!if' takes (a, op, b) or one condition"), false;
  const std::optional<Constant> left = evaluate(list[0], at, diagnostics_);
  if (list.size() == 1 || !left) return left && left->truth();
  const std::optional<Constant> right = evaluate(list[2], at, diagnostics_);
  if (!right) return false;
  const std::string op = list[1].size() == 1 ? list[1].front().text : "";
  const std::optional<bool> result = compare(*left, op, *right);
  if (!result) {
    diagnostics_.error(list[1].empty() ? at : list[1].front().at,
                       left->is_text || right->is_text
                           ? fmt::format("'{}' is not a number: texts and names compare by == and != only",
                                         written(left->is_text ? left->text : right->text))
                           : "expected one of < <= > >= == !=");
  }
  return result.value_or(false);
}

// Splits the list in brackets after the directive's name.
bool Preprocessor::arguments(const Tokens& tokens, std::size_t least, std::size_t most, Arguments& list) {
  const Token& word = tokens.front();
  const bool brackets = tokens.size() > 2 && tokens[1].is("(") && tokens.back().is(")");
  if (brackets) list = split_arguments(tokens.begin() + 2, tokens.end() - 1);
  const bool hole = std::any_of(list.begin(), list.end(), [](const Tokens& one) { return one.empty(); });
  if (brackets && !hole && list.size() >= least && list.size() <= most) return true;
  const std::string count = least == most ? fmt::format("{}", least)
                            : most > 100  ? fmt::format("{} or more", least)
                                          : fmt::format("{} to {}", least, most);
  diagnostics_.error(
      word.at, fmt::format("'!{}' takes {} argument{} in brackets", word.text, count, most == 1 ? "" : "s"));
  return false;
}

bool Preprocessor::text_argument(const Tokens& tokens, std::string& text, std::string_view what) {
  const bool fits =
      tokens.size() == 1 && tokens.front().kind == TokenKind::kText && !tokens.front().text.empty();
  if (fits) {
    text = tokens.front().text;
  } else {
    diagnostics_.error(tokens.front().at, fmt::format("expected {} in single quotes", what));
  }
  return fits;
}

// Whether the directive gave an item.
bool Preprocessor::directive(Line& line, Item& item) {
  const Token word = line.tokens.front();
  if (word.text == "macro_def") return define_macro(line.tokens), false;
  if (line.bad) return false;
  if (word.text == "define") return define(line.tokens), false;
  if (word.text == "include") return include(line.tokens), false;
  if (word.text == "register") return register_directive(line.tokens), false;
  if (!replace_defines(line.tokens)) return false;
  if (word.text == "create") return create(line.tokens, item);
  if (word.text == "object") return object(line.tokens, item);
  if (word.text == "operator") return bind_operator(line.tokens), false;
  if (word.text == "max_addr") return limit_addresses(line.tokens), false;
  if (word.text == "default_palette") return default_palette(line.tokens), false;
  if (word.text == "module") return load_module(line.tokens), false;
  if (word.text == "macro_begin" || word.text == "macro_end") {
    diagnostics_.error(word.at, fmt::format("this '!{}' has no '!macro_def'", word.text));
  } else {
    diagnostics_.error(word.at, fmt::format("there is no directive '!{}'{}", word.text,
                                            did_you_mean(spell(word), kDirectives)));
  }
  return false;
}

void Preprocessor::include(const Tokens& tokens) {
  Arguments list;
  std::string name;
  if (!arguments(tokens, 1, 1, list) || !text_argument(list[0], name, "a file name")) return;
  const Location at = tokens.front().at;
  const std::filesystem::path here = sources_.file(at.file).name;
  std::vector<std::string> candidates{normal((here.parent_path() / name).string())};
  for (const std::string& directory : options_.include_paths) {
    candidates.push_back(normal((std::filesystem::path(directory) / name).string()));
  }
  if (!options_.library_path.empty()) {
    candidates.push_back(normal((std::filesystem::path(options_.library_path) / name).string()));
  }
  for (const std::string& path : candidates) {
    if (std::optional<std::string> text = reader_.read(path)) return open_file(path, std::move(*text), at);
  }
  std::string places;
  for (const std::string& path : candidates) places += (places.empty() ? "" : ", ") + path;
  diagnostics_.error(list[0].front().at, fmt::format("there is no file '{}' (looked for {})", name, places));
}

void Preprocessor::open_file(const std::string& path, std::string text, Location from) {
  std::string chain;
  std::size_t depth = 0;
  bool again = false;
  for (const Frame& frame : frames_) {
    if (frame.macro != nullptr) continue;
    ++depth;
    again = again || frame.path == normal(path);
    if (again) chain += frame.path + " -> ";
  }
  if (again) {
    diagnostics_.error(from, fmt::format("'{}' includes itself: {}{}", normal(path), chain, normal(path)));
    return;
  }
  if (depth >= kMaxIncludeDepth || ++includes_ > kMaxIncludes) {
    diagnostics_.error(from, depth >= kMaxIncludeDepth
                                 ? fmt::format("files include each other more than {} deep", kMaxIncludeDepth)
                                 : fmt::format("more than {} files are included", kMaxIncludes));
    return stop();
  }
  const std::uint32_t file = sources_.add_file(path, std::move(text), from);
  Frame frame;
  frame.lines = std::make_shared<const std::vector<Line>>(lex(sources_, file, diagnostics_));
  frame.path = normal(path);
  frames_.push_back(std::move(frame));
}

void Preprocessor::define(const Tokens& tokens) {
  const bool fits = tokens.size() >= 5 && tokens[1].is("(") && tokens[2].kind == TokenKind::kName &&
                    tokens[3].is(",") && tokens.back().is(")") && tokens.size() - 5 < kMaxLineTokens;
  if (!fits || tokens.size() == 5) {
    diagnostics_.error(tokens.front().at,
                       "'!define' takes a name and the words it stands for: !define(NAME, words)");
    return;
  }
  defines_[tokens[2].text] = Tokens(tokens.begin() + 4, tokens.end() - 1);
}

void Preprocessor::define_macro(const Tokens& tokens) {
  Macro macro;
  macro.at = tokens.front().at;
  Frame& frame = frames_.back();
  Tokens head(tokens.begin() + 1, tokens.end());
  const bool own_line = head.empty() && frame.next < frame.lines->size() &&
                        (*frame.lines)[frame.next].tokens.front().kind != TokenKind::kDirective;
  if (own_line) head = (*frame.lines)[frame.next++].tokens;
  const bool head_fits = read_pattern(head, macro);
  if (!head_fits) {
    diagnostics_.error(head.empty() ? macro.at : head.front().at,
                       "expected a macro's pattern: name($a, $b) or $y = name($a, $b)");
  }
  if (!read_body(macro, macro.at) || !head_fits) return;
  const Macro copy = macro;
  const MacroTable::Handle before = macros_.add(std::move(macro));
  if (before != nullptr && !same_body(*before, copy)) {
    diagnostics_.error(copy.at, fmt::format("the macro '{}' is defined already", pattern(copy)),
                       {{before->at, "it is defined"}});
  }
}

bool Preprocessor::read_pattern(const Tokens& tokens, Macro& macro) {
  std::size_t at = 0;
  const auto parameter = [&](std::string& name) {
    if (at >= tokens.size() || tokens[at].kind != TokenKind::kParameter) return false;
    name = tokens[at++].text;
    return true;
  };
  const auto symbol = [&](std::string_view text) {
    return at < tokens.size() && tokens[at].is(text) && ++at > 0;
  };
  if (parameter(macro.result) && !symbol("=")) return false;
  if (at >= tokens.size() || tokens[at].kind != TokenKind::kName) return false;
  macro.name = tokens[at].text;
  macro.at = tokens[at++].at;
  if (at == tokens.size()) return true;
  if (!symbol("(")) return false;
  if (symbol(")")) return at == tokens.size();
  do {
    std::string name;
    if (!parameter(name)) return false;
    const bool twice =
        name == macro.result || std::count(macro.parameters.begin(), macro.parameters.end(), name) > 0;
    if (twice) return false;
    macro.parameters.push_back(std::move(name));
  } while (symbol(","));
  return symbol(")") && at == tokens.size();
}

// Takes the lines from !macro_begin to its !macro_end out of the current text.
bool Preprocessor::read_body(Macro& macro, Location at) {
  Frame& frame = frames_.back();
  const auto word = [&] {
    const Token& token = (*frame.lines)[frame.next].tokens.front();
    return token.kind == TokenKind::kDirective ? token.text : "";
  };
  if (frame.next >= frame.lines->size() || word() != "macro_begin") {
    diagnostics_.error(at, "expected '!macro_begin' on the line after the macro's pattern");
    return false;
  }
  ++frame.next;
  for (int depth = 1; frame.next < frame.lines->size(); ++frame.next) {
    depth += word() == "macro_def" ? 1 : word() == "macro_end" ? -1 : 0;
    if (depth == 0) return ++frame.next, true;
    macro.body.push_back((*frame.lines)[frame.next]);
    if (module_.empty()) continue;
    for (Token& token : macro.body.back().tokens) {
      if (token.is("?")) token = {TokenKind::kText, token.at, module_, 0.0F};
    }
  }
  diagnostics_.error(at, "this macro has no '!macro_end'");
  return false;
}

// Of the default size and palette.
Declaration Preprocessor::declaration(Declaration::Kind kind, Location at) const {
  Declaration wanted;
  wanted.kind = kind;
  wanted.at = at;
  wanted.width = options_.width;
  wanted.height = options_.height;
  wanted.palette = palette_;
  wanted.scale = scale_;
  return wanted;
}

void Preprocessor::register_directive(const Tokens& tokens) {
  Arguments list;
  if (!arguments(tokens, 1, SIZE_MAX, list)) return;
  for (auto one = list.rbegin(); one != list.rend(); ++one) {
    const Token& word = one->front();
    if (one->size() != 1 || word.kind != TokenKind::kName) {
      diagnostics_.error(word.at, "'!register' takes names: !register(A, B)");
      continue;
    }
    pending_.push_back(declaration(Declaration::Kind::kRegister, word.at));
    pending_.back().name = word.text;
  }
}

bool Preprocessor::size_argument(const Tokens& tokens, Location at, std::uint32_t& size) {
  const std::optional<Constant> value = evaluate(tokens, at, diagnostics_);
  if (!value) return false;
  const bool fits = !value->is_text && value->number >= 1 && value->number <= 67'108'864 &&
                    value->number == std::floor(value->number);
  if (fits) size = static_cast<std::uint32_t>(value->number);
  if (!fits) diagnostics_.error(tokens.front().at, "a register's width and height are whole numbers from 1");
  return fits;
}

bool Preprocessor::create(const Tokens& tokens, Item& item) {
  Arguments list;
  Declaration& wanted = item.declaration;
  wanted = declaration(Declaration::Kind::kElement, tokens.front().at);
  if (!arguments(tokens, 2, 4, list) || !text_argument(list[0], wanted.name, "a name")) return false;
  if (list.size() == 3)
    return diagnostics_.error(wanted.at, "'!create' takes a width and a height, or neither"), false;
  const Token& word = list[1].front();
  if (list[1].size() != 1 || (word.kind != TokenKind::kName && word.kind != TokenKind::kText)) {
    return diagnostics_.error(word.at, "expected a class: REGISTER, VARIABLE or one made by !object"), false;
  }
  wanted.class_name = word.text;
  wanted.at = list[0].front().at;
  if (list.size() == 4 && (!size_argument(list[2], wanted.at, wanted.width) ||
                           !size_argument(list[3], wanted.at, wanted.height))) {
    return false;
  }
  item.kind = Item::Kind::kDeclaration;
  return true;
}

bool Preprocessor::object(const Tokens& tokens, Item& item) {
  Arguments list;
  std::string kind;
  Declaration& wanted = item.declaration;
  wanted = declaration(Declaration::Kind::kClass, tokens.front().at);
  if (!arguments(tokens, 4, 4, list) || !text_argument(list[0], wanted.name, "a class name") ||
      !text_argument(list[1], wanted.alias, "an alias") ||
      !text_argument(list[3], kind, "'SIM_REGISTER' or 'SIM_VARIABLE'")) {
    return false;
  }
  if (kind != "SIM_REGISTER" && kind != "SIM_VARIABLE") {
    return diagnostics_.error(list[3].front().at, "expected 'SIM_REGISTER' or 'SIM_VARIABLE'"), false;
  }
  wanted.of_variables = kind == "SIM_VARIABLE";
  item.kind = Item::Kind::kDeclaration;
  return true;
}

void Preprocessor::bind_operator(const Tokens& tokens) {
  Arguments list;
  if (!arguments(tokens, 2, 2, list)) return;
  const Token& symbol = list[0].front();
  const Token& target = list[1].front();
  if (list[0].size() != 1 ||
      std::find(std::begin(kOperators), std::end(kOperators), symbol.text) == std::end(kOperators)) {
    diagnostics_.error(symbol.at, "expected an infix operator, as in !operator(+, core.add)");
  } else if (list[1].size() != 1 || target.kind != TokenKind::kName) {
    diagnostics_.error(target.at,
                       "expected the name of an instruction or macro, as in !operator(+, core.add)");
  } else {
    operators_[symbol.text] = target.text;
  }
}

void Preprocessor::limit_addresses(const Tokens& tokens) {
  Arguments list;
  if (!arguments(tokens, 1, 1, list)) return;
  const std::optional<Constant> value = evaluate(list[0], tokens.front().at, diagnostics_);
  if (!value) return;
  if (value->is_text || !(value->number >= 1 && value->number <= 1e9)) {
    diagnostics_.error(list[0].front().at, "'!max_addr' takes a number of instructions from 1");
    return;
  }
  max_addr_ = static_cast<std::size_t>(value->number);
}

void Preprocessor::default_palette(const Tokens& tokens) {
  Arguments list;
  std::string name;
  if (!arguments(tokens, 2, 2, list) || !text_argument(list[1], name, "a palette's name")) return;
  const std::optional<Constant> scale = evaluate(list[0], tokens.front().at, diagnostics_);
  if (!scale) return;
  if (scale->is_text || !std::isfinite(scale->number)) {
    diagnostics_.error(list[0].front().at, "expected a number: the value that has the palette's last colour");
    return;
  }
  const std::string wrong = options_.wrong_palette ? options_.wrong_palette(name) : "";
  if (!wrong.empty()) return diagnostics_.error(list[1].front().at, wrong);
  palette_ = name;
  scale_ = static_cast<float>(scale->number);
}

void Preprocessor::load_module(const Tokens& tokens) {
  Arguments list;
  std::string name;
  if (arguments(tokens, 1, 1, list) && text_argument(list[0], name, "a module's name")) module_ = name;
}

}  // namespace apron::syntax
