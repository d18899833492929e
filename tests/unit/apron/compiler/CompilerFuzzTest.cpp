// Random damage to correct programs: no crash, no hang, and whatever is accepted passes the verifier.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "apron/program/LocalityCheck.h"
#include "tests/unit/apron/compiler/CompileText.h"

namespace apron::compiler {
namespace {

const std::vector<std::string>& corpus() {
  static const std::vector<std::string> kPrograms = {
      R"(!register(O, E, D)
!define(UP, 4)
surface.step
O = surface.sense('proximity') >= 0
E = min(O, near.min(O, 4))
D = select(E, 99, 0)
repeat(12)
  where(E > 0)
    D = 1 + min(min(north(D), south(D)), min(east(D), west(D)))
  elsewhere
    D = 0
  endwhere
endrepeat
surface.actuate('height', UP - UP * (D > 2))
)",
      R"(!object('PE','pe',1,'SIM_REGISTER')
!create('A', PE)
!create('B', PE, SURFACE_WIDTH, SURFACE_HEIGHT)
!create('k', VARIABLE)
!operator(+, pe.add)
!macro_def
$y = pe.add($a, $b)
!macro_begin
$y = $a + $b
!macro_end
!macro_def
pe.skip($a, $op, $b)
!macro_begin
!if(SURFACE_WIDTH, >, 4)
if($a, $op, $b)
jump(:#out)
endif
!else
nop
!endif
:t = pe[A] * 2
pe[B] = :t
:#out
!macro_end
pe[A] = pe[B] + 3 + pe[0]
pe.skip(k, <, 3)
v[k] = globalsum(pe[A])
)",
      R"(i = 0
x = -3.5e-2 \
  + 0x1F
#again
i = i + 1
callif(i, >=, 3, #sub)
jumpif(i < 10, #again)
for(j, 10, 1, -2)
  while(i > j)
    i = i - 1
    if(i == 4)
      break
    else
      continue
    endif
  endwhile
endfor
println('i = ', i, ' x = ', x)
end
#sub
x = math.sqrt(x * x) % 3
return
)",
      R"(!include('lib.aps')
!register(A, B)
!create('S', REGISTER, 3, 2)
r[S] = cell.x + cell.y
A = shift(B, 1, -2) + rotate.east(A, 3)
boundary('wrap')
mask.on(A > 2)
B = twice(twice(A) or not B)
mask.off
sim.slider.add('gain', 0, 2, 1)
g = sim.slider.get('gain')
pixel.set(A, 1, 2, g)
mac(A, B, g)
n = pixel.get(A, 0, reg.getWidth(A) - 1)
io.array.save(B, 'b.npy')
)"};
  return kPrograms;
}

const std::map<std::string, std::string>& library() {
  static const std::map<std::string, std::string> kFiles = {
      {"lib.aps", "!macro_def\n$y = twice($a)\n!macro_begin\n:t = $a\n$y = :t + :t\n!macro_end\n"}};
  return kFiles;
}

class Mutator {
 public:
  explicit Mutator(std::uint32_t seed) : random_(seed) {}

  std::string mutate() {
    std::string text = corpus()[pick(corpus().size())];
    for (std::size_t edits = 1 + pick(4); edits > 0; --edits) edit(text);
    return text;
  }

 private:
  std::size_t pick(std::size_t bound) { return bound == 0 ? 0 : random_() % bound; }

  std::string word() {
    static constexpr std::array<std::string_view, 60> kWords = {"where(",
                                                                "endwhere",
                                                                "elsewhere",
                                                                "if(",
                                                                "endif",
                                                                "else",
                                                                "while(",
                                                                "endwhile",
                                                                "for(",
                                                                "endfor",
                                                                "repeat(",
                                                                "break",
                                                                "continue",
                                                                "return",
                                                                "end",
                                                                "jump(",
                                                                "call(",
                                                                "#again",
                                                                "#sub",
                                                                "#l",
                                                                ":t",
                                                                ":#out",
                                                                "$a",
                                                                "$y",
                                                                "!if(",
                                                                "!endif",
                                                                "!else",
                                                                "!define(",
                                                                "!macro_def\n",
                                                                "!macro_begin\n",
                                                                "!macro_end\n",
                                                                "!include('main.aps')",
                                                                "!register(",
                                                                "(",
                                                                ")",
                                                                ",",
                                                                "=",
                                                                "<",
                                                                "-",
                                                                "+",
                                                                "*",
                                                                "not ",
                                                                " and ",
                                                                "\n",
                                                                "\\\n",
                                                                "'",
                                                                "1e38",
                                                                "0",
                                                                "-1",
                                                                "A",
                                                                "r[S]",
                                                                "near.sum(",
                                                                "cell.x",
                                                                "north(",
                                                                "mask.on(",
                                                                "[",
                                                                "]",
                                                                "\xC3\xA9",
                                                                "\xFF",
                                                                "pe.add("};
    return std::string(kWords[pick(kWords.size())]);
  }

