#include "smartsurf/script/lua/Userdata.h"

#include <algorithm>
#include <string>
#include <vector>

#include "smartsurf/script/ScriptContext.h"
#include "smartsurf/script/lua/TableReader.h"

namespace smartsurf::script {
namespace {

std::vector<std::string> collect_string_keys(lua_State* L, int table) {
  std::vector<std::string> names;
  for (lua_pushnil(L); lua_next(L, table) != 0; lua_pop(L, 1))
    if (lua_type(L, -2) == LUA_TSTRING) names.emplace_back(lua_tostring(L, -2));
  std::sort(names.begin(), names.end());
  return names;
}

// Upvalues: the table of methods, the property function or nil, the type's name.
int index_metamethod(ScriptContext&, lua_State* L) {
  lua_settop(L, 2);
  lua_pushvalue(L, 2);
  lua_rawget(L, lua_upvalueindex(1));
  if (!lua_isnil(L, -1)) return 1;
  if (!lua_isnil(L, lua_upvalueindex(2))) {
    lua_pushvalue(L, lua_upvalueindex(2));
    lua_pushvalue(L, 1);
    lua_pushvalue(L, 2);
    lua_call(L, 2, 1);
    if (!lua_isnil(L, -1)) return 1;
  }
  const std::string type = lua_tostring(L, lua_upvalueindex(3));
  const std::vector<std::string> names = collect_string_keys(L, lua_upvalueindex(1));
  std::string hint;
  if (lua_type(L, 2) == LUA_TSTRING) hint = did_you_mean(lua_tostring(L, 2), names);
  throw ScriptError(type + ": has no " + format_value(L, 2) +
                    (hint.empty() ? "; known: " + join_names(names) : hint));
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
  if (property != nullptr)
    lua_pushcfunction(L, property);
  else
    lua_pushnil(L);
  lua_pushstring(L, type);
  lua_pushcclosure(L, guarded<index_metamethod>, 3);
  lua_setfield(L, -2, "__index");
  lua_pushliteral(L, "locked");
  lua_setfield(L, -2, "__metatable");
  lua_pop(L, 1);
}

}  // namespace smartsurf::script
