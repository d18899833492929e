// Episodes of a learning environment: reward, success, info, episode and on_reset.
#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "smartsurf/script/ScriptContext.h"
#include "smartsurf/script/lua/TableReader.h"

namespace smartsurf::script {
namespace {

constexpr std::size_t kMaxInfoFields = 1000;

// True if the infos of an environment have another value of this name (docs/python.md).
bool is_reserved(std::string_view name) {
  constexpr std::array<std::string_view, 9> kNames{"seed",
                                                   "success",
                                                   "nonfinite_actions",
                                                   "metrics",
                                                   "error",
                                                   "final_obs",
                                                   "final_info",
                                                   "terminal_observation",
                                                   "TimeLimit.truncated"};
  return std::ranges::find(kNames, name) != kNames.end() || name.starts_with('_') ||
         name.starts_with("varied.");
}

int reward(ScriptContext& context, lua_State* L) {
  declare_once(context, L, "reward");
  context.reward = store_callback(context, L, 1, "reward: function");
  return 0;
}

int success(ScriptContext& context, lua_State* L) {
  declare_once(context, L, "success");
  context.success = store_callback(context, L, 1, "success: function");
  return 0;
}

int on_reset(ScriptContext& context, lua_State* L) {
  require_loading(context, "on_reset");
  context.on_reset.push_back(store_callback(context, L, 1, "on_reset: function"));
  return 0;
}

// info{ ball = id, error_u = function() … end }: the id of a declared object, or a function that returns a
// number.
int info(ScriptContext& context, lua_State* L) {
  require_loading(context, "info");
  luaL_checktype(L, 1, LUA_TTABLE);
  lua_settop(L, 1);
  // By name: Lua's order of a table's fields differs from run to run.
  std::vector<std::string> names;
  for (lua_pushnil(L); lua_next(L, 1) != 0; lua_pop(L, 1)) {
    if (lua_type(L, -2) != LUA_TSTRING)
      throw ScriptError("info: " + format_value(L, -2) + ": a field needs a name");
    names.push_back(check_string(L, -2, "info: name"));
  }
  std::ranges::sort(names);
  for (const std::string& name : names) {
    const std::string subject = "info." + name;
    if (std::ranges::find(context.info, name, &InfoField::name) != context.info.end())
      throw ScriptError(subject + ": already declared");
    if (is_reserved(name))
      throw ScriptError(subject + ": infos have another value of this name; choose another");
    if (context.info.size() >= kMaxInfoFields) throw ScriptError("info: more than 1000 fields");
    lua_getfield(L, 1, name.c_str());
    InfoField field{.name = name, .object = {}, .callback = -1};
    if (lua_type(L, -1) == LUA_TFUNCTION) {
      field.callback = store_callback(context, L, -1, subject);
    } else if (lua_isinteger(L, -1) != 0) {
      const lua_Integer id = lua_tointeger(L, -1);
      if (id < 0 || id >= std::ssize(context.spec.objects))
        throw ScriptError(subject + " = " + std::to_string(id) +
                          ": there is no such object; create it before info{}");
      field.object = static_cast<scene::ObjectId>(id);
    } else {
      throw_invalid_value(L, -1, subject, "the id of an object or a function");
    }
    context.info.push_back(std::move(field));
    lua_pop(L, 1);
  }
  return 0;
}

int episode(ScriptContext& context, lua_State* L) {
  declare_once(context, L, "episode");
  const TableReader fields(L, 1, "episode", {"seconds"});
  fields.require("seconds");
  double seconds = 0.0;
  fields.read("seconds", seconds);
  if (seconds <= 0.0 || seconds > 1e9)
    throw ScriptError("episode.seconds = " + format_value(seconds) + ": must be in (0, 1e9]");
  context.episode_s = seconds;
  return 0;
}

}  // namespace

void bind_episodes(lua_State* L) {
  lua_register(L, "reward", guarded<reward>);
  lua_register(L, "success", guarded<success>);
  lua_register(L, "info", guarded<info>);
  lua_register(L, "episode", guarded<episode>);
  lua_register(L, "on_reset", guarded<on_reset>);
}

}  // namespace smartsurf::script
