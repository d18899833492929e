#include "apron/language_server/SourceIndex.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>

#include "apron/compiler/Builtins.h"
#include "apron/syntax/Lexer.h"

namespace apron::language_server {

using syntax::Line;
using syntax::Token;
using syntax::TokenKind;

std::uint32_t character_count(std::string_view text) {
  return static_cast<std::uint32_t>(
      std::ranges::count_if(text, [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; }));
}

namespace {

constexpr std::uint32_t kProgram = 0;

// The characters before a token's name: "#", ":#", "$".
std::uint32_t sigil_length(TokenKind kind) {
  switch (kind) {
    case TokenKind::kParameter:
    case TokenKind::kLocalName:
    case TokenKind::kLabel:
    case TokenKind::kDirective:
    case TokenKind::kString:
      return 1;
    case TokenKind::kLocalLabel:
      return 2;
    default:
      return 0;
  }
}

// In a macro's body '$name' and ':name' stand for the parameter and the local name.
Token named_by_string(Token token) {
  const bool is_name = token.text.size() > 1 && (token.text[0] == '$' || token.text[0] == ':');
  if (token.kind != TokenKind::kString || !is_name) return token;
  token.kind = token.text[0] == '$' ? TokenKind::kParameter : TokenKind::kLocalName;
  token.text.erase(0, 1);
  ++token.location.column;
  return token;
}

// How a symbol is looked up: names, labels, parameters and locals of macros are kept apart.
std::string key_of(TokenKind kind, const std::string& name) {
  switch (kind) {
    case TokenKind::kLabel:
      return "#" + name;
    case TokenKind::kLocalLabel:
      return ":#" + name;
    case TokenKind::kParameter:
      return "$" + name;
    case TokenKind::kLocalName:
      return ":" + name;
    default:
      return name;
  }
}

// The key of a filter, slider or switch, which only texts name.
std::string text_key(const std::string& name) { return "'" + name; }

// The comment lines directly above a line, without their slashes.
std::string comment_above(const syntax::SourceManager& sources, const syntax::Location& at) {
  std::vector<std::string> lines;
  for (std::uint32_t line = at.line; line > 1; --line) {
    std::string_view text = sources.line_text(at.file, line - 1);
    text.remove_prefix(std::min(text.find_first_not_of(" \t"), text.size()));
    if (!text.starts_with("//")) break;
    text.remove_prefix(std::min<std::size_t>(text.starts_with("// ") ? 3 : 2, text.size()));
    lines.emplace_back(text);
  }
  std::string comment;
  for (auto line = lines.rbegin(); line != lines.rend(); ++line)
    comment += (comment.empty() ? "" : "\n") + *line;
  return comment;
}

bool is_assignment(const syntax::Tokens& tokens) {
  return tokens.size() > 1 && tokens[0].kind == TokenKind::kName && tokens[1].is("=");
}

}  // namespace

class SourceIndex::Builder {
 public:
  Builder(SourceIndex& index, const syntax::SourceManager& sources) : index_(index), sources_(sources) {}

  void build() {
    std::set<std::string> seen;
    for (std::uint32_t file = 0; file < sources_.file_count(); ++file) {
      if (!seen.insert(sources_.file(file).name).second) continue;
      syntax::Diagnostics ignored;
      files_.push_back(syntax::lex(sources_, file, ignored));
    }
    for (const std::vector<Line>& lines : files_) {
      scan(lines, [this](const Line& line) { declare(line); });
    }
    for (const std::vector<Line>& lines : files_) {
      scan(lines, [this](const Line& line) { use(line); });
    }
  }

 private:
  // Calls visit for each line, with scope_ set to the body that it belongs to.
  template <class Visit>
  void scan(const std::vector<Line>& lines, const Visit& visit) {
    scope_ = kProgram;
    macro_header_ = false;
    for (const Line& line : lines) {
      const Token& first = line.tokens.front();
      const bool is_directive = first.kind == TokenKind::kDirective;
      const bool begins_function =
          first.is_name("function") && line.tokens.size() > 1 && line.tokens[1].kind == TokenKind::kName;
      if ((is_directive && first.text == "macro_def") || begins_function) {
        scope_ = scope_of(first.location);
        in_function_ = begins_function;
        // The signature follows the directive, on its line or the next one.
        macro_header_ = is_directive;
        if (line.tokens.size() == 1) {
          visit_nothing(line);
          continue;
        }
      }
      visit(line);
      if (is_directive && first.text == "macro_begin") macro_header_ = false;
      if ((is_directive && first.text == "macro_end") || first.is_name("endfunction")) {
        scope_ = kProgram;
        macro_header_ = in_function_ = false;
      }
    }
    scope_ = kProgram;
    in_function_ = false;
  }
  static void visit_nothing(const Line&) {}

