#include "smartsurf/script/ScriptContext.h"

#include <algorithm>

#include "smartsurf/script/lua/TableReader.h"

namespace smartsurf::script {

Random ScriptContext::observer_stream(const std::string& purpose) const {
  std::string text = "observe ";
  text.append(observer->kind).append(" ").append(observer->name).append(" ").append(std::to_string(tick));
  return Random::stream(spec.world.seed, text + purpose);
}

Random& ScriptContext::random_stream(lua_State* L) {
  if (observer) {
    if (!observer->random) observer->random = observer_stream("");
    return *observer->random;
  }
  const Purpose purpose = phase == Phase::kLoading ? Purpose::kLoad
                          : resetting              ? Purpose::kReset
                                                   : Purpose::kStep;
  std::optional<Random>& stream = random[static_cast<std::size_t>(purpose)];
  if (stream) return *stream;
  if (!has_drawn()) random_first_use = interpreter->current_location(L);
  if (purpose == Purpose::kLoad) return stream.emplace(spec.world.seed);
  return stream.emplace(Random::stream(spec.world.seed, resetting ? "reset" : "step"));
}

Random& ScriptContext::random_stream(lua_State* L, const std::string& name) {
  constexpr std::size_t kMaxStreams = 1000;
  auto& streams = observer ? observer->named_random : named_random;
  const auto found = std::ranges::find(streams, name, &std::pair<std::string, Random>::first);
  if (found != streams.end()) return found->second;
  if (streams.size() >= kMaxStreams) throw ScriptError("random_stream: more than 1000 streams");
  if (observer) return streams.emplace_back(name, observer_stream(" named " + name)).second;
  if (!has_drawn()) random_first_use = interpreter->current_location(L);
  return named_random.emplace_back(name, Random::stream(spec.world.seed, "named " + name)).second;
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
  declare_once(context, L, declaration, declaration);
}

void declare_once(ScriptContext& context, lua_State* L, const std::string& declaration,
                  const std::string& shown) {
  require_loading(context, shown);
  const std::string location = context.interpreter->current_location(L);
  const auto [previous, is_new] = context.declared_at.emplace(declaration, location);
  if (!is_new) throw ScriptError(shown + ": already declared at " + previous->second);
}

}  // namespace smartsurf::script
