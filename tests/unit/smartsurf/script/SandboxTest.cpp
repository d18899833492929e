#include <atomic>
#include <chrono>
#include <clocale>
#include <cstdlib>
#include <ctime>
#include <random>
#include <utility>

#include "ScriptFixture.h"
#include "tests/unit/common/SanitizedCases.h"

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
  write("a.txt", "");
  EXPECT_EQ(error_of("getmetatable(io.open('a.txt')).__gc = function() while true do end end"),
            "t.lua:1: attempt to index a string value");
  load_on_surface("print(getmetatable(cells), getmetatable(pin{}), getmetatable(io.open('a.txt')))");
  EXPECT_EQ(printed, "locked\tlocked\tlocked\n");
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

// As Lua's: nil, a message and the system's number.
TEST_F(SandboxTest, OpenReturnsNilWhereAPathLeadsNowhere) {
  std::filesystem::create_symlink("loop", folder / "loop");
  options.output_folder = folder / "out";
  load_on_surface("print(io.open('loop')) print(io.open(('x'):rep(300)) == nil) print(io.open('a/b', 'w'))");
  EXPECT_EQ(printed,
            "nil\tloop: Too many levels of symbolic links\t40\ntrue\nnil\ta/b: there is no such folder in " +
                options.output_folder.string() + "/, where a script's files go\t2\n");
  EXPECT_EQ(error_of("io.lines('loop')"),
            "t.lua:1: io.lines: 'loop' cannot be found: Too many levels of symbolic links");
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
    options.load_budget = options.callback_budget = 50'000;
  }
  std::string over(const char* location) {
    return std::string(location) + ": the script ran for more than 50000 instructions: an endless loop?";
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

// coroutine.close() returns the error of a __close function instead of raising it.
TEST_F(BudgetTest, ExcessInClosedCoroutinesEndsTheScript) {
  EXPECT_EQ(
      error_of("local forever = setmetatable({}, {__close = function() while true do end end})\n"
               "local co = coroutine.create(function() local x <close> = forever coroutine.yield() end)\n"
               "coroutine.resume(co) coroutine.close(co)"),
      over("t.lua:1"));
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
  EXPECT_EQ(error_of("while true do string.rep('x', 1 << 20) end"), over("t.lua:1"));
  EXPECT_EQ(error_of("table.move({}, 1, 1 << 60, 2)"), over("t.lua:1"));
}

TEST_F(BudgetTest, RepetitionsAreChargedByTheirLength) {
  load_on_surface("print(#('x'):rep(1 << 20), #string.rep('', 1 << 60))");
  EXPECT_EQ(printed, "1048576\t0\n");
}

TEST_F(BudgetTest, LengthsFromMetamethodsAreChargedBeforeTheyAreBelieved) {
  const std::string huge =
      "local huge = setmetatable({}, {__len = function() return math.maxinteger - 1 end}) ";
  EXPECT_EQ(error_of(huge + "table.insert(huge, 1, 0)"), over("t.lua:1"));
  EXPECT_EQ(error_of(huge + "table.remove(huge, 1)"), over("t.lua:1"));
  EXPECT_EQ(
      error_of("local any = setmetatable({}, {__index = rawequal, __len = function() return 1 << 60 end}) "
               "table.move(any, 1, #any, 2)"),
      over("t.lua:1"));
  EXPECT_EQ(error_of("local text = setmetatable({}, {__index = type, __len = function() return 1 << 60 end}) "
                     "table.concat(text)"),
            over("t.lua:1"));
  EXPECT_EQ(error_of("surface{rows = 4, columns = 4} local n = 0 "
                     "local liar = setmetatable({}, {__len = function() n = n + 1 "
                     "return n == 1 and 2 or 1 << 30 end, __index = rawequal}) table.sort(liar, rawequal)"),
            "");
  EXPECT_EQ(error_of(huge + "table.unpack(huge)"), "t.lua:1: too many results to unpack");
}

// Lua's own functions ask for the length themselves, after it was charged.
TEST_F(BudgetTest, LengthsFromMetamethodsAreAskedForOnce) {
  for (const char* call : {"table.insert(liar, 1, 0)", "table.remove(liar, 1)", "table.concat(liar)"}) {
    load_on_surface(
        std::string("local asked = 0 local liar = setmetatable({}, {__index = type, __newindex = type, "
                    "__len = function() asked = asked + 1 return asked == 1 and 3 or 1 << 22 end}) ") +
        call + " print(asked)");
    EXPECT_EQ(std::exchange(printed, ""), "1\n") << call;
  }
}

TEST_F(SandboxTest, WrappedFunctionsAreNamedInMessages) {
  EXPECT_EQ(error_of("table.insert(nil, 1)"),
            "t.lua:1: bad argument #1 to 'insert' (table expected, got nil)");
  EXPECT_EQ(error_of("table.insert({}, 3, 1)"),
            "t.lua:1: bad argument #2 to 'insert' (position out of bounds)");
  EXPECT_EQ(error_of("string.upper({})"), "t.lua:1: bad argument #1 to 'upper' (string expected, got table)");
  EXPECT_EQ(error_of("table.concat({1, {}})"),
            "t.lua:1: invalid value (table) at index 2 in table for 'concat'");
}

TEST_F(BudgetTest, ChargesWorkOnLongTablesAndStrings) {
  for (const char* statement :
       {"local t = {} for i = 1, 1e4 do t[i] = i end while true do table.insert(t, 1, 0) end",
        "local t = {} for i = 1, 1e4 do t[i] = i end while true do next(t) end",
        "local t = {} for i = 1, 1e4 do t[i] = i end while true do table.sort(t) end",
        "local s = ('x'):rep(1e6) while true do s:upper() end",
        "local s = ('x'):rep(1e6) while true do s:find('y', 1, true) end",
        "local s = ('a'):rep(30) s:find(('a?'):rep(30) .. ('a'):rep(31))",
        "local s = ('a'):rep(1e4) s:match('.-.-.-.-b')", "local s = ('('):rep(1e5) s:gsub('%b()', '')",
        "local s = ('b'):rep(1e3) s:find('[' .. ('a'):rep(1e5) .. ']')",
        "local s = ('b'):rep(1e3) s:find('x?[' .. ('a'):rep(1e5) .. ']')",
        "local t = {} for i = 1, 1e4 do t[i] = {} end for i = 1, 1000 do collectgarbage() end"})
    EXPECT_EQ(error_of(statement), over("t.lua:1")) << statement;
}

TEST_F(SandboxTest, ProcessorTimeIsBounded) {
  options.load_time_s = 0.2;
  for (const char* statement :
       {"local a, b = ('x'):rep(1 << 24) .. '', ('x'):rep((1 << 24) - 1) .. 'x' while true do local _ = a == "
        "b end",
        "local a, b = ('\\0'):rep(1 << 24), ('\\0'):rep((1 << 24) - 1) while true do local _ = a < b end",
        "local a = ('x'):rep(1 << 23) while true do local _ = a .. '' .. a end",
        "local co = coroutine.wrap(function() local a = ('x'):rep(1 << 23) while true do local _ = a .. a "
        "end end) "
        "co()",
        "local s = ('x'):rep(1 << 20) while true do pcall(string.rep, s, 8) end"}) {
    const std::clock_t start = std::clock();
    EXPECT_EQ(error_of(statement), "t.lua:1: the script ran for more than 0.2 s: an endless loop?")
        << statement;
    EXPECT_LT(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC, 2.0) << statement;
  }
}

TEST_F(SandboxTest, LimitsStringLength) {
  const std::string tail = "t.lua:1: a string is longer than 16 MiB";
  EXPECT_EQ(error_of("local s = ('x'):rep((1 << 24) + 100)"), tail);
  EXPECT_EQ(error_of("local s = ('x'):rep(1 << 40)"), tail);
  EXPECT_EQ(error_of("local s = ('x'):rep(1 << 23) s = s .. s .. s"), tail);
  EXPECT_EQ(error_of("local s = ('x'):rep(1e6):gsub('.*', ('%0'):rep(1e6))"),
            "t.lua:1: string.gsub: a string is longer than 16 MiB");
  EXPECT_EQ(error_of("string.pack('c999999999', '')"),
            "t.lua:1: string.pack: a string is longer than 16 MiB");
}

TEST_F(SandboxTest, LimitsCannotBeCaught) {
  const std::string tail = "a string is longer than 16 MiB";
  const std::pair<const char*, std::string> cases[] = {
      {"pcall(string.rep, 'x', 2e7)", tail},
      {"pcall(function() local s = ('x'):rep(1 << 23) s = s .. s .. s end)", tail},
      {"xpcall(string.rep, print, 'x', 2e7)", tail},
      {"coroutine.resume(coroutine.create(function() local s = ('x'):rep(1 << 23) s = s .. s .. s end))",
       tail},
      {"pcall(string.pack, 'c999999999', '')", "string.pack: " + tail},
      {"pcall(string.gsub, ('x'):rep(1e6), '.*', ('%0'):rep(1e6))", "string.gsub: " + tail},
      {"local s = ('x'):rep(9 << 20) pcall(print, s, s)", "print: the text is longer than 16 MiB"}};
  for (const auto& [statement, message] : cases) {
    EXPECT_EQ(error_of(std::string(statement) + "\nprint('on')"), "t.lua:1: " + message) << statement;
    EXPECT_EQ(printed, "") << statement;
  }
}

TEST_F(SandboxTest, MemoryLimitCannotBeCaught) {
  options.memory_limit = 8 << 20;
  for (const char* const statement :
       {"pcall(function() local t = {} for i = 1, 1e9 do t[i] = 'text ' .. i end end)",
        "t = {} pcall(function() for i = 1, 1e9 do t[i] = 'text ' .. i end end)",
        "pcall(string.rep, 'x', 9 << 20)",
        "xpcall(function() local t = {} for i = 1, 1e9 do t[i] = {} end end, print)",
        "local co = coroutine.wrap(function() local t = {} for i = 1, 1e9 do t[i] = {} end end) pcall(co)",
        "local s = ('x'):rep(1 << 20) pcall(table.concat, {s, s, s, s, s, s, s, s})"}) {
    EXPECT_EQ(error_of(std::string(statement) + "\nprint('on')"),
              "t.lua:1: the script needs more than 8 MiB of memory")
        << statement;
    EXPECT_EQ(printed, "") << statement;
  }
  load_on_surface("for i = 1, 100 do local s = ('x'):rep(3 << 20) .. i end print('on')");  // collects garbage
  EXPECT_EQ(printed, "on\n");
}

TEST_F(SandboxTest, NumbersAndOrderIgnoreTheLocaleOfTheHost) {
  const std::string target = (folder / "de_DE.UTF-8").string();
  if (std::system(("localedef -i de_DE -f UTF-8 " + target + " > /dev/null 2>&1").c_str()) != 0)
    GTEST_SKIP() << "no localedef, or it lacks de_DE";
  ::setenv("LOCPATH", folder.c_str(), 1);
  const bool is_set = std::setlocale(LC_ALL, "de_DE.UTF-8") != nullptr;
  const bool has_comma = is_set && *std::localeconv()->decimal_point == ',';
  if (has_comma)
    load_on_surface(
        "print(1.5, tostring(0.1), string.format('%.2f', 2.25), tonumber('1.25'), tonumber('1,25'), 'B' < "
        "'a')");
  std::setlocale(LC_ALL, "C");
  ::unsetenv("LOCPATH");
  ASSERT_TRUE(has_comma);
  EXPECT_EQ(printed, "1.5\t0.1\t2.25\t1.25\tnil\ttrue\n");
}

TEST_F(SandboxTest, StopEndsScriptThatRuns) {
  std::atomic<bool> stop{true};
  options.stop = &stop;
  const auto start = std::chrono::steady_clock::now();
  EXPECT_THROW(load("while true do pcall(function() while true do end end) end"), Interrupted);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(10));
  EXPECT_EQ(error_of("surface{rows = 4, columns = 4} for i = 1, 1e5 do end"),
            "");  // a short one ends by itself
}

