#include "apron/syntax/Preprocessor.h"

#include <gtest/gtest.h>

#include <map>
#include <string>

namespace apron::syntax {
namespace {

struct Result {
  std::string lines;   // the words of each line, joined by blanks
  std::string errors;  // the first line of each report
};

Result preprocess(const std::string& text, const std::map<std::string, std::string>& files = {}) {
  MemoryReader reader;
  reader.files = files;
  reader.files["src/main.aps"] = text;
  SourceManager sources;
  Diagnostics diagnostics;
  PreprocessorOptions options;
  options.file = "src/main.aps";
  options.width = 16;
  options.height = 9;
  options.include_paths = {"more"};
  options.library_path = "lib";
  Preprocessor preprocessor(options, reader, sources, diagnostics);
  Result result;
  for (PreprocessedItem item = preprocessor.next(); item.kind != PreprocessedItem::Kind::kEndOfInput;
       item = preprocessor.next()) {
    const Declaration& wanted = item.declaration;
    if (item.kind == PreprocessedItem::Kind::kLine) {
      for (const Token& token : item.line.tokens) result.lines += spelling(token) + ' ';
      result.lines.back() = '\n';
    } else if (wanted.kind == Declaration::Kind::kClass) {
      result.lines += "class " + wanted.name + " " + wanted.alias + "\n";
    } else {
      result.lines += "make " + wanted.name + " " + wanted.class_name + " " + std::to_string(wanted.width) +
                      "x" + std::to_string(wanted.height) + "\n";
    }
  }
  for (const Diagnostic& one : diagnostics.take()) {
    const std::string report = format_diagnostics(one, sources);
    result.errors += report.substr(0, report.find('\n') + 1);
  }
  return result;
}

std::string lines(const std::string& text, const std::map<std::string, std::string>& files = {}) {
  const Result result = preprocess(text, files);
  EXPECT_EQ(result.errors, "") << text;
  return result.lines;
}

std::string errors(const std::string& text, const std::map<std::string, std::string>& files = {}) {
  return preprocess(text, files).errors;
}

TEST(Preprocessor, DefinesKeepTheirPrecedence) {
  EXPECT_EQ(lines("!define(N, 3)\nx = N * N"), "x = 3 * 3\n");
  EXPECT_EQ(lines("!define(N, 1 + 2)\nx = N * 2"), "x = ( 1 + 2 ) * 2\n");
  EXPECT_EQ(lines("!define(IMG, r[A])\n!define(pe.add, core.add)\nIMG = pe.add(IMG, 1)"),
            "r [ A ] = core.add ( r [ A ] , 1 )\n");
  EXPECT_EQ(lines("!define(ARGS, 1, 2)\nf(ARGS)"), "f ( 1 , 2 )\n");
  EXPECT_EQ(lines("!define(LESS, <)\nif(a, LESS, b)"), "if ( a , < , b )\n");
  EXPECT_EQ(lines("!define(A, B)\n!define(B, A)\nx = A"), "x = A\n");
  EXPECT_EQ(lines("!define(N, 1)\nx = N\n!define(N, 2)\nx = N"), "x = 1\nx = 2\n");
  EXPECT_EQ(lines("x = SURFACE_WIDTH + SURFACE_HEIGHT"), "x = 16 + 9\n");
}

TEST(Preprocessor, LinesHaveALimit) {
  std::string sum = "x = 1";
  for (int i = 0; i < 10'000; ++i) sum += " + 1";
  EXPECT_EQ(errors(sum), "src/main.aps:1:1: error: this line has 20003 words; the limit is 20000\n");
  EXPECT_EQ(
      errors("!define(ten, a a a a a a a a a a)\n!define(more, ten ten ten ten ten ten ten ten ten ten)\n"
             "!define(most, more more more more more more more more more more)\n"
             "x = most most most most most most most most most most most most most most most most most most "
             "most most most"),
      "src/main.aps:4:1: error: the defines in this line grow it beyond 20000 words or 64 levels\n");
}

TEST(Preprocessor, Conditions) {
  const std::string body = "\na\n!else\nb\n!endif\n";
  EXPECT_EQ(lines("!if(1, <, 2)" + body), "a\n");
  EXPECT_EQ(lines("!if(1, >=, 2)" + body), "b\n");
  EXPECT_EQ(lines("!if(SURFACE_WIDTH == 16 && SURFACE_HEIGHT < 10)" + body), "a\n");
  EXPECT_EQ(lines("!define(MODE, 'fast')\n!if(MODE, ==, 'fast')" + body), "a\n");
  EXPECT_EQ(lines("!if('fast', !=, 'fast')" + body), "b\n");
  EXPECT_EQ(lines("!if(0)\n!if(1)\na\n!else\nb\n!endif\n!else\nc\n!endif"), "c\n");
  EXPECT_EQ(lines("!if(1)\n!if(0)\na\n!endif\nd\n!else\nc\n!endif"), "d\n");
  EXPECT_EQ(lines("!if(0)\n!if(nothing, <, 3)\n!endif\n!include('none')\n!endif\nx"), "x\n");
  EXPECT_EQ(lines("!if(-(2 + 1) * 2 + 7 % 4, ==, -3)" + body), "a\n");
}

TEST(Preprocessor, ConditionsCompareAndCalculateAsCpp) {
  const auto check = [](const std::string& condition, bool expected) {
    EXPECT_EQ(lines("!if(" + condition + ")\na\n!else\nb\n!endif\n"), expected ? "a\n" : "b\n") << condition;
  };
  for (int a = -2; a <= 2; ++a)
    for (int b = -2; b <= 2; ++b) {
      const std::string left = std::to_string(a), right = std::to_string(b);
      const auto compare = [&](const std::string& op, bool expected) {
        check(left + " " + op + " " + right, expected);
        check(left + ", " + op + ", " + right, expected);
      };
      compare("<", a < b);
      compare("<=", a <= b);
      compare(">", a > b);
      compare(">=", a >= b);
      compare("==", a == b);
      compare("!=", a != b);
      const auto pair = [&](const char* op) { return left + " " + op + " " + right; };
      check(pair("||"), a != 0 || b != 0);
      check(pair("or"), a != 0 || b != 0);
      check(pair("&&"), a != 0 && b != 0);
      check(pair("and"), a != 0 && b != 0);
      check("not " + pair("<"), a >= b);
      check("not " + left + " or not +" + right + " and 1", a == 0 || b == 0);
      check(pair("+") + " == " + std::to_string(a + b), true);
      check(pair("-") + " == " + std::to_string(a - b), true);
      check(pair("*") + " == " + std::to_string(a * b), true);
      if (b != 0) check(pair("/") + " * " + right + " == " + left, true);
      if (b != 0) check(pair("%") + " == " + std::to_string(((a % b) + b) % b), true);
    }
}

TEST(Preprocessor, IncludeSearchOrder) {
  EXPECT_EQ(lines("!include('a.aps')\nz",
                  {{"src/a.aps", "beside"}, {"more/a.aps", "path"}, {"lib/a.aps", "library"}}),
            "beside\nz\n");
  EXPECT_EQ(lines("!include('a.aps')", {{"more/a.aps", "path"}, {"lib/a.aps", "library"}}), "path\n");
  EXPECT_EQ(lines("!include('a.aps')", {{"lib/a.aps", "library"}}), "library\n");
  EXPECT_EQ(
      lines("!include('sub/a.aps')", {{"src/sub/a.aps", "!include('b.aps')"}, {"src/sub/b.aps", "near"}}),
      "near\n");
  EXPECT_EQ(lines("!include('../a.aps')\n!include('../a.aps')", {{"a.aps", "twice"}}), "twice\ntwice\n");
  EXPECT_EQ(
      errors("!include('a.aps')", {{"src/a.aps", "!include('./b.aps')"}, {"src/b.aps", "!include('a.aps')"}}),
      "src/b.aps:1:1: error: 'src/a.aps' includes itself: src/a.aps -> src/b.aps -> src/a.aps\n");
  EXPECT_EQ(
      errors("!include('a.aps')"),
      "src/main.aps:1:10: error: there is no file 'a.aps' (looked for src/a.aps, more/a.aps, lib/a.aps)\n");
}

TEST(Preprocessor, IncludeDepthIsLimited) {
  std::map<std::string, std::string> files;
  for (int i = 0; i < 40; ++i) {
    files["src/f" + std::to_string(i)] = "!include('f" + std::to_string(i + 1) + "')\n";
  }
  EXPECT_EQ(errors("!include('f0')", files),
            "src/f30:1:1: error: files include each other more than 32 deep\n");
}

TEST(Preprocessor, LoopsAndParametersAreLimited) {
  std::string loops, names;
  for (int i = 0; i < 5000; ++i) loops += "!for(i, 0, 0)\n";
  EXPECT_EQ(errors(loops), "src/main.aps:65:1: error: '!for' is nested deeper than 64\n");
  for (int i = 0; i <= 1000; ++i) names += (i > 0 ? ", $p" : "$p") + std::to_string(i);
  EXPECT_EQ(errors("!macro_def\nm(" + names + ")\n!macro_begin\n!macro_end\n"),
            "src/main.aps:2:1: error: the macro 'm' has 1001 parameters: 1000 at most\n");
}

TEST(Preprocessor, Declarations) {
  EXPECT_EQ(lines("!register(A, B)\nx"), "make A  16x9\nmake B  16x9\nx\n");
  EXPECT_EQ(lines("!create('A', REGISTER)\n!create('B', REGISTER, 4 * 2, SURFACE_HEIGHT)"),
            "make A REGISTER 16x9\nmake B REGISTER 8x9\n");
  EXPECT_EQ(lines("!object('PE', 'pe', 3, 'SIM_REGISTER')\n!default_palette(255, 'grey')\n!max_addr(10)"),
            "class PE pe\n");
}

TEST(Preprocessor, MacrosOverloadByArgumentsAndResult) {
  const std::string text =
      "!macro_def\nf\n!macro_begin\n!macro_end\n!macro_def f($a)\n!macro_begin\n!macro_end\n"
      "!macro_def\n$y = f($a)\n!macro_begin\n!macro_end\n";
  EXPECT_EQ(lines(text), "");
  EXPECT_EQ(lines(text + text), "");  // the same again is no error
  EXPECT_EQ(errors(text + "!macro_def\n$z = f($b)\n!macro_begin\nx\n!macro_end\n"),
            "src/main.aps:13:6: error: the macro '$z = f($b)' is defined already\n");
}

}  // namespace
}  // namespace apron::syntax
