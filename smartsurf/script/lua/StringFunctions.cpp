// Lua's own functions on strings, charged for the bytes that they read or write.
#include <algorithm>
#include <cctype>
#include <string>
#include <string_view>

#include "smartsurf/script/lua/MeteredLibrary.h"

namespace smartsurf::script {
namespace {

// Charges the bytes of the arguments that are strings.
int metered(Sandbox& sandbox, lua_State* L) {
  std::uint64_t bytes = 0;
  for (int i = 1; i <= lua_gettop(L); ++i)
    if (lua_type(L, i) == LUA_TSTRING) bytes += lua_rawlen(L, i);
  sandbox.interpreter->charge(L, bytes / (kBytesPerInstruction / 4));  // most work byte by byte
  return call_wrapped(L);
}

// Doubles the text, so that its length alone determines the work.
int rep(Sandbox& sandbox, lua_State* L) {
  const lua_Integer count = lua_tointeger(L, 2);
  if (count <= 0) return call_wrapped(L);
  std::size_t length = 0, separator_length = 0;
  const char* const text = luaL_checklstring(L, 1, &length);
  const char* const separator = luaL_optlstring(L, 3, "", &separator_length);
  const std::size_t part = length + separator_length;
  if (part == 0) {
    lua_pushliteral(L, "");
    return 1;
  }
  if (static_cast<std::uint64_t>(count) > (kMaxStringBytes + separator_length) / part)
    throw LimitError(kLongString);
  const std::size_t total = static_cast<std::size_t>(count) * part - separator_length;
  sandbox.interpreter->charge(L, total / kBytesPerInstruction);
  std::string result(text, length);
  result.reserve(total);
  if (count > 1) result.append(separator, separator_length);
  while (result.size() < total) result.append(result.data(), std::min(result.size(), total - result.size()));
  lua_pushlstring(L, result.data(), total);
  return 1;
}

// A format of string.pack pads to the sizes that it names, and repeats no option.
int pack(Sandbox& sandbox, lua_State* L) {
  std::size_t length = 0;
  const char* const text = luaL_checklstring(L, 1, &length);
  std::uint64_t size = 0, total = length;
  for (const char c : std::string_view(text, length)) {
    size = std::isdigit(static_cast<unsigned char>(c)) != 0
               ? std::min<std::uint64_t>(10 * size + static_cast<std::uint64_t>(c - '0'), kMaxStringBytes + 1)
               : 0;
    if (size > kMaxStringBytes) throw LimitError(std::string("string.pack: ") + kLongString);
    total += size;
  }
  sandbox.interpreter->charge(L, total / (kBytesPerInstruction / 4));
  return metered(sandbox, L);
}

}  // namespace

int call_metered_by_results(Sandbox& sandbox, lua_State* L) {
  const int results = call_wrapped(L);
  std::uint64_t work = 0;
  for (int i = 1; i <= results; ++i)
    work += lua_type(L, i) == LUA_TSTRING ? lua_rawlen(L, i) / kBytesPerInstruction : 1;
  sandbox.interpreter->charge(L, work);
  return results;
}

void bind_string_functions(lua_State* L) {
  lua_getglobal(L, LUA_STRLIBNAME);
  for (const char* const name : {"lower", "reverse", "upper"}) wrap_field(L, name, guarded<metered>);
  for (const char* const name : {"byte", "sub", "unpack"})
    wrap_field(L, name, guarded<call_metered_by_results>);
  wrap_field(L, "rep", guarded<rep>);
  wrap_field(L, "pack", guarded<pack>);
  lua_pop(L, 1);
  lua_getglobal(L, LUA_UTF8LIBNAME);
  wrap_field(L, "codepoint", guarded<call_metered_by_results>);
  wrap_field(L, "len", guarded<metered>);
  lua_pop(L, 1);
  bind_pattern_functions(L);
}

}  // namespace smartsurf::script
