// at, every, on_tick, on_leave, on_finish: functions that wait. metric: what comes of the run. stop, quit,
// pause, pace: how the run goes on.
#include <algorithm>
#include <string>

#include "smartsurf/script/Fields.h"
#include "smartsurf/script/Session.h"

namespace smartsurf::script {
namespace {

constexpr std::size_t kMostWaiting = 1'000'000;
constexpr std::size_t kMostMetrics = 1000;
constexpr double kShortestPeriod_s = 1e-4;
constexpr double kLongestTime_s = 1e9;

// Keeps the function at `index`; its index in Session::callbacks.
int keep_callback(Session& session, lua_State* L, int index, const std::string& what) {
  if (lua_type(L, index) != LUA_TFUNCTION) must_be(L, index, what, "a function");
  if (session.callbacks.size() - session.free_callbacks.size() >= kMostWaiting)
    throw Problem(what + ": more than 1000000 functions wait");
  lua_pushvalue(L, index);
  const Callback callback{luaL_ref(L, LUA_REGISTRYINDEX), session.interpreter->place(L)};
  if (session.free_callbacks.empty()) {
    session.callbacks.push_back(callback);
    return static_cast<int>(session.callbacks.size() - 1);
  }
  const int slot = session.free_callbacks.back();
  session.free_callbacks.pop_back();
  session.callbacks[static_cast<std::size_t>(slot)] = callback;
  return slot;
}

int at(Session& session, lua_State* L) {
  const double time_s = number_at(L, 1, "at: seconds");
  if (time_s < 0.0 || time_s > kLongestTime_s) must_be(L, 1, "at: seconds", "from 0 to 1e9");
  if (session.phase == Phase::kRunning && time_s < session.time_s)
    throw Problem("at: seconds = " + show(time_s) + ": is over, the simulated time is " +
                  show(session.time_s));
  session.schedule.at(time_s, keep_callback(session, L, 2, "at: function"));
  return 0;
}

int every(Session& session, lua_State* L) {
  const double period_s = number_at(L, 1, "every: seconds");
  if (period_s < kShortestPeriod_s || period_s > kLongestTime_s)
    must_be(L, 1, "every: seconds", "from 0.0001 to 1e9");
  const double start_s = session.phase == Phase::kRunning ? session.time_s : 0.0;
  session.schedule.every(start_s, period_s, keep_callback(session, L, 2, "every: function"));
  return 0;
}

int on_tick(Session& session, lua_State* L) {
  session.on_tick.push_back(keep_callback(session, L, 1, "on_tick: function"));
  return 0;
}

int on_leave(Session& session, lua_State* L) {
  session.on_leave.push_back(keep_callback(session, L, 1, "on_leave: function"));
  return 0;
}

int on_finish(Session& session, lua_State* L) {
  session.on_finish.push_back(keep_callback(session, L, 1, "on_finish: function"));
  return 0;
}

int time(Session& session, lua_State* L) {
  lua_pushnumber(L, session.time_s);
  return 1;
}

// metric('error', 0.3): what the experiment measures; the last value of a name counts.
int metric(Session& session, lua_State* L) {
  const std::string name = text_at(L, 1, "metric: name");
  if (name.empty() || name.size() > 64) must_be(L, 1, "metric: name", "a text of 1 to 64 characters");
  const double value = number_at(L, 2, "metric: value");
  const auto known = std::ranges::find(session.metrics, name, &std::pair<std::string, double>::first);
  if (known != session.metrics.end())
    known->second = value;
  else if (session.metrics.size() < kMostMetrics)
    session.metrics.emplace_back(name, value);
  else
    throw Problem("metric: more than 1000 names");
  return 0;
}

int stop(Session& session, lua_State*) {
  require_running(session, "stop");
  session.host->stop();
  return 0;
}

int quit(Session& session, lua_State*) {
  require_running(session, "quit");
  session.host->quit();
  return 0;
}

// While the script loads, pause and pace wait for the simulation to be there.
void ask(Session& session, std::function<void(Host&)> request) {
  if (session.phase == Phase::kRunning)
    request(*session.host);
  else if (session.at_start.size() < kMostWaiting)
    session.at_start.push_back(std::move(request));
}

int pause(Session& session, lua_State*) {
  ask(session, [](Host& host) { host.pause(); });
  return 0;
}

int pace(Session& session, lua_State* L) {
  const std::string rule = "'max', 'realtime' or a factor greater than 0";
  std::optional<double> factor;
  if (lua_type(L, 1) == LUA_TNUMBER) {
    factor = number_at(L, 1, "pace");
    if (*factor <= 0.0) must_be(L, 1, "pace", rule);
  } else {
    if (lua_type(L, 1) != LUA_TSTRING) must_be(L, 1, "pace", rule);
    const std::string name = text_at(L, 1, "pace");
    if (name == "realtime")
      factor = 1.0;
    else if (name != "max")
      must_be(L, 1, "pace", rule);
  }
  ask(session, [factor](Host& host) { host.pace(factor); });
  return 0;
}

}  // namespace

void bind_events(lua_State* L) {
  lua_register(L, "at", guarded<at>);
  lua_register(L, "every", guarded<every>);
  lua_register(L, "on_tick", guarded<on_tick>);
  lua_register(L, "on_leave", guarded<on_leave>);
  lua_register(L, "on_finish", guarded<on_finish>);
  lua_register(L, "time", guarded<time>);
  lua_register(L, "metric", guarded<metric>);
  lua_register(L, "stop", guarded<stop>);
  lua_register(L, "quit", guarded<quit>);
  lua_register(L, "pause", guarded<pause>);
  lua_register(L, "pace", guarded<pace>);
}

}  // namespace smartsurf::script
