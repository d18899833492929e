// The functions of Lua's standard library that loop in C, with their work charged to the budget.
//
// Lua's count hook runs between instructions of the VM alone. A call of a library function is one
// instruction, however long it takes, so the sandbox charges for it. Where the arguments or the results tell
// the work, Lua's own function is wrapped. Three things are our own, because no check in advance bounds or
// orders them: the pattern functions (PatternMatcher.h), table.sort (TableSort.cpp), and pairs and next
// (OrderedPairs.cpp). A watchdog cannot take their place: it cannot interrupt a C function either, only end
// the process, and when it strikes differs from run to run. Internal to this module.
#pragma once

#include "smartsurf/script/lua/Interpreter.h"

namespace smartsurf::script {

// Replaces the function `name` of the table on top of the stack by one whose first upvalue is the original.
// Messages about bad arguments go on to call the original by its name, which Lua looks up among the loaded
// modules.
inline void wrap_field(lua_State* L, const char* name, lua_CFunction function) {
  lua_getfield(L, -1, name);
  luaL_getsubtable(L, LUA_REGISTRYINDEX, LUA_LOADED_TABLE);
  if (lua_getfield(L, -1, name) == LUA_TNIL) {
    lua_pushvalue(L, -3);
    lua_setfield(L, -3, name);
  }
  lua_pop(L, 2);
  lua_pushcclosure(L, function, 1);
  lua_setfield(L, -2, name);
}

// Calls the wrapped function with the arguments on the stack, and returns the number of its results. A
// function that may yield must be called last.
inline int call_wrapped(lua_State* L) {
  lua_pushvalue(L, lua_upvalueindex(1));
  lua_insert(L, 1);
  lua_callk(L, lua_gettop(L) - 1, LUA_MULTRET, 0,
            [](lua_State* state, int, lua_KContext) { return lua_gettop(state); });
  return lua_gettop(L);
}

// Calls the wrapped function and charges the bytes or the number of its results.
int call_metered_by_results(Sandbox& sandbox, lua_State* L);

// Including table.sort.
void bind_table_functions(lua_State* L);
void bind_table_sort(lua_State* L);
// Including the pattern functions.
void bind_string_functions(lua_State* L);
void bind_pattern_functions(lua_State* L);

}  // namespace smartsurf::script
