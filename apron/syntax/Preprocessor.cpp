#include "apron/syntax/Preprocessor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace apron::syntax {
namespace {

constexpr int kMaxDefineDepth = 64;

// Parenthesises defines that contain an operator, so that neighbours cannot change their meaning.
bool needs_parentheses(const Tokens& tokens) {
  int depth = 0;
  bool has_operator = false;
  for (const Token& token : tokens) {
    if (token.kind != TokenKind::kPunctuator) continue;
    if (token.is("(") || token.is("[")) ++depth;
    if (token.is(")") || token.is("]")) --depth;
    if (depth < 0) return false;
    if (depth > 0 || token.is(")") || token.is("]")) continue;
    if (token.is(",") || token.is("=") || token.is("?")) return false;
    has_operator = true;
  }
  const Token& last = tokens.back();
  const bool ends_whole = last.kind != TokenKind::kPunctuator || last.is(")") || last.is("]");
  return depth == 0 && has_operator && ends_whole;
}

Token make_punctuator(std::string text, Location location) {
  return {TokenKind::kPunctuator, location, std::move(text), 0.0F};
}

}  // namespace

Preprocessor::Preprocessor(PreprocessorOptions options, FileReader& reader, SourceManager& sources,
                           Diagnostics& diagnostics)
    : options_(std::move(options)), reader_(reader), sources_(sources), diagnostics_(diagnostics) {
  const auto number = [](std::uint32_t value) {
    return Tokens{{TokenKind::kNumber, {}, fmt::format("{}", value), static_cast<float>(value)}};
  };
  defines_[std::string(kWidthName)] = number(options_.width);
  defines_[std::string(kHeightName)] = number(options_.height);
  std::optional<std::string> text = reader_.read(options_.file);
  if (text) {
    push_file(options_.file, std::move(*text), {});
    if (!options_.prelude.empty()) include_file(options_.prelude, {}, {});
  } else {
    sources_.add_file(options_.file, "", {});
    report({}, "the file does not exist, is not a regular file or cannot be read");
  }
}

void Preprocessor::abort_input() {
  is_aborted_ = true;
  frames_.clear();
  pending_declarations_.clear();
}

bool Preprocessor::is_active() const {
  return frames_.back().conditionals.empty() || frames_.back().conditionals.back().is_active;
}

PreprocessedItem Preprocessor::next(std::size_t min_depth) {
  PreprocessedItem item;
  while (frames_.size() > min_depth && !diagnostics_.full()) {
    if (!pending_declarations_.empty()) {
      item.kind = PreprocessedItem::Kind::kDeclaration;
      item.declaration = std::move(pending_declarations_.back());
      pending_declarations_.pop_back();
      return item;
    }
    if (frames_.back().next_line >= frames_.back().lines->size()) {
      if (repeat_loop(frames_.back())) continue;
      pop_frame(item);
      if (item.kind == PreprocessedItem::Kind::kMacroEnd) return item;
    } else if (process_line(item)) {
      return item;
    }
  }
  return {};
}

// Goes on with the next round of a `!for`; returns false after the last.
bool Preprocessor::repeat_loop(InputFrame& frame) {
  if (frame.loop_variable.empty()) return false;
  frame.loop_value += frame.loop_step;
  const bool ends =
      frame.loop_step > 0.0 ? frame.loop_value > frame.loop_end : frame.loop_value < frame.loop_end;
  if (!ends) frame.next_line = 0;
  return !ends;
}

void Preprocessor::pop_frame(PreprocessedItem& item) {
  InputFrame& frame = frames_.back();
  for (const ConditionalBlock& condition : frame.conditionals)
    report(condition.location, "this '!if' has no '!endif'");
  item.expansion = frame.expansion;
  if (frame.macro != nullptr) item.kind = PreprocessedItem::Kind::kMacroEnd;
  frames_.pop_back();
}

