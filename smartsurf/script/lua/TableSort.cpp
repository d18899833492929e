// table.sort is Lua's quicksort, comparison by comparison, with two differences for which Lua's own cannot be
// used. Where its halves become too uneven, Lua takes the next pivots from the clock. A script sees them, in
// the order of the comparisons and of equal elements, so these come from a fixed sequence. And each
// comparison is charged: how many an adverse order or a lying length takes is not known in advance.
#include <algorithm>
#include <climits>
#include <cstdint>

#include "smartsurf/script/lua/MeteredLibrary.h"

namespace smartsurf::script {
namespace {

constexpr lua_Integer kMedianOfThreeLimit = 100;  // from this length on, pivots may be pseudorandom
constexpr lua_Integer kUneven = 128;              // a part's share below which they are

// Sorts the table at index 1 by the function at index 2, or by `<` if that is nil.
class Sorter {
 public:
  Sorter(Sandbox& sandbox, lua_State* L) : interpreter_(*sandbox.interpreter), L_(L) {}

  // The elements from `low` to `high`.
  void sort(lua_Integer low, lua_Integer high, std::uint32_t random = 0) {
    while (low < high) {
      order(low, high);
      if (high - low == 1) return;
      const lua_Integer middle = pivot_index(low, high, random);
      lua_geti(L_, 1, middle);
      lua_geti(L_, 1, low);
      if (is_less(-2, -1)) {
        set_two(middle, low);
      } else {
        lua_pop(L_, 2);
        order(middle, high);
      }
      if (high - low == 2) return;
      lua_geti(L_, 1, middle);
      lua_pushvalue(L_, -1);
      lua_geti(L_, 1, high - 1);
      set_two(middle, high - 1);
      const lua_Integer split = partition(low, high);
      const lua_Integer shorter = std::min(split - low, high - split);
      if (split - low < high - split) {
        sort(low, split - 1, random);
        low = split + 1;
      } else {
        sort(split + 1, high, random);
        high = split - 1;
      }
      if ((high - low) / kUneven > shorter) random = random * 1664525U + 1013904223U;
    }
  }

 private:
  bool is_less(int a, int b) {
    interpreter_.charge(L_, 1);
    if (lua_isnil(L_, 2)) return lua_compare(L_, a, b, LUA_OPLT) != 0;
    lua_pushvalue(L_, 2);
    lua_pushvalue(L_, a - 1);
    lua_pushvalue(L_, b - 2);
    lua_call(L_, 2, 1);
    const bool less = lua_toboolean(L_, -1) != 0;
    lua_pop(L_, 1);
    return less;
  }

  // Pops the two values on top into elements i (the topmost) and j.
  void set_two(lua_Integer i, lua_Integer j) {
    lua_seti(L_, 1, i);
    lua_seti(L_, 1, j);
  }

  void order(lua_Integer i, lua_Integer j) {
    lua_geti(L_, 1, i);
    lua_geti(L_, 1, j);
    if (is_less(-1, -2))
      set_two(i, j);
    else
      lua_pop(L_, 2);
  }

  static lua_Integer pivot_index(lua_Integer low, lua_Integer high, std::uint32_t random) {
    if (high - low < kMedianOfThreeLimit || random == 0) return (low + high) / 2;
    const lua_Integer quarter = (high - low) / 4;
    return random % (2 * quarter) + low + quarter;
  }

  // Around the pivot, which is on top of the stack, popped, and element high - 1. Returns its place.
  lua_Integer partition(lua_Integer low, lua_Integer high) {
    lua_Integer i = low, j = high - 1;
    while (true) {
      while (lua_geti(L_, 1, ++i), is_less(-1, -2)) {
        if (i == high - 1) luaL_error(L_, "invalid order function for sorting");
        lua_pop(L_, 1);
      }
      while (lua_geti(L_, 1, --j), is_less(-3, -1)) {
        if (j < i) luaL_error(L_, "invalid order function for sorting");
        lua_pop(L_, 1);
      }
      if (j < i) {
        lua_pop(L_, 1);
        set_two(high - 1, i);
        return i;
      }
      set_two(i, j);
    }
  }

  Interpreter& interpreter_;
  lua_State* L_;
};

int sort(Sandbox& sandbox, lua_State* L) {
  luaL_checktype(L, 1, LUA_TTABLE);
  const lua_Integer length = luaL_len(L, 1);
  if (length < 2) return 0;
  luaL_argcheck(L, length < INT_MAX, 1, "array too big");
  if (!lua_isnoneornil(L, 2)) luaL_checktype(L, 2, LUA_TFUNCTION);
  lua_settop(L, 2);
  Sorter(sandbox, L).sort(1, length);
  return 0;
}

}  // namespace

void bind_table_sort(lua_State* L) {
  lua_getglobal(L, LUA_TABLIBNAME);
  wrap_field(L, "sort", guarded<sort>);
  lua_pop(L, 1);
}

}  // namespace smartsurf::script
