#include "apron/syntax/Parser.h"

#include <gtest/gtest.h>

#include <string>

namespace apron::syntax {
namespace {

std::string show(const std::vector<Statement>&);

// Prefix form with every bracket: (+ a (* b c)).
std::string show(const Expression& expression) {
  if (expression.kind == ExpressionKind::kExpansion) return "{" + show(expression.expansion->body) + "}";
  std::string text =
      expression.kind == ExpressionKind::kString ? "'" + expression.text + "'" : expression.text;
  if (expression.kind == ExpressionKind::kLabel) text = "#" + text;
  if (expression.kind == ExpressionKind::kElement) return text + "[" + show(expression.children[0]) + "]";
  if (expression.children.empty()) return text;
  std::string list = "(" + text;
  for (const Expression& child : expression.children) list += " " + show(child);
  return list + ")";
}

std::string show(const std::vector<Statement>& statements) {
  std::string text;
  for (const Statement& one : statements) {
    if (!text.empty()) text += "; ";
    switch (one.kind) {
      case StatementKind::kAssign:
        text += show(one.target) + " = " + show(one.value);
        break;
      case StatementKind::kCall:
        text += show(one.value);
        break;
      case StatementKind::kLabel:
        text += "#" + one.target.text;
        break;
      case StatementKind::kMacroBegin:
        text += "enter";
        for (const ArgumentBinding& binding : one.expansion->bindings)
          text += " " + binding.name + "=" + show(binding.value);
        break;
      case StatementKind::kMacroEnd:
        text += "leave";
        break;
      case StatementKind::kDeclare:
        text += "declare";
        break;
      case StatementKind::kInvalid:
        text += "invalid " + one.target.text;
        break;
    }
  }
  return text;
}

std::string parse(const std::string& text) {
  MemoryReader reader;
  reader.files["t.aps"] = text;
  SourceManager sources;
  Diagnostics diagnostics;
  PreprocessorOptions options;
  options.file = "t.aps";
  options.is_builtin = [](std::string_view name) { return name == "min" || name == "core.add"; };
  Preprocessor preprocessor(options, reader, sources, diagnostics);
  const std::string shown = show(Parser(preprocessor, sources, diagnostics).parse());
  const std::string report = format_diagnostics(diagnostics.take(), sources);
  return report.empty() ? shown : report.substr(0, report.find('\n'));
}

TEST(Parser, Precedence) {
  EXPECT_EQ(parse("y = a + b * c - d"), "y = (- (+ a (* b c)) d)");
  EXPECT_EQ(parse("y = -a * !b"), "y = (* (- a) (! b))");
  EXPECT_EQ(parse("y = a < b and not c == d or e"), "y = (or (and (< a b) (not (== c d))) e)");
  EXPECT_EQ(parse("y = a xor b nand c nor d"), "y = (nor (xor a (nand b c)) d)");
  EXPECT_EQ(parse("y = not(a) and b"), "y = (and (not a) b)");
  EXPECT_EQ(parse("y = (a + b) * (c)"), "y = (* (+ a b) c)");
}

TEST(Parser, Statements) {
  EXPECT_EQ(parse("mask.off\nmask.on(M)\n#l\njump(#l)"), "mask.off; (mask.on M); #l; (jump #l)");
  EXPECT_EQ(parse("r[A] = v[0] + f()"), "r[A] = (+ v[0] f)");
  EXPECT_EQ(parse("if(a, <=, b)\nif(a <= b)"), "(if a <= b); (if (<= a b))");
  EXPECT_EQ(parse("println('a', max(b, 2))"), "(println 'a' (max b 2))");
}

TEST(Parser, MacrosInStatementsAndExpressions) {
  const std::string macros =
      "!macro_def\n$y = sq($a)\n!macro_begin\n$y = $a * $a\n!macro_end\n"
      "!macro_def\nset($a, $b)\n!macro_begin\n:t = $b\n$a = :t\n#keep\n!macro_end\n";
  EXPECT_EQ(parse(macros + "z = sq(b)"), "enter; z = (* b b); leave");
  EXPECT_EQ(parse(macros + "z = sq(b + 1)"), "enter $a:1=(+ b 1); z = (* $a:1 $a:1); leave");
  EXPECT_EQ(parse(macros + "z = sq(-2)"), "enter; z = (* -2 -2); leave");
  EXPECT_EQ(parse(macros + "z = sq(r[b]) + 1"), "z = (+ {$y:1 = (* r[b] r[b]); leave} 1)");
  EXPECT_EQ(parse(macros + "set(z, w)"), "enter; t:1 = w; z = t:1; #keep; leave");
}

TEST(Parser, RebindsOperators) {
  EXPECT_EQ(parse("!operator(+, core.add)\ny = a + b + 1"), "y = (core.add (core.add a b) 1)");
  EXPECT_EQ(
      parse("!operator(and, both)\n!macro_def\n$y = both($a, $b)\n!macro_begin\n$y = $a and $b\n!macro_end\n"
            "y = a and b"),
      "y = {$y:1 = (and $a:1 $b:1); leave}");
}

TEST(Parser, ReportsUnexpectedToken) {
  EXPECT_EQ(parse("y = a b"), "t.aps:1:7: error: unexpected 'b'; a statement ends with its line");
  EXPECT_EQ(parse("y = (a"), "t.aps:1:7: error: expected ')' before the end of the line");
  EXPECT_EQ(parse("y = f(a; b)"),
            "t.aps:1:8: error: unexpected character ';': a statement ends with its line");
  EXPECT_EQ(parse("y = f(a b)"), "t.aps:1:9: error: expected ',' or ')', not 'b'");
  EXPECT_EQ(parse("f(a)("), "t.aps:1:5: error: expected '=' or the end of the line, not '('");
  EXPECT_EQ(parse("#l x"), "t.aps:1:4: error: a label stands alone on its line");
  EXPECT_EQ(parse("y = " + std::string(300, '-') + "1"),
            "t.aps:1:204: error: this expression is nested more than 200 deep");
  EXPECT_EQ(parse("y = " + std::string(199, '(') + "a" + std::string(199, ')')), "y = a");
  EXPECT_EQ(parse("y = " + std::string(200, '(') + "a" + std::string(200, ')')),
            "t.aps:1:205: error: this expression is nested more than 200 deep");
  const auto sum = [](int terms) {
    std::string text = "y = a";
    for (int i = 1; i < terms; ++i) text += "+a";
    return text;
  };
  EXPECT_EQ(parse(sum(500)).find("error"), std::string::npos);
  EXPECT_NE(parse(sum(501)).find("error: this expression has more than 499 operators in a chain"),
            std::string::npos);
}

}  // namespace
}  // namespace apron::syntax