// Returns whether the line yields an item.
bool Preprocessor::process_line(PreprocessedItem& item) {
  InputFrame& frame = frames_.back();
  Line line = (*frame.lines)[frame.next_line++];
  line.end = line.tokens.back().location;
  line.end.column += static_cast<std::uint32_t>(spelling(line.tokens.back()).size());
  line.location.expansion = line.end.expansion = frame.expansion;
  const bool is_directive = line.tokens.front().kind == TokenKind::kDirective;
  if (is_directive && is_active()) close_bracket(line);
  if (is_directive && handle_conditional(line.tokens)) return false;
  if (!is_active()) return false;
  if (line.tokens.size() > 1 && line.tokens[0].is_name("function") &&
      line.tokens[1].kind == TokenKind::kName) {
    handle_function(line.tokens);
    return false;
  }
  if (++line_count_ > kMaxLines) {
    report(line.tokens.front().location, "the program has more than {} lines", kMaxLines);
    abort_input();
    return false;
  }
  const bool defines_macro = is_directive && line.tokens.front().text == "macro_def";
  if (!defines_macro) substitute(line.tokens, frame);
  if (!defines_macro) join_words(line);
  if (is_directive) {
    handle_directive(line);
    return false;
  }
  if (writes_constant(line.tokens) || !expand_defines(line.tokens)) line.has_error = true;
  item.kind = PreprocessedItem::Kind::kLine;
  item.line = std::move(line);
  return true;
}

// Reports and adds the last bracket of a directive's arguments where it is missing.
void Preprocessor::close_bracket(Line& line) {
  Tokens& tokens = line.tokens;
  if (line.has_error || tokens.size() < 2 || !tokens[1].is("(") || tokens.back().is(")")) return;
  const auto count = [&](std::string_view bracket) {
    return std::ranges::count_if(tokens, [&](const Token& token) { return token.is(bracket); });
  };
  if (count("(") <= count(")")) return;
  report(line.end, "expected ')' before the end of the line");
  tokens.push_back(make_punctuator(")", line.end));
}

std::string Preprocessor::constant_of(const std::string& name) const {
  const auto found = defines_.find(name);
  if (found == defines_.end()) return {};
  std::string text;
  for (const Token& token : found->second) {
    if (token.kind != TokenKind::kNumber && token.kind != TokenKind::kPunctuator) return {};
    text += spelling(token);
  }
  return text;
}

// Reports that the line gives a value to a name that stands for a number.
bool Preprocessor::writes_constant(const Tokens& tokens) {
  const bool counts = tokens.size() > 3 && tokens[0].is_name("for") && tokens[1].is("(") && tokens[3].is(",");
  const auto equals = find_equals(tokens.begin(), tokens.end());
  if (!counts && (equals == tokens.end() || !operator_target("=").empty())) return false;
  const auto targets = counts ? std::vector<Tokens>{{tokens[2]}} : split_arguments(tokens.begin(), equals);
  for (const Tokens& target : targets) {
    const bool is_name = target.size() == 1 && target[0].kind == TokenKind::kName;
    const std::string constant = is_name ? constant_of(target[0].text) : "";
    if (constant.empty()) continue;
    report(target[0].location, "'{}' is a constant, {}, and cannot be written", target[0].text, constant);
    return true;
  }
  return false;
}

bool Preprocessor::assigns_plainly() const {
  const auto in_macro = std::ranges::find_if(frames_.rbegin(), frames_.rend(),
                                             [](const InputFrame& frame) { return frame.macro != nullptr; });
  return in_macro != frames_.rend() &&
         std::ranges::find(assigning_plainly_, in_macro->macro) != assigning_plainly_.end();
}

bool Preprocessor::is_expanding(const MacroTable::Handle& macro) const {
  return std::ranges::any_of(frames_, [&](const InputFrame& frame) { return frame.macro == macro; });
}

std::string Preprocessor::endless_function() const {
  for (auto frame = frames_.begin(); frame != frames_.end(); ++frame) {
    if (frame->macro == nullptr || !frame->macro->is_function) continue;
    const auto is_same = [&](const InputFrame& other) { return other.macro == frame->macro; };
    if (std::any_of(std::next(frame), frames_.end(), is_same))
      return fmt::format(": the function '{}' calls itself; functions cannot, unless an !if ends it",
                         frame->macro->name);
  }
  return "";
}

MacroTable::Handle Preprocessor::find_macro(const std::string& name, std::size_t arguments,
                                            bool has_result) const {
  MacroTable::Handle macro = macros_.find(name, arguments, has_result);
  if (macro != nullptr && is_builtin(name) && is_expanding(macro)) return nullptr;
  return macro;
}

