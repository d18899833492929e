// string.find, match, gmatch and gsub, which charge the steps of the match.
#include <algorithm>
#include <cstring>
#include <string>
#include <string_view>

#include "smartsurf/script/lua/MeteredLibrary.h"
#include "smartsurf/script/lua/PatternMatcher.h"

namespace smartsurf::script {
namespace {

constexpr std::uint64_t kStepsPerInstruction = 4;

std::string_view check_text(lua_State* L, int index) {
  std::size_t length = 0;
  const char* const text = luaL_checklstring(L, index, &length);
  return {text, length};
}

PatternMatcher make_matcher(Sandbox& sandbox, lua_State* L, std::string_view subject,
                            std::string_view pattern) {
  return {subject, pattern,
          [&sandbox, L](std::size_t steps) { sandbox.interpreter->charge(L, steps / kStepsPerInstruction); }};
}

// The index of argument `index`, from 1 or, if negative, from the end, as one from 0; at most length + 1.
std::size_t start_index(lua_State* L, int index, std::size_t length) {
  const lua_Integer start = luaL_optinteger(L, index, 1);
  if (start > 0) return std::min<lua_Unsigned>(static_cast<lua_Unsigned>(start) - 1, length + 1);
  if (start == 0 || start < -static_cast<lua_Integer>(length)) return 0;
  return length - -start;
}

// Pushes capture `i` of the match [begin, end); without captures, the whole match is the first.
void push_capture(lua_State* L, const PatternMatcher& matcher, std::size_t i, std::string_view subject,
                  std::size_t begin, std::size_t end) {
  if (i >= matcher.capture_count()) {
    if (i != 0) throw ScriptError("invalid capture index %" + std::to_string(i + 1));
    lua_pushlstring(L, subject.data() + begin, end - begin);
    return;
  }
  const PatternMatcher::Capture& capture = matcher.capture(i);
  if (capture.open) throw ScriptError("unfinished capture");
  if (capture.is_position)
    lua_pushinteger(L, static_cast<lua_Integer>(capture.begin) + 1);
  else
    lua_pushlstring(L, subject.data() + capture.begin, capture.length);
}

int push_captures(lua_State* L, const PatternMatcher& matcher, std::string_view subject, std::size_t begin,
                  std::size_t end, bool whole_if_none) {
  const std::size_t count = matcher.capture_count() == 0 && whole_if_none ? 1 : matcher.capture_count();
  luaL_checkstack(L, static_cast<int>(count), "too many captures");
  for (std::size_t i = 0; i < count; ++i) push_capture(L, matcher, i, subject, begin, end);
  return static_cast<int>(count);
}

int find_or_match(Sandbox& sandbox, lua_State* L, bool find) {
  const std::string_view subject = check_text(L, 1);
  std::string_view pattern = check_text(L, 2);
  const std::size_t start = start_index(L, 3, subject.size());
  if (start > subject.size()) {
    lua_pushnil(L);
    return 1;
  }
  const bool plain =
      find && (lua_toboolean(L, 4) != 0 || pattern.find_first_of("^$*+?.([%-") == pattern.npos);
  if (plain) {
    // memmem() takes linear time, unlike std::string_view::find().
    const std::string_view rest = subject.substr(start);
    const void* const at = ::memmem(rest.data(), rest.size(), pattern.data(), pattern.size());
    const std::size_t found = at == nullptr ? subject.npos : static_cast<const char*>(at) - subject.data();
    const std::size_t scanned = at == nullptr ? rest.size() : found - start;
    sandbox.interpreter->charge(L, (scanned + pattern.size()) / kBytesPerInstruction);
    if (found == subject.npos) {
      lua_pushnil(L);
      return 1;
    }
    lua_pushinteger(L, static_cast<lua_Integer>(found) + 1);
    lua_pushinteger(L, static_cast<lua_Integer>(found + pattern.size()));
    return 2;
  }
  const bool anchored = pattern.starts_with('^');
  if (anchored) pattern.remove_prefix(1);
  PatternMatcher matcher = make_matcher(sandbox, L, subject, pattern);
  for (std::size_t s = start; s <= subject.size(); ++s) {
    const std::optional<std::size_t> end = matcher.match_at(s);
    if (end && find) {
      lua_pushinteger(L, static_cast<lua_Integer>(s) + 1);
      lua_pushinteger(L, static_cast<lua_Integer>(*end));
      return 2 + push_captures(L, matcher, subject, s, *end, false);
    }
    if (end) return push_captures(L, matcher, subject, s, *end, true);
    if (anchored) break;
  }
  lua_pushnil(L);
  return 1;
}

int find(Sandbox& sandbox, lua_State* L) { return find_or_match(sandbox, L, true); }
int match(Sandbox& sandbox, lua_State* L) { return find_or_match(sandbox, L, false); }

// The iterator of gmatch. Upvalues: subject, pattern, where to search next, end of the last match or -1.
int next_match(Sandbox& sandbox, lua_State* L) {
  const std::string_view subject = check_text(L, lua_upvalueindex(1)),
                         pattern = check_text(L, lua_upvalueindex(2));
  const lua_Integer last = lua_tointeger(L, lua_upvalueindex(4));
  PatternMatcher matcher = make_matcher(sandbox, L, subject, pattern);
  for (std::size_t s = lua_tointeger(L, lua_upvalueindex(3)); s <= subject.size(); ++s) {
    const std::optional<std::size_t> end = matcher.match_at(s);
    if (!end || static_cast<lua_Integer>(*end) == last) continue;
    lua_pushinteger(L, static_cast<lua_Integer>(*end));
    lua_copy(L, -1, lua_upvalueindex(3));
    lua_replace(L, lua_upvalueindex(4));
    return push_captures(L, matcher, subject, s, *end, true);
  }
  lua_pushinteger(L, static_cast<lua_Integer>(subject.size()) + 1);
  lua_replace(L, lua_upvalueindex(3));
  return 0;
}

int gmatch(Sandbox&, lua_State* L) {
  const std::string_view subject = check_text(L, 1);
  check_text(L, 2);
  const std::size_t start = start_index(L, 3, subject.size());
  lua_settop(L, 2);
  lua_pushinteger(L, static_cast<lua_Integer>(start));
  lua_pushinteger(L, -1);
  lua_pushcclosure(L, guarded<next_match>, 4);
  return 1;
}

void append_within_limit(std::string& result, std::string_view text) {
  if (text.size() > kMaxStringBytes - result.size())
    throw LimitError(std::string("string.gsub: ") + kLongString);
  result.append(text);
}

// The replacement string with %0 to %9 and %% expanded.
void append_expanded(lua_State* L, std::string& result, const PatternMatcher& matcher,
                     std::string_view subject, std::size_t begin, std::size_t end) {
  const std::string_view text = check_text(L, 3);
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      append_within_limit(result, text.substr(i, 1));
      continue;
    }
    const char c = ++i < text.size() ? text[i] : '\0';
    if (c == '%' && i < text.size()) {
      append_within_limit(result, "%");
    } else if (c == '0') {
      append_within_limit(result, subject.substr(begin, end - begin));
    } else if (c >= '1' && c <= '9') {
      push_capture(L, matcher, c - '1', subject, begin, end);
      std::size_t length = 0;
      const char* const capture = luaL_tolstring(L, -1, &length);
      append_within_limit(result, {capture, length});
      lua_pop(L, 2);
    } else {
      throw ScriptError("invalid use of '%' in replacement string");
    }
  }
}

