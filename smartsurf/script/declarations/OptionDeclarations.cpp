// option: values that the command line can override. vary: what each episode draws. random,
// random_stream, math.random: the experiment's random numbers.
#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "common/text/Number.h"
#include "smartsurf/script/ScriptContext.h"
#include "smartsurf/script/lua/TableReader.h"

namespace smartsurf::script {
namespace {

constexpr std::size_t kMaxOptions = 1000;

constexpr const char* kNameRule = "1 to 60 letters, digits, _ and -";

bool is_name(const std::string& name) {
  return !name.empty() && name.size() <= 60 && std::all_of(name.begin(), name.end(), [](unsigned char c) {
    return c < 0x80 && (std::isalnum(c) || c == '_' || c == '-');
  });
}

// The value that --set assigns to `name`; null if none.
const std::string* find_override(const ScriptContext& context, const std::string& name) {
  const std::string* value = nullptr;
  for (const auto& [key, text] : context.options.overrides)
    if (key == name) value = &text;
  return value;
}

template <typename T>
std::optional<T> parse_number(std::string_view text) {
  T value{};
  if (text.starts_with("+")) text.remove_prefix(1);
  return common::parse_number(text, value) ? std::optional(value) : std::nullopt;
}

[[noreturn]] void throw_option_error(lua_State* L, const std::string& name, const std::string& text,
                                     const std::string& requirement) {
  throw ScriptError("option '" + name + "': --set " + name + "=" + to_single_line(text.substr(0, 60)) +
                    ": must be " + requirement + " (default " + format_value(L, 2) + ")");
}

void push_number(lua_State* L, const std::string& name, const std::string& text) {
  const bool wants_integer = lua_isinteger(L, 2) != 0;
  if (const auto integer = parse_number<std::int64_t>(text); integer && wants_integer) {
    lua_pushinteger(L, *integer);
    return;
  }
  const auto number = parse_number<double>(text);
  if (!number || !std::isfinite(*number)) throw_option_error(L, name, text, "a number");
  lua_pushnumber(L, *number);
}

void push_boolean(lua_State* L, const std::string& name, const std::string& text) {
  if (text == "true" || text == "1" || text == "yes")
    lua_pushboolean(L, 1);
  else if (text == "false" || text == "0" || text == "no")
    lua_pushboolean(L, 0);
  else
    throw_option_error(L, name, text, "true or false");
}

// Pushes the option's value: the default at index 2, or the --set value converted to the default's type.
void push_option_value(ScriptContext& context, lua_State* L, const std::string& name) {
  const int type = lua_type(L, 2);
  if (type == LUA_TNUMBER)
    check_number(L, 2, "option '" + name + "'");
  else if (type == LUA_TSTRING)
    check_string(L, 2, "option '" + name + "': default");
  else if (type != LUA_TBOOLEAN)
    throw_invalid_value(L, 2, "option '" + name + "': default", "a number, a string, true or false");
  const std::string* const text = find_override(context, name);
  if (text == nullptr)
    lua_pushvalue(L, 2);
  else if (type == LUA_TNUMBER)
    push_number(L, name, *text);
  else if (type == LUA_TBOOLEAN)
    push_boolean(L, name, *text);
  else
    lua_pushlstring(L, text->data(), text->size());
}

// The values that the fourth argument allows: {low, high} of a number, which is whole if the default is, or
// the strings of which the option is one.
struct Allowed {
  std::vector<double> ends = {};
  std::vector<std::string> words = {};
  bool is_whole = false;
};

Allowed check_allowed(lua_State* L, const std::string& name) {
  const bool is_number = lua_type(L, 2) == LUA_TNUMBER;
  const std::string what = "option '" + name + "': " + (is_number ? "range" : "choice"),
                    requirement = is_number ? "{low, high}" : "a list of strings, {'one', 'two'}";
  if (lua_type(L, 2) == LUA_TBOOLEAN) throw_invalid_value(L, 4, what, "left out: true or false is one");
  Allowed a;
  if (is_number) {
    a.ends = check_numbers(L, 4, what, 2, requirement);
    if (a.ends[0] > a.ends[1])
      throw ScriptError(what + ": low = " + format_value(a.ends[0]) +
                        " is above high = " + format_value(a.ends[1]));
    a.is_whole = lua_isinteger(L, 2) != 0;
    return a;
  }
  if (!lua_istable(L, 4) || lua_rawlen(L, 4) == 0) throw_invalid_value(L, 4, what, requirement);
  for_each_element(L, 4, what, [&](int i, const std::string& element) {
    a.words.push_back(to_single_line(check_string(L, i, element)));
  });
  return a;
}

std::string to_text(const Allowed& a) {
  return a.words.empty() ? format_value(a.ends[0]) + " to " + format_value(a.ends[1]) : join_names(a.words);
}

// The option's value is on top of the stack; a float that is whole, as 20.0, becomes an integer.
void require_allowed(ScriptContext& context, lua_State* L, const std::string& name, const Allowed& a) {
  bool is_allowed = false;
  if (a.words.empty()) {
    const double value = lua_tonumber(L, -1);
    is_allowed = a.ends[0] <= value && value <= a.ends[1] && (!a.is_whole || value == std::floor(value));
    if (is_allowed && a.is_whole) {
      lua_pushinteger(L, lua_tointeger(L, -1));
      lua_replace(L, -2);
    }
  } else {
    is_allowed = std::ranges::find(a.words, lua_tostring(L, -1)) != a.words.end();
  }
  if (is_allowed) return;
  const std::string requirement =
      (a.words.empty() ? a.is_whole ? "a whole number, " : "" : "one of ") + to_text(a);
  if (const std::string* const text = find_override(context, name))
    throw_option_error(L, name, *text, requirement);
  throw_invalid_value(L, 2, "option '" + name + "': default", requirement);
}

// Returns the kind of the value on top of the stack, whose type is that of the default at index 2. An integer
// may be set to a real number.
scene::OptionSpec::Kind option_kind(lua_State* L) {
  using Kind = scene::OptionSpec::Kind;
  const int type = lua_type(L, 2);
  if (type == LUA_TBOOLEAN) return Kind::kBool;
  if (type == LUA_TSTRING) return Kind::kText;
  return lua_isinteger(L, 2) != 0 && lua_isinteger(L, -1) != 0 ? Kind::kInteger : Kind::kReal;
}

int option(ScriptContext& context, lua_State* L) {
  require_loading(context, "option");
  lua_settop(L, 4);
  const std::string name = check_string(L, 1, "option: name");
  if (!is_name(name) || !std::isalpha(static_cast<unsigned char>(name[0])))
    throw_invalid_value(L, 1, "option: name", std::string(kNameRule) + ", a letter first");
  scene::OptionSpec spec{.name = name,
                         .value = {},
                         .help = lua_isnil(L, 3) ? "" : check_string(L, 3, "option '" + name + "': help")};
  declare_once(context, L, "option '" + name + "'");
  if (context.spec.options.size() >= kMaxOptions) throw ScriptError("option: more than 1000 options");
  push_option_value(context, L, name);
  if (!lua_isnil(L, 4)) {
    const Allowed allowed = check_allowed(L, name);
    require_allowed(context, L, name, allowed);
    spec.help += (spec.help.empty() ? "" : "; ") + to_text(allowed);
    if (allowed.words.empty()) spec.range = {allowed.ends[0], allowed.ends[1]};
    spec.choices = allowed.words;
  }
  spec.kind = option_kind(L);
  std::size_t length = 0;
  const char* const text = luaL_tolstring(L, -1, &length);
  spec.value.assign(text, length);
  context.spec.options.push_back(std::move(spec));
  lua_pop(L, 1);
  return 1;
}

// {LOW, HIGH} or {LOW, HIGH, MODE} at the top of the stack.
scene::Variation check_variation(const ScriptContext& context, lua_State* L, const std::string& nuisance) {
  const std::string name = "vary." + nuisance,
                    requirement = "{low, high} or {low, high, 'factor' or 'offset'}";
  const int table = lua_gettop(L);
  const std::size_t size = lua_istable(L, table) ? lua_rawlen(L, table) : 0;
  if (size != 2 && size != 3) throw_invalid_value(L, table, name, requirement);
  for (lua_pushnil(L); lua_next(L, table) != 0; lua_pop(L, 1))
    if (lua_isinteger(L, -2) == 0) throw_invalid_value(L, table, name, requirement);
  scene::Variation v{.name = nuisance, .subject = context.interpreter->current_location(L) + ": " + name};
  for_each_element(L, table, name, [&](int i, const std::string& element) {
    if (element.ends_with("[3]")) {
      const auto mode = scene::find_variation_mode(check_string(L, i, element));
      if (!mode) throw_invalid_value(L, i, element, "'absolute', 'factor' or 'offset'");
      v.mode = *mode;
    } else {
      (element.ends_with("[1]") ? v.low : v.high) = check_number(L, i, element);
    }
  });
  throw_if_invalid(validate(v), name + ": ");
  return v;
}

// simulation::Nuisances checks the name once the scene is complete.
int vary(ScriptContext& context, lua_State* L) {
  declare_once(context, L, "vary");
  if (!lua_istable(L, 1)) throw_invalid_value(L, 1, "vary", "a table, vary{friction = {0.5, 1.5, 'factor'}}");
  for (lua_pushnil(L); lua_next(L, 1) != 0; lua_pop(L, 1)) {
    if (lua_type(L, -2) != LUA_TSTRING)
      throw_invalid_value(L, -2, "vary", "by name: vary{friction = {0.5, 1.5, 'factor'}}");
    const std::string name = lua_tostring(L, -2);
    if (context.vary.size() >= kMaxOptions) throw ScriptError("vary: more than 1000 nuisances");
    context.vary.push_back(check_variation(context, L, to_single_line(name)));
  }
  return 0;
}

struct Bounds {
  double low = 0.0, high = 1.0;
};

// The arguments at `first` and after it; [0, 1) without these.
Bounds check_bounds(lua_State* L, int first, const std::string& name) {
  if (lua_gettop(L) < first) return {};
  const Bounds b{check_number(L, first, name + ": low"), check_number(L, first + 1, name + ": high")};
  if (b.low > b.high)
    throw ScriptError(name + ": low = " + format_value(b.low) + " is above high = " + format_value(b.high));
  return b;
}

int random(ScriptContext& context, lua_State* L) {
  const int count = lua_gettop(L);
  if (count != 0 && count != 2) throw ScriptError("random: takes random(low, high), or random() for [0, 1)");
  const Bounds b = check_bounds(L, 1, "random");
  lua_pushnumber(L, context.random_stream(L).uniform(b.low, b.high));
  return 1;
}

int random_stream(ScriptContext& context, lua_State* L) {
  const int count = lua_gettop(L);
  if (count != 1 && count != 3)
    throw ScriptError(
        "random_stream: takes random_stream(name, low, high), or random_stream(name) for [0, 1)");
  const std::string name = check_string(L, 1, "random_stream: name");
  if (!is_name(name)) throw_invalid_value(L, 1, "random_stream: name", kNameRule);
  const Bounds b = check_bounds(L, 2, "random_stream");
  lua_pushnumber(L, context.random_stream(L, name).uniform(b.low, b.high));
  return 1;
}

// Replaces Lua's math.random with the experiment's random numbers; same signatures: (), (n), (0) for an
// integer of any bits, (low, high).
int math_random(ScriptContext& context, lua_State* L) {
  const int count = lua_gettop(L);
  if (count == 0) {
    lua_pushnumber(L, context.random_stream(L).uniform_unit());
    return 1;
  }
  if (count > 2) throw ScriptError("math.random: takes at most 2 numbers");
  std::int64_t low = count == 1 ? 1 : check_integer(L, 1, "math.random: low", INT64_MIN, INT64_MAX);
  std::int64_t high = check_integer(L, count, "math.random: high", INT64_MIN, INT64_MAX);
  if (count == 1 && high == 0) low = INT64_MIN, high = INT64_MAX;
  if (low > high)
    throw ScriptError("math.random: low = " + std::to_string(low) +
                      " is above high = " + std::to_string(high));
  lua_pushinteger(L, context.random_stream(L).uniform_integer(low, high));
  return 1;
}

int math_randomseed(ScriptContext&, lua_State*) {
  throw ScriptError("math.randomseed: the experiment has one seed; set it with world{seed = ...} or --seed");
}

}  // namespace

void bind_options(lua_State* L) {
  lua_register(L, "option", guarded<option>);
  lua_register(L, "vary", guarded<vary>);
  lua_register(L, "random", guarded<random>);
  lua_register(L, "random_stream", guarded<random_stream>);
  lua_getglobal(L, "math");
  lua_pushcfunction(L, guarded<math_random>);
  lua_setfield(L, -2, "random");
  lua_pushcfunction(L, guarded<math_randomseed>);
  lua_setfield(L, -2, "randomseed");
  lua_pop(L, 1);
}

}  // namespace smartsurf::script
