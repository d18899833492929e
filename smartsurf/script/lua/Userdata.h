// Registers userdata types whose metatables suggest corrections for misspelt methods. Internal to this
// module.
#pragma once

#include <span>
#include <type_traits>

#include "smartsurf/script/lua/Interpreter.h"

namespace smartsurf::script {

// Creates the metatable `type` with `methods`. A property is a function of no arguments, which returns what
// all values of the type have under its name. Other names are errors.
void register_userdata_type(lua_State* L, const char* type, std::span<const luaL_Reg> methods,
                            std::span<const luaL_Reg> properties = {});

// A handle is userdata that holds the id of an object or a joint; its type is "object" or "joint". Handles of
// equal ids are equal.
static_assert(std::is_same_v<scene::ObjectId, scene::JointId>);
void register_handle_type(lua_State* L, const char* type, std::span<const luaL_Reg> methods);
void push_handle(lua_State* L, const char* type, scene::ObjectId id);
// Returns null if the value at `index` is not a handle of the type.
const scene::ObjectId* test_handle(lua_State* L, int index, const char* type);
// The id of the handle whose method is called. Throws ScriptError.
scene::ObjectId check_handle(lua_State* L, const char* type, const char* method);

}  // namespace smartsurf::script
