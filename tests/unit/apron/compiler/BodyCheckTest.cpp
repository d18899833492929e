// The bodies of macros that no line calls: errors that do not depend on the arguments are found, others are
// not reported.
#include "apron/compiler/BodyCheck.h"

#include <gtest/gtest.h>

#include "tests/unit/apron/compiler/CompileText.h"

namespace apron::compiler {
namespace {

std::string macro(const std::string& pattern, const std::string& body) {
  return "!macro_def\n" + pattern + "\n!macro_begin\n" + body + "\n!macro_end\n";
}

// The first lines of the errors.
std::string checked(const std::string& text) {
  syntax::MemoryReader reader;
  reader.files["main.aps"] = text;
  CompileOptions options;
  options.file = "main.aps";
  options.width = 8;
  options.height = 6;
  EXPECT_TRUE(compile(options, reader).program);
  const CompileResult result = check_macro_bodies(options, reader);
  std::string lines;
  for (const syntax::Diagnostic& error : result.diagnostics)
    lines += first_line(syntax::format_diagnostics(error, result.sources)) + '\n';
  return lines;
}

const std::string kHead = "!register(A)\n!operand_kind(analogue, 'an analogue register', A)\n" +
                          macro("move(analogue $y, analogue $a)", "$y = $a") + "A = 1\n";

// A plane may be of integers.
TEST(BodyCheck, TriesAllTypesOfCells) {
  EXPECT_EQ(checked("function y = f(plane a)\n  y = a & 3 | 1\nendfunction\n"), "");
  EXPECT_EQ(checked(macro("$y = f($a)", "$y = uint16($a) << 4 ^ 0xFFFF")), "");
  EXPECT_NE(checked("function y = f(plane a)\n  y = math.sin(a & 3)\nendfunction\n"), "");
}

TEST(BodyCheck, FindsErrorsThatEveryCallHas) {
  EXPECT_EQ(checked(macro("f($a, $n)", ":t = Missing * $n\n$a = :t")),
            "main.aps:4:6: error: 'Missing' is not a register, and no line writes it as a scalar; before it "
            "is read, "
            "!register(Missing) or Missing = 0 makes it one\n");
  EXPECT_EQ(checked(macro("$y = f($a)", "if($a > 0\n$y = 1\nendif")),
            "main.aps:4:3: error: this bracket is not closed\n");
  EXPECT_EQ(checked(macro("f", "jump(#nowhere)")),
            "main.aps:4:6: error: there is no label '#nowhere'; a line '#nowhere' makes one\n");
  EXPECT_EQ(checked(macro("$y = f($a, $b)", "$y = g($a, $b) + 1") + macro("$y = g($a, $b)", "$y = max($a)")),
            "main.aps:9:6: error: 'max' takes 2 arguments, not 1\n");
  // An argument of a kind that a macro states, directly or through another macro.
  EXPECT_EQ(checked(kHead + macro("f($a)", "move($a, B)")),
            "main.aps:12:10: error: operand 2 of 'move' must be an analogue register, not 'B'\n");
  EXPECT_EQ(checked(kHead + macro("f($a)", "g($a)") + macro("g($b)", "move($b, A)\nmove($b, 3)")),
            "main.aps:18:10: error: operand 2 of 'move' must be an analogue register, not '3'\n");
}

// Each passes its parameter to the next one forty times: 40⁸ paths, none of which tells its kind.
TEST(BodyCheck, FollowsParametersOncePerMacro) {
  std::string text = kHead, next = "last";
  text += macro("last($x)", "");
  for (const char* name : {"h", "g", "f", "e", "d", "c", "b", "a"}) {
    std::string body = "!if(0)\n";  // or a call would expand 40^8 lines, up to the limit
    for (int i = 0; i < 40; ++i) body += next + "($x)\n";
    text += macro(std::string(name) + "($x)", body + "!endif");
    next = name;
  }
  checked(text);
}

TEST(BodyCheck, LeavesNamesThatAreMadeOfArgumentsToRealCalls) {
  EXPECT_EQ(checked(macro("keep($a)", "$a ## _old = $a")), "");
  EXPECT_EQ(checked(macro("$y = sum_of($stem)", "$y = $stem ## 0 + $stem ## 1")), "");
  EXPECT_NE(checked(macro("f($a)", "part ## 1 = Missing")), "");
}

TEST(BodyCheck, AcceptsBodiesThatSomeArgumentsSuit) {
  for (const std::string& text :
       {macro("$y = f($a, $k)", "$y = filter.do($a, $k)"), macro("f($a, $op, $l)", "jumpif($a, $op, 3, $l)"),
        macro("f($n, $many)", "A = $n * A + $many[3]"),
        macro("f($file, $a, $n)", "io.image.savecount($a, $file, $n)"),
        macro("f($class, $n)", "res.setvar($class, $n, 1)"), macro("$y = f($n)", "$y = globalsum($n)"),
        macro("f($s)", "!if($s != on)\n!error('write on')\n!endif"),
        macro("f($k, $n)", "filter.setElement($k, 0, 0, $n)"),
        macro("f($n)", "repeat($n)") + macro("g", "endrepeat\nA = 1\nA = A + 1"),
        macro("f($n)", "if(4, >, $n)\nf2($n)\nendif") + macro("f2($n)", "shift(A, A, $n, 1)")}) {
    EXPECT_EQ(checked("!register(A)\nfilter.create('text', 3, 3)\n" + text), "") << text;
  }
}

}  // namespace
}  // namespace apron::compiler
