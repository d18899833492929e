#include "smartsurf/script/Session.h"

namespace smartsurf::script {

Random& Session::generator(lua_State* L) {
  if (!random) {
    random.emplace(spec.world.seed);
    random_used_at = interpreter->place(L);
  }
  return *random;
}

void require_running(const Session& session, const std::string& what) {
  if (session.phase != Phase::kRunning)
    throw Problem(what +
                  ": there is no simulation while the script loads; call it inside a function given to at, "
                  "every, on_tick or on_finish");
}

void require_loading(const Session& session, const std::string& what) {
  if (session.phase != Phase::kLoading)
    throw Problem(what + ": only while the script loads, outside at, every, on_tick and on_finish");
}

void declare_once(Session& session, lua_State* L, const std::string& what) {
  require_loading(session, what);
  const std::string place = session.interpreter->place(L);
  const auto [before, is_new] = session.declared_at.emplace(what, place);
  if (!is_new) throw Problem(what + ": already declared at " + before->second);
}

}  // namespace smartsurf::script
