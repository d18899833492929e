// tostring, print's text of a value and string.format without addresses, which differ from run to run: a
// table, function, coroutine or userdata is shown with its number in the order of first use.
#include "smartsurf/script/lua/ValueText.h"

#include <string>
#include <string_view>

#include "smartsurf/script/lua/MeteredLibrary.h"

namespace smartsurf::script {
namespace {

constexpr const char* kIdentityTable = "smartsurf.identities";  // value -> number; its keys are weak

bool has_identity(int type) {
  return type == LUA_TTABLE || type == LUA_TFUNCTION || type == LUA_TTHREAD || type == LUA_TUSERDATA ||
         type == LUA_TLIGHTUSERDATA;
}

// The number of the value at `index`.
lua_Integer identity(lua_State* L, int index) {
  index = lua_absindex(L, index);
  if (!luaL_getsubtable(L, LUA_REGISTRYINDEX, kIdentityTable)) {
    lua_createtable(L, 0, 1);
    lua_pushliteral(L, "k");
    lua_setfield(L, -2, "__mode");
    lua_setmetatable(L, -2);
  }
  lua_pushvalue(L, index);
  lua_rawget(L, -2);
  lua_Integer number = lua_tointeger(L, -1);
  lua_pop(L, 1);
  if (number == 0) {
    lua_rawgeti(L, -1, 0);  // the last number given; a plain integer key is never collected
    number = lua_tointeger(L, -1) + 1;
    lua_pop(L, 1);
    lua_pushinteger(L, number);
    lua_rawseti(L, -2, 0);
    lua_pushvalue(L, index);
    lua_pushinteger(L, number);
    lua_rawset(L, -3);
  }
  lua_pop(L, 1);
  return number;
}

int tostring(Sandbox&, lua_State* L) {
  luaL_checkany(L, 1);
  push_value_text(L, 1);
  return 1;
}

// Wraps Lua's string.format. Converts the arguments that Lua would show by their addresses.
int format(Sandbox& sandbox, lua_State* L) {
  std::size_t length = 0;
  const char* const text = luaL_checklstring(L, 1, &length);
  std::string pattern(text, length);
  sandbox.interpreter->charge(L, length / kBytesPerInstruction);
  const int arguments = lua_gettop(L);
  int argument = 1;
  for (std::size_t i = 0; i < pattern.size(); ++i) {
    if (pattern[i] != '%') continue;
    if (++i < pattern.size() && pattern[i] == '%') continue;
    while (i < pattern.size() &&
           std::string_view("-+ #0123456789.").find(pattern[i]) != std::string_view::npos)
      ++i;
    if (i >= pattern.size() || ++argument > arguments) break;
    if (pattern[i] == 'p') {
      pattern[i] = 's';
      if (has_identity(lua_type(L, argument)))
        lua_pushfstring(L, "%I", static_cast<LUAI_UACINT>(identity(L, argument)));
      else
        lua_pushliteral(L, "(null)");
      lua_replace(L, argument);
    } else if (pattern[i] == 's') {
      push_value_text(L, argument);
      std::size_t bytes = 0;
      lua_tolstring(L, -1, &bytes);
      sandbox.interpreter->charge(L, bytes / kBytesPerInstruction);
      lua_replace(L, argument);
    }
  }
  lua_pushlstring(L, pattern.data(), pattern.size());
  lua_replace(L, 1);
  return call_wrapped(L);
}

}  // namespace

void push_value_text(lua_State* L, int index) {
  index = lua_absindex(L, index);
  luaL_checkstack(L, 8, nullptr);
  const bool own_text = luaL_getmetafield(L, index, "__tostring") != LUA_TNIL;
  if (own_text) lua_pop(L, 1);
  if (own_text || !has_identity(lua_type(L, index))) {
    luaL_tolstring(L, index, nullptr);
    return;
  }
  const lua_Integer number = identity(L, index);
  const int name = luaL_getmetafield(L, index, "__name");
  lua_pushfstring(L, "%s: %I", name == LUA_TSTRING ? lua_tostring(L, -1) : luaL_typename(L, index),
                  static_cast<LUAI_UACINT>(number));
  if (name != LUA_TNIL) lua_remove(L, -2);
}

void bind_value_text(lua_State* L) {
  lua_register(L, "tostring", guarded<tostring>);
  lua_getglobal(L, LUA_STRLIBNAME);
  wrap_field(L, "format", guarded<format>);
  lua_pop(L, 1);
  // An open file has a method of its own, which shows its address.
  if (luaL_getmetatable(L, LUA_FILEHANDLE) == LUA_TTABLE) {
    lua_pushnil(L);
    lua_setfield(L, -2, "__tostring");
  }
  lua_pop(L, 1);
}

}  // namespace smartsurf::script
