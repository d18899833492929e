// Method tables of userdata types, with suggestions for misspelt methods. Internal to this module.
#pragma once

#include <span>

#include "smartsurf/script/lua/Interpreter.h"

namespace smartsurf::script {

// Makes the metatable `type`, whose values answer to `methods`. `property`, where given, is asked before an
// unknown name is refused: (value, name) → a value, or nothing.
void register_userdata_type(lua_State* L, const char* type, std::span<const luaL_Reg> methods,
                            lua_CFunction property = nullptr);

}  // namespace smartsurf::script
