// Text of Lua values that is the same in every run. Internal to this module.
#pragma once

#include "smartsurf/script/lua/Interpreter.h"

namespace smartsurf::script {

// Pushes what tostring() returns for the value at `index`.
void push_value_text(lua_State* L, int index);

// Replaces tostring and string.format. The standard library must be bound.
void bind_value_text(lua_State* L);

}  // namespace smartsurf::script
