// Messages about functions and arrays, and what a call costs.
#include <gtest/gtest.h>

#include "tests/unit/apron/compiler/CompileText.h"

namespace apron::compiler {
namespace {

const std::string kHead =
    "!register(A, B, ch[3])\n!scalar(w[2])\n"
    "function y = f(plane a, number n)\ny = a * n\nendfunction\n"
    "function u, v = two(a)\nu = a\nv = a + u\nendfunction\n"
    "function change(register r, integer n)\n!for(i, 1, n)\nr = r + i\n!endfor\nendfunction\n"
    "function y = load(text name)\ny = surface.has(name)\nendfunction\n"
    "function y = first(plane a[], number b[])\ny = a[0] * b[0]\nendfunction\n";

std::string error(const std::string& lines) { return first_line(errors(compile_text(kHead + lines))); }

TEST(FunctionErrors, NameLocalsAsTheFunctionDoes) {
  const auto body = [](const std::string& lines) {
    return error("function y = g(plane a)\n" + lines + "\nendfunction\nA = g(A)");
  };
  EXPECT_EQ(body("t = q + a\nq = 3\ny = t"), "main.aps:22:5: error: 'q' is read before it is written");
  EXPECT_EQ(body("t = 1\ny = t[A]"), "main.aps:23:7: error: there is no class 't'");
  EXPECT_EQ(
      body("y = 1\ny = y * a"),
      "main.aps:23:1: error: 'y' is a scalar, and the value is a register of 8x6; begin with !register(y)");
}

TEST(FunctionErrors, NameTheArgument) {
  const std::string at = "main.aps:21:";
  EXPECT_EQ(error("A = f(1, 2)"), at + "7: error: 'f' takes a plane for 'a', and this is a number");
  EXPECT_EQ(error("A = f(A, B + 1)"), at + "12: error: 'f' takes a number for 'n', and this is a plane");
  EXPECT_EQ(error("A = f(ch, 1)"), at + "7: error: 'f' takes a plane for 'a', and this is an array");
  EXPECT_EQ(error("change(A + 1, 2)"),
            at + "10: error: 'change' takes a register for 'r', and this is a plane");
  EXPECT_EQ(error("n = 2\nchange(A, n)"),
            "main.aps:22:1: error: 'change' takes a whole number that is a constant for 'n'");
  EXPECT_EQ(error("n = load(3)"), at + "10: error: 'load' takes a text for 'name', and this is a number");
  EXPECT_EQ(error("A = first(A, w)"),
            at + "11: error: 'first' takes an array of registers for 'a', and this is a plane");
  EXPECT_EQ(error("A = first(ch, ch)"),
            at + "15: error: 'first' takes an array of numbers for 'b', and this is an array");
  EXPECT_EQ(error("A = two(A)"), at + "5: error: 'two' gives 2 results, and 1 is written");
  EXPECT_EQ(error("A = 1 + two(A)"), at + "9: error: 'two' gives 2 results: write a line u, v = two(a)");
  EXPECT_EQ(error("A, B = A + 1"),
            at + "6: error: only a function that gives several results can stand after this '='");
  EXPECT_EQ(error("A = f(A)"),
            at + "5: error: no macro 'f' takes 1 argument and gives a result; there is y = f(a, n)");
}

TEST(FunctionErrors, LabelsOfTheirOwnCannotBeCalled) {
  for (const char* call : {"call(#sub)", "callif(n > 1, #sub)"})
    EXPECT_NE(error("function y = g(number n)\ny = n\n" + std::string(call) +
                    "\njump(#out)\n#sub\ny = y + 1\nreturn\n#out\nendfunction")
                  .find("error: the label '#sub' of the function 'g' cannot be called, as 'return' ends the "
                        "function: write a function of its own before this one"),
              std::string::npos);
  EXPECT_EQ(error("function y = g(number n)\ny = n\ncall(#sub)\nendfunction\nx = g(1)\nend\n#sub\nreturn"),
            "");
}

TEST(FunctionErrors, FunctionsThatCallThemselves) {
  const std::string told = ": the function 'g' calls itself; functions cannot, unless an !if ends it";
  const std::string nested =
      error("function y = g(n)\ny = 1\nif(n > 1)\ny = n * g(n - 1)\nendif\nendfunction\nx = g(5)");
  EXPECT_NE(nested.find(" deep here" + told), std::string::npos) << nested;
  EXPECT_EQ(error("function g(n)\ng(n)\nendfunction\ng(5)"),
            "main.aps:22:1: error: macros are expanded more than 64 deep here" + told);
  EXPECT_EQ(error("function y = g(integer n)\n!if(n, <=, 1)\ny = 1\n!else\ny = n * g(n - "
                  "1)\n!endif\nendfunction\nx = g(5)"),
            "");
}

TEST(FunctionErrors, AnElementWhoseIndexIsConstantIsARegister) {
  EXPECT_EQ(error("!for(i, 0, 1)\nchange(ch[i + 1], 2)\n!endfor\nchange(ch[(2 - 1) * 2], 1)"), "");
  EXPECT_EQ(error("change(ch[1 + 2], 2)"),
            "main.aps:21:8: error: the array 'ch' has 3 elements, numbered from 0; there is no number 3");
}

TEST(FunctionErrors, OfDefinitions) {
  const auto first_error = [](const std::string& text) { return first_line(errors(compile_text(text))); };
  EXPECT_EQ(first_error("function y = f(a)\nx = a\nendfunction\n"),
            "main.aps:1:14: error: the function 'f' does not write its result 'y'");
  EXPECT_EQ(first_error("function f(integer n)\nn = 2\nendfunction\n"),
            "main.aps:1:10: error: the function 'f' writes 'n', which is a constant");
  const std::string result =
      "error: the result 'y' is a scalar here, and 'where' masks registers only: begin with !register(y)";
  EXPECT_EQ(
      first_error("function y = f(plane a)\nwhere(a > 1)\ny = 1\nelsewhere\ny = 2\nendwhere\nendfunction\n"
                  "!register(A)\nA = f(A)\n"),
      "main.aps:3:1: " + result);
  EXPECT_EQ(
      first_error(
          "function y, z = f(plane a)\nz = a\ny = 0\nwhere(a > 1)\nadd(y, 1, 2)\nendwhere\nendfunction\n"
          "!register(A, B)\nA, B = f(A)\n"),
      "main.aps:5:5: " + result);
  EXPECT_EQ(
      first_error("!register(A)\nfunction y = f(plane a)\nwhere(a > 1)\nn = 1\nendwhere\ny = n\nendfunction\n"
                  "function y = g(plane a)\n!register(y)\nwhere(a > 1)\ny = 1\nendwhere\nendfunction\n"
                  "where(A)\nA = f(A) + g(A)\nendwhere\n"),
      "");
  EXPECT_EQ(first_error("function y = f(a\ny = a\nendfunction\n"),
            "main.aps:1:1: error: expected a function's pattern: function y = f(plane a, number n)");
  const std::string twice =
      "main.aps:1:1: error: 'a' occurs twice: results and parameters have different names";
  for (const char* pattern : {"a = f(a)", "a, b = f(a, b)", "y = f(a, plane a)", "a, a = f(b)"})
    EXPECT_EQ(first_error("function " + std::string(pattern) + "\ny = 1\nendfunction\n"), twice) << pattern;
  EXPECT_EQ(first_error("function y = f(a)\ny = a\n"),
            "main.aps:1:1: error: this function has no 'endfunction'");
  EXPECT_EQ(first_error("function f(a)\nend\nendfunction\nfunction f(b)\nnop\nendfunction\n"),
            "main.aps:4:10: error: the function 'f(b)' is defined already");
  EXPECT_EQ(first_error("!register(ch[2])\nch[2] = 1\n"),
            "main.aps:2:1: error: the array 'ch' has 2 elements, numbered from 0; there is no number 2");
  EXPECT_EQ(first_error("!register(ch[0])\n"),
            "main.aps:1:14: error: an array has a whole number of elements, from 1 to 4096");
  EXPECT_EQ(first_error("!register(ch[2])\nprintln(ch)\n"),
            "main.aps:2:9: error: 'ch' is an array; ch[0] is its first element");
  EXPECT_EQ(first_error("!register(ch[2])\nch = 1\n"),
            "main.aps:2:1: error: 'ch' is an array; ch[0] is its first element");
  EXPECT_EQ(first_error("!for(i, 0, 3)\nn = i\n"), "main.aps:1:1: error: this '!for' has no '!endfor'");
  EXPECT_EQ(first_error("!for(i, 0, 0.5)\nn = i\n!endfor\n"),
            "main.aps:1:12: error: '!for' counts in whole numbers that are constants");
}

TEST(FunctionErrors, OnlyRegistersOfTheCallerAreWritten) {
  const std::string head = kHead + "function fill(register r[])\nr[0] = 7\nendfunction\n";
  const auto of_body = [&](const std::string& parameters, const std::string& lines) {
    return first_line(
        errors(compile_text(head + "function g(" + parameters + ")\n" + lines + "\nendfunction\n")));
  };
  const std::string at = "main.aps:24:10: error: the function 'g' writes ";
  const std::string array = at + "'p', which is an array of the caller: declare it 'register'";
  EXPECT_EQ(of_body("plane p[]", "p[0] = 1"), array);
  EXPECT_EQ(of_body("plane p[]", "fill(p)"), array);
  EXPECT_EQ(of_body("plane p[]", "change(p[1], 2)"), array);
  EXPECT_EQ(of_body("register p[]", "fill(p)\nchange(p[1], 2)\np[2] = 1"), "");
  EXPECT_EQ(of_body("integer p", "change(p, 1)"), at + "'p', which is a constant");
  const std::string element = at + "elements of 'ch', which is the program's: pass it as 'register'";
  EXPECT_EQ(of_body("plane p", "ch[0] = p"), element);
  EXPECT_EQ(of_body("plane p", "fill(ch)"), element);
  EXPECT_EQ(of_body("plane p", "!register(ch[2])\nch[0] = p\nfill(ch)"), "");
  for (const char* write : {"change(B, 1)", "pixel.set(B, 0, 0, 1)"})
    EXPECT_NE(error("function y = g(plane p)\ny = p\n" + std::string(write) + "\nendfunction\nA = g(A)\n")
                  .find("error: 'B' is read before it is written, as a name that the function writes is "
                        "local: pass the program's as 'register'"),
              std::string::npos);
}

// A parameter that the body writes, also through calls and macros, is the function's own.
TEST(Function, ParametersArePassedByValue) {
  const std::string head =
      kHead +
      "!macro_def\nswap($a, $b)\n!macro_begin\n:kept = $a\n$a = $b\n$b = :kept\n"
      "!macro_end\n!macro_def\nthrough($a)\n!macro_begin\n:kept = 1 * $a\nswap($a, :kept)\n!macro_end\n"
      "!macro_def\nadvance\n!macro_begin\nB = B + 1\n!macro_end\n"
      "!macro_def\n$y = computed($a)\n!macro_begin\n$y = $a * 2\n!macro_end\n";
  const auto body = [&](const std::string& lines, const std::string& after = "") {
    return listing(compile_text(head + "function y = g(plane p, q)\n" + lines + "\ny = p + q\nendfunction\n" +
                                after + "A = g(B, 2)\n"));
  };
  for (const char* lines : {"change(p, 1)", "swap(p, t)", "through(p)", "load(p, 3)",
                            "surface.sense('proximity', p)", "x = 2 * f(p, 1)\np = 3", "advance"})
    EXPECT_TRUE(body("t = p * 2\n" + std::string(lines)).starts_with("copy $0, B\n")) << lines << body(lines);
  EXPECT_TRUE(body("late(p)", "!macro_def\nlate($a)\n!macro_begin\n$a = 1\n!macro_end\n")
                  .starts_with("copy $0, B\n"));
  EXPECT_EQ(body("t = computed(p) and (p > q)"),
            "mul $0, B, 2\ngt $1, B, 2\nand $2, $0, $1\nadd A, B, 2\nend\n");
}

// A declaration of any type is local to the call, and zero at its start.
TEST(Function, DeclaresRegistersOfAnyType) {
  for (const std::string type : {"int32", "uint16", "uint8"})
    EXPECT_EQ(listing(compile_text("!" + type + "(X)\nfunction y = g(plane a)\n!" + type +
                                   "(t, h[1])\nt = t + a\ny = h[0] + t\nendfunction\nX = g(X)\n")),
              "copy." + type + " $0, 0\ncopy." + type + " $1, 0\nadd." + type + " $0, $0, X\nadd." + type +
                  " X, $1, $0\nend\n");
}

// A result that the last line writes goes to the caller's register; nothing is copied.
TEST(Function, LocalsThatStartAtZeroShareStorage) {
  const std::string function =
      "function y = g(plane a)\nz = globalmax((a + 1) * (a + 2))\nif(z > 9)\nD = a * 3\nendif\ny = a + "
      "D\nendfunction\n"
      "!register(A)\n";
  std::string text = function;
  for (int i = 0; i < 50; ++i) text += "A = g(A)\n";
  const CompileResult one = compile_text(function + "A = g(A)\n"), many = compile_text(text);
  ASSERT_TRUE(one.program && many.program) << errors(many);
  EXPECT_EQ(many.program->registers.size(), one.program->registers.size());
  EXPECT_EQ(many.program->variables.size(), one.program->variables.size());
}

TEST(Function, CostsWhatItsLinesCost) {
  EXPECT_EQ(listing(compile_text(kHead + "A = f(B, 2)")), "mul A, B, 2\nend\n");
  EXPECT_EQ(listing(compile_text(kHead + "where(B)\nA = f(B, 2)\nendwhere")),
            "mask.push B\nmul A, B, 2\nmask.pop\nend\n");
  EXPECT_EQ(listing(compile_text(kHead + "A, B = two(B)")),
            "copy $0, B\nadd $1, B, $0\ncopy A, $0\ncopy B, $1\nend\n");
  EXPECT_EQ(listing(compile_text(kHead + "change(A, 2)")), "add A, A, 1\nadd A, A, 2\nend\n");
  EXPECT_EQ(listing(compile_text(kHead + "ch[2 - 1] = ch[0] + 1")), "add ch[1], ch[0], 1\nend\n");
}

}  // namespace
}  // namespace apron::compiler
