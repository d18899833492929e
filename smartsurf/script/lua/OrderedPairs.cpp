// pairs and next with a reproducible order: numbers ascending, strings by their bytes, then false and true.
// Lua's own order depends on addresses and on a random hash seed.
#include <algorithm>
#include <string_view>
#include <vector>

#include "smartsurf/script/ScriptContext.h"
#include "smartsurf/script/lua/TableReader.h"

namespace smartsurf::script {
namespace {

constexpr std::uint64_t kInstructionsPerKey = 20;  // that collecting and sorting a key take

struct TableKey {
  enum Kind { kNumber, kString, kBoolean, kUnordered } kind = kUnordered;
  bool is_integer = false, boolean = false;
  lua_Integer integer = 0;
  lua_Number number = 0.0;
  std::string_view string;  // owned by Lua; valid while the key exists

  bool operator<(const TableKey& other) const {
    if (kind != other.kind) return kind < other.kind;
    switch (kind) {
      case kNumber:
        if (is_integer && other.is_integer) return integer < other.integer;
        return as_long_double() < other.as_long_double();
      case kString:
        return string < other.string;
      case kBoolean:
        return !boolean && other.boolean;
      case kUnordered:
        return false;
    }
    return false;
  }
  // Exact for every integer if long double has a mantissa of at least 64 bits.
  long double as_long_double() const {
    return is_integer ? static_cast<long double>(integer) : static_cast<long double>(number);
  }
};

TableKey key_at(lua_State* L, int index) {
  TableKey key;
  switch (lua_type(L, index)) {
    case LUA_TNUMBER:
      key.kind = TableKey::kNumber;
      key.is_integer = lua_isinteger(L, index) != 0;
      key.integer = lua_tointeger(L, index);
      key.number = lua_tonumber(L, index);
      break;
    case LUA_TSTRING: {
      std::size_t length = 0;
      const char* const text = lua_tolstring(L, index, &length);
      key.kind = TableKey::kString;
      key.string = {text, length};
      break;
    }
    case LUA_TBOOLEAN:
      key.kind = TableKey::kBoolean;
      key.boolean = lua_toboolean(L, index) != 0;
      break;
    default:
      break;
  }
  return key;
}

void push_key(lua_State* L, const TableKey& key) {
  switch (key.kind) {
    case TableKey::kNumber:
      if (key.is_integer)
        lua_pushinteger(L, key.integer);
      else
        lua_pushnumber(L, key.number);
      break;
    case TableKey::kString:
      lua_pushlstring(L, key.string.data(), key.string.size());
      break;
    case TableKey::kBoolean:
      lua_pushboolean(L, key.boolean ? 1 : 0);
      break;
    case TableKey::kUnordered:
      lua_pushnil(L);
      break;
  }
}

[[noreturn]] void throw_unordered_keys(const char* function, const char* type) {
  throw ScriptError(std::string(function) + ": the table has several keys without an order, such as a " +
                    type +
                    "; their order would differ from run to run: use a list, or number or string keys");
}

struct SortedKeys {
  std::vector<TableKey> sorted;
  bool has_unordered = false;
};

// The sorted keys of the table at index 1. Leaves its only unordered key on the stack, or nil if there is
// none. Throws ScriptError for several unordered keys.
SortedKeys sorted_keys(lua_State* L, const char* function) {
  Interpreter& interpreter = *Interpreter::context_of(L).interpreter;
  SortedKeys keys;
  lua_pushnil(L);
  const int unordered_index = lua_gettop(L);
  for (lua_pushnil(L); lua_next(L, 1) != 0; lua_pop(L, 1)) {
    interpreter.charge(L, kInstructionsPerKey);
    const TableKey key = key_at(L, -2);
    if (key.kind != TableKey::kUnordered) {
      keys.sorted.push_back(key);
      continue;
    }
    if (keys.has_unordered) throw_unordered_keys(function, luaL_typename(L, -2));
    keys.has_unordered = true;
    lua_pushvalue(L, -2);
    lua_replace(L, unordered_index);
  }
  std::sort(keys.sorted.begin(), keys.sorted.end());
  return keys;
}

// The iterator of pairs. Upvalues: the table, the list of its keys, the index of the last key returned. Skips
// keys that were removed during the iteration.
int next_pair(ScriptContext&, lua_State* L) {
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

int pairs(ScriptContext&, lua_State* L) {
  luaL_checkany(L, 1);
  if (luaL_getmetafield(L, 1, "__pairs") != LUA_TNIL) {
    lua_pushvalue(L, 1);
    lua_call(L, 1, 3);
    return 3;
  }
  luaL_checktype(L, 1, LUA_TTABLE);
  lua_settop(L, 1);
  const SortedKeys keys = sorted_keys(L, "pairs");
  lua_pushvalue(L, 1);
  lua_createtable(L, static_cast<int>(keys.sorted.size()) + 1, 0);
  lua_Integer i = 0;
  for (const TableKey& key : keys.sorted) {
    push_key(L, key);
    lua_rawseti(L, -2, ++i);
  }
  if (keys.has_unordered) {
    lua_pushvalue(L, 2);
    lua_rawseti(L, -2, ++i);
  }
  lua_pushinteger(L, 0);
  lua_pushcclosure(L, guarded<next_pair>, 3);
  lua_pushvalue(L, 1);
  lua_pushnil(L);
  return 3;
}

int next(ScriptContext&, lua_State* L) {
  luaL_checktype(L, 1, LUA_TTABLE);
  lua_settop(L, 2);
  const SortedKeys keys = sorted_keys(L, "next");
  auto it = keys.sorted.begin();
  bool after_unordered = false;
  if (!lua_isnil(L, 2)) {
    const TableKey last = key_at(L, 2);
    after_unordered = last.kind == TableKey::kUnordered;
    it = std::upper_bound(keys.sorted.begin(), keys.sorted.end(), last);
  }
  if (it != keys.sorted.end())
    push_key(L, *it);
  else if (keys.has_unordered && !after_unordered)
    lua_pushvalue(L, 3);
  else
    lua_pushnil(L);
  if (lua_isnil(L, -1)) return 1;
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
