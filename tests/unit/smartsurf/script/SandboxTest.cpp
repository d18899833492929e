#include "ScriptFixture.h"

namespace smartsurf::script {
namespace {

using SandboxTest = ScriptTest;

TEST_F(SandboxTest, DeniesSystemAndNativeCodeFunctions) {
  const std::string tail = ": not available in an experiment; --unsafe enables Lua's full library";
  for (const char* name : {"os.execute", "os.getenv", "os.remove", "os.rename", "os.tmpname", "os.setlocale",
                           "io.popen", "io.tmpfile", "io.input", "debug.sethook", "debug.getregistry"})
    EXPECT_EQ(error_of(std::string(name) + "('x')"), "t.lua:1: " + std::string(name) + tail);
  EXPECT_EQ(error_of("os.exit(3)"),
            "t.lua:1: os.exit: not available in an experiment; stop() or quit() ends the run");
  EXPECT_EQ(error_of("print(os.time())"),
            "t.lua:1: os.time: not available in an experiment; time() is the "
            "simulated time; the wall clock would make runs irreproducible");
  EXPECT_EQ(error_of("loadfile('x')"),
            "t.lua:1: loadfile: not available in an experiment; require() and dofile() "
            "load files beside the script");
  EXPECT_EQ(error_of("package.loadlib('a', 'b')"),
            "t.lua:1: library 'package': not available in this version; "
            "available: require() of a file beside the script");
}

TEST_F(SandboxTest, RejectsBytecode) {
  EXPECT_EQ(error_of("\x1bLua"), "t.lua:1: this is compiled Lua; give the source text");
  load_on_surface("print(load(string.dump(function() end), 'c', 'b'))");
  EXPECT_EQ(printed, "nil\tattempt to load a binary chunk (mode is 't')\n");
  write("m.lua", "\x1bLua");
  EXPECT_EQ(error_of("require 'm'"), "m.lua:1: this is compiled Lua; give the source text");
}

TEST_F(SandboxTest, LoadAcceptsSourceText) {
  load_on_surface("print(load('return 1 + 1')(), load('return x', 'c', 't', {x = 5})(), (load('= =')))");
  EXPECT_EQ(printed, "2\t5\tnil\n");
}

TEST_F(SandboxTest, MetatablesAreProtected) {
  EXPECT_EQ(error_of("getmetatable(_G).__index = nil"), "t.lua:1: attempt to index a string value");
  EXPECT_EQ(error_of("setmetatable(_G, nil)"), "t.lua:1: cannot change a protected metatable");
  EXPECT_EQ(error_of("setmetatable({}, {__gc = function() end})"),
            "t.lua:1: setmetatable: __gc is not available in an experiment");
  load_on_surface("print(getmetatable(cells), getmetatable(pin{}))");
  EXPECT_EQ(printed, "locked\tlocked\n");
}

TEST_F(SandboxTest, RequireLoadsFilesBesideScriptOnce) {
  std::filesystem::create_directory(folder / "lib");
  write("lib/parts.lua", "print('loading', ...)\nreturn {radius = 3}");
  load_on_surface("print(require('lib.parts').radius, require('lib.parts') == require('lib.parts'))");
  EXPECT_EQ(printed, "loading\tlib.parts\n3\ttrue\n");
  write("bad.lua", "\n\nspere{}");
  EXPECT_EQ(error_of("\nrequire 'bad'"), "bad.lua:3: unknown name 'spere' (did you mean 'sphere'?)");
  write("syntax.lua", "\nlocal = 3");
  EXPECT_EQ(error_of("\nrequire 'syntax'"), "syntax.lua:2: <name> expected near '='");
  write("loop.lua", "require 'loop'");
  EXPECT_EQ(error_of("require 'loop'"), "loop.lua:1: require: 'loop' requires itself");
  EXPECT_EQ(error_of("\nrequire 'none'"), "t.lua:2: require: 'none.lua' is not beside the script");
}

TEST_F(SandboxTest, DofileRunsFileBesideScript) {
  write("values.lua", "return 1, 2");
  load_on_surface("print(dofile('values.lua'))");
  EXPECT_EQ(printed, "1\t2\n");
}

TEST_F(SandboxTest, ReadsFilesOnlyBesideScript) {
  write("data.csv", "1,2\n3,4\n");
  load_on_surface(
      "for line in io.lines('data.csv') do print(line) end local f <close> = io.open('data.csv') "
      "print(f:read('a')) print((io.open('none.csv')))");
  EXPECT_EQ(printed, "1,2\n3,4\n1,2\n3,4\n\nnil\n");
  const std::string tail = " is outside the script's folder and the output folder; --unsafe allows it";
  EXPECT_EQ(error_of("io.open('/etc/passwd')"), "t.lua:1: io.open: '/etc/passwd'" + tail);
  EXPECT_EQ(error_of("io.open('../../x')"), "t.lua:1: io.open: '../../x'" + tail);
  EXPECT_EQ(error_of("io.lines('/etc/passwd')"), "t.lua:1: io.lines: '/etc/passwd'" + tail);
  EXPECT_EQ(error_of("dofile('/etc/passwd')"), "t.lua:1: dofile: '/etc/passwd'" + tail);
  EXPECT_EQ(error_of("require '..x'"), "t.lua:1: require: '//x.lua'" + tail);
  std::filesystem::create_symlink("/etc/passwd", folder / "link");
  EXPECT_EQ(error_of("io.open('link')"), "t.lua:1: io.open: 'link'" + tail);
  std::filesystem::create_symlink("/dev/zero", folder / "zero");
  EXPECT_EQ(error_of("io.open('zero')"), "t.lua:1: io.open: 'zero'" + tail);
  EXPECT_EQ(error_of("io.open('.')"), "t.lua:1: io.open: '.' is not a regular file");
}

TEST_F(SandboxTest, WritesFilesOnlyInOutputFolder) {
  EXPECT_EQ(error_of("io.open('new.csv', 'w')"),
            "t.lua:1: io.open: 'new.csv' cannot be written: this run has no output folder");
  options.output_folder = folder / "out";
  std::filesystem::create_directory(options.output_folder);
  load_on_surface(
      "local f = io.open('new.csv', 'w') f:write('1,2') f:close() print(io.open('new.csv'):read('a'))");
  EXPECT_EQ(printed, "1,2\n");
  EXPECT_TRUE(std::filesystem::exists(folder / "out" / "new.csv"));
  EXPECT_EQ(error_of("io.open('../new.csv', 'w')"),
            "t.lua:1: io.open: '../new.csv' is outside the output folder; --unsafe allows it");
  EXPECT_EQ(error_of("io.open('../t.lua', 'r+')"),
            "t.lua:1: io.open: '../t.lua' is outside the output folder; --unsafe allows it");
}

TEST_F(SandboxTest, UnsafeEnablesFullLibrary) {
  options.unsafe = true;
  write("part.lua", "return 5");
  load_on_surface(
      "print(type(os.execute), type(io.popen), type(package.loadlib), require('part'), os.getenv('x'))");
  EXPECT_EQ(printed, "function\tfunction\tfunction\t5\tnil\n");
  EXPECT_EQ(error_of("spere{}"), "t.lua:1: unknown name 'spere' (did you mean 'sphere'?)");
}

class BudgetTest : public ScriptTest {
 protected:
  void SetUp() override {
    ScriptTest::SetUp();
    options.load_budget = options.callback_budget = 200'000;
  }
  std::string over(const char* location) {
    return std::string(location) + ": the script ran for more than 200000 instructions: an endless loop?";
  }
};

TEST_F(BudgetTest, EndlessLoopIsStoppedWithItsLocation) {
  EXPECT_EQ(error_of("\nwhile true do end"), over("t.lua:2"));
  EXPECT_EQ(run_error_of("\nwhile true do end"), over("t.lua:3"));
}

TEST_F(BudgetTest, PcallAndCoroutinesCannotEscape) {
  EXPECT_EQ(error_of("while true do pcall(function() while true do end end) end"), over("t.lua:1"));
  EXPECT_EQ(
      error_of(
          "while true do xpcall(function() while true do end end, function() while true do end end) end"),
      over("t.lua:1"));
  EXPECT_EQ(error_of("while true do coroutine.wrap(function() while true do end end)() end"),
            over("t.lua:1"));
  EXPECT_EQ(error_of("while true do coroutine.create(print) end"), over("t.lua:1"));
  EXPECT_EQ(error_of("local forever = setmetatable({}, {__close = function() while true do end end})\n"
                     "local function f() local x <close> = forever while true do end end\n"
                     "pcall(f) pcall(coroutine.wrap(f)) local co = coroutine.create(f) coroutine.resume(co) "
                     "coroutine.close(co)")
                .substr(0, 6),
            "t.lua:");
  EXPECT_EQ(error_of("local function f() pcall(f) f() end f()").substr(0, 7), "t.lua:1");
}

TEST_F(BudgetTest, CoroutinesAndXpcallBehaveAsInLua) {
  load_on_surface(R"(
    local gen = coroutine.wrap(function(a) local b = coroutine.yield(a + 1) return a + b end)
    print(gen(1), gen(5), pcall(gen))
    local co = coroutine.create(function() xpcall(function() coroutine.yield(7) error('e', 0) end, print) return 8 end)
    print(coroutine.resume(co)) print(coroutine.resume(co)) print(coroutine.close(co))
    print(xpcall(function(...) return ... end, print, 1, 2))
    print(xpcall(error, function(m) return 'handled ' .. m end, 'it'))
    print(coroutine.close(coroutine.create(print))))");
  EXPECT_EQ(printed,
            "2\t6\tfalse\tcannot resume dead coroutine\ntrue\t7\ne\ntrue\t8\ntrue\ntrue\t1\t2\n"
            "false\thandled it\ntrue\n");
}

TEST_F(BudgetTest, ChargesLoopsInLibraryFunctions) {
  EXPECT_EQ(error_of("string.rep('', 1 << 60)"), over("t.lua:1"));
  EXPECT_EQ(error_of("table.move({}, 1, 1 << 60, 2)"), over("t.lua:1"));
}

TEST_F(BudgetTest, EachCallHasItsOwnBudget) {
  Experiment e = load_on_surface("on_tick(function() for i = 1, 60000 do end end)");
  FakeSimulation simulation(e.scene());
  e.start(simulation);
  run_ticks(e, 0, 50);
}

TEST_F(SandboxTest, LimitsMemory) {
  options.memory_limit = 8 << 20;
  const std::string message = ": the script needs more than 8 MiB of memory";
  EXPECT_EQ(error_of("local t = {}\nfor i = 1, 1e9 do\nt[i] = 'text ' .. i end"), "t.lua:3" + message);
  EXPECT_EQ(error_of("\nlocal s = string.rep('x', 1 << 24)"), "t.lua:2" + message);
  options.memory_limit = 1000;
  EXPECT_EQ(error_of("surface{}"), "t.lua: the memory limit is too small to start a script");
  options.memory_limit = 12000;
  EXPECT_EQ(error_of("surface{}").substr(0, 31), "t.lua: the script needs more th");
}

TEST_F(SandboxTest, DeepRecursionIsAnError) {
  EXPECT_NE(error_of("local function f() return 1 + f() end\nf()").find("t.lua:1: stack overflow"),
            std::string::npos);
  EXPECT_NE(
      error_of(
          "local s = string.rep('(', 1000) .. '1' .. string.rep(')', 1000)\nassert(load('return ' .. s))")
          .find("C stack overflow"),
      std::string::npos);
  EXPECT_NE(
      error_of("local t = setmetatable({}, {}) getmetatable(t).__index = function(_, k) return t[k + 1] end\n"
               "print(t[1])")
          .find("stack overflow"),
      std::string::npos);
}

TEST_F(SandboxTest, LimitsObjectCount) {
  EXPECT_EQ(error_of("local p = {0, 0, 0}\nfor i = 1, 1000001 do sphere{radius = 1, position = p} end"),
            "t.lua:2: sphere: more than 1000000 objects");
}

}  // namespace
}  // namespace smartsurf::script
