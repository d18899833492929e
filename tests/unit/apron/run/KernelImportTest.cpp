// What `apron import` makes of C++ kernels and of instruction lists, what it reports, and that the result
// computes what the kernel computes.
#include "apron/run/import/KernelImport.h"

#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <random>
#include <sstream>

#include "apron/compiler/Compiler.h"
#include "tests/unit/apron/vm/TestProgram.h"

namespace apron::run {
namespace {

std::string library_text() {
  std::ostringstream text;
  text << std::ifstream(APRON_SCAMP_LIBRARY).rdbuf();
  return text.str();
}

ImportedKernels import_text(const std::string& text, const std::string& picture = "") {
  static const KernelVocabulary vocabulary = read_vocabulary(library_text());
  return import_kernels(text, vocabulary, {"kernel.cpp", picture, {}});
}

// Without the lines that every program begins with.
std::string body(const ImportedKernels& imported) {
  const std::string head = "// Imported from kernel.cpp by apron import.\n!include('scamp5.aps')\n";
  EXPECT_EQ(imported.program.substr(0, head.size()), head);
  return imported.program.substr(head.size());
}

std::string notes(const ImportedKernels& imported) {
  std::string text;
  for (const ImportNote& note : imported.notes)
    text += std::to_string(note.line) + (note.in_kernel ? " kernel: " : " host: ") + note.text + '\n';
  return text;
}

constexpr const char* kSobel = R"(
#include <scamp5.hpp>
using namespace SCAMP5_PE;
int main(){
  vs_init();
  while(1){
    scamp5_kernel_begin();
      get_image(C, D);
      movx(A,C,north); movx(B,C,south);
      add(A,A,B);
      add(A,A,C); add(A,A,C);
      movx(B,A,east);
      movx(A,A,west);
      sub(B,B,A);
      abs(D,B);
    scamp5_kernel_end();
  }
}
)";

std::string repeated(const std::string& text, int count) {
  std::string all;
  for (int i = 0; i < count; ++i) all += text;
  return all;
}

// The program of a kernel file of unknown origin: no nesting is too deep for the stack, no macro takes all
// memory. (import_test.py has macros that double sixty times, which take a sanitizer twelve seconds.)
TEST(KernelImport, DeepTextIsLeftOut) {
  for (const char* statement : {"{", "if(1)", "while(1)", "if(1);else ", "for(;;){", "do{"})
    EXPECT_NO_THROW(import_text("int main(){" + repeated(statement, 2000) + "mov(A,B);")) << statement;
  for (const char* expression : {"(", "1?", "1?2:", "!", "f(", "1+(2*"})
    for (const char* before : {"int main(){ scamp5_in(A,", "const int x = ", "\n#if "})
      EXPECT_NO_THROW(import_text(before + repeated(expression, 5000) + "1);}\n")) << before << expression;
  EXPECT_NO_THROW(import_text("int main(){ int a; " + repeated("a = ", 40000) + "1; }"));
  const std::string calls = repeated("F(", 60) + "mov(A,B);" + repeated(")", 60);
  EXPECT_NO_THROW(import_text("#define F(x) x x\nint main(){ " + calls + "}\n"));
}

TEST(KernelImport, BracketsInMoreThanTwoHundredOthersAreRefusedInOneLine) {
  std::mt19937 random(7);
  for (int round = 0; round < 60; ++round) {
    const int depth = round == 0 ? 20000 : static_cast<int>(random() % 100) + 150, lines = 1 + random() % 5;
    std::string open, close;
    for (int i = 0; i < depth; ++i) {
      const std::size_t kind = round % 2 == 0 ? 0 : random() % 3;
      open += std::array{"(", "f(", "g["}[kind];
      close.insert(0, std::array{")", ")", "]"}[kind]);
    }
    const std::string value = open + "1" + close;
    // With the brackets of main and of scamp5_in.
    const bool is_too_deep = depth + 2 > 200;
    const std::string refusal = std::to_string(lines + 1) + " host: brackets are nested more than 200 deep\n";
    const std::string text = "#define M(x) scamp5_in(A, x)\n" + repeated("\n", lines - 1) + "int main(){ ";
    for (const std::string& written :
         {text + "scamp5_in(A, " + value + "); }", text + "M(" + value + "); }"}) {
      const std::string found = notes(import_text(written));
      EXPECT_EQ(found == refusal, is_too_deep) << depth << found;
      EXPECT_EQ(found.find("200 deep") != std::string::npos, is_too_deep);
    }
  }
}

TEST(KernelImport, TranslatesKernelsOfTheTutorials) {
  const ImportedKernels imported = import_text(kSobel);
  EXPECT_EQ(
      body(imported),
      "!define(FRAMES, 1)\n\nrepeat(FRAMES)\n  get_image(C, D)\n  movx(A, C, north)\n  movx(B, C, south)\n"
      "  add(A, A, B)\n  add(A, A, C)\n  add(A, A, C)\n  movx(B, A, east)\n  movx(A, A, west)\n"
      "  sub(B, B, A)\n  abs(D, B)\nendrepeat\n");
  EXPECT_EQ(notes(imported), "5 host: 'vs_init' runs on the controller or host\n");
  EXPECT_EQ(imported.instructions, 10U);
  EXPECT_NE(import_text(kSobel, "p.png").program.find("repeat(FRAMES)\n  PIX = io.image.open('p.png')\n"),
            std::string::npos);
}

TEST(KernelImport, FunctionsMacrosAndKernelObjectsBecomeMacros) {
  const ImportedKernels imported = import_text(
      "#define SPAN 3\n#define twice(X, Y) {\\\n  mov(F, Y);\\\n  add(X, Y, F);\\\n}\n"
      "#define west(X,Y) {mov(X,Y,west);}\n"
      "void edge(AREG out, const areg_t& from){\n  scamp5_kernel_begin();\n  subx(out, from, east, from);\n"
      "  twice(out, out);\n  scamp5_kernel_end();\n}\n"
      "scamp5_kernel blur([]{\n  using namespace scamp5_kernel_api;\n  divq(B, A);\n  west(A, B);\n});\n"
      "void host_only(){ printf(\"x\"); }\n"
      "int main(){ scamp5_launch_kernel(blur); edge(B, A); }\n");
  EXPECT_EQ(
      body(imported),
      "!define(SPAN, 3)\n\n"
      "// twice, line 2\n!macro_def\ntwice($X, $Y)\n!macro_begin\nmov(F, $Y)\nadd($X, $Y, F)\n!macro_end\n\n"
      "// edge, line 7\n!macro_def\nedge($out, $from)\n!macro_begin\nsubx($out, $from, east, $from)\n"
      "twice($out, $out)\n!macro_end\n\n"
      "// blur, line 13\n!macro_def\nblur\n!macro_begin\ndivq(B, A)\nmov(A, B, west)\n!macro_end\n\n"
      "blur\nedge(B, A)\n");
  EXPECT_EQ(notes(imported), "18 host: the function 'host_only' has no instruction of the chip\n");
}

TEST(KernelImport, AFunctionThatAnExpressionNeedsIsNotLeftOut) {
  const ImportedKernels imported = import_text(
      "int half(int v) { return v / 2; }\nint unused(int v) { return v; }\n"
      "int main() { int n = half(9); scamp5_in(A, n); }\n");
  EXPECT_NE(imported.program.find("n = half(9)"), std::string::npos) << imported.program;
  EXPECT_EQ(notes(imported), "2 host: the function 'unused' has no instruction of the chip\n");
}

TEST(KernelImport, NamesOfTypesAreTheTypes) {
  const ImportedKernels imported = import_text(
      "typedef unsigned char byte;\nusing small = const byte;\ntypedef const dreg_t& Digital;\n"
      "void keep(Digital out, Digital in) { MOV(out, in); }\n"
      "int main() { byte b = 250; b += 10; small s = byte(257); keep(R5, R6); scamp5_in(A, b + s); }\n");
  EXPECT_NE(imported.program.find("b = cpp.unsigned(b + 10, 8)"), std::string::npos) << imported.program;
  EXPECT_NE(imported.program.find("keep(R5, R6)"), std::string::npos) << imported.program;
  EXPECT_EQ(notes(imported), "");
}

TEST(KernelImport, KernelsWithoutMainRunInTheOrderOfTheText) {
  const std::string text =
      import_text(
          "void one(){ scamp5_kernel_begin(); res(A); scamp5_kernel_end(); }\n"
          "void two(){ one(); scamp5_kernel_begin(); mov(B, A); scamp5_kernel_end(); }\n")
          .program;
  EXPECT_EQ(text.substr(text.rfind("!macro_end")), "!macro_end\n\ntwo\n");
}

TEST(KernelImport, LoopsConditionsAndScalars) {
  const ImportedKernels imported = import_text(
      "int main(){\n  int n = 4, m, k = n * (2 + m);\n  int steps = 0b101;\n  for(int i = 0; i < 3; i++) { "
      "res(A); }\n"
      "  for(int i = 1; i <= steps; i += 2) scamp5_in(A, i * 2 - 1);\n"
      "  for(int i = 8; i > 0; --i) scamp5_in(B, -i);\n"
      "  if(steps > 3 && steps != 7) { all(); } else steps += 1;\n  while(steps < 9) steps++;\n}\n");
  EXPECT_EQ(body(imported),
            "!include('cpp.aps')\n\nn = 4\nm = 0\nk = n * (2 + m)\nsteps = 5\nrepeat(3)\n  "
            "res(A)\nendrepeat\nfor(i, 1, steps, "
            "2)\n  scamp5_in(A, cpp.signed(i * 2 - 1, 8))\nendfor\n"
            "for(i, 8, 1, -1)\n  scamp5_in(B, -i)\nendfor\nif(steps > 3 && steps != 7)\n  all\nelse\n"
            "  steps = steps + (1)\nendif\nwhile(steps < 9)\n  steps = steps + 1\nendwhile\n");
  EXPECT_EQ(notes(imported), "");
}

TEST(KernelImport, ExclusiveBoundsBecomeInclusive) {
  const ImportedKernels imported = import_text(
      "int main(){\n  for(int k = 2; k < 5; k++) scamp5_in(A, k);\n  for(int k = 0; k < SIZE; k++) "
      "scamp5_in(A, k);\n"
      "  for(int k = 5; k > 2; k--) scamp5_in(A, k);\n}\n");
  EXPECT_NE(imported.program.find("for(k, 2, 4)\n"), std::string::npos) << imported.program;
  EXPECT_NE(imported.program.find("for(k, 0, SIZE - 1)\n"), std::string::npos) << imported.program;
  EXPECT_NE(imported.program.find("for(k, 5, 3, -1)\n"), std::string::npos) << imported.program;
}

TEST(KernelImport, SlidersDirectionsAndOutput) {
  const ImportedKernels imported = import_text(
      "int main(){\n  vs_gui_add_slider(\"level\", -20, 127, 10, &level);\n  scamp5_in(E, level);\n"
      "  scamp5_kernel_begin();\n  DNEWS(S1, S0, south|east, 1);\n  scamp5_kernel_end();\n"
      "  scamp5_output_image(S1, display);\n  scamp5_in(F, other);\n}\n");
  EXPECT_EQ(body(imported),
            "!include('cpp.aps')\nsim.slider.add('level', -20, 127, 10)\nother = 0  // of the program around "
            "the kernels\n\n"
            "level = sim.slider.get('level')\nscamp5_in(E, cpp.signed(level, 8))\nCLR(RS, RW, RN, "
            "RE)\nSET(RS, RE)\n"
            "DNEWS1(S1, S0)\nsim.show(S1)\nscamp5_in(F, cpp.signed(other, 8))\n");
  EXPECT_EQ(notes(imported),
            "8 host: 'other' has no value in the kernels; it is 0\n"
            "8 host: 'other', which is the controller's, reaches an instruction or decides about it\n");
}

TEST(KernelImport, VariablesOfEnums) {
  const ImportedKernels imported = import_text(
      "enum class Mode : uint8_t { Idle, Run = 5 };\ntypedef enum { OFF, ON } state_t;\nenum Side { LEFT = "
      "2, RIGHT };\n"
      "void step(Mode m, const state_t s){ scamp5_in(A, (int)m + s); }\n"
      "int main(){\n  Mode m = Mode::Run;\n  state_t s{ON};\n  enum Side side = RIGHT;\n  Side other = "
      "LEFT;\n"
      "  step(m, s);\n  scamp5_in(B, side + other);\n}\n");
  EXPECT_EQ(notes(imported), "");
  EXPECT_NE(imported.program.find("m = 5\ns = 1\nside = 3\nother = 2\nstep(m, s)\n"), std::string::npos)
      << imported.program;
}

TEST(KernelImport, SlidersByTheirHandles) {
  const ImportedKernels imported = import_text(
      "vs_handle low;\nint high = 3;\nint main(){\n  auto on = vs_gui_add_switch(\"on\", true);\n"
      "  low = vs_gui_add_slider(\"low: \", -9, 9, 2);\n"
      "  auto top = vs_gui_add_slider(\"top: \", 0, 9, 3, &high);\n"
      "  scamp5_get_image(A, B, vs_gui_read_slider(VS_GUI_FRAME_GAIN));\n"
      "  int k = vs_gui_read_slider(low) + vs_gui_read_slider(top);\n"
      "  if (vs_gui_read_slider(on)) scamp5_in(C, k);\n}\n");
  EXPECT_EQ(body(imported),
            "!include('cpp.aps')\nsim.switch.add('on', 1)\nsim.slider.add('low', -9, 9, 2)\n"
            "sim.slider.add('high', 0, 9, 3)\nsim.slider.add('frame_gain', 1, 5, 1)\n\nhigh = 3\n"
            "high = sim.slider.get('high')\nscamp5_get_image(A, B, sim.slider.get('frame_gain'))\n"
            "k = sim.slider.get('low') + sim.slider.get('high')\nif(sim.switch.get('on'))\n"
            "  scamp5_in(C, cpp.signed(k, 8))\nendif\n");
}

// The lines of the errors.
std::string errors(const std::string& text) {
  std::string lines;
  for (const ImportNote& note : import_text(text).notes)
    if (note.severity == Severity::kError) lines += std::to_string(note.line) + ' ';
  return lines;
}

TEST(KernelImport, AValueThatIsLeftOutMustNotReachAnInstruction) {
  const std::string wrong[] = {
      "int main(){ uint8_t e[2];\nint x = e[0];\nscamp5_in(A, x); }",
      "int main(){ int x = 5;\nx = clock();\nx++;\nscamp5_in(A, x); }",
      "int main(){ int x = 5;\n{ int x = clock();\nscamp5_in(A, x); } }",
      "int main(){ int x = 0;\nwhile(1){ get_image(B);\nscamp5_in(A, x);\nx = clock(); } }",
      "void put(AREG y, int n){\nscamp5_in(y, n); }\nint main(){ int x = clock(); put(A, x); }",
      "void put(AREG y){\nres(y); }\nint main(){ int x = clock(); if(x > 3){ put(A); } }",
      "int get(int n){ return n; }\nint main(){ int x = clock();\nint k = get(x);\nscamp5_in(A, k); }",
      "void set(int& n){ n = clock(); }\nint main(){ int x = 1;\nset(x);\nscamp5_in(A, x); }",
      "int main(){ int e[3], k = 0;\nfor(int i = 0; i < 9; i++){\nif(e[i]) break;\nk++; }\nscamp5_in(A, k); "
      "}",
      "int main(){ int e[3];\nfor(int i = 0; i < 9; i++){\nif(e[i]) continue;\nmov(A, B); } }",
      "void put(int* e){\nif(e[0]) return;\nres(A); }\nint main(){ put(0); }",
      "int main(){ int n[2];\nn[0] = scamp5_global_count(R5, A, 1); }",
      "int main(){ int n[2];\nn[0] = scamp5_global_sum_sparse(A);\nMOV(R5, SELECT); }",
      "int main(){ int x = 1, k = 0;\nif(clock()) x = 2;\nif(x > 1) k = 1;\nscamp5_in(A, k); }"};
  for (const std::string& text : wrong) EXPECT_NE(errors(text), "") << text;
  const std::string right[] = {
      "int main(){ int x = 5;\nint t = clock();\nscamp5_in(A, x); }",
      "int main(){ int x = 5;\n{ int x = clock(); }\nscamp5_in(A, x); }",
      "int main(){ int on = 1; vs_on_gui_update(3, [&](int v){ on = v; });\nif(on) res(A); }",
      "int main(){ int n[2]; n[0] = scamp5_global_sum_sparse(A) + scamp5_global_count(R5); res(A); }",
      "int main(){ int t = 0;\nwhile(1){ get_image(A); if(clock()) break; t = clock(); int n = t * 2; } }",
      "int main(){ int n = 0, t = clock(); if(t > 3) n = scamp5_global_sum_64(A); }"};
  for (const std::string& text : right) EXPECT_EQ(errors(text), "") << text;
  EXPECT_EQ(errors(wrong[0]), "3 ");
  EXPECT_EQ(errors(wrong[4]), "2 ");
}

TEST(KernelImport, FirstValuesOfSwitches) {
  const std::string program =
      import_text(
          "int other(){ int on = 0; return on; }\n"
          "int main(){\n  int on = 1, level = 3;\n  vs_gui_add_switch(\"on\", on == 1, &on);\n  level = 7;\n"
          "  vs_gui_add_slider(\"level\", 0, 9, level, &level);\n  if(on) scamp5_in(A, level);\n}\n")
          .program;
  EXPECT_NE(program.find("sim.switch.add('on', 1)\nsim.slider.add('level', 0, 9, 7)\n"), std::string::npos)
      << program;
}

TEST(KernelImport, SwitchRunsFromItsLabelOn) {
  const ImportedKernels imported = import_text(
      "int main(){\n  int n = 4;\n  switch(n){ case 1: case 2: res(A); break; default: res(B); }\n}\n");
  EXPECT_EQ(
      body(imported),
      "\nn = 4\nvalue_1 = n\nreached = 0\nif(value_1 == 1 || value_1 == 2)\n  reached = 1\nendif\n"
      "if(reached)\n  res(A)\n  jump(#leave1)\nendif\nif((value_1 != 1 && value_1 != 2))\n  reached = 1\n"
      "endif\nif(reached)\n  res(B)\nendif\n#leave1\n");
  EXPECT_EQ(notes(imported), "");
}

TEST(KernelImport, DefaultArgumentsAndFirstValuesOfSliders) {
  const ImportedKernels imported = import_text(
      "void step(AREG y, int n = 3, int m = -1){ scamp5_in(y, n); scamp5_in(y, m); }\n"
      "int main(){\n  int level = 20;\n  vs_gui_add_slider(\"level\", 0, 127, level, &level);\n"
      "  step(A);\n  step(B, 5);\n  step(C, 5, level);\n  uint8_t box[4];\n  scamp5_in(A, box[1]);\n}\n");
  EXPECT_EQ(body(imported),
            "!include('cpp.aps')\nsim.slider.add('level', 0, 127, 20)\n\n// step, line "
            "1\n!macro_def\nstep($y, $n, $m)\n!macro_begin\n"
            "scamp5_in($y, cpp.signed($n, 8))\nscamp5_in($y, cpp.signed($m, 8))\n!macro_end\n\nlevel = "
            "20\nlevel = sim.slider.get('level')\n"
            "step(A, 3, -1)\nstep(B, 5, -1)\nstep(C, 5, level)\n");
  EXPECT_EQ(
      notes(imported),
      "8 host: 'box [ …' is code of the controller\n9 host: the array 'box' belongs to the controller\n");
}

TEST(KernelImport, NamesWhatItCannotTranslate) {
  const ImportedKernels imported = import_text(
      "scamp5_kernel_begin();\nmovx(A, B);\nmovy(A, B, north);\nadd(A, B, table[3]);\nint k = p->x;\n"
      "goto end;\nres(C);\nscamp5_kernel_end();\n");
  EXPECT_EQ(notes(imported),
            "2 kernel: 'movx' takes 3 arguments, not 2\n"
            "3 kernel: scamp5.aps has no instruction 'movy'; did you mean 'mov'?\n"
            "4 kernel: 'table' has no value in the kernels; it is 0\n"
            "4 kernel: '[' in an expression has no counterpart\n"
            "5 kernel: 'p' has no value in the kernels; it is 0\n"
            "5 kernel: '->' in an expression has no counterpart\n"
            "6 kernel: 'goto' has no counterpart\n");
  EXPECT_NE(imported.program.find("// not translated (line 2): 'movx' takes 3 arguments, not 2\n"),
            std::string::npos);
  EXPECT_NE(imported.program.find("\nres(C)\n"), std::string::npos);
}

TEST(KernelImport, NumbersKeepTheirFractionsAndExponents) {
  const auto value = [](const std::string& text) {
    const std::string program = body(import_text("int main(){ float f = " + text + "; scamp5_in(A, f); }"));
    const std::size_t first = program.find("f = ");
    return program.substr(first, program.find('\n', first) - first);
  };
  EXPECT_EQ(value("-0.5f"), "f = -0.5");
  EXPECT_EQ(value("-(2.25f + 3)"), "f = -5.25");
  EXPECT_EQ(value("1e-3"), "f = 1e-3");
  EXPECT_EQ(value("2.5e+2f"), "f = 2.5e+2");
  EXPECT_EQ(value("0x1p-2"), "f = 0.25");
  EXPECT_EQ(value("0x1e-3"), "f = 27");
  EXPECT_EQ(value("1'000 + 'a' + 017 + 0b11u"), "f = 1115");
  EXPECT_EQ(value("-0.0f"), "f = 0");
  EXPECT_EQ(notes(import_text("int main(){ scamp5_in(A, 3000000000); }")),
            "1 host: '3000000000' does not fit int\n");
  EXPECT_EQ(notes(import_text("int main(){ scamp5_in(A, 5_kg); }")),
            "1 host: '5_kg' in an expression has no counterpart\n");
}

TEST(KernelImport, NamesMeanWhatTheyMeanWhereTheyStand) {
  EXPECT_NE(import_text("#define N 3\nint f(int k){ return N + k; }\n#undef N\n#define N 5\n"
                        "int main(){ scamp5_in(A, f(0)); scamp5_in(B, N); }")
                .program.find("$result = N + $k"),
            std::string::npos);
  EXPECT_NE(
      import_text(
          "const int K = 3; int g(int n = K){ return n * 2; } int main(){ int K = 5; scamp5_in(A, g()); }")
          .program.find("g(3)"),
      std::string::npos);
  EXPECT_NE(
      notes(import_text("namespace x { const int k = 4; } const int k = 9; int main(){ scamp5_in(A, k); }"))
          .find("another 'k' is declared"),
      std::string::npos);
  EXPECT_NE(notes(import_text("int main(){ int a = 1, b = 2; (a > b ? a : b) = 7; scamp5_in(A, b); }"))
                .find("reaches an instruction"),
            std::string::npos);
}

TEST(KernelImport, TranslatesInstructionLists) {
  EXPECT_EQ(body(import_text("# generated\nB = north(A)\nA = add(A, B)\nA = div2(A)\nB = addneg(A, B)\r\n")),
            "\n// generated\nnorth(B, A)\nadd(A, A, B)\ndiv2(A, A)\naddneg(B, A, B)\n");
  EXPECT_EQ(body(import_text("// Kernel 1\nmovx(B, A, north);\nsub2x(C, A, east, east, B); neg(A, C);\n")),
            "\n// Kernel 1\nmovx(B, A, north)\nsub2x(C, A, east, east, B)\nneg(A, C)\n");
  EXPECT_EQ(notes(import_text("A = mul(A, B)\nA = add(A, B)\n")),
            "1 kernel: scamp5.aps has no instruction 'mul'\n");
}

TEST(KernelImport, SurvivesAnyText) {
  std::mt19937 rng(5);
  const std::vector<std::string> words = {"(",
                                          ")",
                                          "{",
                                          "}",
                                          "[",
                                          "]",
                                          ";",
                                          ",",
                                          "=",
                                          "for",
                                          "while",
                                          "if",
                                          "else",
                                          "int",
                                          "add",
                                          "A",
                                          "north",
                                          "3",
                                          "#define x(",
                                          "\n",
                                          "scamp5_kernel_begin()",
                                          "scamp5_kernel",
                                          "void f(",
                                          "\"",
                                          "'",
                                          "/*",
                                          "//",
                                          "::",
                                          "do",
                                          "&",
                                          "main"};
  for (int round = 0; round < 3000; ++round) {
    std::string text;
    for (int i = 0; i < 20; ++i) text += words[rng() % words.size()] + (rng() % 2 == 0 ? " " : "");
    EXPECT_FALSE(import_text(text).program.empty());
  }
}

// Compiled with the library and run on an image; returns the register D.
vm::test::Cells run_on_image(const std::string& program, std::uint32_t size, const vm::test::Cells& image) {
  const std::string file = testing::TempDir() + "apron_import_" + std::to_string(getpid()) + ".aps";
  std::ofstream(file) << program << "io.image.save(D, 'out')\n";
  compiler::CompileOptions options;
  options.file = file;
  options.width = options.height = size;
  options.library_path =
      std::string(APRON_SCAMP_LIBRARY).substr(0, std::string(APRON_SCAMP_LIBRARY).rfind('/'));
  syntax::DiskReader reader;
  compiler::CompileResult compiled = compiler::compile(options, reader);
  std::remove(file.c_str());
  if (!compiled.program) {
    ADD_FAILURE() << syntax::format_diagnostics(compiled.diagnostics, compiled.sources);
    return {};
  }
  vm::test::FakeHost host;
  host.sensors["in"] = image;
  vm::Vm vm(std::move(*compiled.program), {}, host);
  EXPECT_EQ(vm.run(), vm::Status::kEnded) << vm.error();
  return host.actuators["out"];
}

// |right - left| of the columns (1 2 1) of the image, 0 beyond the edge.
TEST(KernelImport, ImportedSobelEqualsItsDefinitionToTheBit) {
  constexpr int kSize = 37;
  std::mt19937 rng(9);
  vm::test::Cells image(kSize * kSize);
  for (float& cell : image) cell = static_cast<float>(113 + static_cast<int>(rng() % 30));
  const vm::test::Cells edges = run_on_image(import_text(kSobel, "in").program, kSize, image);
  ASSERT_EQ(edges.size(), image.size());
  const auto at = [&](int x, int y) {
    return x < 0 || y < 0 || x >= kSize || y >= kSize ? 0 : static_cast<int>(image[y * kSize + x]) - 128;
  };
  const auto column = [&](int x, int y) {
    return x < 0 || x >= kSize ? 0 : at(x, y - 1) + 2 * at(x, y) + at(x, y + 1);
  };
  for (int y = 0; y < kSize; ++y)
    for (int x = 0; x < kSize; ++x)
      ASSERT_EQ(edges[y * kSize + x], static_cast<float>(std::abs(column(x + 1, y) - column(x - 1, y))))
          << x << ' ' << y;
}

}  // namespace
}  // namespace apron::run
