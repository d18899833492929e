// The functions of Lua's table and string libraries that loop in C, with their work charged to the budget.
// Lengths that a metamethod returns are charged before they are believed. Internal to this module.
#pragma once

#include <lua.hpp>

namespace smartsurf::script {

// Replaces a function of the table on top of the stack by one whose upvalue is the original.
inline void replace_function(lua_State* L, const char* name, lua_CFunction function) {
  lua_getfield(L, -1, name);
  lua_pushcclosure(L, function, 1);
  lua_setfield(L, -2, name);
}

// Including table.sort.
void bind_table_functions(lua_State* L);
void bind_table_sort(lua_State* L);
// Including the pattern functions.
void bind_string_functions(lua_State* L);
void bind_pattern_functions(lua_State* L);

}  // namespace smartsurf::script
