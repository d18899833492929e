// The Lua standard library as the sandbox offers it. Internal to this module.
#pragma once

#include "smartsurf/script/lua/Interpreter.h"

namespace smartsurf::script {

// The Lua standard library, reduced to what the sandbox allows. Must run first.
void bind_standard_library(lua_State* L, const Sandbox&);
void bind_ordered_pairs(lua_State* L);     // pairs, next, with a reproducible order
void bind_denied_libraries(lua_State* L);  // os, debug: every access is an error
// Makes access to an unknown global an error that suggests the nearest name. Must run last.
void guard_globals(lua_State* L);

}  // namespace smartsurf::script
