// The functions of Lua's table and string libraries that loop in C, with their work charged to the budget.
// Lengths that a metamethod returns are charged before they are believed. Internal to this module.
#pragma once

#include <lua.hpp>

namespace smartsurf::script {

void bind_table_functions(lua_State* L);
// Including the pattern functions.
void bind_string_functions(lua_State* L);
void bind_pattern_functions(lua_State* L);

}  // namespace smartsurf::script
