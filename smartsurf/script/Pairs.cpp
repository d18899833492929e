// pairs and next in an order that is the same on every run: numbers ascending, then texts by their bytes,
// then false and true. Lua's own order hangs on addresses and on a random hash seed.
#include <algorithm>
#include <string_view>
#include <vector>

#include "smartsurf/script/Fields.h"
#include "smartsurf/script/Session.h"

namespace smartsurf::script {
namespace {

struct Key {
  enum Kind { kNumber, kText, kBoolean, kOther } kind = kOther;
  bool is_integer = false, truth = false;
  lua_Integer integer = 0;
  lua_Number number = 0.0;
  std::string_view text;  // Lua's own bytes: as long as the key lives

  bool operator<(const Key& other) const {
    if (kind != other.kind) return kind < other.kind;
    switch (kind) {
      case kNumber:
        if (is_integer && other.is_integer) return integer < other.integer;
        return exact() < other.exact();
      case kText:
        return text < other.text;
      case kBoolean:
        return !truth && other.truth;
      case kOther:
        return false;
    }
    return false;
  }
  // Wide enough for every integer where long double has 64 bits of mantissa or more.
  long double exact() const {
    return is_integer ? static_cast<long double>(integer) : static_cast<long double>(number);
  }
};

Key key_at(lua_State* L, int index) {
  Key key;
  switch (lua_type(L, index)) {
    case LUA_TNUMBER:
      key.kind = Key::kNumber;
      key.is_integer = lua_isinteger(L, index) != 0;
      key.integer = lua_tointeger(L, index);
      key.number = lua_tonumber(L, index);
      break;
    case LUA_TSTRING: {
      std::size_t length = 0;
      const char* const text = lua_tolstring(L, index, &length);
      key.kind = Key::kText;
      key.text = {text, length};
      break;
    }
    case LUA_TBOOLEAN:
      key.kind = Key::kBoolean;
      key.truth = lua_toboolean(L, index) != 0;
      break;
    default:
      break;
  }
  return key;
}

void push_key(lua_State* L, const Key& key) {
  switch (key.kind) {
    case Key::kNumber:
      if (key.is_integer)
        lua_pushinteger(L, key.integer);
      else
        lua_pushnumber(L, key.number);
      break;
    case Key::kText:
      lua_pushlstring(L, key.text.data(), key.text.size());
      break;
    case Key::kBoolean:
      lua_pushboolean(L, key.truth ? 1 : 0);
      break;
    case Key::kOther:
      lua_pushnil(L);
      break;
  }
}

[[noreturn]] void refuse_key(const char* function, const char* type) {
  throw Problem(
      std::string(function) + ": the table has several keys that are a " + type +
      " or the like; their order would differ from run to run: use a list, or numbers or texts as keys");
}

struct Keys {
  std::vector<Key> sorted;
  bool has_other = false;
};

// The keys of the table at 1. The one of them that cannot be compared, if any, is left on the stack, else
// nil.
Keys keys_of(lua_State* L, const char* function) {
  Keys keys;
  lua_pushnil(L);
  const int other = lua_gettop(L);
  for (lua_pushnil(L); lua_next(L, 1) != 0; lua_pop(L, 1)) {
    const Key key = key_at(L, -2);
    if (key.kind != Key::kOther) {
      keys.sorted.push_back(key);
      continue;
    }
    if (keys.has_other) refuse_key(function, luaL_typename(L, -2));
    keys.has_other = true;
    lua_pushvalue(L, -2);
    lua_replace(L, other);
  }
  std::sort(keys.sorted.begin(), keys.sorted.end());
  return keys;
}

// Upvalues: the table, the list of its keys, the index of the last one given. Keys that went meanwhile are
// skipped.
int step(Session&, lua_State* L) {
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

int pairs(Session& session, lua_State* L) {
  luaL_checkany(L, 1);
  if (luaL_getmetafield(L, 1, "__pairs") != LUA_TNIL) {
    lua_pushvalue(L, 1);
    lua_call(L, 1, 3);
    return 3;
  }
  luaL_checktype(L, 1, LUA_TTABLE);
  lua_settop(L, 1);
  const Keys keys = keys_of(L, "pairs");
  session.interpreter->charge(L, keys.sorted.size());
  lua_pushvalue(L, 1);
  lua_createtable(L, static_cast<int>(keys.sorted.size()) + 1, 0);
  lua_Integer i = 0;
  for (const Key& key : keys.sorted) {
    push_key(L, key);
    lua_rawseti(L, -2, ++i);
  }
  if (keys.has_other) {
    lua_pushvalue(L, 2);
    lua_rawseti(L, -2, ++i);
  }
  lua_pushinteger(L, 0);
  lua_pushcclosure(L, guarded<step>, 3);
  lua_pushvalue(L, 1);
  lua_pushnil(L);
  return 3;
}

int next(Session& session, lua_State* L) {
  luaL_checktype(L, 1, LUA_TTABLE);
  lua_settop(L, 2);
  const Keys keys = keys_of(L, "next");
  session.interpreter->charge(L, keys.sorted.size());
  auto it = keys.sorted.begin();
  bool after_other = false;
  if (!lua_isnil(L, 2)) {
    const Key last = key_at(L, 2);
    after_other = last.kind == Key::kOther;
    it = std::upper_bound(keys.sorted.begin(), keys.sorted.end(), last);
  }
  if (it != keys.sorted.end())
    push_key(L, *it);
  else if (keys.has_other && !after_other)
    lua_pushvalue(L, 3);
  else
    lua_pushnil(L);
  if (lua_isnil(L, -1)) return 1;
  lua_pushvalue(L, -1);
  lua_rawget(L, 1);
  return 2;
}

}  // namespace

void bind_pairs(lua_State* L) {
  lua_register(L, "pairs", guarded<pairs>);
  lua_register(L, "next", guarded<next>);
}

}  // namespace smartsurf::script
