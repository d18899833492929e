// Several errors in one run, and what stands below them.
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <string>

#include "apron/compiler/Builtins.h"
#include "apron/program/LocalityCheck.h"
#include "tests/unit/apron/compiler/CompileText.h"

namespace apron::compiler {
namespace {

TEST(Report, ErrorsAreSortedByLine) {
  const CompileResult result = compile_text(
      "!register(Image)\n"
      "Image = Imgae + 1\n"
      "\tif(Image > 0\n"
      "x = 1 +\n"
      "endif\n"
      "y = x\n"
      "Image = frobnicate(Image)\n");
  EXPECT_EQ(errors(result),
            "main.aps:2:9: error: 'Imgae' is not a register, and no line writes it as a scalar; did you mean "
            "'Image'?\n"
            "    Image = Imgae + 1\n"
            "            ^\n"
            "main.aps:3:4: error: this bracket is not closed\n"
            "    \tif(Image > 0\n"
            "    \t  ^\n"
            "main.aps:4:8: error: expected a value\n"
            "    x = 1 +\n"
            "           ^\n"
            "main.aps:7:9: error: there is no instruction or macro 'frobnicate'\n"
            "    Image = frobnicate(Image)\n"
            "            ^\n");
}

TEST(Report, LongWordsAreShortened) {
  const std::string word(1 << 20, 'x');
  for (const std::string& line : {word + " = 1 +", "println(" + word + ")", "!include('" + word + ".aps')",
                                  "x = " + std::string(1 << 20, '1') + "y", "call(#" + word + ")"})
    EXPECT_LT(errors(compile_text(line + "\n")).size(), 2500U) << line.substr(0, 20);
}

TEST(Report, StopsAfterTwentyErrors) {
  std::string text;
  for (int i = 0; i < 50; ++i) text += "x = )\n";
  const CompileResult result = compile_text(text);
  EXPECT_EQ(result.diagnostics.size(), 20U);
  EXPECT_NE(errors(result).find("error: stopped after 20 errors"), std::string::npos);
}

TEST(Report, ColumnsCountCharacters) {
  const std::string report = errors(compile_text("println('größe', größe)\r\n"));
  EXPECT_EQ(
      report,
      "main.aps:1:18: error: 'größe' is not a register, and no line writes it as a scalar; before it is "
      "read, !register(größe) or größe = 0 makes it one\n"
      "    println('größe', größe)\n"
      "                     ^\n");
}

TEST(Report, IncludesAreChained) {
  const CompileResult result = compile_text(
      "// first\n!include('a.aps')\n", {{"a.aps", "!include('sub/b.aps')\n"}, {"sub/b.aps", "\nx = )\n"}});
  EXPECT_EQ(errors(result),
            "sub/b.aps:2:5: error: expected a value, not ')'\n"
            "    x = )\n"
            "        ^\n"
            "  note: included from a.aps:1:1\n"
            "  note: included from main.aps:2:1\n");
}

TEST(Report, AFileThatIsIncludedTwiceIsReportedOnce) {
  const CompileResult result = compile_text("!include('a.aps')\n!include('a.aps')\n", {{"a.aps", "x = )\n"}});
  EXPECT_EQ(errors(result),
            "a.aps:1:5: error: expected a value, not ')'\n"
            "    x = )\n"
            "        ^\n"
            "  note: included from main.aps:1:1\n");
}

TEST(Report, MissingMainFile) {
  syntax::MemoryReader nothing;
  CompileOptions options;
  options.file = "gone.aps";
  options.width = options.height = 4;
  EXPECT_EQ(errors(compile(options, nothing)),
            "gone.aps: error: the file does not exist, is not a regular file or cannot be read\n");
}

TEST(LocalProfile, ReportsNonLocalInstructions) {
  const CompileResult result = compile_text(
      "!register(A, B)\n"
      "A = surface.sense('proximity')\n"
      "A = near.max(A, 8)\n"
      "A = shift.east(B, 2)\n"
      "A = shift(B, 1, 1)\n"
      "A = rotate.north(B)\n"
      "x = globalsum(A)\n"
      "if(x > 0)\n"
      "pixel.set(A, 0, 0, 1)\n"
      "endif\n"
      "surface.actuate('height', A)\n");
  ASSERT_TRUE(result.program) << errors(result);
  std::string text;
  for (const program::NonLocalInstruction& found : program::find_nonlocal_instructions(*result.program)) {
    const program::Program& p = *result.program;
    text += std::to_string(p.source_locations[p.code[found.instruction].source_location].line) + ": " +
            found.reason + '\n';
  }
  EXPECT_EQ(text,
            "4: shift by (2, 0) reaches beyond the north, east, south and west neighbours\n"
            "5: shift by (1, 1) reaches beyond the north, east, south and west neighbours\n"
            "6: rotate by (0, -1) joins opposite edges of the array\n"
            "7: globalsum needs the whole array\n"
            "9: pixel.set needs the whole array\n");
}

TEST(Manual, NamesEveryInstruction) {
  std::ifstream stream(APRON_MANUAL);
  std::stringstream text;
  text << stream.rdbuf();
  for (const std::string& name : builtin_names()) {
    const bool there = text.str().find('`' + name + '`') != std::string::npos ||
                       text.str().find('`' + name + '(') != std::string::npos ||
                       text.str().find(' ' + name + '(') != std::string::npos;
    EXPECT_TRUE(there) << name;
  }
}

}  // namespace
}  // namespace apron::compiler