  void edit(std::string& text) {
    const std::size_t at = pick(text.size() + 1);
    const std::size_t length = std::min(pick(12), text.size() - at);
    const std::string& other = corpus()[pick(corpus().size())];
    const std::size_t from = pick(other.size());
    switch (pick(7)) {
      case 0:
        text.erase(at, length);
        break;
      case 1:
        text.insert(at, word());
        break;
      case 2:
        if (at < text.size()) text[at] = static_cast<char>(pick(256));
        break;
      case 3:
        text.insert(at, other.substr(from, pick(80)));
        break;
      case 4:
        swap_lines(text);
        break;
      case 5:
        text.replace(at, length, word());
        break;
      default:
        drop_line(text);
    }
  }

  static std::vector<std::size_t> starts(const std::string& text) {
    std::vector<std::size_t> list{0};
    for (std::size_t i = 0; i < text.size(); ++i) {
      if (text[i] == '\n') list.push_back(i + 1);
    }
    return list;
  }

  void drop_line(std::string& text) {
    const auto lines = starts(text);
    const std::size_t at = lines[pick(lines.size())];
    text.erase(at, text.find('\n', at) - at);
  }

  void swap_lines(std::string& text) {
    const auto lines = starts(text);
    const std::size_t from = lines[pick(lines.size())];
    const std::string line = text.substr(from, text.find('\n', from) - from) + "\n";
    text.insert(lines[pick(lines.size())], line);
  }

  std::mt19937 random_;
};

TEST(Fuzz, CorpusCompiles) {
  for (const std::string& text : corpus()) {
    const CompileResult result = compile_text(text, library());
    EXPECT_TRUE(result.program) << errors(result);
  }
}

TEST(Fuzz, DamagedProgramsFailOrVerify) {
  constexpr int kRounds = 1000;
  Mutator mutator(20240917);
  int accepted = 0;
  int refused = 0;
  for (int i = 0; i < kRounds; ++i) {
    const std::string text = mutator.mutate();
    const CompileResult result = compile_text(text, library());
    ASSERT_EQ(result.program.has_value(), result.diagnostics.empty()) << text;
    ASSERT_LE(result.diagnostics.size(), syntax::kMaxErrors) << text;
    if (!result.program) {
      ++refused;
      const std::string report = errors(result);
      ASSERT_NE(report.find("error: "), std::string::npos) << text;
      // The verifier is the last line of defence: the compiler must not need it.
      ASSERT_EQ(report.find("error: instruction "), std::string::npos) << report << text;
      continue;
    }
    ++accepted;
    ASSERT_EQ(program::verify(*result.program), "") << text;
    ASSERT_FALSE(program::disassemble(*result.program).empty());
    static_cast<void>(program::find_nonlocal_instructions(*result.program));
  }
  EXPECT_GT(accepted, kRounds / 20);
  EXPECT_GT(refused, kRounds / 4);
}

TEST(Fuzz, DeepAndLongInputsTerminate) {
  const auto repeated = [](std::string_view part, int times) {
    std::string text;
    for (int i = 0; i < times; ++i) text += part;
    return text;
  };
  const std::string chain = [] {
    std::string text = "!define(D0, 1+1)\n";
    for (int i = 1; i < 60; ++i) {
      text += "!define(D" + std::to_string(i) + ", D" + std::to_string(i - 1) + " + D" +
              std::to_string(i - 1) + ")\n";
    }
    return text + "x = D59\n";
  }();
  const std::string doubling = [] {
    std::string text = "!macro_def\n$y = m0($a)\n!macro_begin\n$y = $a\n!macro_end\n";
    for (int i = 1; i < 60; ++i) {
      const std::string n = std::to_string(i);
      const std::string m = std::to_string(i - 1);
      text +=
          "!macro_def\n$y = m" + n + "($a)\n!macro_begin\n$y = m" + m + "($a) + m" + m + "($a)\n!macro_end\n";
    }
    return text + "x = m59(1)\n";
  }();
  const std::vector<std::string> inputs = {
      "x = " + repeated("(", 100000),
      "x = " + repeated("-", 100000) + "1",
      "x = 1" + repeated(" + 1", 100000),
      "x = " + repeated("abs(", 50000) + "1",
      "x = " + repeated("not ", 50000) + "1",
      repeated("if(1)\n", 20000),
      repeated("where(1)\n", 500),
      repeated("!if(1)\n", 50000),
      "!if(" + repeated("(", 50000),
      repeated("#l\n", 50000),
      repeated("v[", 50000),
      "!register(" + repeated("A,", 50000) + "B)",
      "x = " + repeated("0", 100000),
      repeated("\\\n", 100000),
      chain,
      doubling,
  };
  for (const std::string& text : inputs) {
    const CompileResult result = compile_text(text);
    EXPECT_FALSE(result.program && text.size() > 200000) << text.substr(0, 40);
    if (result.program) {
      EXPECT_EQ(program::verify(*result.program), "");
    }
    EXPECT_LT(errors(result).size(), 200000U) << text.substr(0, 40);
    const std::string limit = "expands more than 100000 macros", found = errors(result);
    EXPECT_EQ(found.find(limit), found.rfind(limit)) << "a limit is reported once";
  }
}

}  // namespace
}  // namespace apron::compiler
