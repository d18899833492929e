#include "smartsurf/script/ScriptContext.h"

namespace smartsurf::script {

Random& ScriptContext::random_generator(lua_State* L) {
  if (!random) {
    random.emplace(spec.world.seed);
    random_first_use = interpreter->current_location(L);
  }
  return *random;
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