// Appends what replaces the match [begin, end).
void append_replacement(lua_State* L, std::string& result, const PatternMatcher& matcher,
                        std::string_view subject, std::size_t begin, std::size_t end) {
  switch (lua_type(L, 3)) {
    case LUA_TFUNCTION:
      lua_pushvalue(L, 3);
      lua_call(L, push_captures(L, matcher, subject, begin, end, true), 1);
      break;
    case LUA_TTABLE:
      push_capture(L, matcher, 0, subject, begin, end);
      lua_gettable(L, 3);
      break;
    default:
      append_expanded(L, result, matcher, subject, begin, end);
      return;
  }
  if (lua_toboolean(L, -1) == 0) {
    append_within_limit(result, subject.substr(begin, end - begin));
  } else if (lua_isstring(L, -1) != 0) {
    std::size_t length = 0;
    const char* const text = lua_tolstring(L, -1, &length);
    append_within_limit(result, {text, length});
  } else {
    throw ScriptError(std::string("invalid replacement value (a ") + luaL_typename(L, -1) + ")");
  }
  lua_pop(L, 1);
}

int gsub(Sandbox& sandbox, lua_State* L) {
  const std::string_view subject = check_text(L, 1);
  std::string_view pattern = check_text(L, 2);
  const int type = lua_type(L, 3);
  luaL_argexpected(L,
                   type == LUA_TNUMBER || type == LUA_TSTRING || type == LUA_TFUNCTION || type == LUA_TTABLE,
                   3, "string/function/table");
  const lua_Integer most = luaL_optinteger(L, 4, static_cast<lua_Integer>(subject.size()) + 1);
  lua_settop(L, 3);
  const bool anchored = pattern.starts_with('^');
  if (anchored) pattern.remove_prefix(1);
  PatternMatcher matcher = make_matcher(sandbox, L, subject, pattern);
  std::string result;
  lua_Integer count = 0;
  std::optional<std::size_t> last;
  std::size_t s = 0;
  while (count < most) {
    const std::optional<std::size_t> end = matcher.match_at(s);
    if (end && end != last) {
      ++count;
      const std::size_t before = result.size();
      if (type == LUA_TSTRING) sandbox.interpreter->charge(L, lua_rawlen(L, 3) / kStepsPerInstruction);
      append_replacement(L, result, matcher, subject, s, *end);
      sandbox.interpreter->charge(L, 1 + (result.size() - before) / kBytesPerInstruction);
      s = *end;
      last = end;
    } else if (s < subject.size()) {
      append_within_limit(result, subject.substr(s++, 1));
    } else {
      break;
    }
    if (anchored) break;
  }
  if (s < subject.size()) append_within_limit(result, subject.substr(s));
  lua_pushlstring(L, result.data(), result.size());
  lua_pushinteger(L, count);
  return 2;
}

}  // namespace

void bind_pattern_functions(lua_State* L) {
  lua_getglobal(L, LUA_STRLIBNAME);
  static constexpr luaL_Reg kFunctions[] = {{"find", guarded<find>},
                                            {"match", guarded<match>},
                                            {"gmatch", guarded<gmatch>},
                                            {"gsub", guarded<gsub>},
                                            {nullptr, nullptr}};
  luaL_setfuncs(L, kFunctions, 0);
  lua_pop(L, 1);
}

}  // namespace smartsurf::script
