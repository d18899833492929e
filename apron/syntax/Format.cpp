#include "apron/syntax/Format.h"

#include <algorithm>
#include <string_view>
#include <utility>
#include <vector>

#include "apron/syntax/Diagnostic.h"
#include "apron/syntax/Lexer.h"
#include "apron/syntax/Sources.h"

namespace apron::syntax {
namespace {

constexpr std::size_t kIndent = 2;        // blanks a block
constexpr std::size_t kCommentGap = 2;    // blanks before a comment at the end of a line
constexpr std::size_t kMaxColumns = 110;  // comments are not aligned beyond

enum class Kind { kWord, kOpen, kClose, kComma, kOperator };

struct Piece {
  Kind kind = Kind::kWord;
  std::string_view text;
};

// One physical line, in its parts.
struct Row {
  std::vector<Piece> pieces;
  std::string_view comment;  // with its slashes; "" for none
  bool continued = false;    // ends in a backslash
};

bool is_word(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '.' ||
         static_cast<unsigned char>(c) >= 0x80;
}
bool is_digit(char c) { return c >= '0' && c <= '9'; }

// Length of the word, number, text or symbol at the beginning; the text has lexed without errors.
std::size_t length(std::string_view text, bool first, Kind& kind) {
  const char c = text.front();
  const auto words = [&](std::size_t from) {
    while (from < text.size() && is_word(text[from])) ++from;
    return from;
  };
  kind = Kind::kWord;
  if (c == '\'') return std::min(text.find('\'', 1), text.size() - 1) + 1;
  if (is_digit(c) || (c == '.' && text.size() > 1 && is_digit(text[1]))) {
    std::size_t end = words(0);
    const bool hex = text.size() > 1 && (text[1] == 'x' || text[1] == 'X');
    const bool exponent = !hex && (text[end - 1] == 'e' || text[end - 1] == 'E') && end + 1 < text.size() &&
                          (text[end] == '+' || text[end] == '-') && is_digit(text[end + 1]);
    return exponent ? words(end + 1) : end;
  }
  if (is_word(c)) return words(0);
  if (c == ':' && text.size() > 1 && text[1] == '#') return words(2);
  if (c == '$' || c == '#' || c == ':') return words(1);
  if (c == '!' && first && text.size() > 1 && is_word(text[1])) return words(1);
  kind = c == '(' || c == '['   ? Kind::kOpen
         : c == ')' || c == ']' ? Kind::kClose
         : c == ','             ? Kind::kComma
         : c == '?'             ? Kind::kWord
                                : Kind::kOperator;
  if (kind != Kind::kOperator) return 1;
  for (const std::string_view pair : {"<=", ">=", "==", "!=", "&&", "||"})
    if (text.substr(0, 2) == pair) return 2;
  return 1;
}

Row read_row(std::string_view line, bool begins) {
  Row row;
  while (!line.empty()) {
    if (line.front() == ' ' || line.front() == '\t' || line.front() == '\r') {
      line.remove_prefix(1);
    } else if (line.substr(0, 2) == "//") {
      while (line.back() == ' ' || line.back() == '\t' || line.back() == '\r') line.remove_suffix(1);
      row.comment = line;
      break;
    } else if (line.front() == '\\') {
      row.continued = true;
      line.remove_prefix(1);
    } else {
      Piece piece;
      const std::size_t size = length(line, begins && row.pieces.empty(), piece.kind);
      piece.text = line.substr(0, size);
      row.pieces.push_back(piece);
      line.remove_prefix(size);
    }
  }
  return row;
}

bool is_word_operator(std::string_view text) {
  static constexpr std::string_view kWords[] = {"and", "or", "xor", "nand", "nor", "not"};
  return std::find(std::begin(kWords), std::end(kWords), text) != std::end(kWords);
}

// The words of a row with the blanks that belong between them. `before`: the last piece of the row that it
// continues.
std::string join(const Row& row, const Piece* before) {
  std::string text;
  const Piece* last = before;
  bool last_infix = false, last_prefix = false;
  for (const Piece& piece : row.pieces) {
    const bool after_value =
        last != nullptr && (last->kind == Kind::kClose || (last->kind == Kind::kWord && !last_infix));
    const bool infix = (piece.kind == Kind::kOperator && piece.text != "!" && after_value) ||
                       (is_word_operator(piece.text) && piece.text != "not" && after_value);
    const bool prefix = piece.kind == Kind::kOperator && !after_value;
    bool blank = last != nullptr && last->kind != Kind::kOpen && !last_prefix && piece.kind != Kind::kComma &&
                 piece.kind != Kind::kClose;
    if (piece.kind == Kind::kOpen && last != nullptr && last->kind == Kind::kWord && !last_infix)
      blank = false;
    if (blank && !text.empty()) text += ' ';
    text += piece.text;
    last = &piece;
    last_infix = infix;
    // An operator that is an argument, as in if(a, <, b), is followed by a comma, which takes no blank
    // anyway.
    last_prefix = prefix;
  }
  return text;
}

// How the line's first word changes the depth of blocks: of the line itself, and of those after it.
std::pair<int, int> depth_change(const Row& row) {
  if (row.pieces.empty()) return {0, 0};
  const std::string_view word = row.pieces.front().text;
  for (const std::string_view open : {"if", "while", "for", "repeat", "where", "!if"})
    if (word == open) return {0, 1};
  for (const std::string_view close : {"endif", "endwhile", "endfor", "endrepeat", "endwhere", "!endif"})
    if (word == close) return {-1, -1};
  for (const std::string_view turn : {"else", "elsewhere", "!else"})
    if (word == turn) return {-1, 0};
  return {0, 0};
}

struct Written {
  std::string code;
  std::string_view comment;
};

// Characters, not bytes.
std::size_t columns(std::string_view text) {
  return static_cast<std::size_t>(std::count_if(
      text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; }));
}

bool has_words(const std::string& code) { return code.find_first_not_of(' ') != std::string::npos; }

// Comments at the ends of neighbouring lines stand below each other.
std::string with_comments(const std::vector<Written>& lines) {
  std::string text;
  for (std::size_t first = 0; first < lines.size();) {
    std::size_t last = first, widest = 0;
    while (last < lines.size() && has_words(lines[last].code) && !lines[last].comment.empty()) {
      const std::size_t width = columns(lines[last].code);
      if (width + kCommentGap + columns(lines[last].comment) > kMaxColumns && last > first) break;
      widest = std::max(widest, width);
      ++last;
    }
    if (last == first) {
      text.append(lines[first].code).append(lines[first].comment) += '\n';
      ++first;
      continue;
    }
    for (; first < last; ++first) {
      const std::size_t gap = widest - columns(lines[first].code) + kCommentGap;
      text.append(lines[first].code).append(gap, ' ').append(lines[first].comment) += '\n';
    }
  }
  return text;
}

std::string arrange(std::string_view text) {
  std::vector<Written> lines;
  int depth = 0;
  bool continues = false, empty = false;
  Piece before;
  if (text.substr(0, 3) == "\xEF\xBB\xBF") text.remove_prefix(3);
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const Row row = read_row(text.substr(0, end), !continues);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (row.pieces.empty() && row.comment.empty() && !row.continued && !continues) {
      empty = true;
      continue;
    }
    if (empty && !lines.empty()) lines.push_back({});
    empty = false;
    const auto [own, after] = continues ? std::pair{2, 0} : depth_change(row);
    const auto blanks = static_cast<std::size_t>(std::max(depth + own, 0)) * kIndent;
    depth = std::max(depth + after, 0);
    std::string code = join(row, continues && before.text.data() != nullptr ? &before : nullptr);
    if (row.continued) code += code.empty() ? "\\" : " \\";
    lines.push_back(
        {code.empty() && row.comment.empty() ? "" : std::string(blanks, ' ') + code, row.comment});
    if (!row.pieces.empty()) before = row.pieces.back();
    if (!row.continued) before = {};
    continues = row.continued;
  }
  return with_comments(lines);
}

std::vector<Line> words(const std::string& text, bool& good) {
  Sources sources;
  Diagnostics diagnostics;
  const std::uint32_t file = sources.add_file("", text, {});
  std::vector<Line> lines = lex(sources, file, diagnostics);
  good = diagnostics.empty();
  return lines;
}

bool same_words(const std::vector<Line>& a, const std::vector<Line>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Line& p, const Line& q) {
    return std::equal(p.tokens.begin(), p.tokens.end(), q.tokens.begin(), q.tokens.end(),
                      [](const Token& s, const Token& t) { return s.kind == t.kind && s.text == t.text; });
  });
}

}  // namespace

std::string format_program(const std::string& text) {
  bool good = false, still_good = false;
  const std::vector<Line> before = words(text, good);
  if (!good) return text;
  std::string result = arrange(text);
  const std::vector<Line> after = words(result, still_good);
  return still_good && same_words(before, after) ? result : text;
}

}  // namespace apron::syntax
