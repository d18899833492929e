#include "apron/syntax/Formatter.h"

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <string_view>
#include <vector>

#include "apron/syntax/Diagnostic.h"
#include "apron/syntax/Lexer.h"
#include "apron/syntax/SourceManager.h"
#include "common/text/Utf8.h"

namespace apron::syntax {
namespace {

constexpr std::size_t kIndent = 2;        // spaces per block
constexpr std::size_t kCommentGap = 2;    // spaces before a trailing comment
constexpr std::size_t kMaxColumns = 110;  // comments are not aligned beyond this

struct FormatToken {
  enum class Kind { kWord, kOpen, kClose, kComma, kOperator };
  Kind kind = Kind::kWord;
  std::string_view text;
};

using Kind = FormatToken::Kind;

// One physical line, split into its parts.
struct PhysicalLine {
  std::vector<FormatToken> tokens;
  std::string_view comment;  // including the slashes; "" for none
  bool continued = false;    // ends in a backslash
};

bool is_word_character(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '.' ||
         static_cast<unsigned char>(c) >= 0x80;
}
bool is_digit(char c) { return c >= '0' && c <= '9'; }

// Length of the first token. Precondition: the text lexes without errors.
std::size_t token_length(std::string_view text, bool first, Kind& kind) {
  const char c = text.front();
  const auto scan_word = [&](std::size_t from) {
    while (from < text.size() && is_word_character(text[from])) ++from;
    return from;
  };
  kind = Kind::kWord;
  if (c == '\'') return std::min(text.find('\'', 1), text.size() - 1) + 1;
  if (is_digit(c) || (c == '.' && text.size() > 1 && is_digit(text[1]))) {
    std::size_t end = scan_word(0);
    const bool hex = text.size() > 1 && (text[1] == 'x' || text[1] == 'X');
    const bool exponent = !hex && (text[end - 1] == 'e' || text[end - 1] == 'E') && end + 1 < text.size() &&
                          (text[end] == '+' || text[end] == '-') && is_digit(text[end + 1]);
    return exponent ? scan_word(end + 1) : end;
  }
  if (is_word_character(c)) return scan_word(0);
  if (c == ':' && text.size() > 1 && text[1] == '#') return scan_word(2);
  const bool joins = text.substr(0, 2) == "##";
  if (!joins && (c == '$' || c == '#' || c == ':')) return scan_word(1);
  if (c == '!' && first && text.size() > 1 && is_word_character(text[1])) return scan_word(1);
  kind = c == '(' || c == '['   ? Kind::kOpen
         : c == ')' || c == ']' ? Kind::kClose
         : c == ','             ? Kind::kComma
         : c == '?'             ? Kind::kWord
                                : Kind::kOperator;
  if (kind != Kind::kOperator) return 1;
  return std::max<std::size_t>(punctuator_length(text), 1);
}

PhysicalLine scan_line(std::string_view line, bool starts_statement) {
  PhysicalLine line_tokens;
  while (!line.empty()) {
    if (line.front() == ' ' || line.front() == '\t' || line.front() == '\r') {
      line.remove_prefix(1);
    } else if (line.substr(0, 2) == "//") {
      while (line.back() == ' ' || line.back() == '\t' || line.back() == '\r') line.remove_suffix(1);
      line_tokens.comment = line;
      break;
    } else if (line.front() == '\\') {
      line_tokens.continued = true;
      line.remove_prefix(1);
    } else {
      FormatToken token;
      const std::size_t size = token_length(line, starts_statement && line_tokens.tokens.empty(), token.kind);
      token.text = line.substr(0, size);
      line_tokens.tokens.push_back(token);
      line.remove_prefix(size);
    }
  }
  return line_tokens;
}

bool is_word_operator(std::string_view text) {
  static constexpr std::string_view kWords[] = {"and", "or", "xor", "nand", "nor", "not"};
  return std::find(std::begin(kWords), std::end(kWords), text) != std::end(kWords);
}

// True if two tokens would be read as other ones without a space between them, as & & and / /.
bool need_space(std::string_view left, std::string_view right, bool first) {
  const std::string text = std::string(left).append(right);
  Kind kind = Kind::kWord;
  return text.starts_with("//") || token_length(text, first, kind) != left.size();
}

// The tokens of a line with canonical spacing. previous: the last token of the line that it continues, or
// null.
std::string join_tokens(const PhysicalLine& line, const FormatToken* previous) {
  std::string text;
  const bool starts_statement = previous == nullptr;
  bool last_infix = false, last_prefix = false;
  for (const FormatToken& token : line.tokens) {
    const bool after_value = previous != nullptr && (previous->kind == Kind::kClose ||
                                                     (previous->kind == Kind::kWord && !last_infix));
    const bool infix = (token.kind == Kind::kOperator && token.text != "!" && after_value) ||
                       (is_word_operator(token.text) && token.text != "not" && after_value);
    const bool prefix = token.kind == Kind::kOperator && !after_value;
    bool needs_space = previous != nullptr && previous->kind != Kind::kOpen && !last_prefix &&
                       token.kind != Kind::kComma && token.kind != Kind::kClose;
    if (token.kind == Kind::kOpen && previous != nullptr && previous->kind == Kind::kWord && !last_infix)
      needs_space = false;
    if (last_prefix && token.kind != Kind::kComma && token.kind != Kind::kClose)
      needs_space =
          need_space(previous->text, token.text, starts_statement && previous == line.tokens.data());
    if (needs_space && !text.empty()) text += ' ';
    text += token.text;
    previous = &token;
    last_infix = infix;
    // An operator as an argument, as in if(a, <, b), is followed by a comma, which takes no space
    // anyway.
    last_prefix = prefix;
  }
  return text;
}

// How the first word of a line changes the block depth.
enum class BlockRole : std::uint8_t { kNone, kOpen, kMiddle, kClose };
using enum BlockRole;

struct BlockKeyword {
  std::string_view word;
  BlockRole role;
  std::string_view family;
};

constexpr BlockKeyword kBlockKeywords[] = {{"if", kOpen, "if"},
                                           {"else", kMiddle, "if"},
                                           {"endif", kClose, "if"},
                                           {"while", kOpen, "while"},
                                           {"endwhile", kClose, "while"},
                                           {"for", kOpen, "for"},
                                           {"endfor", kClose, "for"},
                                           {"repeat", kOpen, "repeat"},
                                           {"endrepeat", kClose, "repeat"},
                                           {"where", kOpen, "where"},
                                           {"elsewhere", kMiddle, "where"},
                                           {"endwhere", kClose, "where"},
                                           {"function", kOpen, "function"},
                                           {"endfunction", kClose, "function"},
                                           {"!for", kOpen, "!for"},
                                           {"!endfor", kClose, "!for"},
                                           {"!if", kOpen, "!if"},
                                           {"!else", kMiddle, "!if"},
                                           {"!endif", kClose, "!if"}};

// The role of each statement line. A macro may have the name of a block, as where(A) of scamp5.aps: an
// opening word without its closing one, and the pattern of a macro's definition, open nothing.
std::vector<BlockRole> find_block_roles(const std::vector<PhysicalLine>& lines) {
  struct Open {
    std::string_view family;
    std::vector<std::size_t> lines;  // the opening line and the middle ones
  };
  std::vector<BlockRole> roles(lines.size(), kNone);
  std::vector<Open> open;
  bool continues = false, is_pattern = false;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const bool is_statement = !continues && !lines[i].tokens.empty();
    continues = lines[i].continued;
    if (!is_statement) continue;
    const std::string_view word = lines[i].tokens.front().text;
    const bool is_keyword_pattern = is_pattern;
    is_pattern = word == "!macro_def" && lines[i].tokens.size() == 1;
    if (is_keyword_pattern) continue;
    const auto* const keyword = std::ranges::find(kBlockKeywords, word, &BlockKeyword::word);
    if (keyword == std::end(kBlockKeywords)) continue;
    if (keyword->role == kOpen) {
      open.push_back({keyword->family, {i}});
      continue;
    }
    const auto match = std::find_if(open.rbegin(), open.rend(),
                                    [&](const Open& block) { return block.family == keyword->family; });
    if (match == open.rend()) continue;
    match->lines.push_back(i);
    if (keyword->role == kMiddle) continue;
    for (const std::size_t line : match->lines) roles[line] = kMiddle;
    roles[match->lines.front()] = kOpen;
    roles[i] = kClose;
    open.erase(std::prev(match.base()), open.end());
  }
  return roles;
}

struct FormattedLine {
  std::string code;
  std::string_view comment;
};

// Characters, not bytes.
std::size_t display_width(std::string_view text) {
  return std::ranges::count_if(text, [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; });
}

bool has_code(const std::string& code) { return code.find_first_not_of(' ') != std::string::npos; }

// Aligns the trailing comments of adjacent lines.
std::string align_comments(const std::vector<FormattedLine>& lines) {
  std::string text;
  for (std::size_t first = 0; first < lines.size();) {
    std::size_t last = first, widest = 0;
    while (last < lines.size() && has_code(lines[last].code) && !lines[last].comment.empty()) {
      const std::size_t width = display_width(lines[last].code);
      if (width + kCommentGap + display_width(lines[last].comment) > kMaxColumns && last > first) break;
      widest = std::max(widest, width);
      ++last;
    }
    if (last == first) {
      text.append(lines[first].code).append(lines[first].comment) += '\n';
      ++first;
      continue;
    }
    for (; first < last; ++first) {
      const std::size_t gap = widest - display_width(lines[first].code) + kCommentGap;
      text.append(lines[first].code).append(gap, ' ').append(lines[first].comment) += '\n';
    }
  }
  return text;
}

}  // namespace