  std::uint32_t scope_of(const syntax::Location& location) {
    return scopes_.try_emplace({location.file, location.line}, static_cast<std::uint32_t>(scopes_.size() + 1))
        .first->second;
  }

  void add(Symbol::Kind kind, const Token& name, std::uint32_t scope, const Line& line) {
    const bool is_text = name.kind == TokenKind::kString &&
                         (kind == Symbol::Kind::kFilter || kind == Symbol::Kind::kParameter);
    const auto key = std::pair(scope, is_text ? text_key(name.text) : key_of(name.kind, name.text));
    if (name.text.empty() || !table_.try_emplace(key, index_.symbols_.size()).second) return;
    Symbol symbol;
    symbol.kind = kind;
    symbol.name = name.text;
    symbol.location = name.location;
    symbol.text = std::string(sources_.line_text(name.location.file, name.location.line));
    symbol.text.erase(0, std::min(symbol.text.find_first_not_of(" \t"), symbol.text.size()));
    symbol.scope = scope;
    symbol.comment =
        comment_above(sources_, macro_header_ && kind == Symbol::Kind::kMacro
                                    ? syntax::Location{line.location.file, line.location.line - 1, 1, 0}
                                    : line.location);
    index_.symbols_.push_back(std::move(symbol));
  }

  void declare_directive(const Line& line) {
    const syntax::Tokens& tokens = line.tokens;
    const std::string& directive = tokens[0].text;
    const auto argument = [&](std::size_t i) -> const Token* {
      return i < tokens.size() ? &tokens[i] : nullptr;
    };
    if (directive == "register" || directive == "scalar" || directive == "machine_register" ||
        directive == "int32" || directive == "uint16" || directive == "uint8") {
      const auto kind = directive == "scalar" ? Symbol::Kind::kScalar : Symbol::Kind::kRegister;
      for (std::size_t i = 1; i < tokens.size(); ++i)
        if ((tokens[i].kind == TokenKind::kName || tokens[i].kind == TokenKind::kLocalName) &&
            (tokens[i - 1].is("(") || tokens[i - 1].is(",")))
          add(kind, tokens[i], tokens[i].kind == TokenKind::kLocalName || in_function_ ? scope_ : kProgram,
              line);
    } else if (directive == "define" && argument(2) != nullptr) {
      add(Symbol::Kind::kDefine, tokens[2], kProgram, line);
    } else if (directive == "create" && argument(2) != nullptr && tokens[2].kind == TokenKind::kString) {
      const bool variable = tokens.size() > 4 && tokens[4].is_name("VARIABLE");
      add(variable ? Symbol::Kind::kScalar : Symbol::Kind::kRegister, tokens[2], kProgram, line);
    } else if (directive == "object" && argument(4) != nullptr) {
      add(Symbol::Kind::kClass, tokens[2], kProgram, line);
      add(Symbol::Kind::kClass, tokens[4], kProgram, line);
    } else if (directive == "for" && argument(2) != nullptr) {
      add(Symbol::Kind::kDefine, tokens[2], in_function_ ? scope_ : kProgram, line);
      if (!index_.symbols_.empty() && index_.symbols_.back().location == tokens[2].location)
        index_.symbols_.back().is_counter = true;
    }
  }

  // "y = f(a, b)" of a macro or function, from this token on.
  void declare_signature(const Line& line, std::size_t first, Symbol::Kind kind) {
    const syntax::Tokens& tokens = line.tokens;
    std::size_t name = first;
    for (std::size_t i = first; i + 1 < tokens.size(); ++i)
      if (tokens[i].is("=")) name = i + 1;
    if (name >= tokens.size()) return;
    add(kind, tokens[name], kProgram, line);
    for (std::size_t i = first; i < tokens.size(); ++i) {
      if (i == name) continue;
      const bool last_word = i + 1 == tokens.size() || tokens[i + 1].is(",") || tokens[i + 1].is(")") ||
                             tokens[i + 1].is("=") || tokens[i + 1].is("[");
      if (tokens[i].kind == TokenKind::kParameter || (tokens[i].kind == TokenKind::kName && last_word))
        add(Symbol::Kind::kParameter, tokens[i], scope_, line);
    }
  }

