#include "smartsurf/script/lua/Userdata.h"

#include <algorithm>
#include <string>
#include <vector>

#include "smartsurf/script/lua/TableReader.h"

namespace smartsurf::script {
namespace {

// Called with names that the table of methods lacks. Upvalues: the table of methods, the property function or
// nil, the type's name.
int index_metamethod(Sandbox&, lua_State* L) {
  lua_settop(L, 2);
  if (!lua_isnil(L, lua_upvalueindex(2))) {
    lua_pushvalue(L, lua_upvalueindex(2));
    lua_pushvalue(L, 2);
    lua_call(L, 1, 1);
    if (!lua_isnil(L, -1)) return 1;
  }
  const std::string type = lua_tostring(L, lua_upvalueindex(3));
  const std::vector<std::string> names = string_keys(L, lua_upvalueindex(1));
  std::string hint;
  if (lua_type(L, 2) == LUA_TSTRING) hint = did_you_mean(lua_tostring(L, 2), names);
  throw ScriptError(type + ": has no " + format_value(L, 2) +
                    (hint.empty() ? "; known: " + join_names(names) : hint));
}

// Upvalue: the handle's type.
int handles_equal(lua_State* L) {
  const char* const type = lua_tostring(L, lua_upvalueindex(1));
  const scene::ObjectId *const a = test_handle(L, 1, type), *const b = test_handle(L, 2, type);
  lua_pushboolean(L, a != nullptr && b != nullptr && *a == *b ? 1 : 0);
  return 1;
}

int handle_to_string(Sandbox&, lua_State* L) {
  const char* const type = lua_tostring(L, lua_upvalueindex(1));
  lua_pushfstring(L, "%s %I", type, static_cast<LUAI_UACINT>(check_handle(L, type, "id")));
  return 1;
}

}  // namespace

void register_userdata_type(lua_State* L, const char* type, std::span<const luaL_Reg> methods,
                            lua_CFunction property) {
  luaL_newmetatable(L, type);
  lua_newtable(L);
  for (const luaL_Reg& method : methods) {
    lua_pushcfunction(L, method.func);
    lua_setfield(L, -2, method.name);
  }
  // Lua finds a method in the table without a call; a reward function looks one up in each step of each
  // world.
  lua_createtable(L, 0, 1);
  lua_pushvalue(L, -2);
  if (property != nullptr)
    lua_pushcfunction(L, property);
  else
    lua_pushnil(L);
  lua_pushstring(L, type);
  lua_pushcclosure(L, guarded<index_metamethod>, 3);
  lua_setfield(L, -2, "__index");
  lua_setmetatable(L, -2);
  lua_setfield(L, -2, "__index");
  lua_pushliteral(L, "locked");
  lua_setfield(L, -2, "__metatable");
  lua_pop(L, 1);
}

void register_handle_type(lua_State* L, const char* type, std::span<const luaL_Reg> methods) {
  register_userdata_type(L, type, methods);
  luaL_getmetatable(L, type);
  for (const luaL_Reg& method :
       {luaL_Reg{"__eq", handles_equal}, luaL_Reg{"__tostring", guarded<handle_to_string>}}) {
    lua_pushstring(L, type);
    lua_pushcclosure(L, method.func, 1);
    lua_setfield(L, -2, method.name);
  }
  lua_pop(L, 1);
}

void push_handle(lua_State* L, const char* type, scene::ObjectId id) {
  new (lua_newuserdatauv(L, sizeof id, 0)) scene::ObjectId(id);
  luaL_setmetatable(L, type);
}

const scene::ObjectId* test_handle(lua_State* L, int index, const char* type) {
  return static_cast<const scene::ObjectId*>(luaL_testudata(L, index, type));
}

scene::ObjectId check_handle(lua_State* L, const char* type, const char* method) {
  if (const scene::ObjectId* const id = test_handle(L, 1, type)) return *id;
  const std::string name(type);
  throw ScriptError(name + ":" + method + ": call it with a colon, " + name + "(id):" + method);
}

}  // namespace smartsurf::script
