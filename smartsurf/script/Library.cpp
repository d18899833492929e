// Lua's standard library as an experiment gets it: nothing that leaves the process, runs native code, escapes
// the budget, or differs from run to run.
#include <algorithm>
#include <array>
#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

#include "smartsurf/script/Fields.h"
#include "smartsurf/script/Session.h"

namespace smartsurf::script {
namespace {

constexpr std::uint64_t kCoroutineCost = 1000;  // each may run that long before its own counter looks

// Replaces the function `name` of the table on top by `function`, which gets the old one as its first
// upvalue.
void wrap(lua_State* L, const char* name, lua_CFunction function) {
  lua_getfield(L, -1, name);
  lua_pushcclosure(L, function, 1);
  lua_setfield(L, -2, name);
}

void wrap_in(lua_State* L, const char* library, const char* name, lua_CFunction function) {
  lua_getglobal(L, library);
  wrap(L, name, function);
  lua_pop(L, 1);
}

int all_results(lua_State* L, int, lua_KContext) { return lua_gettop(L); }

// Calls the wrapped function with the arguments on the stack; coroutines may yield inside.
int call_wrapped(lua_State* L) {
  lua_pushvalue(L, lua_upvalueindex(1));
  lua_insert(L, 1);
  lua_callk(L, lua_gettop(L) - 1, LUA_MULTRET, 0, all_results);
  return lua_gettop(L);
}

void say(const Session& session, const std::string& text) {
  if (session.options.print) {
    session.options.print(text);
    return;
  }
  std::fwrite(text.data(), 1, text.size(), stdout);
  std::fflush(stdout);
}

int print(Session& session, lua_State* L) {
  std::string line;
  const int count = lua_gettop(L);
  for (int i = 1; i <= count; ++i) {
    std::size_t length = 0;
    const char* const text = luaL_tolstring(L, i, &length);
    if (i > 1) line += '\t';
    line.append(text, length);
    lua_pop(L, 1);
  }
  say(session, line + "\n");
  return 0;
}

int io_write(Session& session, lua_State* L) {
  std::string text;
  for (int i = 1; i <= lua_gettop(L); ++i) {
    std::size_t length = 0;
    const char* const part = luaL_checklstring(L, i, &length);
    text.append(part, length);
  }
  say(session, text);
  return 0;
}

// Source text only: bytecode can break the interpreter.
int load(Session&, lua_State* L) {
  if (lua_gettop(L) < 3) lua_settop(L, 3);
  lua_pushliteral(L, "t");
  lua_replace(L, 3);
  return call_wrapped(L);
}

// Lua runs finalizers with the instruction count switched off.
int setmetatable(Session&, lua_State* L) {
  if (lua_type(L, 2) == LUA_TTABLE) {
    lua_pushliteral(L, "__gc");
    lua_rawget(L, 2);
    if (!lua_isnil(L, -1)) throw Problem("setmetatable: __gc is not available in an experiment");
    lua_pop(L, 1);
  }
  return call_wrapped(L);
}

// Lua calls the handler of xpcall from inside the instruction count's hook, with the count switched off: when
// the budget is spent, it must not run. Upvalue: the script's handler.
int on_xpcall_error(Session& session, lua_State* L) {
  if (session.interpreter->budget_exceeded()) return 1;
  lua_pushvalue(L, lua_upvalueindex(1));
  lua_insert(L, 1);
  lua_call(L, lua_gettop(L) - 1, 1);
  return 1;
}

int xpcall(Session&, lua_State* L) {
  luaL_checktype(L, 2, LUA_TFUNCTION);
  lua_pushvalue(L, 2);
  lua_pushcclosure(L, guarded<on_xpcall_error>, 1);
  lua_replace(L, 2);
  return call_wrapped(L);
}

int coroutine_create(Session& session, lua_State* L) {
  session.interpreter->charge(L, kCoroutineCost);
  return call_wrapped(L);
}

// A coroutine that an error ended stays uncounted where its budget's end was the error, and closing it would
// run the script's __close functions: so neither of these two closes such a coroutine.
int coroutine_close(Session&, lua_State* L) {
  lua_State* const other = lua_tothread(L, 1);
  if (other == nullptr || lua_status(other) == LUA_OK || lua_status(other) == LUA_YIELD)
    return call_wrapped(L);
  lua_pushboolean(L, 0);
  lua_pushliteral(L, "the coroutine ended with an error");
  return 2;
}

// Upvalues: Lua's coroutine.resume, the coroutine.
int resume_wrapped(Session&, lua_State* L) {
  lua_pushvalue(L, lua_upvalueindex(1));
  lua_insert(L, 1);
  lua_pushvalue(L, lua_upvalueindex(2));
  lua_insert(L, 2);
  lua_call(L, lua_gettop(L) - 1, LUA_MULTRET);
  if (lua_toboolean(L, 1) == 0) return lua_error(L);
  return lua_gettop(L) - 1;
}

// coroutine.wrap; upvalues: Lua's coroutine.create and coroutine.resume.
int coroutine_wrap(Session& session, lua_State* L) {
  session.interpreter->charge(L, kCoroutineCost);
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
  lua_getfield(L, -1, "create");
  lua_getfield(L, -2, "resume");
  lua_pushcclosure(L, guarded<coroutine_wrap>, 2);
  lua_setfield(L, -2, "wrap");
  wrap(L, "create", guarded<coroutine_create>);
  wrap(L, "close", guarded<coroutine_close>);
  lua_pop(L, 1);
}

// string.rep and table.move loop in C, as long as they are told to.
int counted_rep(Session& session, lua_State* L) {
  const lua_Integer count = lua_tointeger(L, 2);
  if (count > 0) session.interpreter->charge(L, static_cast<std::uint64_t>(count));
  return call_wrapped(L);
}

int counted_move(Session& session, lua_State* L) {
  const lua_Integer first = lua_tointeger(L, 2), last = lua_tointeger(L, 3);
  if (last > first)
    session.interpreter->charge(L, static_cast<std::uint64_t>(last) - static_cast<std::uint64_t>(first));
  return call_wrapped(L);
}

int collectgarbage(Session&, lua_State* L) {
  const std::string what = lua_isnoneornil(L, 1) ? "collect" : text_at(L, 1, "collectgarbage");
  if (what != "collect" && what != "count" && what != "step")
    must_be(L, 1, "collectgarbage", "'collect', 'count' or 'step'");
  lua_settop(L, 1);
  return call_wrapped(L);
}

struct Denied {
  std::string_view name, instead;
};
constexpr std::array<Denied, 6> kDenied{{
    {"os.exit", "stop() or quit() ends the run"},
    {"os.time", "time() is the simulated time; the wall clock would make every run another"},
    {"os.clock", "time() is the simulated time; the wall clock would make every run another"},
    {"os.date", "time() is the simulated time; the wall clock would make every run another"},
    {"io.read", "option() takes values from the command line"},
    {"loadfile", "require() and dofile() load files beside the script"},
}};

[[noreturn]] void deny(const std::string& name) {
  for (const Denied& denied : kDenied)
    if (denied.name == name)
      throw Problem(name + ": not available in an experiment; " + std::string(denied.instead));
  throw Problem(name + ": not available in an experiment; --unsafe allows the whole of Lua's library");
}

int deny_field(Session&, lua_State* L) {
  deny(std::string(lua_tostring(L, lua_upvalueindex(1))) + "." +
       (lua_type(L, 2) == LUA_TSTRING ? one_line(lua_tostring(L, 2)) : show(L, 2)));
}

// Features of the experiments' language that a later version has.
struct Later {
  std::string_view name, kind, instead;
};
constexpr std::array<Later, 1> kLater{{
    {"package", "library", "require() of a file beside the script"},
}};

std::vector<std::string> global_names(lua_State* L) {
  std::vector<std::string> names;
  for (lua_pushnil(L); lua_next(L, 1) != 0; lua_pop(L, 1))
    if (lua_type(L, -2) == LUA_TSTRING) names.emplace_back(lua_tostring(L, -2));
  std::sort(names.begin(), names.end());
  return names;
}

int unknown_global(Session&, lua_State* L) {
  lua_settop(L, 2);
  const std::string name = lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : show(L, 2);
  for (const Later& later : kLater)
    if (later.name == name)
      throw Problem(std::string(later.kind) + " '" + name +
                    "': not available in this version; available: " + std::string(later.instead));
  if (name == "loadfile") deny(name);
  throw Problem("unknown name '" + one_line(name.substr(0, 60)) + "'" + suggestion(name, global_names(L)));
}

void open_safe(lua_State* L) {
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
  wrap(L, "load", guarded<load>);
  wrap(L, "setmetatable", guarded<setmetatable>);
  wrap(L, "collectgarbage", guarded<collectgarbage>);
  wrap(L, "xpcall", guarded<xpcall>);
  lua_pop(L, 1);
  bind_coroutines(L);
  wrap_in(L, LUA_STRLIBNAME, "rep", guarded<counted_rep>);
  wrap_in(L, LUA_TABLIBNAME, "move", guarded<counted_move>);
}

// With --unsafe, require finds Lua files beside the script as well.
void open_unsafe(lua_State* L, const std::string& folder) {
  luaL_openlibs(L);
  lua_getglobal(L, "package");
  lua_getfield(L, -1, "path");
  const std::string path = folder + "/?.lua;" + lua_tostring(L, -1);
  lua_pushlstring(L, path.data(), path.size());
  lua_setfield(L, -3, "path");
  lua_settop(L, 0);
}

// Gives the table on top a metatable that refuses what is not in it.
void deny_rest(lua_State* L, const char* library) {
  lua_createtable(L, 0, 2);
  lua_pushstring(L, library);
  lua_pushcclosure(L, guarded<deny_field>, 1);
  lua_setfield(L, -2, "__index");
  lua_pushliteral(L, "locked");
  lua_setfield(L, -2, "__metatable");
  lua_setmetatable(L, -2);
}

}  // namespace

void bind_library(lua_State* L, const Session& session) {
  if (session.options.unsafe)
    open_unsafe(L, session.folder.string());
  else
    open_safe(L);
  lua_register(L, "print", guarded<print>);
}

void bind_denied(lua_State* L) {
  lua_newtable(L);
  deny_rest(L, "os");
  lua_setglobal(L, "os");
  lua_newtable(L);
  deny_rest(L, "debug");
  lua_setglobal(L, "debug");
  lua_getglobal(L, "io");
  lua_pushcfunction(L, guarded<io_write>);
  lua_setfield(L, -2, "write");
  deny_rest(L, "io");
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
