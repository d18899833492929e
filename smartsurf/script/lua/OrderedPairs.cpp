// pairs and next in a reproducible order: numbers ascending, strings by their bytes, then false and true. The
// order of Lua's own follows from the hash table, whose seed Lua draws from the clock and from addresses in
// each run.
#include <algorithm>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "smartsurf/script/lua/StandardLibrary.h"
#include "smartsurf/script/lua/TableReader.h"

namespace smartsurf::script {
namespace {

constexpr std::uint64_t kInstructionsPerKey = 20;  // that collecting and sorting a key take

struct TableKey {
  enum Kind { kNumber, kString, kBoolean, kUnordered } kind = kUnordered;
  // A number, or 0 and 1 for false and true. A long double with a mantissa of 64 bits is exact for every
  // integer.
  long double number = 0.0L;
  std::string_view string;  // owned by Lua; valid while the key exists
  lua_Integer index = 0;    // in the list of the keys as Lua visits them

  bool operator<(const TableKey& other) const {
    return std::tie(kind, number, string) < std::tie(other.kind, other.number, other.string);
  }
};

TableKey key_at(lua_State* L, int index) {
  switch (lua_type(L, index)) {
    case LUA_TNUMBER:
      return {TableKey::kNumber,
              lua_isinteger(L, index) != 0 ? static_cast<long double>(lua_tointeger(L, index))
                                           : static_cast<long double>(lua_tonumber(L, index)),
              {}};
    case LUA_TSTRING: {
      std::size_t length = 0;
      const char* const text = lua_tolstring(L, index, &length);
      return {TableKey::kString, 0.0L, {text, length}};
    }
    case LUA_TBOOLEAN:
      return {TableKey::kBoolean, static_cast<long double>(lua_toboolean(L, index)), {}};
    default:
      return {};
  }
}

[[noreturn]] void throw_unordered_keys(const char* function, const char* type) {
  throw ScriptError(std::string(function) + ": the table has several keys without an order, such as a " +
                    type +
                    "; their order would differ from run to run: use a list, or number or string keys");
}

// The sorted keys of the table at index 1; one without an order is the last. Pushes the list of the keys to
// which their indices refer. Throws ScriptError for several keys without an order.
std::vector<TableKey> sorted_keys(lua_State* L, const char* function) {
  Interpreter& interpreter = *Interpreter::sandbox_of(L).interpreter;
  std::vector<TableKey> keys;
  bool has_unordered = false;
  lua_newtable(L);
  const int list = lua_gettop(L);
  for (lua_pushnil(L); lua_next(L, 1) != 0; lua_pop(L, 1)) {
    interpreter.charge(L, kInstructionsPerKey);
    TableKey key = key_at(L, -2);
    if (key.kind == TableKey::kUnordered && std::exchange(has_unordered, true))
      throw_unordered_keys(function, luaL_typename(L, -2));
    key.index = static_cast<lua_Integer>(keys.size()) + 1;
    keys.push_back(key);
    lua_pushvalue(L, -2);
    lua_rawseti(L, list, key.index);
  }
  std::sort(keys.begin(), keys.end());
  return keys;
}

// The iterator of pairs. Upvalues: the table, the list of its keys, the index of the last key returned. Skips
// keys that were removed during the iteration.
int next_pair(Sandbox&, lua_State* L) {
  lua_Integer i = lua_tointeger(L, lua_upvalueindex(3));
  while (true) {
    lua_rawgeti(L, lua_upvalueindex(2), ++i);
    if (lua_isnil(L, -1)) return 1;
    lua_pushvalue(L, -1);
    lua_rawget(L, lua_upvalueindex(1));
    if (!lua_isnil(L, -1)) break;
    lua_pop(L, 2);
  }
  lua_pushinteger(L, i);
  lua_replace(L, lua_upvalueindex(3));
  return 2;
}

int pairs(Sandbox&, lua_State* L) {
  luaL_checkany(L, 1);
  if (luaL_getmetafield(L, 1, "__pairs") != LUA_TNIL) {
    lua_pushvalue(L, 1);
    lua_call(L, 1, 3);
    return 3;
  }
  luaL_checktype(L, 1, LUA_TTABLE);
  lua_settop(L, 1);
  const std::vector<TableKey> keys = sorted_keys(L, "pairs");  // at index 2
  lua_pushvalue(L, 1);
  lua_createtable(L, static_cast<int>(keys.size()), 0);
  lua_Integer i = 0;
  for (const TableKey& key : keys) {
    lua_rawgeti(L, 2, key.index);
    lua_rawseti(L, -2, ++i);
  }
  lua_pushinteger(L, 0);
  lua_pushcclosure(L, guarded<next_pair>, 3);
  lua_pushvalue(L, 1);
  lua_pushnil(L);
  return 3;
}

int next(Sandbox&, lua_State* L) {
  luaL_checktype(L, 1, LUA_TTABLE);
  lua_settop(L, 2);
  const std::vector<TableKey> keys = sorted_keys(L, "next");  // at index 3
  const auto it = lua_isnil(L, 2) ? keys.begin() : std::upper_bound(keys.begin(), keys.end(), key_at(L, 2));
  if (it == keys.end()) {
    lua_pushnil(L);
    return 1;
  }
  lua_rawgeti(L, 3, it->index);
  lua_pushvalue(L, -1);
  lua_rawget(L, 1);
  return 2;
}

}  // namespace

void bind_ordered_pairs(lua_State* L) {
  lua_register(L, "pairs", guarded<pairs>);
  lua_register(L, "next", guarded<next>);
}

}  // namespace smartsurf::script
