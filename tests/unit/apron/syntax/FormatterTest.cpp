// The layout of programs: what it is, that it is a fixed point, and that it changes no word and no comment.
#include "apron/syntax/Formatter.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>
#include <string>

#include "apron/syntax/Diagnostic.h"
#include "apron/syntax/Lexer.h"
#include "apron/syntax/SourceManager.h"

namespace apron::syntax {
namespace {

bool lexes(const std::string& text) {
  SourceManager sources;
  Diagnostics diagnostics;
  lex(sources, sources.add_file("", text, {}), diagnostics);
  return diagnostics.empty();
}

// A layout that changes the tokens is not used; no text may have one.
void expect_keeps_tokens(const std::string& text) {
  if (lexes(text)) {
    EXPECT_EQ(format_source(text), format_unchecked(text)) << text;
  }
}

TEST(Format, SpacesTokens) {
  EXPECT_EQ(format_source("A=B+1\n"), "A = B + 1\n");
  EXPECT_EQ(format_source("  A  =  -B*(C>0.5)  \n"), "A = -B * (C > 0.5)\n");
  EXPECT_EQ(format_source("x=a- -b\n"), "x = a - -b\n");
  EXPECT_EQ(format_source("x=(-a)%b\n"), "x = (-a) % b\n");
  EXPECT_EQ(format_source("if(a,<,b)\nendif\n"), "if(a, <, b)\nendif\n");
  EXPECT_EQ(format_source("y=f( a ,r[ B ] , -1 )\n"), "y = f(a, r[B], -1)\n");
  EXPECT_EQ(format_source("x=not a>b and(c or d)\n"), "x = not a > b and (c or d)\n");
  EXPECT_EQ(format_source("x=and(a,not(b))\n"), "x = and(a, not(b))\n");
  EXPECT_EQ(format_source("x=!a&&!b!=c\n"), "x = !a && !b != c\n");
  EXPECT_EQ(format_source("x=1.5e-3+0x1F-2.0f\n"), "x = 1.5e-3 + 0x1F - 2.0f\n");
  EXPECT_EQ(format_source("x=a<<2>>b&c|~d^e\n"), "x = a << 2 >> b & c | ~d ^ e\n");
  EXPECT_EQ(format_source("!operator( >> ,core.sub)\nx=( & & a)\n"), "!operator(>>, core.sub)\nx = (& &a)\n");
  EXPECT_EQ(format_source("!operator( - ,core.sub)\n!include( 'a  b.aps' )\n"),
            "!operator(-, core.sub)\n!include('a  b.aps')\n");
  EXPECT_EQ(format_source("plugin(?,3,$y)\n"), "plugin(?, 3, $y)\n");
  EXPECT_EQ(format_source("jump( #top )\n#top\n"), "jump(#top)\n#top\n");
  EXPECT_EQ(format_source("println('// no comment')//one\n"), "println('// no comment')  //one\n");
}

TEST(Format, IndentsBlocksAndAlignsComments) {
  EXPECT_EQ(format_source("if(a)\nb = 1\nelse\nwhere(A)\n// here\nA = 1\nendwhere\nendif\n"),
            "if(a)\n  b = 1\nelse\n  where(A)\n    // here\n    A = 1\n  endwhere\nendif\n");
  EXPECT_EQ(format_source("a = 1 // one\nlonger = 22    // two\n\nb = 3     // three\n"),
            "a = 1        // one\nlonger = 22  // two\n\nb = 3  // three\n");
  EXPECT_EQ(format_source("!if(1)\n!define(X,1)\n!endif\n"), "!if(1)\n  !define(X, 1)\n!endif\n");
  EXPECT_EQ(format_source("\n\n\na = 1\r\n\n\n\nb = 2\n\n"), "a = 1\n\nb = 2\n");
  EXPECT_EQ(format_source("a = 1 + \\\n2 - \\ // why\n-3\n"), "a = 1 + \\\n    2 - \\  // why\n    -3\n");
}

// A macro may have the name of a block: its calls have no closing word, and its definition is a pattern.
TEST(Format, LeavesMacrosNamedLikeBlocksAlone) {
  EXPECT_EQ(format_source("where(A)\nmov(B, A)\nall\nmov(B, A)\n"), "where(A)\nmov(B, A)\nall\nmov(B, A)\n");
  EXPECT_EQ(format_source("if(a)\nwhere(A)\nall\nendif\nb = 1\n"),
            "if(a)\n  where(A)\n  all\nendif\nb = 1\n");
  EXPECT_EQ(
      format_source("!macro_def\nwhere($a)\n!macro_begin\nif($a)\nb = 1\nendif\n!macro_end\nendwhere\n"),
      "!macro_def\nwhere($a)\n!macro_begin\nif($a)\n  b = 1\nendif\n!macro_end\nendwhere\n");
  EXPECT_EQ(format_source("where(A)\nwhere(B)\nC = 1\nelsewhere\nC = 2\nendwhere\n"),
            "where(A)\nwhere(B)\n  C = 1\nelsewhere\n  C = 2\nendwhere\n");
  EXPECT_EQ(format_source("else\nendif\nif(a)\n"), "else\nendif\nif(a)\n");
}

TEST(Format, KeepsTextThatDoesNotLex) {
  EXPECT_EQ(format_source("a  = 'open\n"), "a  = 'open\n");
  EXPECT_EQ(format_source(""), "");
}

TEST(Format, IsIdempotentOnEveryScript) {
  int scripts = 0;
  for (const char* directory : {"scripts", "tests/apron"})
    for (const auto& entry :
         std::filesystem::recursive_directory_iterator(std::filesystem::path(APRON_SOURCE) / directory)) {
      if (entry.path().extension() != ".aps") continue;
      std::ostringstream text;
      text << std::ifstream(entry.path()).rdbuf();
      const std::string once = format_source(text.str());
      EXPECT_EQ(format_source(once), once) << entry.path();
      expect_keeps_tokens(text.str());
      const auto comments = [](const std::string& all) {
        std::string words;
        for (const char c : all)
          if (c != ' ' && c != '\n' && c != '\r') words += c;
        return words;
      };
      EXPECT_EQ(comments(once), comments(text.str())) << entry.path();
      ++scripts;
    }
  EXPECT_GT(scripts, 30);
}

// Random words with random blanks between them: the layout depends on the words alone.
TEST(Format, IsIdempotentOnRandomTokens) {
  std::mt19937 rng(3);
  const std::vector<std::string> words = {
      "a",  "if", "endif", "while", "endwhile", "(",    ")",      "[",       "]",   ",",     "=",
      "+",  "-",  "*",     "!",     "not",      "and",  "<=",     "!=",      "1.5", "'t x'", "$p",
      ":l", "#m", "?",     "!if",   "\n",       "\n",   "// c\n", " \\\n",   ":#n", "else",  ".5",
      "<<", ">>", "<",     ">",     ">=",       "==",   "&",      "|",       "^",   "~",     "&&",
      "||", "##", "/",     "%",     "0x1F",     "2.0f", "1e-3",   "!include"};
  for (int round = 0; round < 3000; ++round) {
    std::string text;
    for (int i = 0; i < 12; ++i) {
      text += words[rng() % words.size()];
      text += rng() % 2 == 0 ? " " : "  ";
    }
    const std::string once = format_source(text);
    EXPECT_EQ(format_source(once), once) << text;
    expect_keeps_tokens(text);
  }
}

}  // namespace
}  // namespace apron::syntax
