#include "apron/syntax/Writes.h"

#include <algorithm>
#include <iterator>
#include <optional>
#include <string_view>
#include <utility>

namespace apron::syntax {
namespace {

std::optional<BodyWrites::Place> place_of(const Tokens& tokens) {
  const bool is_element = tokens.size() > 3 && tokens[1].is("[") && tokens.back().is("]");
  if (tokens.empty() || (tokens.size() > 1 && !is_element)) return std::nullopt;
  const TokenKind kind = tokens.front().kind;
  if (kind != TokenKind::kName && kind != TokenKind::kParameter) return std::nullopt;
  return BodyWrites::Place{tokens.front(), is_element};
}

void add_place(const Tokens& tokens, std::vector<BodyWrites::Place>& places) {
  if (auto place = place_of(tokens)) places.push_back(*std::move(place));
}

// `y z = …` is the statement of a rebound '=' and has a target in each word.
void add_targets(const Tokens& tokens, std::vector<BodyWrites::Place>& targets) {
  const bool is_list = tokens.size() > 1 && !tokens[1].is("[");
  if (!is_list) return add_place(tokens, targets);
  for (const Token& token : tokens) add_place({token}, targets);
}

Tokens::const_iterator closing_bracket(Tokens::const_iterator open, Tokens::const_iterator last) {
  int depth = 0;
  return std::find_if(open, last, [&](const Token& token) {
    if (token.is("(")) ++depth;
    if (token.is(")")) --depth;
    return depth == 0;
  });
}

void add_calls(const Tokens& tokens, std::vector<BodyWrites::Call>& calls) {
  for (auto name = tokens.begin(); name + 1 < tokens.end(); ++name) {
    if (name->kind != TokenKind::kName || !name[1].is("(")) continue;
    const auto close = closing_bracket(name + 1, tokens.end());
    if (close == tokens.end()) return;
    const std::vector<Tokens> arguments = split_arguments(name + 2, close);
    BodyWrites::Call call{name->text, arguments.size(), name != tokens.begin(), false, {}};
    for (std::size_t i = 0; i < arguments.size(); ++i)
      if (auto place = place_of(arguments[i])) call.places.emplace_back(i, *std::move(place));
    if (call.places.empty()) continue;
    call.begins_with_text = !arguments[0].empty() && arguments[0].front().kind == TokenKind::kString;
    calls.push_back(std::move(call));
  }
}

}  // namespace

bool declares_locals(const Token& directive) {
  static constexpr std::string_view kNames[] = {"register", "scalar", "int32", "uint16", "uint8"};
  return directive.kind == TokenKind::kDirective &&
         std::ranges::find(kNames, directive.text) != std::end(kNames);
}

BodyWrites find_writes(const std::vector<Line>& body) {
  BodyWrites writes;
  for (const Line& line : body) {
    const Tokens& tokens = line.tokens;
    if (declares_locals(tokens.front()) && tokens.size() > 2) {
      for (const Tokens& name : split_arguments(tokens.begin() + 2, tokens.end() - 1))
        add_place(name, writes.declared);
    }
    if (tokens.front().kind == TokenKind::kDirective) continue;
    if (const auto equals = find_equals(tokens.begin(), tokens.end()); equals != tokens.end())
      for (const Tokens& target : split_arguments(tokens.begin(), equals))
        add_targets(target, writes.targets);
    add_calls(tokens, writes.calls);
  }
  return writes;
}

}  // namespace apron::syntax
