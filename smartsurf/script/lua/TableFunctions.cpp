#include <climits>
#include <string>

#include "smartsurf/script/ScriptContext.h"
#include "smartsurf/script/lua/MeteredLibrary.h"

namespace smartsurf::script {
namespace {

std::uint64_t distance(lua_Integer from, lua_Integer to) {
  return to > from ? static_cast<std::uint64_t>(to) - static_cast<std::uint64_t>(from) : 0;
}

lua_Integer table_length(lua_State* L) {
  luaL_checktype(L, 1, LUA_TTABLE);
  return luaL_len(L, 1);
}

int insert(ScriptContext& context, lua_State* L) {
  const lua_Integer length = table_length(L);
  const auto end = static_cast<lua_Integer>(static_cast<lua_Unsigned>(length) + 1);
  lua_Integer position = end;
  switch (lua_gettop(L)) {
    case 2:
      break;
    case 3:
      position = luaL_checkinteger(L, 2);
      luaL_argcheck(L, static_cast<lua_Unsigned>(position) - 1 < static_cast<lua_Unsigned>(end), 2,
                    "position out of bounds");
      context.interpreter->charge(L, distance(position, end));
      for (lua_Integer i = end; i > position; --i) {
        lua_geti(L, 1, i - 1);
        lua_seti(L, 1, i);
      }
      break;
    default:
      return luaL_error(L, "wrong number of arguments to 'insert'");
  }
  lua_seti(L, 1, position);
  return 0;
}

int remove(ScriptContext& context, lua_State* L) {
  const lua_Integer length = table_length(L);
  lua_Integer position = luaL_optinteger(L, 2, length);
  if (lua_gettop(L) >= 2)
    luaL_argcheck(
        L,
        position == length || static_cast<lua_Unsigned>(length) + 1 - static_cast<lua_Unsigned>(position) <=
                                  static_cast<lua_Unsigned>(length),
        2, "position out of bounds");
  lua_geti(L, 1, position);
  context.interpreter->charge(L, distance(position, length));
  for (; position < length; ++position) {
    lua_geti(L, 1, position + 1);
    lua_seti(L, 1, position);
  }
  lua_pushnil(L);
  lua_seti(L, 1, position);
  return 1;
}

int concat(ScriptContext& context, lua_State* L) {
  const lua_Integer length = table_length(L);
  std::size_t separator_bytes = 0;
  const char* const separator = luaL_optlstring(L, 2, "", &separator_bytes);
  const lua_Integer first = luaL_optinteger(L, 3, 1), last = luaL_optinteger(L, 4, length);
  std::string text;
  const auto append = [&](const char* characters, std::size_t bytes) {
    context.interpreter->charge(L, bytes / kBytesPerInstruction);
    if (bytes > kMaxStringBytes - text.size())
      throw ScriptError("table.concat: a string is longer than 16 MiB");
    text.append(characters, bytes);
  };
  for (lua_Integer i = first; i <= last; ++i) {
    context.interpreter->charge(L, 1);
    lua_geti(L, 1, i);
    if (lua_isstring(L, -1) == 0)
      return luaL_error(L, "invalid value (at index %I) in table for 'concat'", static_cast<LUAI_UACINT>(i));
    std::size_t bytes = 0;
    const char* const element = lua_tolstring(L, -1, &bytes);
    append(element, bytes);
    lua_pop(L, 1);
    if (i == last) break;  // before i overflows
    append(separator, separator_bytes);
  }
  lua_pushlstring(L, text.data(), text.size());
  return 1;
}

int unpack(ScriptContext& context, lua_State* L) {
  const lua_Integer first = luaL_optinteger(L, 2, 1);
  const lua_Integer last = lua_isnoneornil(L, 3) ? luaL_len(L, 1) : luaL_checkinteger(L, 3);
  if (first > last) return 0;
  const std::uint64_t count = distance(first, last);
  if (count >= INT_MAX || lua_checkstack(L, static_cast<int>(count + 1)) == 0)
    return luaL_error(L, "too many results to unpack");
  context.interpreter->charge(L, count);
  for (lua_Integer i = first; i < last; ++i) lua_geti(L, 1, i);
  lua_geti(L, 1, last);
  return static_cast<int>(count) + 1;
}

// table.move loops in C without calling the count hook.
int move(ScriptContext& context, lua_State* L) {
  context.interpreter->charge(L, distance(lua_tointeger(L, 2), lua_tointeger(L, 3)));
  lua_pushvalue(L, lua_upvalueindex(1));
  lua_insert(L, 1);
  lua_call(L, lua_gettop(L) - 1, 1);
  return 1;
}

}  // namespace

void bind_table_functions(lua_State* L) {
  lua_getglobal(L, LUA_TABLIBNAME);
  replace_function(L, "insert", guarded<insert>);
  replace_function(L, "remove", guarded<remove>);
  replace_function(L, "concat", guarded<concat>);
  replace_function(L, "unpack", guarded<unpack>);
  replace_function(L, "move", guarded<move>);
  lua_pop(L, 1);
  bind_table_sort(L);
}

}  // namespace smartsurf::script
