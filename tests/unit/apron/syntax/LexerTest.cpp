#include "apron/syntax/Lexer.h"

#include <gtest/gtest.h>

#include <string>

namespace apron::syntax {
namespace {

// The words of each line, joined by blanks, one line each.
std::string words(const std::string& text, std::string* errors = nullptr) {
  SourceManager sources;
  Diagnostics diagnostics;
  const std::uint32_t file = sources.add_file("t.aps", text, {});
  std::string result;
  for (const Line& line : lex(sources, file, diagnostics)) {
    for (const Token& token : line.tokens) result += spelling(token) + ' ';
    result.back() = '\n';
  }
  const std::string report = format_diagnostics(diagnostics.take(), sources);
  if (errors != nullptr) {
    *errors = report.substr(0, report.find('\n'));
  } else {
    EXPECT_EQ(report, "") << text;
  }
  return result;
}

double number(const std::string& text) {
  SourceManager sources;
  Diagnostics diagnostics;
  const std::vector<Line> lines = lex(sources, sources.add_file("t.aps", text, {}), diagnostics);
  EXPECT_TRUE(diagnostics.empty()) << text;
  EXPECT_EQ(lines.at(0).tokens.at(0).kind, TokenKind::kNumber) << text;
  return lines.at(0).tokens.at(0).number;
}

TEST(Lexer, TokensAndLines) {
  EXPECT_EQ(words("a=b+1 // a comment\n\n  mask.on(M)// more\n"), "a = b + 1\nmask.on ( M )\n");
  EXPECT_EQ(words("x=a<=b&&!c||d!=e"), "x = a <= b && ! c || d != e\n");
  EXPECT_EQ(words("#again\njump(#again)\n$y = f($a, :t, :#out, ?)"),
            "#again\njump ( #again )\n$y = f ( $a , :t , :#out , ? )\n");
  EXPECT_EQ(words("!define(A, 1)\n  !else\n"), "!define ( A , 1 )\n!else\n");
  EXPECT_EQ(words("println('it, (is) // text')"), "println ( 'it, (is) // text' )\n");
}

TEST(Lexer, LineEndsAndContinuations) {
  EXPECT_EQ(words("a = 1\r\nb = 2\r\n"), "a = 1\nb = 2\n");
  EXPECT_EQ(words("a = 1 \\\n  + 2\\\r\n+ 3 \\ // why\n + 4\nb"), "a = 1 + 2 + 3 + 4\nb\n");
  EXPECT_EQ(words("a = 1 \\"), "a = 1\n");
  EXPECT_EQ(words("\xEF\xBB\xBF"
                  "a = 1"),
            "a = 1\n");
}

TEST(Lexer, NamesOfAnyAlphabet) { EXPECT_EQ(words("größe = высота.x + _a1"), "größe = высота.x + _a1\n"); }

TEST(Lexer, Numbers) {
  EXPECT_EQ(number("12"), 12.0F);
  EXPECT_EQ(number(".5"), 0.5F);
  EXPECT_EQ(number("5."), 5.0F);
  EXPECT_EQ(number("1.5e3"), 1500.0F);
  EXPECT_EQ(number("2E-2"), 0.02F);
  EXPECT_EQ(number("0xFf"), 255.0F);
  EXPECT_EQ(number("0x1000001"), 16777217.0);
  EXPECT_EQ(number("0x1FFFFFFFFFFFFF"), number("9007199254740991"));
  EXPECT_EQ(number("0xFFFFFFFFFFFFFFFFF"), number("295147905179352825855"));
  EXPECT_EQ(number("0x8000010000000000000"), number("37778936375320450170880"));
  EXPECT_EQ(number("1.25f"), 1.25F);
  EXPECT_EQ(number("1e-60"), 0.0F);
  EXPECT_EQ(number("1e-4000"), 0.0F);
  EXPECT_EQ(number("0.1"), 0.1F);
}

TEST(Lexer, ReportsFirstBadTokenOfLineAndContinues) {
  std::string error;
  EXPECT_EQ(words("if(a @ b\nc = 1\n", &error), "if ( a\nc = 1\n");
  EXPECT_EQ(error, "t.aps:1:6: error: unexpected character '@'");
  words("a = \xFF", &error);
  EXPECT_EQ(error, "t.aps:1:5: error: this byte is not UTF-8");
  words("a = '\xC0\xAF'", &error);
  EXPECT_EQ(error, "t.aps:1:6: error: this text holds a byte that is not printable UTF-8");
  words("a\xC2\xA0= 1", &error);
  EXPECT_EQ(error, "t.aps:1:2: error: unexpected character '\xC2\xA0' (U+00A0)");
  words(std::string("a = \0 1", 7), &error);
  EXPECT_EQ(error, "t.aps:1:5: error: unexpected control character U+0000");
  words("1.2.3", &error);
  EXPECT_EQ(error, "t.aps:1:1: error: '1.2.3' is not a number");
  words("3.5e99", &error);
  EXPECT_EQ(error, "t.aps:1:1: error: the number 3.5e99 does not fit 32-bit floating point");
}

TEST(Lexer, LocationsCountCharactersAndPhysicalLines) {
  SourceManager sources;
  Diagnostics diagnostics;
  const auto lines = lex(sources, sources.add_file("t.aps", "é = 1 \\\n + bb\n", {}), diagnostics);
  const Tokens& tokens = lines.at(0).tokens;
  EXPECT_EQ(tokens.at(1).location.column, 3U);
  EXPECT_EQ(tokens.at(4).location.line, 2U);
  EXPECT_EQ(tokens.at(4).location.column, 4U);
}

}  // namespace
}  // namespace apron::syntax
