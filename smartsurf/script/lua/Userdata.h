// Registers userdata types whose metatables suggest corrections for misspelt methods. Internal to this
// module.
#pragma once

#include <span>

#include "smartsurf/script/lua/Interpreter.h"

namespace smartsurf::script {

// Creates the metatable `type` with `methods`. If `property` is not null, it is called for other names as
// property(value, name) and returns the value, or nil for an unknown name, which is an error.
void register_userdata_type(lua_State* L, const char* type, std::span<const luaL_Reg> methods,
                            lua_CFunction property = nullptr);

}  // namespace smartsurf::script
