// option: a value that the command line may change. random: the experiment's own random numbers.
#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "smartsurf/script/Fields.h"
#include "smartsurf/script/Session.h"

namespace smartsurf::script {
namespace {

constexpr std::size_t kMostOptions = 1000;

bool is_option_name(const std::string& name) {
  return !name.empty() && name.size() <= 60 && std::isalpha(static_cast<unsigned char>(name[0])) &&
         std::all_of(name.begin(), name.end(),
                     [](unsigned char c) { return c < 0x80 && (std::isalnum(c) || c == '_' || c == '-'); });
}

// What --set gives for this name.
const std::string* given(const Session& session, const std::string& name) {
  const std::string* value = nullptr;
  for (const auto& [key, text] : session.options.set)
    if (key == name) value = &text;
  return value;
}

template <typename T>
std::optional<T> parsed(const std::string& text) {
  T value{};
  const char* const begin = text.data() + (text.starts_with("+") ? 1 : 0);
  const auto [end, error] = std::from_chars(begin, text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

[[noreturn]] void refuse(lua_State* L, const std::string& name, const std::string& text,
                         const std::string& rule) {
  throw Problem("option '" + name + "': --set " + name + "=" + one_line(text.substr(0, 60)) + ": must be " +
                rule + " (default " + show(L, 2) + ")");
}

void push_number(lua_State* L, const std::string& name, const std::string& text) {
  const bool wants_integer = lua_isinteger(L, 2) != 0;
  if (const auto integer = parsed<std::int64_t>(text); integer && wants_integer) {
    lua_pushinteger(L, *integer);
    return;
  }
  const auto number = parsed<double>(text);
  if (!number || !std::isfinite(*number)) refuse(L, name, text, "a number");
  lua_pushnumber(L, *number);
}

void push_boolean(lua_State* L, const std::string& name, const std::string& text) {
  if (text == "true" || text == "1" || text == "yes")
    lua_pushboolean(L, 1);
  else if (text == "false" || text == "0" || text == "no")
    lua_pushboolean(L, 0);
  else
    refuse(L, name, text, "true or false");
}

// The option's value: the default at index 2, or what --set gives, as a value of the default's type.
void push_option_value(Session& session, lua_State* L, const std::string& name) {
  const std::string* const text = given(session, name);
  switch (lua_type(L, 2)) {
    case LUA_TNUMBER:
      number_at(L, 2, "option '" + name + "'");
      text == nullptr ? lua_pushvalue(L, 2) : push_number(L, name, *text);
      break;
    case LUA_TBOOLEAN:
      text == nullptr ? lua_pushvalue(L, 2) : push_boolean(L, name, *text);
      break;
    case LUA_TSTRING:
      if (text == nullptr)
        lua_pushvalue(L, 2);
      else
        lua_pushlstring(L, text->data(), text->size());
      break;
    default:
      must_be(L, 2, "option '" + name + "': default", "a number, a text, true or false");
  }
}

int option(Session& session, lua_State* L) {
  require_loading(session, "option");
  lua_settop(L, 3);
  const std::string name = text_at(L, 1, "option: name");
  if (!is_option_name(name)) must_be(L, 1, "option: name", "letters, digits, _ and -, a letter first");
  const std::string help = lua_isnil(L, 3) ? "" : text_at(L, 3, "option '" + name + "': help");
  declare_once(session, L, "option '" + name + "'");
  if (session.spec.options.size() >= kMostOptions) throw Problem("option: more than 1000 options");
  push_option_value(session, L, name);
  std::size_t length = 0;
  const char* const text = luaL_tolstring(L, -1, &length);
  session.spec.options.push_back({name, std::string(text, length), help});
  lua_pop(L, 1);
  return 1;
}

int random(Session& session, lua_State* L) {
  const int count = lua_gettop(L);
  if (count != 0 && count != 2) throw Problem("random: takes random(low, high), or random() for [0, 1)");
  const double low = count == 0 ? 0.0 : number_at(L, 1, "random: low");
  const double high = count == 0 ? 1.0 : number_at(L, 2, "random: high");
  if (low > high) throw Problem("random: low = " + show(low) + " is above high = " + show(high));
  lua_pushnumber(L, session.generator(L).between(low, high));
  return 1;
}

// As Lua's own, from the experiment's sequence: math.random(), math.random(n), math.random(low, high).
int math_random(Session& session, lua_State* L) {
  const int count = lua_gettop(L);
  if (count == 0) {
    lua_pushnumber(L, session.generator(L).unit());
    return 1;
  }
  if (count > 2) throw Problem("math.random: takes at most 2 numbers");
  const std::int64_t low = count == 1 ? 1 : integer_at(L, 1, "math.random: low", INT64_MIN, INT64_MAX);
  const std::int64_t high = integer_at(L, count, "math.random: high", INT64_MIN, INT64_MAX);
  if (low > high)
    throw Problem("math.random: low = " + std::to_string(low) + " is above high = " + std::to_string(high));
  lua_pushinteger(L, session.generator(L).integer(low, high));
  return 1;
}

int math_randomseed(Session&, lua_State*) {
  throw Problem("math.randomseed: the experiment has one seed; set it with world{seed = ...} or --seed");
}

}  // namespace

void bind_options(lua_State* L) {
  lua_register(L, "option", guarded<option>);
  lua_register(L, "random", guarded<random>);
  lua_getglobal(L, "math");
  lua_pushcfunction(L, guarded<math_random>);
  lua_setfield(L, -2, "random");
  lua_pushcfunction(L, guarded<math_randomseed>);
  lua_setfield(L, -2, "randomseed");
  lua_pop(L, 1);
}

}  // namespace smartsurf::script
