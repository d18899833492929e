// Small programs and the instructions they become.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "tests/unit/apron/compiler/CompileText.h"

namespace apron::compiler {
namespace {

// Registers A, B, C are there; the final `end` is left out of the comparison.
std::string compiled(const std::string& text) {
  std::string lines = listing(compile_text("!register(A, B, C)\n" + text + "\n"));
  const std::string end = "end\n";
  if (lines.size() >= end.size() && lines.substr(lines.size() - end.size()) == end)
    lines.resize(lines.size() - end.size());
  return lines;
}

TEST(Listing, ShiftThenMinimumIsTwoInstructions) {
  EXPECT_EQ(compiled("A = min(A, shift.east(B))"), "shift $0, B, 1, 0\nmin A, A, $0\n");
}

TEST(Listing, FormsOfOneInstruction) {
  for (const char* form : {"A = B + 1", "A = add(B, 1)", "A = core.add(B, 1)", "add(A, B, 1)",
                           "core.add(A, B, 1)", "r[A] = REGISTER[B] + 1", "r[0] = r[1] + 1"})
    EXPECT_EQ(compiled(form), "add A, B, 1\n") << form;
  EXPECT_EQ(compiled("core.load(A, B)"), "copy A, B\n");
  EXPECT_EQ(compiled("mac(A, B, 2)"), "mac A, B, 2, A\n");
  EXPECT_EQ(compiled("A = mac(B, 2, C)"), "mac A, B, 2, C\n");
}

// Operands without calls are evaluated both, which needs no jump.
TEST(Listing, ShortCircuitsOnlyBeforeCalls) {
  EXPECT_EQ(compiled("a = 1\nb = 2\nc = a > 0 and b > 1"),
            "copy a, 1\ncopy b, 2\ngt $0, a, 0\ngt $1, b, 1\nand c, $0, $1\n");
  EXPECT_EQ(compiled("a = 1\nb = a and globalany(A)"),
            "copy a, 1\nne $0, a, 0\njump.eq $0, 0, @5\nglobalany $1, A\nne $0, $1, 0\ncopy b, $0\n");
}

TEST(Listing, ShiftsByScalars) {
  EXPECT_EQ(compiled("n = 2\nA = shift.west(B, n)"), "copy n, 2\nneg $0, n\nshift A, B, $0, 0\n");
  EXPECT_EQ(compiled("n = 2\nA = rotate(B, 1, n)"), "copy n, 2\nrotate A, B, 1, n\n");
}

TEST(Listing, LabelForms) {
  EXPECT_EQ(compiled("sim.label('stage')"), "sim.label.text 'stage', ''\n");
  EXPECT_EQ(compiled("sim.label('stage', 'two')"), "sim.label.text 'stage', 'two'\n");
  EXPECT_EQ(compiled("n = 2\nsim.label('n', n)"), "copy n, 2\nsim.label 'n', n\n");
  EXPECT_EQ(compiled("sim.label(1, 2, 'three', A)\nsim.label('map', A)"), "");
}

TEST(Listing, KeepsMacroUsesWithLocations) {
  const CompileResult result = compile_text(
      "!register(A)\n!macro_def\n$y = one($a)\n!macro_begin\n$y = $a + 1\n!macro_end\n"
      "!macro_def\ntwo($a)\n!macro_begin\n$a = one($a)\n!macro_end\nA = 0\ntwo(A)\n");
  ASSERT_TRUE(result.program) << errors(result);
  const program::Program& program = *result.program;
  ASSERT_EQ(program.expansions.size(), 3U);
  EXPECT_EQ(program.expansions[1].macro, "two");
  EXPECT_EQ(program.expansions[1].call_site.line, 13U);
  EXPECT_EQ(program.expansions[2].macro, "one");
  EXPECT_EQ(program.expansions[2].call_site.line, 10U);
  EXPECT_EQ(program.expansions[2].call_site.expansion, 1U);
  const auto add = std::find_if(program.code.begin(), program.code.end(),
                                [](const program::Instruction& i) { return i.op == program::Opcode::kAdd; });
  ASSERT_NE(add, program.code.end());
  EXPECT_EQ(program.source_locations[add->source_location].line, 5U);
  EXPECT_EQ(program.source_locations[add->source_location].expansion, 2U);
}

TEST(Listing, PrecedenceAndAssociation) {
  EXPECT_EQ(compiled("A = A + B * C"), "mul $0, B, C\nadd A, A, $0\n");
  EXPECT_EQ(compiled("A = (A + B) * C"), "add $0, A, B\nmul A, $0, C\n");
  EXPECT_EQ(compiled("A = A - B - C"), "sub $0, A, B\nsub A, $0, C\n");
  EXPECT_EQ(compiled("A = -A * B"), "neg $0, A\nmul A, $0, B\n");
  EXPECT_EQ(compiled("A = A > 1 and B < 2 or C"), "gt $0, A, 1\nlt $1, B, 2\nand $0, $0, $1\nor A, $0, C\n");
  EXPECT_EQ(compiled("A = not B > 1"), "gt $0, B, 1\nnot A, $0\n");
  EXPECT_EQ(compiled("A = !B > 1"), "not $0, B\ngt A, $0, 1\n");
  EXPECT_EQ(compiled("A = A xor B && C"), "and $0, B, C\nxor A, A, $0\n");
  EXPECT_EQ(compiled("A = A % B / C"), "mod $0, A, B\ndiv A, $0, C\n");
}

TEST(Listing, FoldsConstants) {
  EXPECT_EQ(compiled("A = B * (2 * 3 - 1)"), "mul A, B, 5\n");
  EXPECT_EQ(compiled("A = shift.north(B, 2 - 1)"), "shift A, B, 0, -1\n");
  EXPECT_EQ(compiled("A = B + SURFACE_WIDTH * SURFACE_HEIGHT"), "add A, B, 48\n");
  EXPECT_EQ(compiled("x = 0x10 + 1.5e1"), "copy x, 31\n");
  EXPECT_EQ(compiled("x = max(3, abs(-7)) > 6.5"), "copy x, 1\n");
  EXPECT_EQ(compiled("A = reg.getWidth(B) * 10 + reg.getHeight(B)"), "copy A, 86\n");
  EXPECT_EQ(compiled("x = -7 % 4"), "copy x, 1\n");
}

TEST(Listing, ShiftReadsOppositeNeighbour) {
  EXPECT_EQ(compiled("A = north(B)"), compiled("A = shift.south(B)"));
  EXPECT_EQ(compiled("A = east(B)"), compiled("A = shift.west(B)"));
  EXPECT_EQ(compiled("A = south(B)"), "shift A, B, 0, -1\n");
  EXPECT_EQ(compiled("A = west(B)"), "shift A, B, 1, 0\n");
  EXPECT_EQ(compiled("A = rotate.west(B, 3)"), "rotate A, B, -3, 0\n");
  EXPECT_EQ(compiled("A = shift(B, 2, -1)"), "shift A, B, 2, -1\n");
  EXPECT_EQ(compiled("A = shift.east(B, 0)"), "copy A, B\n");
}

TEST(Listing, ShiftIsOutOfPlace) {
  EXPECT_EQ(compiled("A = shift.north(A)"), "shift $0, A, 0, -1\ncopy A, $0\n");
  // The temporary that holds the sum is still needed as the source.
  EXPECT_EQ(compiled("A = shift.north(A + B)"), "add $0, A, B\nshift A, $0, 0, -1\n");
  EXPECT_EQ(compiled("A = shift.north(A + B) * 2"), "add $0, A, B\nshift $1, $0, 0, -1\nmul A, $1, 2\n");
}

TEST(Listing, NeighbourhoodsAreOutOfPlace) {
  EXPECT_EQ(compiled("A = near.max(B, 4)"), "near.max A, B, 4\n");
  EXPECT_EQ(compiled("A = near.sum(A, 8)"), "near.sum $0, A, 8\ncopy A, $0\n");
  EXPECT_EQ(compiled("A = A + near.any(A)"), "near.any $0, A, 4\nadd A, A, $0\n");
}

TEST(Listing, ReusesTemporaries) {
  const CompileResult result = compile_text(
      "!register(A)\nA = (A + 1) * (A + 2) + (A + 3) * (A + 4) + (A + 5) * (A + 6)\nA = (A * A) + (A - 1)\n");
  ASSERT_TRUE(result.program) << errors(result);
  EXPECT_EQ(result.program->registers.size(), 4U);
  for (const program::Instruction& in : result.program->code) {
    if (in.destination.kind != program::OperandKind::kRegister) continue;
    const bool temporary = result.program->registers[in.destination.index].name.front() == '$';
    EXPECT_EQ(in.masked, !temporary);
  }
}

TEST(Listing, Conditions) {
  EXPECT_EQ(compiled("x = 1\nif(x, <, 2)\nx = 3\nelse\nx = 4\nendif"),
            "copy x, 1\nunless.lt x, 2, @4\ncopy x, 3\njump @5\ncopy x, 4\n");
  EXPECT_EQ(compiled("x = 1\nif(x == 2)\nx = 3\nendif"), "copy x, 1\njump.ne x, 2, @3\ncopy x, 3\n");
  EXPECT_EQ(compiled("x = 1\nif(x != 2)\nx = 3\nendif"), "copy x, 1\njump.eq x, 2, @3\ncopy x, 3\n");
  EXPECT_EQ(compiled("x = 1\nif(x)\nx = 3\nendif"), "copy x, 1\njump.eq x, 0, @3\ncopy x, 3\n");
  EXPECT_EQ(compiled("x = 1\nif(x > 0 and x < 9)\nnop\nendif"),
            "copy x, 1\ngt $0, x, 0\nlt $1, x, 9\nand $0, $0, $1\njump.eq $0, 0, @6\nnop\n");
  EXPECT_EQ(compiled("if(1, >, 2)\nnop\nendif"), "jump @2\nnop\n");
  EXPECT_EQ(compiled("while(globalsum(A) > 0)\nA = A - 1\nendwhile"),
            "globalsum $0, A\nunless.gt $0, 0, @4\nsub A, A, 1\njump @0\n");
}

TEST(Listing, Loops) {
  EXPECT_EQ(compiled("for(i, 1, 3)\nnop\nendfor"),
            "copy i, 1\nunless.le i, 3, @5\nnop\nadd i, i, 1\njump @1\n");
  EXPECT_EQ(compiled("for(i, 3, 1, -1)\nnop\nendfor"),
            "copy i, 3\nunless.ge i, 1, @5\nnop\nadd i, i, -1\njump @1\n");
  EXPECT_EQ(
      compiled("s = 2\nfor(i, 0, 8, s)\nnop\nendfor"),
      "copy s, 2\ncopy $0, s\ncheck.for 0, 8, $0\ncopy i, 0\nsign $1, $0\nfloor $2, $0\nsub $2, $0, $2\n"
      "copy $3, 0\nabs $4, $0\ndiv $4, 8, $4\nmul $4, $4, 2.3841858e-07\nmin $4, $4, 0.25\n"
      "div $5, 8, $0\nadd $4, $5, $4\nfloor $4, $4\n"
      "unless.gt $2, 0, @18\nunless.le $3, $4, @28\njump @21\n"
      "sub $5, 8, i\nmul $5, $5, $1\nunless.ge $5, 0, @28\nnop\n"
      "add $3, $3, 1\nunless.gt $2, 0, @26\nmac i, $3, $0, 0\njump @15\nadd i, i, $0\njump @15\n");
  // The bound is taken once, and its temporary is not lost to the body.
  EXPECT_EQ(compiled("n = 4\nfor(i, 1, n + 1)\nx = (i + 1) * (i + 2)\nendfor"),
            "copy n, 4\nadd $0, n, 1\ncheck.for 1, $0, 1\ncopy i, 1\nunless.le i, $0, @10\nadd $1, i, 1\nadd "
            "$2, i, 2\n"
            "mul x, $1, $2\nadd i, i, 1\njump @4\n");
  EXPECT_EQ(compiled("repeat(2)\nif(1 < 2)\nbreak\nendif\ncontinue\nendrepeat"),
            "copy $0, 2\nunless.gt $0, 0, @6\njump @6\njump @4\nsub $0, $0, 1\njump @1\n");
}

TEST(Listing, LabelsAndRoutines) {
  EXPECT_EQ(compiled("x = 0\n#top\nx = x + 1\njumpif(x, <, 5, #top)\njumpif(x < 9, #top)\ncallif(x, >, 1, "
                     "#f)\nend\n#f\nreturn"),
            "copy x, 0\nadd x, x, 1\njump.lt x, 5, @1\njump.lt x, 9, @1\nunless.gt x, 1, @6\ncall "
            "@7\nend\nreturn\n");
  EXPECT_EQ(compiled("call(#f)\nend\n#f\nreturn"), "call @2\nend\nreturn\n");
}

TEST(Listing, Masks) {
  EXPECT_EQ(compiled("where(A > 0)\nwhere(B, <, 1)\nC = 1\nendwhere\nelsewhere\nC = 2\nendwhere"),
            "gt $0, A, 0\nmask.push $0\nlt $0, B, 1\nmask.push $0\ncopy C, 1\nmask.pop\nmask.else\ncopy C, "
            "2\nmask.pop\n");
  EXPECT_EQ(compiled("A = mask.if(B, >=, 2)\nmask.on(A)\nC = 1\nmask.off\nA = mask.not(mask.and(A, B))"),
            "ge A, B, 2\nmask.on A\ncopy C, 1\nmask.off\nand $0, A, B\nnot A, $0\n");
}

TEST(Listing, SurfaceHostAndCells) {
  EXPECT_EQ(
      compiled("A = surface.sense('proximity')\nsurface.sense(B, 'force')\nsurface.actuate('height', 4 - A)\n"
               "surface.step\nx = surface.time + surface.dt\nx = "
               "surface.tick\nif(surface.has('force'))\nnop\nendif"),
      "surface.sense A, 'proximity'\nsurface.sense B, 'force'\nsub $0, 4, A\nsurface.actuate 'height', $0\n"
      "surface.step\nsurface.time $1\nsurface.dt $2\nadd x, $1, $2\nsurface.tick x\nsurface.has $1, 'force'\n"
      "jump.eq $1, 0, @12\nnop\n");
  EXPECT_EQ(compiled("println('n = ', 3, ' ', A)\nprint"),
            "print.text 'n = '\nprint.value 3\nprint.text ' '\nprint.value A\nprint.line\n");
  EXPECT_EQ(
      compiled("A = cell.x + 8 * cell.row\npixel.set(A, 1, 2, 3)\nx = pixel.get(A, 1, 2)\nB = globalmax(A)"),
      "cell.x $0\ncell.y $1\nmul $1, 8, $1\nadd A, $0, $1\npixel.set A, 1, 2, 3\npixel.get x, A, 1, 2\n"
      "globalmax $2, A\ncopy B, $2\n");
  EXPECT_EQ(
      compiled("io.array.open(A, 'in.npy')\nB = io.image.open('in.png')\nio.array.save(A + B, 'out.csv')"),
      "io.array.open A, 'in.npy'\nio.image.open B, 'in.png'\nadd $0, A, B\nio.array.save $0, 'out.csv'\n");
  EXPECT_EQ(compiled("sim.slider.add('gain', 0, 2, 1)\nsim.switch.add('on')\nx = sim.slider.get('gain') * 2\n"
                     "sim.show(A)\nsim.label('text', x)"),
            "parameter $0, 'gain'\nmul x, $0, 2\nsim.show A, ''\nsim.label 'text', x\n");
  EXPECT_EQ(compiled("sim.display(A, 'map')\nsim.tile\nsim.tile(3, 2)\ntimer.start\ntimer.start('lap')\n"
                     "x = timer.read('lap') * 2\ntimer.stop\ntimer.reset\ntimer.wait(x)"),
            "sim.display A, 'map'\nsim.tile 0\nsim.tile 3\ntimer.start ''\ntimer.start 'lap'\n"
            "timer.read $0, 'lap'\nmul x, $0, 2\ntimer.stop ''\ntimer.reset ''\ntimer.wait x\n");
  EXPECT_EQ(compiled("boundary('reflect')\nboundary(2.5)"), "boundary 3, 0\nboundary 4, 2.5\n");
}

TEST(Listing, CellCoordinatesTakeShapeOfStatement) {
  EXPECT_EQ(listing(compile_text("!create('S', REGISTER, 3, 2)\nr[S] = cell.x * 2 + cell.y\n")),
            "cell.x $0\nmul $0, $0, 2\ncell.y $1\nadd S, $0, $1\nend\n");
}

TEST(Listing, ReportsReadBeforeWriteOnAllPaths) {
  // Written later in the text, but earlier on a path: by a jump back, and by a routine.
  EXPECT_EQ(compiled("jump(#b)\n#a\ny = x\nend\n#b\nx = 1\njump(#a)"),
            "jump @3\ncopy y, x\nend\ncopy x, 1\njump @1\n");
  EXPECT_EQ(compiled("call(#f)\ny = x\nend\n#f\nx = 1\nreturn"),
            "call @3\ncopy y, x\nend\ncopy x, 1\nreturn\n");
  EXPECT_NE(compiled("call(#f)\nend\n#g\nx = 1\nend\n#f\ny = x\nreturn").find("call"), std::string::npos);
  EXPECT_NE(compiled("y = x\nend\nx = 1").find("the scalar 'x' is read here"), std::string::npos);
}

// What a block holds has storage of its own only if a routine runs in it.
TEST(Listing, LoopsWithoutCallsShareTheirCounters) {
  const std::string loop = "repeat(3)\nx = (x + 1) * (x + 2)\nendrepeat\n";
  const CompileResult plain =
      compile_text("x = 0\n" + loop + loop + "call(#f)\nend\n#f\n" + loop + "return\n");
  ASSERT_TRUE(plain.program) << errors(plain);
  EXPECT_EQ(plain.program->variables.size(), 4U);  // x, a counter, two of the sum
  const std::string calling = "repeat(3)\ncall(#f)\nendrepeat\n";
  const CompileResult calls = compile_text("x = 0\n" + calling + calling + "end\n#f\n" + loop + "return\n");
  ASSERT_TRUE(calls.program) << errors(calls);
  EXPECT_EQ(calls.program->variables.size(), 6U);
}

TEST(Listing, RefusesARecursionThatOverwritesWhatItsCallerHolds) {
  const auto error = [](const std::string& text) { return first_line(errors(compile_text(text + "\n"))); };
  const std::string told =
      " keeps one value for all depths of the recursion: hold it in an array, with an "
      "element for each depth";
  const std::string back = "error: this call leads back to itself, and ";
  EXPECT_EQ(error("d = 0\ncall(#f)\nend\n#f\nd = d + 1\nif(d < 3)\nrepeat(2)\ncall(#f)\nendrepeat\nendif\n"
                  "return"),
            "main.aps:8:1: " + back + "the 'repeat' of line 7" + told);
  EXPECT_EQ(error("n = 3\ncall(#f)\nend\n#f\nfor(i, 0, n)\ncall(#g)\nendfor\nreturn\n#g\ncallif(n > 5, #f)\n"
                  "return"),
            "main.aps:6:1: " + back + "the 'for' of line 5" + told);
  const std::string macro = "!macro_def\nm($a)\n!macro_begin\n:t = $a\ncall(#f)\n";
  const std::string uses = "!macro_end\nd = 0\ncall(#f)\nend\n#f\nd = d + 1\nif(d < 5)\nm(d)\nendif\nreturn";
  EXPECT_EQ(error(macro + "d = :t\n" + uses),
            "main.aps:5:1: " + back + "the local name ':t' of line 4" + told);
  EXPECT_EQ(error("!macro_def\nm($a)\n!macro_begin\ncall(#f)\nif($a > 2)\n:t = $a\nendif\nd = :t\n" + uses),
            "main.aps:4:1: " + back + "the local name ':t' of line 6" + told);
  // The local name is not read after the call.
  EXPECT_EQ(error(macro + uses), "");
  EXPECT_EQ(error("d = 0\ncall(#f)\nend\n#f\nd = d + 1\ncallif(d < 5, #f)\nrepeat(2)\nd = d + 1\nendrepeat\n"
                  "return"),
            "");
  // It starts the program again, and no routine returns from there.
  EXPECT_EQ(
      error("n = 0\n#start\nrepeat(3)\ncall(#f)\nendrepeat\nend\n#f\nn = n + 1\nif(n == 2)\njump(#start)\n"
            "endif\nreturn"),
      "");
}

// A local name starts at 0 where a path reads it before it writes it, and only there.
TEST(Listing, LocalNamesStartAtZero) {
  const auto function = [](const std::string& body) {
    return compiled("function y = f(number a)\n" + body + "\nendfunction\nx = f(3)");
  };
  EXPECT_EQ(function("if(a > 0)\nt = 5\nelse\nt = 6\nendif\ny = t").find(", 0\n"), std::string::npos);
  EXPECT_EQ(
      compiled("n = 1\nfunction y = f(number a)\nif(a > 0)\nt = 5\nendif\ny = t\nendfunction\nx = f(n)"),
      "copy n, 1\ncopy $0, 0\nunless.gt n, 0, @4\ncopy $0, 5\ncopy x, $0\n");
}

TEST(Listing, FiltersAndPropagation) {
  EXPECT_EQ(compiled("A = flood(A, B)"), "flood $0, A, B\ncopy A, $0\n");
  EXPECT_EQ(compiled("distance(A, B > 0)"), "gt $0, B, 0\ndistance A, $0\n");
  EXPECT_EQ(
      compiled("filter.create('k', 3, 2)\nx = 1\nfilter.setElement('k', x, 1, 5)\nfilter.do(A, B, 'k')"),
      "copy x, 1\nadd $0, 3, x\nfilter.set filter 'k', $0, 5\nfilter.do A, B, filter 'k'\n");
  EXPECT_EQ(compiled("A = filter.gauss.fast(B, 1)"),
            "filter.do $0, B, filter '$gauss 1'\nfilter.do A, $0, filter '$gauss 1'\n");
}

// A random number is one a cell where the statement has a register.
TEST(Listing, RandomNumbersTakeKindOfStatement) {
  EXPECT_EQ(compiled("A = random.float.white"), "random.float.rand A, -1, 1\n");
  EXPECT_EQ(compiled("x = random.int.rand(1, 6)"), "random.int.rand x, 1, 6\n");
  EXPECT_EQ(compiled("A = B * random.float.rand(0, 1)"), "random.float.rand $0, 0, 1\nmul A, B, $0\n");
  EXPECT_EQ(compiled("x = 2 * random.float.rand(0, 1)"), "random.float.rand $0, 0, 1\nmul x, 2, $0\n");
  EXPECT_EQ(compiled("A = random.int.gauss(0, 2)"), "random.float.gauss $0, 0, 2\nround A, $0\n");
  EXPECT_EQ(compiled("where(random.int.white)\nA = 1\nendwhere"),
            "random.int.rand $0, 0, 1\nmask.push $0\ncopy A, 1\nmask.pop\n");
}

TEST(Listing, ElementsByIndexAndPlugins) {
  EXPECT_EQ(compiled("A = res.getreg(r, 2)\nres.setreg(REGISTER, 0, 1)\nx = res.match(r, 'B')"),
            "res.getreg A, REGISTER, 2\nres.setreg REGISTER, 0, 1\ncopy x, 1\n");
  EXPECT_EQ(compiled("!module('m')\nA = plugin(?, 3, B + 1, 2)\nplugin(?, 4, x, A)\nplugin(?, 5)"),
            "add $0, B, 1\nplugin.with $0\nplugin.with 2\nplugin A, module 'm', 3\nplugin.with A\n"
            "plugin x, module 'm', 4\nplugin.do module 'm', 5\n");
  // In a macro '?' is the module of its library, whatever was loaded since.
  EXPECT_EQ(compiled("!module('m')\n!macro_def\n$y = f($a)\n!macro_begin\nplugin(?, 1, $y, $a)\n!macro_end\n"
                     "!module('n')\nA = f(B)"),
            "plugin.with B\nplugin A, module 'm', 1\n");
}

TEST(Listing, RegistersTakeTheDefaultPalette) {
  EXPECT_EQ(compiled("!default_palette(255, 'jet')\n!register(D)\nD = A"),
            "reg.setPalette D, 'jet'\nreg.setScale D, 0, 255\ncopy D, A\n");
}

TEST(Listing, InstructionsKnowTheirSourceLine) {
  const CompileResult result = compile_text("!register(A)\n\nA = 1\nA = A \\\n  + 2\n");
  ASSERT_TRUE(result.program);
  const program::Program& p = *result.program;
  EXPECT_EQ(p.source_locations[p.code[0].source_location].line, 3U);
  EXPECT_EQ(p.source_locations[p.code[1].source_location].line, 4U);
  EXPECT_EQ(p.files.at(p.source_locations[p.code[1].source_location].file), "main.aps");
}

}  // namespace
}  // namespace apron::compiler
