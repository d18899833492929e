// The Lua standard library of the sandbox, without functions that leave the process, run native code, escape
// the instruction budget or make runs irreproducible.
#include <algorithm>
#include <array>
#include <cstdio>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "common/text/Printable.h"
#include "smartsurf/script/lua/MeteredLibrary.h"
#include "smartsurf/script/lua/StandardLibrary.h"
#include "smartsurf/script/lua/TableReader.h"
#include "smartsurf/script/lua/ValueText.h"

namespace smartsurf::script {
namespace {

constexpr std::uint64_t kCoroutineCost = 1000;  // what a coroutine may run before its first budget check

void write_output(const Sandbox& sandbox, const std::string& text) {
  if (sandbox.options.print_output) {
    sandbox.options.print_output(text);
    return;
  }
  common::print_output(text);
  std::fflush(stdout);
}

// The text lies outside Lua's heap, whose limit does not hold for it.
void append_output(std::string& text, const char* part, std::size_t length, const char* function) {
  if (length > kMaxStringBytes - std::min(text.size(), kMaxStringBytes))
    throw LimitError(std::string(function) + ": the text is longer than 16 MiB");
  text.append(part, length);
}

int print(Sandbox& sandbox, lua_State* L) {
  std::string line;
  const int count = lua_gettop(L);
  for (int i = 1; i <= count; ++i) {
    std::size_t length = 0;
    if (sandbox.options.unsafe)
      luaL_tolstring(L, i, nullptr);
    else
      push_value_text(L, i);
    const char* const text = lua_tolstring(L, -1, &length);
    sandbox.interpreter->charge(L, length / kBytesPerInstruction);
    if (i > 1) line += '\t';
    append_output(line, text, length, "print");
    lua_pop(L, 1);
  }
  write_output(sandbox, line + "\n");
  return 0;
}

int io_write(Sandbox& sandbox, lua_State* L) {
  std::string text;
  for (int i = 1; i <= lua_gettop(L); ++i) {
    std::size_t length = 0;
    const char* const part = luaL_checklstring(L, i, &length);
    sandbox.interpreter->charge(L, length / kBytesPerInstruction);
    append_output(text, part, length, "io.write");
  }
  write_output(sandbox, text);
  return 0;
}

// Accepts source text only, because malformed bytecode can crash the interpreter.
int load(Sandbox& sandbox, lua_State* L) {
  if (lua_type(L, 1) != LUA_TSTRING) {
    if (lua_gettop(L) < 3) lua_settop(L, 3);
    lua_pushliteral(L, "t");
    lua_replace(L, 3);
    return call_wrapped(L);
  }
  std::size_t length = 0;
  const char* const text = lua_tolstring(L, 1, &length);
  const char* const chunk = luaL_optstring(L, 2, text);
  const bool has_environment = !lua_isnone(L, 4);
  if (sandbox.interpreter->compile_metered(L, {text, length}, chunk) != LUA_OK) {
    lua_pushnil(L);
    lua_insert(L, -2);
    return 2;
  }
  if (has_environment) {
    lua_pushvalue(L, 4);
    if (lua_setupvalue(L, -2, 1) == nullptr) lua_pop(L, 1);
  }
  return 1;
}

// Rejects __gc, because Lua runs finalizers with the count hook disabled.
int setmetatable(Sandbox&, lua_State* L) {
  if (lua_type(L, 2) == LUA_TTABLE) {
    lua_pushliteral(L, "__gc");
    lua_rawget(L, 2);
    if (!lua_isnil(L, -1)) throw ScriptError("setmetatable: __gc is not available in an experiment");
    lua_pop(L, 1);
  }
  return call_wrapped(L);
}

// When the budget is exceeded, the error is raised inside the count hook, and Lua calls the message handler
// there with the hook disabled. The script's handler must not run then. Upvalue: the script's handler.
int on_xpcall_error(Sandbox& sandbox, lua_State* L) {
  if (sandbox.interpreter->budget_exceeded()) return 1;
  lua_pushvalue(L, lua_upvalueindex(1));
  lua_insert(L, 1);
  lua_call(L, lua_gettop(L) - 1, 1);
  return 1;
}

int xpcall(Sandbox&, lua_State* L) {
  luaL_checktype(L, 2, LUA_TFUNCTION);
  lua_pushvalue(L, 2);
  lua_pushcclosure(L, guarded<on_xpcall_error>, 1);
  lua_replace(L, 2);
  return call_wrapped(L);
}

int coroutine_resume(Sandbox& sandbox, lua_State* L) {
  lua_State* const coroutine = lua_tothread(L, 1);
  if (coroutine == nullptr || coroutine == L) return call_wrapped(L);
  lua_pushvalue(L, lua_upvalueindex(1));
  lua_insert(L, 1);
  const Interpreter::RunningCoroutine running(*sandbox.interpreter, L, coroutine);
  lua_call(L, lua_gettop(L) - 1, LUA_MULTRET);
  return lua_gettop(L);
}

int coroutine_create(Sandbox& sandbox, lua_State* L) {
  sandbox.interpreter->charge(L, kCoroutineCost);
  return call_wrapped(L);
}

// Does not close a coroutine that ended with an error, because that would run the script's __close functions.
// If the error was an exceeded budget, the coroutine's count hook stays disabled, so they would run without a
// limit. For the same reason, coroutine_wrap replaces Lua's version, which closes the coroutine on an error.
int coroutine_close(Sandbox&, lua_State* L) {
  lua_State* const coroutine = lua_tothread(L, 1);
  if (coroutine == nullptr || lua_status(coroutine) == LUA_OK || lua_status(coroutine) == LUA_YIELD)
    return call_wrapped(L);
  lua_pushboolean(L, 0);
  lua_pushliteral(L, "the coroutine ended with an error");
  return 2;
}

// The function that coroutine.wrap returns. Upvalues: Lua's coroutine.resume, the coroutine.
int resume_wrapped(Sandbox&, lua_State* L) {
  lua_pushvalue(L, lua_upvalueindex(1));
  lua_insert(L, 1);
  lua_pushvalue(L, lua_upvalueindex(2));
  lua_insert(L, 2);
  lua_call(L, lua_gettop(L) - 1, LUA_MULTRET);
  if (lua_toboolean(L, 1) == 0) return lua_error(L);
  return lua_gettop(L) - 1;
}

// coroutine.wrap. Upvalues: Lua's coroutine.create and coroutine.resume.
int coroutine_wrap(Sandbox& sandbox, lua_State* L) {
  sandbox.interpreter->charge(L, kCoroutineCost);
  lua_settop(L, 1);
  lua_pushvalue(L, lua_upvalueindex(2));
  lua_pushvalue(L, lua_upvalueindex(1));
  lua_pushvalue(L, 1);
  lua_call(L, 1, 1);
  lua_pushcclosure(L, guarded<resume_wrapped>, 2);
  return 1;
}

void bind_coroutines(lua_State* L) {
  lua_getglobal(L, LUA_COLIBNAME);
  wrap_field(L, "resume", guarded<coroutine_resume>);
  lua_getfield(L, -1, "create");
  lua_getfield(L, -2, "resume");
  lua_pushcclosure(L, guarded<coroutine_wrap>, 2);
  lua_setfield(L, -2, "wrap");
  wrap_field(L, "create", guarded<coroutine_create>);
  wrap_field(L, "close", guarded<coroutine_close>);
  lua_pop(L, 1);
}

int collectgarbage(Sandbox& sandbox, lua_State* L) {
  const std::string mode = lua_isnoneornil(L, 1) ? "collect" : check_string(L, 1, "collectgarbage");
  if (mode != "collect" && mode != "count" && mode != "step")
    throw_invalid_value(L, 1, "collectgarbage", "'collect', 'count' or 'step'");
  if (mode != "count")
    sandbox.interpreter->charge(L, sandbox.interpreter->memory_used() / kBytesPerInstruction);
  lua_settop(L, 1);
  return call_wrapped(L);
}

struct DeniedFunction {
  std::string_view name, alternative;
};
constexpr std::array<DeniedFunction, 6> kDeniedFunctions{{
    {"os.exit", "stop() or quit() ends the run"},
    {"os.time", "time() is the simulated time; the wall clock would make runs irreproducible"},
    {"os.clock", "time() is the simulated time; the wall clock would make runs irreproducible"},
    {"os.date", "time() is the simulated time; the wall clock would make runs irreproducible"},
    {"io.read", "option() takes values from the command line"},
    {"loadfile", "require() and dofile() load files beside the script"},
}};

[[noreturn]] void throw_unavailable(const std::string& name) {
  for (const DeniedFunction& denied : kDeniedFunctions)
    if (denied.name == name)
      throw ScriptError(name + ": not available in an experiment; " + std::string(denied.alternative));
  throw ScriptError(name + ": not available in an experiment; --unsafe enables Lua's full library");
}

int deny_field(Sandbox&, lua_State* L) {
  throw_unavailable(
      std::string(lua_tostring(L, lua_upvalueindex(1))) + "." +
      (lua_type(L, 2) == LUA_TSTRING ? to_single_line(lua_tostring(L, 2)) : format_value(L, 2)));
}

// Names that users of other simulators and languages try, and what to write here.
const char* known_equivalent(const std::string& name) {
  static const std::map<std::string, const char*, std::less<>> kEquivalents = {
      {"cube", "box{size = {x, y, z}}"},
      {"cuboid", "box{size = {x, y, z}}"},
      {"block", "box{size = {x, y, z}}"},
      {"brick", "box{size = {x, y, z}}"},
      {"wall", "box{size = {x, y, z}, fixed = true}"},
      {"obstacle", "box{size = {x, y, z}, fixed = true}"},
      {"circle", "sphere{radius = r} or cylinder{radius = r, height = h}"},
      {"marble", "sphere{radius = r}"},
      {"disc", "cylinder{radius = r, height = h}"},
      {"disk", "cylinder{radius = r, height = h}"},
      {"puck", "cylinder{radius = r, height = h}"},
      {"coin", "cylinder{radius = r, height = h}"},
      {"pill", "capsule{radius = r, height = h}"},
      {"polyhedron", "hull{points = {{x, y, z}, ...}}"},
      {"convex", "hull{points = {{x, y, z}, ...}}"},
      {"model", "mesh{file = 'part.stl'}"},
      {"floor", "world{ground = true}"},
      {"ground", "world{ground = true}"},
      {"plane", "world{ground = true}"},
      {"gravity", "world{gravity = -9.81}"},
      {"friction", "material{name = 'steel', friction = 0.5}"},
      {"actuator", "surface{actuator = pin{}}"},
      {"actuators", "surface{actuators = {pin{}, ball{}}}"},
      {"sensor", "surface{sensors = {proximity{}}}"},
      {"sensors", "surface{sensors = {proximity{}}}"},
      {"grid", "surface{rows = 64, columns = 64}"},
      {"wait", "at(seconds, function) or every(seconds, function)"},
      {"sleep", "at(seconds, function) or every(seconds, function)"},
      {"after", "at(seconds, function)"},
      {"timer", "at(seconds, function) or every(seconds, function)"},
      {"update", "on_tick(function(t, tick) ... end)"},
      {"step", "on_tick(function(t, tick) ... end)"},
      {"rand", "random(low, high)"},
      {"parameter", "option('name', default, 'help')"},
      {"param", "option('name', default, 'help')"},
      {"exit", "stop('message')"},
      {"import", "require 'file'"},
      {"include", "require 'file'"}};
  const auto found = kEquivalents.find(name);
  return found == kEquivalents.end() ? nullptr : found->second;
}

int unknown_global(Sandbox&, lua_State* L) {
  lua_settop(L, 2);
  const std::string name = lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : format_value(L, 2);
  if (name == "package")
    throw ScriptError(
        "library 'package': not available in this version; available: require() of a file beside the script");
  if (name == "loadfile") throw_unavailable(name);
  if (const char* const equivalent = known_equivalent(name))
    throw ScriptError("unknown name '" + name + "'; write " + equivalent);
  throw ScriptError("unknown name '" + to_single_line(name.substr(0, 60)) + "'" +
                    did_you_mean(name, string_keys(L, 1)));
}

void open_sandboxed_libraries(lua_State* L) {
  luaL_requiref(L, LUA_GNAME, luaopen_base, 1);
  luaL_requiref(L, LUA_TABLIBNAME, luaopen_table, 1);
  luaL_requiref(L, LUA_STRLIBNAME, luaopen_string, 1);
  luaL_requiref(L, LUA_MATHLIBNAME, luaopen_math, 1);
  luaL_requiref(L, LUA_UTF8LIBNAME, luaopen_utf8, 1);
  luaL_requiref(L, LUA_COLIBNAME, luaopen_coroutine, 1);
  lua_settop(L, 0);
  lua_pushglobaltable(L);
  for (const char* const name : {"dofile", "loadfile"}) {
    lua_pushnil(L);
    lua_setfield(L, -2, name);
  }
  wrap_field(L, "load", guarded<load>);
  wrap_field(L, "setmetatable", guarded<setmetatable>);
  wrap_field(L, "collectgarbage", guarded<collectgarbage>);
  wrap_field(L, "xpcall", guarded<xpcall>);
  lua_pop(L, 1);
  bind_coroutines(L);
}

// For --unsafe: the full library, with the script's folder on package.path.
void open_all_libraries(lua_State* L, const std::string& folder) {
  luaL_openlibs(L);
  lua_getglobal(L, "package");
  lua_getfield(L, -1, "path");
  const std::string path = folder + "/?.lua;" + lua_tostring(L, -1);
  lua_pushlstring(L, path.data(), path.size());
  lua_setfield(L, -3, "path");
  lua_settop(L, 0);
}

// Makes access to a missing field of the table on top an error.
void deny_unknown_fields(lua_State* L, const char* library) {
  lua_createtable(L, 0, 2);
  lua_pushstring(L, library);
  lua_pushcclosure(L, guarded<deny_field>, 1);
  lua_setfield(L, -2, "__index");
  lua_pushliteral(L, "locked");
  lua_setfield(L, -2, "__metatable");
  lua_setmetatable(L, -2);
}

}  // namespace

void bind_standard_library(lua_State* L, const Sandbox& sandbox) {
  if (sandbox.options.unsafe)
    open_all_libraries(L, sandbox.script_folder.string());
  else
    open_sandboxed_libraries(L);
  lua_register(L, "print", guarded<print>);
}

void bind_denied_libraries(lua_State* L) {
  for (const char* const library : {"os", "debug"}) {
    lua_newtable(L);
    deny_unknown_fields(L, library);
    lua_setglobal(L, library);
  }
  lua_getglobal(L, "io");
  lua_pushcfunction(L, guarded<io_write>);
  lua_setfield(L, -2, "write");
  deny_unknown_fields(L, "io");
  lua_pop(L, 1);
}

void guard_globals(lua_State* L) {
  lua_pushglobaltable(L);
  lua_createtable(L, 0, 2);
  lua_pushcfunction(L, guarded<unknown_global>);
  lua_setfield(L, -2, "__index");
  lua_pushliteral(L, "locked");
  lua_setfield(L, -2, "__metatable");
  lua_setmetatable(L, -2);
  lua_pop(L, 1);
}

}  // namespace smartsurf::script