bool Preprocessor::enter_macro(const MacroTable::Handle& macro, std::uint32_t expansion,
                               std::vector<Tokens> results, std::vector<Tokens> arguments) {
  if (is_aborted_) return false;  // expressions that are being parsed go on; the error is reported
  const Location call = sources_.expansion(expansion).call;
  const std::size_t depth =
      std::ranges::count_if(frames_, [](const InputFrame& f) { return f.macro != nullptr; });
  std::string limit_error;
  if (depth >= kMaxMacroDepth) {
    const std::string function = endless_function();
    limit_error =
        fmt::format("macros are expanded more than {} deep here{}", kMaxMacroDepth,
                    function.empty() ? fmt::format(": does '{}' call itself?", macro->name) : function);
  } else if (sources_.expansion_count() > kMaxExpansions) {
    limit_error = fmt::format("the program expands more than {} macros", kMaxExpansions);
  }
  if (!limit_error.empty()) {
    diagnostics_.error(call, limit_error);
    abort_input();
    return false;
  }
  InputFrame frame;
  frame.lines = std::shared_ptr<const std::vector<Line>>(macro, &macro->body);
  frame.macro = macro;
  frame.expansion = expansion;
  for (std::size_t i = 0; i < arguments.size(); ++i)
    frame.parameters[macro->parameters[i].name] = std::move(arguments[i]);
  if (!macro->result_parameter.empty())
    frame.parameters[macro->result_parameter] = std::move(results.front());
  for (std::size_t i = 0; i < macro->further_results.size(); ++i)
    frame.parameters[macro->further_results[i]] = std::move(results[i + 1]);
  frames_.push_back(std::move(frame));
  return true;
}

void Preprocessor::substitute(Tokens& tokens, const InputFrame& frame) const {
  for (Token& token : tokens) {
    if (token.kind != TokenKind::kName || token.text != frame.loop_variable) continue;
    token.kind = TokenKind::kNumber;
    token.number = frame.loop_value;
    token.text = fmt::format("{:.0f}", frame.loop_value);
  }
  if (frame.macro == nullptr) return;
  Tokens out;
  out.reserve(tokens.size());
  for (const Token& token : tokens) {
    const std::size_t first = out.size();
    const bool is_replaced = substitute(token, frame, out);
    if (!is_replaced) out.push_back(token);
    for (std::size_t i = first; i < out.size(); ++i) {
      if (is_replaced) out[i].parameter = token.location;
      out[i].location.expansion = out[i].parameter.expansion = frame.expansion;
    }
  }
  tokens = std::move(out);
}

// Returns whether the token was replaced.
bool Preprocessor::substitute(const Token& token, const InputFrame& frame, Tokens& out) const {
  const auto unique = [&](TokenKind kind, std::string_view name) {
    const char* const sign = frame.macro->is_function ? "::" : ":";
    out.push_back({kind, token.location, fmt::format("{}{}{}", name, sign, frame.expansion), 0.0, false,
                   frame.expansion});
    return true;
  };
  if (token.kind == TokenKind::kLocalName) return unique(TokenKind::kName, token.text);
  if (token.kind == TokenKind::kLocalLabel) return unique(TokenKind::kLabel, token.text);
  if (token.kind == TokenKind::kString && token.text.size() > 1 && token.text.front() == ':') {
    return unique(TokenKind::kString, token.text.substr(1));
  }
  const bool quoted = token.kind == TokenKind::kString && token.text.size() > 1 && token.text.front() == '$';
  if (token.kind != TokenKind::kParameter && !quoted) return false;
  const auto found = frame.parameters.find(quoted ? token.text.substr(1) : token.text);
  if (found == frame.parameters.end()) return false;
  if (!quoted) {
    out.insert(out.end(), found->second.begin(), found->second.end());
  } else {
    Token text = token;
    text.text.clear();
    for (const Token& token_part : found->second) {
      const bool as_is = token_part.kind == TokenKind::kString || token_part.kind == TokenKind::kName;
      text.text += as_is ? token_part.text : spelling(token_part);
    }
    out.push_back(std::move(text));
  }
  return true;
}