  void declare(const Line& line) {
    const syntax::Tokens& tokens = line.tokens;
    const Token& first = tokens[0];
    if (first.kind == TokenKind::kDirective) {
      if (first.text == "macro_def") return declare_signature(line, 1, Symbol::Kind::kMacro);
      return declare_directive(line);
    }
    if (macro_header_) return declare_signature(line, 0, Symbol::Kind::kMacro);
    if (first.is_name("function") && tokens.size() > 1)
      return declare_signature(line, 1, Symbol::Kind::kFunction);
    if ((first.kind == TokenKind::kLabel || first.kind == TokenKind::kLocalLabel) && tokens.size() == 1)
      return add(Symbol::Kind::kLabel, first,
                 first.kind == TokenKind::kLocalLabel || in_function_ ? scope_ : kProgram, line);
    // A name that is written: in a function it is local.
    const std::uint32_t own_scope = in_function_ ? scope_ : kProgram;
    if (is_assignment(tokens) && (in_function_ || !table_.contains({kProgram, first.text})))
      add(Symbol::Kind::kScalar, first, own_scope, line);
    if (first.kind == TokenKind::kLocalName) add(Symbol::Kind::kScalar, first, scope_, line);
    if (first.is_name("for") && tokens.size() > 2) {
      const bool local = tokens[2].kind == TokenKind::kLocalName;
      if (local || tokens[2].kind == TokenKind::kName)
        add(Symbol::Kind::kScalar, tokens[2], local ? scope_ : own_scope, line);
    }
    if (tokens.size() > 2 && tokens[2].kind == TokenKind::kString) {
      if (first.is_name("filter.create") || first.is_name("filter.kernel.gabor"))
        add(Symbol::Kind::kFilter, tokens[2], kProgram, line);
      if (first.is_name("sim.slider.add") || first.is_name("sim.switch.add"))
        add(Symbol::Kind::kParameter, tokens[2], kProgram, line);
    }
  }

  std::optional<std::size_t> find_number(const Token& token) const {
    const std::string key = key_of(token.kind, token.text);
    auto found = table_.end();
    if (token.kind == TokenKind::kString) found = table_.find({kProgram, text_key(token.text)});
    if (found == table_.end()) found = table_.find({scope_, key});
    if (found == table_.end()) found = table_.find({kProgram, key});
    return found == table_.end() ? std::nullopt : std::optional(found->second);
  }
  const Symbol* find_symbol(const Token& token) const {
    const auto number = find_number(token);
    return number ? &index_.symbols_[*number] : nullptr;
  }

  // Returns what a part of a ## b stands for: a name that is neither a parameter nor a counter stands for
  // itself.
  Join::Kind part_kind(const Token& token) const {
    const Symbol* const symbol = find_symbol(token);
    if (token.kind == TokenKind::kParameter) return Join::Kind::kWord;
    if (token.kind != TokenKind::kName || symbol == nullptr) return Join::Kind::kText;
    if (symbol->kind == Symbol::Kind::kParameter) return Join::Kind::kWord;
    return symbol->is_counter ? Join::Kind::kNumber : Join::Kind::kText;
  }

  static bool joins_at(const Line& line, std::size_t i) {
    return i < line.tokens.size() && line.tokens[i].is("##");
  }

  void note_joins(const Line& line) {
    for (std::size_t i = 0; i < line.tokens.size(); ++i) {
      if (line.tokens[i].kind != TokenKind::kPunctuator) index_.texts_.insert(line.tokens[i].text);
      if (!joins_at(line, i + 1) || (i > 0 && joins_at(line, i - 1))) continue;
      Join join{line.tokens[i].location, {}};
      for (std::size_t part = i; part < line.tokens.size(); part += 2) {
        join.parts.push_back({part_kind(line.tokens[part]), line.tokens[part].text});
        if (!joins_at(line, part + 1)) break;
      }
      index_.joins_.push_back(std::move(join));
    }
  }

  // res.match(CLASS, 'name')
  static bool is_matched_element(const Line& line, std::size_t i) {
    return i >= 4 && line.tokens[i - 4].is_name("res.match") && line.tokens[i - 1].is(",");
  }

