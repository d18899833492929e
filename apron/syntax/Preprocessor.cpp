#include "apron/syntax/Preprocessor.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <utility>

namespace apron::syntax {
namespace {

constexpr int kMaxDefineDepth = 64;

// Defines with an operator keep their meaning whatever stands beside them.
bool wants_brackets(const Tokens& tokens) {
  int depth = 0;
  bool has_operator = false;
  for (const Token& token : tokens) {
    if (token.kind != TokenKind::kSymbol) continue;
    if (token.is("(") || token.is("[")) ++depth;
    if (token.is(")") || token.is("]")) --depth;
    if (depth < 0) return false;
    if (depth > 0 || token.is(")") || token.is("]")) continue;
    if (token.is(",") || token.is("=") || token.is("?")) return false;
    has_operator = true;
  }
  const Token& last = tokens.back();
  const bool ends_whole = last.kind != TokenKind::kSymbol || last.is(")") || last.is("]");
  return depth == 0 && has_operator && ends_whole;
}

Token symbol(std::string text, Location at) { return {TokenKind::kSymbol, at, std::move(text), 0.0F}; }

}  // namespace

Preprocessor::Preprocessor(PreprocessorOptions options, FileReader& reader, Sources& sources,
                           Diagnostics& diagnostics)
    : options_(std::move(options)), reader_(reader), sources_(sources), diagnostics_(diagnostics) {
  const auto number = [](std::uint32_t value) {
    return Tokens{{TokenKind::kNumber, {}, fmt::format("{}", value), static_cast<float>(value)}};
  };
  defines_["SURFACE_WIDTH"] = number(options_.width);
  defines_["SURFACE_HEIGHT"] = number(options_.height);
  std::optional<std::string> text = reader_.read(options_.file);
  if (text) {
    open_file(options_.file, std::move(*text), {});
  } else {
    sources_.add_file(options_.file, "", {});
    diagnostics_.error({}, "the file does not exist or cannot be read");
  }
}

void Preprocessor::stop() {
  frames_.clear();
  pending_.clear();
}

bool Preprocessor::active() const {
  return frames_.back().conditions.empty() || frames_.back().conditions.back().active;
}

Item Preprocessor::next(std::size_t floor) {
  Item item;
  while (frames_.size() > floor && !diagnostics_.full()) {
    if (!pending_.empty()) {
      item.kind = Item::Kind::kDeclaration;
      item.declaration = std::move(pending_.back());
      pending_.pop_back();
      return item;
    }
    if (frames_.back().next >= frames_.back().lines->size()) {
      leave(item);
      if (item.kind == Item::Kind::kLeave) return item;
    } else if (step(item)) {
      return item;
    }
  }
  return {};
}

void Preprocessor::leave(Item& item) {
  Frame& frame = frames_.back();
  for (const Condition& condition : frame.conditions)
    diagnostics_.error(condition.at, "this '!if' has no '!endif'");
  item.expansion = frame.expansion;
  if (frame.macro != nullptr) item.kind = Item::Kind::kLeave;
  frames_.pop_back();
}

// Whether the line gave an item.
bool Preprocessor::step(Item& item) {
  Frame& frame = frames_.back();
  Line line = (*frame.lines)[frame.next++];
  line.at.expansion = frame.expansion;
  const bool is_directive = line.tokens.front().kind == TokenKind::kDirective;
  if (is_directive && condition_directive(line.tokens)) return false;
  if (!active()) return false;
  if (++lines_ > kMaxLines) {
    diagnostics_.error(line.tokens.front().at, fmt::format("the program has more than {} lines", kMaxLines));
    stop();
    return false;
  }
  const bool defines_macro = is_directive && line.tokens.front().text == "macro_def";
  if (!defines_macro) substitute(line.tokens, frame);
  if (is_directive) return directive(line, item);
  if (!replace_defines(line.tokens)) line.bad = true;
  item.kind = Item::Kind::kLine;
  item.line = std::move(line);
  return true;
}

bool Preprocessor::expanding(const MacroTable::Handle& macro) const {
  return std::any_of(frames_.begin(), frames_.end(),
                     [&](const Frame& frame) { return frame.macro == macro; });
}

MacroTable::Handle Preprocessor::find(const std::string& name, std::size_t arguments, bool result) const {
  MacroTable::Handle macro = macros_.find(name, arguments, result);
  if (macro != nullptr && is_builtin(name) && expanding(macro)) return nullptr;
  return macro;
}

bool Preprocessor::enter(const MacroTable::Handle& macro, std::uint32_t expansion, Tokens result,
                         std::vector<Tokens> arguments) {
  const Location call = sources_.expansion(expansion).call;
  const auto depth =
      std::count_if(frames_.begin(), frames_.end(), [](const Frame& f) { return f.macro != nullptr; });
  std::string problem;
  if (static_cast<std::size_t>(depth) >= kMaxMacroDepth) {
    problem = fmt::format("macros are expanded more than {} deep here: does '{}' call itself?",
                          kMaxMacroDepth, macro->name);
  } else if (sources_.expansion_count() > kMaxExpansions) {
    problem = fmt::format("the program expands more than {} macros", kMaxExpansions);
  }
  if (!problem.empty()) {
    diagnostics_.error(call, problem);
    stop();
    return false;
  }
  Frame frame;
  frame.lines = std::shared_ptr<const std::vector<Line>>(macro, &macro->body);
  frame.macro = macro;
  frame.expansion = expansion;
  for (std::size_t i = 0; i < arguments.size(); ++i)
    frame.parameters[macro->parameters[i]] = std::move(arguments[i]);
  if (!macro->result.empty()) frame.parameters[macro->result] = std::move(result);
  frames_.push_back(std::move(frame));
  return true;
}

void Preprocessor::substitute(Tokens& tokens, const Frame& frame) const {
  if (frame.macro == nullptr) return;
  Tokens out;
  out.reserve(tokens.size());
  for (const Token& token : tokens) {
    const std::size_t first = out.size();
    if (!substitute(token, frame, out)) out.push_back(token);
    for (std::size_t i = first; i < out.size(); ++i) out[i].at.expansion = frame.expansion;
  }
  tokens = std::move(out);
}

// Whether something else takes the token's place.
bool Preprocessor::substitute(const Token& token, const Frame& frame, Tokens& out) const {
  const auto unique = [&](TokenKind kind, std::string_view name) {
    out.push_back({kind, token.at, fmt::format("{}:{}", name, frame.expansion), 0.0F});
    return true;
  };
  if (token.kind == TokenKind::kLocal) return unique(TokenKind::kName, token.text);
  if (token.kind == TokenKind::kLocalLabel) return unique(TokenKind::kLabel, token.text);
  if (token.kind == TokenKind::kText && token.text.size() > 1 && token.text.front() == ':') {
    return unique(TokenKind::kText, token.text.substr(1));
  }
  const bool quoted = token.kind == TokenKind::kText && token.text.size() > 1 && token.text.front() == '$';
  if (token.kind != TokenKind::kParameter && !quoted) return false;
  const auto found = frame.parameters.find(quoted ? token.text.substr(1) : token.text);
  if (found == frame.parameters.end()) return false;
  if (!quoted) {
    out.insert(out.end(), found->second.begin(), found->second.end());
  } else {
    Token text = token;
    text.text.clear();
    for (const Token& part : found->second) {
      const bool as_is = part.kind == TokenKind::kText || part.kind == TokenKind::kName;
      text.text += as_is ? part.text : spell(part);
    }
    out.push_back(std::move(text));
  }
  return true;
}

bool Preprocessor::replace_defines(Tokens& tokens) {
  Tokens out;
  std::set<std::string> hidden;
  if (!replace_defines(tokens, out, hidden, 0)) {
    diagnostics_.error(tokens.front().at,
                       fmt::format("the defines in this line grow it beyond {} words or {} levels",
                                   kMaxLineTokens, kMaxDefineDepth));
    return false;
  }
  if (!out.empty()) tokens = std::move(out);
  return true;
}

bool Preprocessor::replace_defines(const Tokens& tokens, Tokens& out, std::set<std::string>& hidden,
                                   int level) {
  if (level > kMaxDefineDepth) return false;
  for (const Token& token : tokens) {
    if (out.size() > kMaxLineTokens) return false;
    const bool wanted = token.kind == TokenKind::kName && !token.done;
    const auto found = wanted ? defines_.find(token.text) : defines_.end();
    if (found == defines_.end()) {
      out.push_back(token);
      continue;
    }
    if (hidden.count(token.text) > 0) {
      out.push_back(token);
      out.back().done = true;
      continue;
    }
    Tokens body = found->second;
    for (Token& word : body) word.at = token.at;  // an error in it is shown where it is used
    const bool brackets = !body.empty() && body.size() > 1 && wants_brackets(body);
    if (brackets) out.push_back(symbol("(", token.at));
    hidden.insert(token.text);
    if (!replace_defines(body, out, hidden, level + 1)) return false;
    hidden.erase(token.text);
    if (brackets) out.push_back(symbol(")", token.at));
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

std::vector<Tokens> split_arguments(Tokens::const_iterator first, Tokens::const_iterator last) {
  std::vector<Tokens> list;
  if (first == last) return list;
  list.emplace_back();
  int depth = 0;
  for (; first != last; ++first) {
    if (first->is("(") || first->is("[")) ++depth;
    if (first->is(")") || first->is("]")) --depth;
    if (depth == 0 && first->is(",")) {
      list.emplace_back();
    } else {
      list.back().push_back(*first);
    }
  }
  return list;
}

}  // namespace apron::syntax
