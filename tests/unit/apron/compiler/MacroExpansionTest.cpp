// Macros as the compiler sees them: libraries in the original's style, values, a macro's own names.
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <string>

#include "apron/program/LocalityCheck.h"
#include "tests/unit/apron/compiler/CompileText.h"

namespace apron::compiler {
namespace {

std::string macro(const std::string& pattern, const std::string& body) {
  return "!macro_def\n" + pattern + "\n!macro_begin\n" + body + "\n!macro_end\n";
}

std::string compiled(const std::string& text, const std::map<std::string, std::string>& files = {}) {
  return listing(compile_text("!register(A, B, C)\n" + text + "\n", files));
}

TEST(Macro, OriginalStyleInstructionSet) {
  const std::string library =
      "!object('ANALOGUE', 'a', 1, 'SIM_REGISTER')\n"
      "!object('CONTROL', 'c', 2, 'SIM_VARIABLE')\n"
      "!create('X', ANALOGUE)\n!create('Y', ANALOGUE)\n!create('n', CONTROL)\n"
      "!define(ACC, a[X])\n"
      "!operator(+, pe.add)\n" +
      macro("$r1 = pe.add($r2, $r3)", "core.add($r1, $r2, $r3)") + macro("pe.add($r1)", "ACC = ACC + $r1") +
      macro("pe.skip($x, $op, $y)", "if($x, $op, $y)\njump(:#skip)\nendif\nACC = 0\n:#skip");
  EXPECT_EQ(compiled("!include('pe.aps')\nACC = a[Y] + 1\npe.add(a[1])\npe.skip(c[n], >=, 2)\nc[0] = 3",
                     {{"pe.aps", library}}),
            "add X, Y, 1\nadd X, X, Y\nunless.ge n, 2, @4\njump @5\ncopy X, 0\ncopy n, 3\nend\n");
}

// A define may have its own name in it, and stays what it is on its way through macros.
TEST(Macro, DefineIsNotExpandedInItself) {
  EXPECT_EQ(compiled("!object('pe', 'p', 1, 'SIM_REGISTER')\n!create('D', pe)\n!define(D, p[D])\n" +
                     macro("$r = pe.add($a, $b)", "$r = core.add($a, $b)") +
                     macro("pe.add($a, $b)", "$a = pe.add($a, $b)") + "pe.add(D, 1)\nD = pe.add(D, D)"),
            "add D, D, 1\nadd D, D, D\nend\n");
}

TEST(Macro, ShadowsInstructionExceptInItsBody) {
  const std::string clipped = macro("$y = add($a, $b)", "$y = min(add($a, $b), 127)");
  EXPECT_EQ(compiled(clipped + "A = add(A, B)"), "add $0, A, B\nmin A, $0, 127\nend\n");
  const std::string where = macro("where($c)", "mask.on($c)") + macro("all", "mask.off");
  EXPECT_EQ(compiled(where + "where(A)\nB = 1\nall"), "mask.on A\ncopy B, 1\nmask.off\nend\n");
}

TEST(Macro, MayOpenBlockClosedByAnother) {
  const std::string pair = macro("unless($a, $b)", "if($a, >=, $b)\nelse") + macro("endunless", "endif");
  EXPECT_EQ(compiled(pair + "x = 1\nunless(x, 3)\nx = 2\nendunless"),
            "copy x, 1\nunless.ge x, 3, @3\njump @4\ncopy x, 2\nend\n");
}

TEST(Macro, NestedArgumentsAreEvaluatedOnce) {
  const std::string square = macro("$y = sqr($a)", "$y = $a * $a");
  EXPECT_EQ(compiled(square + "A = sqr(B + 1) + sqr(2)"),
            "add $0, B, 1\nmul $1, $0, $0\ncopy $2, 4\nadd A, $1, $2\nend\n");
  EXPECT_EQ(compiled(square + "x = sqr(3)"), "copy x, 9\nend\n");
}

TEST(Macro, LocalNamesAreUniqueAndTypedByFirstWrite) {
  const std::string body =
      macro("$y = f($a)", ":t = $a + 1\n:n = 2\nrepeat(:n)\n:t = :t * 2\nendrepeat\n$y = :t");
  const std::string once = "add $0, A, 1\n";
  const std::string lines = compiled(body + "B = f(A)\nC = f(A)");
  EXPECT_EQ(lines.substr(0, once.size()), once);
  // Both expansions use the same temporary, one after the other.
  EXPECT_EQ(lines.find("$3"), std::string::npos) << lines;
}

TEST(Macro, ResultStartsAtZeroUnlessItsLastLineWritesItWhole) {
  const std::string inc = macro("$y = inc($a)", "$y = $a + 1");
  EXPECT_EQ(compiled(inc + "A = inc(B) * 2"), "add $0, B, 1\nmul A, $0, 2\nend\n");
  EXPECT_EQ(compiled(inc + "mask.on(B)\nA = inc(B) * 2"), "mask.on B\nadd $0, B, 1\nmul A, $0, 2\nend\n");
  const std::string relu = macro("$y = relu($a)", "where($a > 0)\n$y = $a\nendwhere");
  EXPECT_EQ(compiled(relu + "A = relu(B) * 2"),
            "copy $0, 0\ngt $1, B, 0\nmask.push $1\ncopy $0, B\nmask.pop\nmul A, $0, 2\nend\n");
  EXPECT_EQ(compiled(macro("$y = more($a)", "mac($y, $a, 2)") + "A = more(B) * 2"),
            "copy $0, 0\nmac $0, B, 2, $0\nmul A, $0, 2\nend\n");
}

// Under the caller's mask a body computes as without one: its own where selects, local registers are written
// whole, and a register of the caller that it writes before its last line is merged at the end.
TEST(Macro, BodiesIgnoreTheCallersMask) {
  const std::string twice = macro("$y = twice($a)", "$y = $a + 1\n$y = $y * 2");
  EXPECT_EQ(compiled(twice + "A = twice(B)"), "add A, B, 1\nmul A, A, 2\nend\n");
  EXPECT_EQ(compiled(twice + "where(B)\nA = twice(B)\nendwhere"),
            "mask.push B\ncopy $0, A\nadd A, B, 1\nmul A, A, 2\ncopy $0, A\ncopy A, $0\nmask.pop\nend\n");
  const std::string relu = macro("$y = relu($a)", ":r = $a\nwhere(:r < 0)\n:r = 0\nendwhere\n$y = :r");
  EXPECT_EQ(compiled(relu + "where(B)\nA = relu(A)\nendwhere"),
            "mask.push B\ncopy $0, A\nlt $1, $0, 0\nmask.push $1\nselect $0, $1, 0, $0\nmask.pop\n"
            "copy A, $0\nmask.pop\nend\n");
  // What a body does to masks itself, it does to all registers.
  const std::string only = macro("only($m)", ":m = $m > 0\nmask.on(:m)\n:m = 1");
  EXPECT_EQ(compiled(only + "only(B)\nA = 1"),
            "copy $0, 0\ngt $0, B, 0\nmask.on $0\ncopy $0, 1\ncopy A, 1\nend\n");
}

TEST(Macro, ErrorsShowExpansionChain) {
  const std::string library =
      macro("$y = outer($a)", "$y = inner($a) + 1") + macro("$y = inner($a)", "$y = $a + Missing");
  const CompileResult result =
      compile_text("!include('lib.aps')\n!register(A)\nA = outer(A)\n", {{"lib.aps", library}});
  EXPECT_EQ(errors(result),
            "lib.aps:9:11: error: 'Missing' is not a register, and no line writes it as a scalar; before it "
            "is read, !register(Missing) or Missing = 0 makes it one\n"
            "    $y = $a + Missing\n"
            "              ^\n"
            "  note: in expansion of macro 'inner' at lib.aps:4:6\n"
            "  note: in expansion of macro 'outer' at main.aps:3:5\n");
}

TEST(Macro, SyntaxErrorsNameTheLineOfTheBody) {
  EXPECT_EQ(
      errors(compile_text("function y = scale(plane a, number k)\n  y = a k\nendfunction\n!register(A)\n\n"
                          "A = scale(cell.x, 3)\n")),
      "main.aps:2:9: error: unexpected '3'\n"
      "      y = a k\n"
      "            ^\n"
      "  note: in the call of function 'scale' at main.aps:6:5\n");
  EXPECT_EQ(errors(compile_text(macro("$y = f($a, $b)", "$y = g($a, $b)") +
                                macro("$y = g($a, $b)", ":t = 1\n$y = :t $b") + "n = 4\nk = f(n, n)\n")),
            "main.aps:10:9: error: unexpected 'n'; a statement ends with its line\n"
            "    $y = :t $b\n"
            "            ^\n"
            "  note: in expansion of macro 'g' at main.aps:4:6\n"
            "  note: in expansion of macro 'f' at main.aps:13:5\n");
  EXPECT_EQ(first_line(errors(compile_text(macro("$y = f($a)", "$y = 2 + ($a") + "k = f(1)\n"))),
            "main.aps:4:13: error: expected ')' before the end of the line");
  // An argument of another kind than the body needs is the caller's mistake.
  EXPECT_EQ(
      first_line(errors(compile_text(macro("$y = f($a)", "$y = $a + 1") + "k = f(Missing)\n"))),
      "main.aps:6:7: error: 'Missing' is not a register, and no line writes it as a scalar; before it is "
      "read, !register(Missing) or Missing = 0 makes it one");
}

TEST(Macro, ErrorsInFunctionsShowTheirCall) {
  EXPECT_EQ(errors(compile_text("function f(a)\nx = Missing\nendfunction\nf(1)\n")),
            "main.aps:2:5: error: 'Missing' is not a register, and no line writes it as a scalar; before it "
            "is read, !register(Missing) or Missing = 0 makes it one\n"
            "    x = Missing\n"
            "        ^\n"
            "  note: in the call of function 'f' at main.aps:4:1\n");
}

TEST(Macro, InstalledLibrariesCompileAndStayLocal) {
  std::map<std::string, std::string> files;
  for (const char* name : {"apron.aps", "morphology.aps"}) {
    std::ifstream stream(std::string(APRON_SCRIPTS) + "/" + name);
    std::stringstream text;
    text << stream.rdbuf();
    ASSERT_FALSE(text.str().empty()) << name;
    files["lib/" + std::string(name)] = text.str();
  }
  const CompileResult result = compile_text(
      "!include('apron.aps')\n!include('morphology.aps')\n!register(A, B, M)\n"
      "A = erode(B)\nA = dilate(A, 2)\nB = open(A) - close(A)\nM = between(A, FALSE, TRUE)\n"
      "where(threshold(M, PI))\nB = count_steps(A, 5)\nendwhere\nB = spread_max(B, M, 9)\nswap(A, B)\nA = "
      "erode(A, 3)\n",
      files);
  ASSERT_TRUE(result.program) << errors(result);
  EXPECT_TRUE(program::find_nonlocal_instructions(*result.program).empty());
}

}  // namespace
}  // namespace apron::compiler
