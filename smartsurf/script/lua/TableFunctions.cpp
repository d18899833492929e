// Lua's own functions on tables, charged for the elements that they visit. A charge believes a length only
// once it is settled: the library asks for it again, and a metamethod could then answer with another.
#include <algorithm>

#include "smartsurf/script/lua/MeteredLibrary.h"

namespace smartsurf::script {
namespace {

std::uint64_t distance(lua_Integer from, lua_Integer to) {
  return to > from ? static_cast<std::uint64_t>(to) - static_cast<std::uint64_t>(from) : 0;
}

int push_upvalue(lua_State* L) {
  lua_pushvalue(L, lua_upvalueindex(1));
  return 1;
}

// The length of the table at index 1. A table with a metamethod for it is replaced by one that stands for its
// elements and has this length for good. Lua's own function refuses what is not a table.
lua_Integer settle_length(lua_State* L) {
  if (lua_type(L, 1) != LUA_TTABLE) return 0;
  if (luaL_getmetafield(L, 1, "__len") == LUA_TNIL) return static_cast<lua_Integer>(lua_rawlen(L, 1));
  lua_pop(L, 1);
  const lua_Integer length = luaL_len(L, 1);
  lua_newtable(L);
  lua_createtable(L, 0, 3);
  lua_pushinteger(L, length);
  lua_pushcclosure(L, push_upvalue, 1);
  lua_setfield(L, -2, "__len");
  for (const char* const access : {"__index", "__newindex"}) {
    lua_pushvalue(L, 1);
    lua_setfield(L, -2, access);
  }
  lua_setmetatable(L, -2);
  lua_replace(L, 1);
  return length;
}

// table.insert and table.remove move the elements from a position on, if they have that many arguments.
template <int arguments_with_position>
int metered_from_position(Sandbox& sandbox, lua_State* L) {
  const lua_Integer length = settle_length(L);
  if (lua_gettop(L) >= arguments_with_position)
    sandbox.interpreter->charge(L, distance(std::max<lua_Integer>(lua_tointeger(L, 2), 1), length));
  return call_wrapped(L);
}

int concat(Sandbox& sandbox, lua_State* L) {
  const lua_Integer length = settle_length(L);
  std::uint64_t elements = distance(luaL_optinteger(L, 3, 1), luaL_optinteger(L, 4, length));
  // Lua stops at the first absent element, and the heap holds all of those that are there.
  if (lua_getmetatable(L, 1) == 0)
    elements = std::min<std::uint64_t>(elements, sandbox.interpreter->memory_used());
  else
    lua_pop(L, 1);
  sandbox.interpreter->charge(L, elements);
  return call_metered_by_results(sandbox, L);
}

int move(Sandbox& sandbox, lua_State* L) {
  sandbox.interpreter->charge(L, distance(lua_tointeger(L, 2), lua_tointeger(L, 3)));
  return call_wrapped(L);
}

}  // namespace

void bind_table_functions(lua_State* L) {
  lua_getglobal(L, LUA_TABLIBNAME);
  wrap_field(L, "insert", guarded<metered_from_position<3>>);
  wrap_field(L, "remove", guarded<metered_from_position<2>>);
  wrap_field(L, "concat", guarded<concat>);
  wrap_field(L, "unpack", guarded<call_metered_by_results>);
  wrap_field(L, "move", guarded<move>);
  lua_pop(L, 1);
  bind_table_sort(L);
}

}  // namespace smartsurf::script
