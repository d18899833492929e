// The REPL with its input from a string.
#include "apron/run/cli/Repl.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <random>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace apron::run {
namespace {

std::string run_repl_session(const std::string& typed, std::uint32_t width = 3, std::uint32_t height = 2,
                             Options options = {}) {
  options.width = width;
  options.height = height;
  std::istringstream in(typed);
  std::string out;
  Repl(
      options, in, [&](std::string_view text) { out += text; }, false)
      .run();
  return out;
}

TEST(Repl, RunsLinesAndShowsValues) {
  EXPECT_EQ(run_repl_session("!register(A)\nA = cell.x\nA\nA + 10\nn = 4\nn * 2\n"),
            "0 1 2\n0 1 2\n10 11 12\n10 11 12\n8\n");
}

TEST(Repl, RunsEachLineOnce) {
  EXPECT_EQ(run_repl_session("println('a')\nprintln('b')\nx = random.int.rand(1, 1000)\ny = x\nx == y\n"),
            "a\nb\n1\n");
}

TEST(Repl, WaitsForEndOfBlock) {
  EXPECT_EQ(run_repl_session(
                "n = 0\nrepeat(3)\n  n = n + 1\nendrepeat\nn\n!macro_def\ntwice($a)\n!macro_begin\nif($a "
                "> 0)\n$a = "
                "$a * 2\nendif\n!macro_end\ntwice(n)\nn\n"),
            "3\n6\n");
  EXPECT_TRUE(is_incomplete("while(1)\n"));
  EXPECT_TRUE(is_incomplete("a = 1 + \\\n"));
  EXPECT_TRUE(is_incomplete("!macro_def\nf($a)\n!macro_begin\nendif\n"));
  EXPECT_FALSE(is_incomplete("while(1)\nendwhile\n"));
  EXPECT_FALSE(is_incomplete("endif\n"));
}

TEST(Repl, DiscardsFailedEntries) {
  const std::string out =
      run_repl_session("!register(A)\nA = B\nx = pixel.get(A, 9, 9)\nA = 1\npixel.get(A, 0, 0)\n:list\n");
  EXPECT_NE(out.find("error: 'B' is not a register"), std::string::npos) << out;
  EXPECT_NE(out.find("pixel.get at column 9, row 9 is outside"), std::string::npos) << out;
  EXPECT_NE(out.find("\n1\n!register(A)\nA = 1\n"), std::string::npos) << out;
}

std::string draw_expression(std::mt19937& random, int depth) {
  static const std::vector<std::string> kOperands = {
      "A", "P", "n", "2", "2.5", "foo", "max(A)", "min(A, 3)", "sift.north(A)", "math.sqrt(bar)", "'a//b'"};
  static const std::vector<std::string> kOperators = {"+", "-", "*", "/", "==", "<", "and", "|"};
  const auto pick = [&](const std::vector<std::string>& list) { return list[random() % list.size()]; };
  const auto inner = [&] { return depth == 0 ? pick(kOperands) : draw_expression(random, depth - 1); };
  switch (random() % 5) {
    case 0:
      return pick({"-", "not ", "~"}) + inner();
    case 1:
      return "(" + inner() + ")";
    case 2:
      return pick({"abs", "globalsum", "sqrt"}) + "(" + inner() + ")";
    default:
      return inner() + " " + pick(kOperators) + " " + inner();
  }
}

TEST(Repl, SaysOfAnExpressionWhatItsPrintlnDoes) {
  std::mt19937 random(11);
  const std::string declared = "!register(A)\n!uint8(P)\nn = 3\n";
  for (int round = 0; round < 300; ++round) {
    const std::string expression = draw_expression(random, static_cast<int>(random() % 3));
    EXPECT_EQ(run_repl_session(declared + expression + (random() % 2 == 0 ? "  // it's shown\n" : "\n")),
              run_repl_session(declared + "println(" + expression + ")\n"))
        << expression;
  }
}

TEST(Repl, TakesACallForWhatItsErrorsAreNotAbout) {
  const std::string functions =
      "!register(A)\nfunction y = f(plane p)\ny = p\nendfunction\n!macro_def\nm($a)\n!macro_begin\n$a = "
      "1\n!macro_end\n";
  for (const auto& [entry, error] : {std::pair{"f(foo)", "'foo' is not"},
                                     {"m(A + foo)", "'foo' is not"},
                                     {"foo", "'foo' is not"},
                                     {"shift(A, 1, foo)", "'foo' is not"},
                                     {"println(foo)", "'foo' is not"},
                                     {"if(foo", "is not closed"},
                                     {"surface.step(3)", "takes 0 arguments"},
                                     {"A = foo", "'foo' is not"},
                                     {"A == ", "expected a value"}})
    EXPECT_NE(run_repl_session(functions + entry + "\n").find(error), std::string::npos) << entry;
}

TEST(Repl, NumbersTheLinesOfTheProgram) {
  std::mt19937 random(5);
  std::string typed = "!register(A)\n";
  for (int line = 2; line < 60; ++line) {
    typed += random() % 2 == 0 ? "A = " + std::to_string(line) + "\n" : "if(1)\n\nendif\n";
    line += typed.ends_with("endif\n") ? 2 : 0;
    const std::string next = "line:" + std::to_string(line + 1);
    for (const std::string entry : {"A = foo", "foo + 1", "A = pixel.get(A, 9, 9)", "pixel.get(A, 9, 9)"})
      EXPECT_TRUE(run_repl_session(typed + entry + "\n").starts_with(next + ":")) << typed << entry;
  }
}

TEST(Repl, RefusesValuesOutsideOfASlider) {
  Options options;
  options.parameters = {{"gain", 9.0F}, {"later", 1.0F}};
  EXPECT_EQ(run_repl_session(
                "sim.slider.add('gain', 0, 5, 1)\nsim.slider.add('gain', 0, 9, 1)\nsim.slider.get('gain')\n",
                3, 2, options),
            "error: --set: 'gain' = 9 is not from 0 to 5\n9\n");
}

TEST(Repl, EntriesGoOnAfterTheEndOfAFrame) {
  EXPECT_EQ(
      run_repl_session("!register(A)\nfor(i, 1, 3)\nA = A + surface.tick\nprintln(i)\nsurface.step\nendfor\n"
                       "sim.frame\nA\nsurface.tick\n"),
      "1\n2\n3\n3 3 3\n3 3 3\n4\n");
}

TEST(Repl, Commands) {
  EXPECT_EQ(run_repl_session("!register(A)\nn = 2\nA = n\n:names\n:undo\n:names\n:list\n"),
            "A 3x2\nn = 2\nA 3x2\nn = 2\n!register(A)\nn = 2\n");
  EXPECT_EQ(run_repl_session(":clear\n:nonsense\n:quit\nprintln('never')\n"),
            "unknown command ':nonsense'; see :help\n");
  EXPECT_EQ(run_repl_session("!register(A)\nA = cell.x\n:show A\n", 4, 2), " -*@\n -*@\n4x2, 0 to 3\n");
  EXPECT_EQ(run_repl_session("end\nprintln(1)\n"),
            "the program ends before this line; :undo removes the last entry\n");
}

TEST(Repl, KnowsHelpAndQuitWithoutColon) {
  const std::string help = run_repl_session(":help\n");
  EXPECT_NE(help.find(":undo"), std::string::npos);
  EXPECT_EQ(run_repl_session("help\n"), help);
  EXPECT_EQ(run_repl_session("  ?  \n"), help);
  EXPECT_EQ(run_repl_session("quit\nprintln('never')\n"), "");
  EXPECT_EQ(run_repl_session("exit\nprintln('never')\n"), "");
  // In a block, and assigned to, they are names.
  EXPECT_EQ(run_repl_session("help = 3\nif(1)\nhelp\nendif\nprintln(help)\n").find(":undo"),
            std::string::npos);
}

TEST(Repl, SavesFilesOnce) {
  const std::string name =
      (std::filesystem::path(testing::TempDir()) / ("repl_" + std::to_string(getpid()))).string();
  run_repl_session("!register(A)\nA = 1\nio.array.save(A, '" + name + ".csv')\n:save " + name + ".aps\n");
  EXPECT_TRUE(std::filesystem::remove(name + ".csv"));
  EXPECT_TRUE(std::filesystem::remove(name + ".aps"));
  run_repl_session("!register(A)\nio.array.save(A, '" + name + ".csv')\n");
  std::filesystem::remove(name + ".csv");
  EXPECT_EQ(run_repl_session("n = 1\n:save  " + name + " my prog.aps \n"), "");
  EXPECT_TRUE(std::filesystem::remove(name + " my prog.aps"));
  EXPECT_EQ(run_repl_session(":save\n:show \n"),
            ":save takes a file name\n:show takes the name of a register\n");
}

TEST(Repl, ShrinksPicturesToTerminal) {
  std::vector<float> cells(200 * 100, 0.0F);
  cells[0] = 1.0F;
  const std::string text = format_register_ascii(cells, 200, 100, 50);
  EXPECT_EQ(text.substr(0, 3), "@\n\n");
  EXPECT_NE(text.find("200x100, 0 to 1"), std::string::npos);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 14);  // 100 rows at 8 per line, and the range
}

}  // namespace
}  // namespace apron::run