TEST_F(SandboxTest, TextOfValuesIsTheSameInEveryRun) {
  const char* const text =
      "local a, b = {}, {}\n"
      "print(a, b, print, coroutine.create(print), setmetatable({}, {__name = 'point'}))\n"
      "print(tostring(a), string.format('%s %5s %-10s|%p %p %d%%', a, 'x', b, b, 1, 7), ('%s'):format(a))\n"
      "print(setmetatable({}, {__tostring = function() return 'own' end}), tostring(nil), tostring(1.5))\n"
      "print(#tostring(io.open('t.lua')) < 20)";
  load_on_surface(text);
  EXPECT_EQ(printed,
            "table: 1\ttable: 2\tfunction: 3\tthread: 4\tpoint: 5\n"
            "table: 1\ttable: 1     x table: 2  |2 (null) 7%\ttable: 1\n"
            "own\tnil\t1.5\ntrue\n");
}

// An adversary of quicksort (McIlroy 1999) decides the order while it is asked, so that parts become as
// uneven as they can. Lua then takes its pivots from the clock.
TEST_F(SandboxTest, SortComparesTheSameInEveryRun) {
  load_on_surface(R"(
    local function order_found(n)
      local value, list, solid, candidate = {}, {}, 0, 0
      for i = 1, n do value[i], list[i] = n, i end
      table.sort(list, function(a, b)
        if value[a] == n and value[b] == n then
          local frozen = a == candidate and a or b
          value[frozen], solid = solid, solid + 1
        end
        if value[a] == n then candidate = a elseif value[b] == n then candidate = b end
        return value[a] < value[b]
      end)
      return table.concat(value, ' ')
    end
    local first = order_found(2000)
    for _ = 1, 3 do print(order_found(2000) == first) end)");
  EXPECT_EQ(printed, "true\ntrue\ntrue\n");
}

