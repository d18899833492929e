#include "smartsurf/script/ScriptContext.h"

#include "smartsurf/script/lua/TableReader.h"

namespace smartsurf::script {

Random& ScriptContext::random_generator(lua_State* L) {
  if (!random) {
    random.emplace(spec.world.seed);
    random_first_use = interpreter->current_location(L);
  }
  return *random;
}

int store_callback(ScriptContext& context, lua_State* L, int index, const std::string& subject) {
  constexpr std::size_t kMaxCallbacks = 1'000'000;
  if (lua_type(L, index) != LUA_TFUNCTION) throw_invalid_value(L, index, subject, "a function");
  if (context.callbacks.size() - context.free_callbacks.size() >= kMaxCallbacks)
    throw ScriptError(subject + ": more than 1000000 callbacks");
  lua_pushvalue(L, index);
  const Callback callback{luaL_ref(L, LUA_REGISTRYINDEX), context.interpreter->current_location(L)};
  if (context.free_callbacks.empty()) {
    context.callbacks.push_back(callback);
    return static_cast<int>(context.callbacks.size() - 1);
  }
  const int slot = context.free_callbacks.back();
  context.free_callbacks.pop_back();
  context.callbacks[slot] = callback;
  return slot;
}

void require_running(const ScriptContext& context, const std::string& subject) {
  if (context.phase != Phase::kRunning)
    throw ScriptError(
        subject +
        ": there is no simulation while the script loads; call it inside a function given to at, "
        "every, on_tick or on_finish");
}

void require_loading(const ScriptContext& context, const std::string& subject) {
  if (context.phase != Phase::kLoading)
    throw ScriptError(subject + ": only while the script loads, outside at, every, on_tick and on_finish");
}

void declare_once(ScriptContext& context, lua_State* L, const std::string& declaration) {
  require_loading(context, declaration);
  const std::string location = context.interpreter->current_location(L);
  const auto [previous, is_new] = context.declared_at.emplace(declaration, location);
  if (!is_new) throw ScriptError(declaration + ": already declared at " + previous->second);
}

}  // namespace smartsurf::script