// a ## b: one word of two, after parameters and the counters of `!for` are replaced.
void Preprocessor::join_words(Line& line) {
  Tokens out;
  for (std::size_t i = 0; i < line.tokens.size(); ++i) {
    const Token& token = line.tokens[i];
    if (!token.is("##")) {
      out.push_back(token);
      continue;
    }
    const Token* right = i + 1 < line.tokens.size() ? &line.tokens[i + 1] : nullptr;
    const auto is_word = [](const Token& word, bool is_first) {
      return word.kind == TokenKind::kName || word.kind == TokenKind::kString ||
             (word.kind == TokenKind::kNumber
                  ? !is_first && word.number >= 0 && word.number == std::floor(word.number)
                  : is_first && word.kind == TokenKind::kLabel);
    };
    if (out.empty() || right == nullptr || !is_word(out.back(), true) || !is_word(*right, false)) {
      report(token.location, "'##' joins a name, label or text with a name, text or whole number");
      line.has_error = true;
      return;
    }
    std::string& text = out.back().text;
    // A local name ends with the number of its expansion.
    const std::size_t end =
        out.back().kind == TokenKind::kString ? text.size() : std::min(text.find(':'), text.size());
    text.insert(end, right->kind == TokenKind::kNumber ? fmt::format("{:.0f}", right->number) : right->text);
    ++i;
  }
  line.tokens = std::move(out);
}

bool Preprocessor::expand_defines(Tokens& tokens) {
  Tokens out;
  std::set<std::string> hide_set;
  if (tokens.size() > kMaxLineTokens) {
    report(tokens.front().location, "this line has {} words; the limit is {}", tokens.size(), kMaxLineTokens);
    return false;
  }
  if (!expand_defines(tokens, out, hide_set, 0)) {
    report(tokens.front().location, "the defines in this line grow it beyond {} words or {} levels",
           kMaxLineTokens, kMaxDefineDepth);
    return false;
  }
  if (!out.empty()) tokens = std::move(out);
  return true;
}

bool Preprocessor::expand_defines(const Tokens& tokens, Tokens& out, std::set<std::string>& hide_set,
                                  int depth) {
  if (depth > kMaxDefineDepth) return false;
  for (std::size_t i = 0; i < tokens.size(); ++i) {
    const Token& token = tokens[i];
    if (out.size() > kMaxLineTokens) return false;
    const bool may_expand = token.kind == TokenKind::kName && !token.no_expand;
    const bool is_indexed =
        may_expand && i + 3 < tokens.size() && tokens[i + 1].is("[") && tokens[i + 3].is("]");
    auto found = is_indexed ? defines_.find(indexed_name(token, tokens[i + 2])) : defines_.end();
    if (found != defines_.end()) {
      i += 3;
    } else {
      found = may_expand ? defines_.find(token.text) : defines_.end();
    }
    if (found == defines_.end()) {
      out.push_back(token);
      continue;
    }
    if (hide_set.count(found->first) > 0) {
      out.push_back(token);
      out.back().no_expand = true;
      continue;
    }
    const std::string name = found->first;
    Tokens body = found->second;
    for (Token& body_token : body) {  // errors are reported at the use
      body_token.location = token.location;
      body_token.parameter = token.parameter;
    }
    const bool parenthesize = !body.empty() && body.size() > 1 && needs_parentheses(body);
    if (parenthesize) out.push_back(make_punctuator("(", token.location));
    hide_set.insert(name);
    if (!expand_defines(body, out, hide_set, depth + 1)) return false;
    hide_set.erase(name);
    if (parenthesize) out.push_back(make_punctuator(")", token.location));
  }
  return true;
}

std::string Preprocessor::operator_target(const std::string& symbol) const {
  const auto found = operators_.find(symbol);
  return found == operators_.end() ? "" : found->second;
}

std::vector<std::string> Preprocessor::define_names() const {
  std::vector<std::string> names;
  names.reserve(defines_.size());
  for (const auto& [name, tokens] : defines_) names.push_back(name);
  return names;
}

std::string indexed_name(const Token& name, const Token& index) {
  return fmt::format("{}[{}]", name.text, index.text);
}

}  // namespace apron::syntax
