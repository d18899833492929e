#include "smartsurf/script/lua/Userdata.h"

#include <algorithm>
#include <iterator>
#include <string>
#include <vector>

#include "smartsurf/script/lua/TableReader.h"

namespace smartsurf::script {
namespace {

void push_functions(lua_State* L, std::span<const luaL_Reg> functions) {
  lua_createtable(L, 0, static_cast<int>(functions.size()));
  for (const luaL_Reg& function : functions) {
    lua_pushcfunction(L, function.func);
    lua_setfield(L, -2, function.name);
  }
}

// Called with names that the table of methods lacks. Upvalues: the tables of methods and of properties, the
// type's name.
int index_metamethod(Sandbox&, lua_State* L) {
  lua_settop(L, 2);
  lua_pushvalue(L, 2);
  if (lua_rawget(L, lua_upvalueindex(2)) == LUA_TFUNCTION) {
    lua_call(L, 0, 1);
    return 1;
  }
  const std::string type = lua_tostring(L, lua_upvalueindex(3));
  std::vector<std::string> names = string_keys(L, lua_upvalueindex(1));
  std::ranges::copy(string_keys(L, lua_upvalueindex(2)), std::back_inserter(names));
  std::ranges::sort(names);
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
                            std::span<const luaL_Reg> properties) {
  luaL_newmetatable(L, type);
  push_functions(L, methods);
  // Lua finds a method in the table without a call; a reward function looks one up in each step of each
  // world.
  lua_createtable(L, 0, 1);
  lua_pushvalue(L, -2);
  push_functions(L, properties);
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