using OverrunDeathTest = ScriptTest;

// The keys of a growing table collide in its next size, so that one assignment takes time in proportion to
// their square.
constexpr const char* kUninterruptible =
    "local t, step = {}, (1 << 19) - 1 for i = 1, (1 << 18) + 1 do t[i * step] = true end";

TEST_F(OverrunDeathTest, UninterruptibleOperationEndsTheProcess) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  options.load_time_s = 0.3;
  options.end_process = [](const std::string& message) {
    std::fprintf(stderr, "%s\n", message.c_str());
    std::_Exit(2);
  };
  EXPECT_EXIT(error_of(kUninterruptible), testing::ExitedWithCode(2),
              "t.lua: one operation of the script took too long and cannot be interrupted");
}

TEST_F(OverrunDeathTest, StopEndsUninterruptibleOperation) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  static std::atomic<bool> stop{true};
  options.stop = &stop;
  options.end_process = [](const std::string& message) { std::_Exit(message.empty() ? 143 : 1); };
  EXPECT_EXIT(error_of(kUninterruptible), testing::ExitedWithCode(143), "");
}

// Lua's own functions, which --unsafe leaves in place, are the reference.
TEST_F(SandboxTest, LibraryFunctionsBehaveAsInLua) {
  std::mt19937 random(7);
  const auto pick = [&](const auto& list) { return std::string(list[random() % std::size(list)]); };
  const char* const items[] = {"a",  "b",   ".",    "%a", "%d",    "%s", "[ab]",   "[^b]", "[a-c%d]", "%w",
                               "%.", "(a)", "(.-)", "()", "%b()",  "%1", "%f[%a]", "(",    ")",       "[]]",
                               "^",  "$",   "(b*)", "-",  "[%w_]", "%",  "[a",     "%f",   "(a(b)c)", "[-a]"};
  const char* const suffixes[] = {"", "", "", "*", "+", "-", "?"};
  const char* const subjects[] = {"", "a", "abab 12", "(a(b)c)", "aab.b-]b", "x = 42, y = 7", "aaaa\\0b"};
  const char* const replacements[] = {
      "'<%0>'", "'%1'", "'%%'", "{a = 'x', b = false}", "function(x) return x ~= 'a' and '.' or nil end",
      "'%2'",   "7"};
  std::string script = "local function show(...) print(select('#', ...), ...) end\n";
  for (int i = 0; i < 1500; ++i) {
    std::string pattern = random() % 5 == 0 ? "^" : "";
    for (std::size_t n = random() % 4 + 1; n > 0; --n) pattern += pick(items) + pick(suffixes);
    const std::string arguments = "'" + pick(subjects) + "', '" + pattern + "'";
    const int start = static_cast<int>(random() % 7) - 2;
    script += "show(pcall(string.find, " + arguments + ", " + std::to_string(start) + "))\n";
    script += "show(pcall(string.match, " + arguments + ", " + std::to_string(start) + "))\n";
    script += "show(pcall(string.gsub, " + arguments + ", " + pick(replacements) + "))\n";
    script += "show(pcall(function() local all = '' for a, b in string.gmatch(" + arguments +
              ") do all = all .. tostring(a) .. ':' .. tostring(b) .. ' ' end return all end))\n";
  }
  for (const char* call : {"table.insert(t, 4)",
                           "table.insert(t, 1, 9)",
                           "table.insert(t, 5, 9)",
                           "table.insert(t, 4, 8)",
                           "table.insert(t)",
                           "table.remove(t)",
                           "table.remove(t, 1)",
                           "table.remove(t, 4)",
                           "table.remove(t, 6)",
                           "table.remove({})",
                           "table.remove({}, 0)",
                           "table.concat(t, ', ')",
                           "table.concat(t, '', 2, 3)",
                           "table.concat({1, {}, 3})",
                           "table.concat(t, '-', 3, 1)",
                           "table.concat(t, '', math.maxinteger)",
                           "table.unpack(t)",
                           "table.unpack(t, 2)",
                           "table.unpack(t, 2, 5)",
                           "table.unpack(t, 1, 1e8)",
                           "table.sort(t, function(a, b) return a > b end)",
                           "#table.move(t, 1, 3, 2)",
                           "string.rep('ab', 3, '-')",
                           "string.rep('ab', 1, '-')",
                           "string.rep('', 5, ', ')",
                           "string.rep('', 5)",
                           "string.rep('abc', 7)",
                           "string.rep(7, '3')",
                           "string.rep('a', -1)",
                           "string.rep('a', 1.5)",
                           "string.rep({}, 2)",
                           "string.byte('abc', 1, -1)",
                           "string.sub('abcdef', -3, -2)",
                           "string.pack('<i4z', 7, 'x')",
                           "string.unpack('<i2', 'ab')",
                           "utf8.len('añb')",
                           "utf8.len('\\xff')",
                           "utf8.codepoint('añ', 1, -1)",
                           "string.upper('aé')",
                           "string.find('a.b', '.', 1, true)",
                           "string.find('', '')",
                           "string.find('abc', '', 10)"})
    script += std::string("do local t = {3, 1, 2} show(pcall(function() return ") + call +
              " end)) show(#t, t[1], t[2], t[3], t[4]) end\n";
  // Only the messages of errors may differ in the location and the name of the function.
  script =
      "local print_line = print\nlocal function print(n, ok, ...) if ok == false then print_line(n, ok) else "
      "print_line(n, ok, ...) end end\n" +
      script;
  load_on_surface(script);
  const std::string ours = std::exchange(printed, "");
  options.unsafe = true;
  load_on_surface(script);
  ASSERT_GT(ours.size(), 20000U);
  std::istringstream left(ours), right(printed);
  std::string a, b, line;
  for (int i = 1; std::getline(left, a) && std::getline(right, b); ++i) EXPECT_EQ(a, b) << "line " << i;
}

TEST_F(BudgetTest, EachCallHasItsOwnBudget) {
  Experiment e = load_on_surface("on_tick(function() for i = 1, 20000 do end end)");
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
  if (kIsSanitized) GTEST_SKIP() << "a million objects take half a minute";
  EXPECT_EQ(error_of("local p = {0, 0, 0}\nfor i = 1, 1000001 do sphere{radius = 1, position = p} end"),
            "t.lua:2: sphere: more than 1000000 objects");
}

}  // namespace
}  // namespace smartsurf::script