  void use(const Line& line) {
    note_joins(line);
    for (std::size_t i = 0; i < line.tokens.size(); ++i) {
      const Token token = named_by_string(line.tokens[i]);
      if (token.kind == TokenKind::kNumber || token.kind == TokenKind::kPunctuator) continue;
      if ((joins_at(line, i + 1) || (i > 0 && joins_at(line, i - 1))) &&
          part_kind(token) == Join::Kind::kText)
        continue;
      const std::uint32_t length = character_count(token.text);
      syntax::Location start = token.location;
      start.column += sigil_length(token.kind);
      if (token.kind == TokenKind::kName || token.kind == TokenKind::kDirective)
        index_.words_.push_back({token.location, length + (token.kind == TokenKind::kDirective ? 1 : 0),
                                 (token.kind == TokenKind::kDirective ? "!" : "") + token.text});
      const auto found = find_number(token);
      if (!found) continue;
      // A text is a name only where it declares one, or where an instruction takes the name of a filter or
      // slider.
      const Symbol& symbol = index_.symbols_[*found];
      const bool named_by_text =
          symbol.kind == Symbol::Kind::kClass || table_.contains({kProgram, text_key(token.text)});
      if (token.kind == TokenKind::kString && !named_by_text && !(token.location == symbol.location) &&
          !is_matched_element(line, i))
        continue;
      index_.occurrences_.push_back({start, length, *found});
    }
  }

  SourceIndex& index_;
  const syntax::SourceManager& sources_;
  std::vector<std::vector<Line>> files_;
  std::map<std::pair<std::uint32_t, std::string>, std::size_t> table_;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> scopes_;
  std::uint32_t scope_ = kProgram;
  bool in_function_ = false, macro_header_ = false;
};

SourceIndex::SourceIndex(const syntax::SourceManager& sources) { Builder(*this, sources).build(); }

bool SourceIndex::can_make(const Join& join, std::size_t first_part, std::string_view name) const {
  if (first_part == join.parts.size()) return name.empty();
  const Join::Part& part = join.parts[first_part];
  if (part.kind == Join::Kind::kText)
    return name.starts_with(part.text) && can_make(join, first_part + 1, name.substr(part.text.size()));
  for (std::size_t length = 1; length <= name.size(); ++length) {
    const std::string_view head = name.substr(0, length);
    const bool is_number = head.find_first_not_of("0123456789") == std::string_view::npos;
    if (!is_number && (part.kind == Join::Kind::kNumber || !texts_.contains(head))) continue;
    if (can_make(join, first_part + 1, name.substr(length))) return true;
  }
  return false;
}

const syntax::Location* SourceIndex::find_join(const Symbol& symbol, const std::string& name) const {
  if (symbol.kind == Symbol::Kind::kFilter) return nullptr;
  // Those stand for another word: what stands for itself in a join does so no more under their name.
  const bool is_replaced = symbol.kind == Symbol::Kind::kParameter || symbol.is_counter;
  for (const Join& join : joins_) {
    if (!is_replaced && can_make(join, 0, name)) return &join.location;
    for (std::size_t i = 0; i < join.parts.size(); ++i) {
      if (is_replaced && name != symbol.name && join.parts[i].kind == Join::Kind::kText &&
          join.parts[i].text == name)
        return &join.location;
      if (is_replaced || join.parts[i].kind != Join::Kind::kWord) continue;
      Join given = join;
      given.parts[i] = {Join::Kind::kText, name};
      const auto is_made = [&](const std::string& text) { return can_make(given, 0, text); };
      if (std::ranges::any_of(texts_, is_made)) return &join.location;
    }
  }
  return nullptr;
}

const Occurrence* SourceIndex::find(std::uint32_t file, std::uint32_t line, std::uint32_t column) const {
  const auto covers = [&](const Occurrence& o) {
    return o.location.file == file && o.location.line == line && o.location.column <= column &&
           column <= o.location.column + o.length;
  };
  const auto found = std::ranges::find_if(occurrences_, covers);
  return found == occurrences_.end() ? nullptr : &*found;
}

std::string SourceIndex::name_at(std::uint32_t file, std::uint32_t line, std::uint32_t column,
                                 std::uint32_t& start) const {
  for (const Word& word : words_) {
    if (word.location.file != file || word.location.line != line || column < word.location.column ||
        column > word.location.column + word.length)
      continue;
    start = word.location.column;
    return word.name;
  }
  return {};
}

}  // namespace apron::language_server