std::string format_unchecked(std::string_view text) {
  std::vector<PhysicalLine> scanned;
  bool continues = false, starts_statement = true;
  text = common::without_byte_order_mark(text);
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    scanned.push_back(scan_line(text.substr(0, end), starts_statement));
    continues = scanned.back().continued;
    starts_statement = !continues || (starts_statement && scanned.back().tokens.empty());
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  const std::vector<BlockRole> roles = find_block_roles(scanned);
  std::vector<FormattedLine> lines;
  std::size_t depth = 0;
  bool pending_blank_line = false;
  FormatToken previous;
  continues = false;
  for (std::size_t i = 0; i < scanned.size(); ++i) {
    const PhysicalLine& line = scanned[i];
    if (line.tokens.empty() && line.comment.empty() && !line.continued && !continues) {
      pending_blank_line = true;
      continue;
    }
    if (pending_blank_line && !lines.empty()) lines.push_back({});
    pending_blank_line = false;
    const bool outdents = roles[i] == kMiddle || roles[i] == kClose;
    const std::size_t indent = (continues ? depth + 2 : outdents ? depth - 1 : depth) * kIndent;
    if (roles[i] == kOpen) ++depth;
    if (roles[i] == kClose) --depth;
    std::string code = join_tokens(line, continues && previous.text.data() != nullptr ? &previous : nullptr);
    if (line.continued) code += code.empty() ? "\\" : " \\";
    lines.push_back(
        {code.empty() && line.comment.empty() ? "" : std::string(indent, ' ') + code, line.comment});
    if (!line.tokens.empty()) previous = line.tokens.back();
    if (!line.continued) previous = {};
    continues = line.continued;
  }
  return align_comments(lines);
}

namespace {

std::vector<Line> lex_text(const std::string& text, bool& success) {
  SourceManager sources;
  Diagnostics diagnostics;
  const std::uint32_t file = sources.add_file("", text, {});
  std::vector<Line> lines = lex(sources, file, diagnostics);
  success = diagnostics.empty();
  return lines;
}

bool same_tokens(const std::vector<Line>& a, const std::vector<Line>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Line& p, const Line& q) {
    return std::equal(p.tokens.begin(), p.tokens.end(), q.tokens.begin(), q.tokens.end(),
                      [](const Token& s, const Token& t) { return s.kind == t.kind && s.text == t.text; });
  });
}

}  // namespace

std::string format_source(const std::string& text) {
  bool lexes = false, result_lexes = false;
  const std::vector<Line> before = lex_text(text, lexes);
  if (!lexes) return text;
  std::string result = format_unchecked(text);
  const std::vector<Line> after = lex_text(result, result_lexes);
  return result_lexes && same_tokens(before, after) ? result : text;
}

}  // namespace apron::syntax
