// Callbacks (at, every, on_tick, on_leave, on_finish), results (metric) and run control (stop, quit, pause,
// pace).
#include <algorithm>
#include <limits>
#include <string>

#include "smartsurf/script/ScriptContext.h"
#include "smartsurf/script/lua/TableReader.h"

namespace smartsurf::script {
namespace {

constexpr std::size_t kMaxDeferredRequests = 1'000'000;
constexpr std::size_t kMaxMetrics = 1000;
constexpr double kMinPeriod_s = 1e-4;
constexpr double kMaxTime_s = 1e9;

int at(ScriptContext& context, lua_State* L) {
  const double time_s = check_number(L, 1, "at: seconds");
  if (time_s < 0.0 || time_s > kMaxTime_s) throw_invalid_value(L, 1, "at: seconds", "from 0 to 1e9");
  if (context.phase == Phase::kRunning && time_s < context.time_s)
    throw ScriptError("at: seconds = " + format_value(time_s) + ": is in the past, the simulated time is " +
                      format_value(context.time_s));
  context.event_queue.schedule_at(time_s, store_callback(context, L, 2, "at: function"));
  return 0;
}

int every(ScriptContext& context, lua_State* L) {
  const double period_s = check_number(L, 1, "every: seconds");
  if (period_s < kMinPeriod_s || period_s > kMaxTime_s)
    throw_invalid_value(L, 1, "every: seconds", "from 0.0001 to 1e9");
  const double start_s = context.phase == Phase::kRunning ? context.time_s : 0.0;
  context.event_queue.schedule_every(start_s, period_s, store_callback(context, L, 2, "every: function"));
  return 0;
}

int on_tick(ScriptContext& context, lua_State* L) {
  context.on_tick.push_back(store_callback(context, L, 1, "on_tick: function"));
  return 0;
}

int on_leave(ScriptContext& context, lua_State* L) {
  context.on_leave.push_back(store_callback(context, L, 1, "on_leave: function"));
  return 0;
}

int on_finish(ScriptContext& context, lua_State* L) {
  context.on_finish.push_back(store_callback(context, L, 1, "on_finish: function"));
  return 0;
}

int time(ScriptContext& context, lua_State* L) {
  lua_pushnumber(L, context.time_s);
  return 1;
}

// metric('error', 0.3) reports a result of the experiment. The last value of a name counts.
// metric('error', function() … end) declares one whose value the function computes after each tick, which
// nothing else may give.
int metric(ScriptContext& context, lua_State* L) {
  const std::string name = check_string(L, 1, "metric: name");
  if (name.empty() || name.size() > 64)
    throw_invalid_value(L, 1, "metric: name", "a string of 1 to 64 characters");
  const bool is_function = lua_isfunction(L, 2);
  if (is_function) require_loading(context, "metric: a function");
  const std::string shown = "metric '" + name + "'";
  if (is_function)
    declare_once(context, L, shown);
  else if (const auto function = context.declared_at.find(shown); function != context.declared_at.end())
    throw ScriptError(shown + ": already declared at " + function->second + ", as a function");
  const double value =
      is_function ? std::numeric_limits<double>::quiet_NaN() : check_number(L, 2, "metric: value");
  auto existing = std::ranges::find(context.metrics, name, &scene::Metric::first);
  if (existing == context.metrics.end()) {
    if (context.metrics.size() >= kMaxMetrics) throw ScriptError("metric: more than 1000 names");
    existing = context.metrics.emplace(existing, name, value);
  }
  existing->second = value;
  if (is_function)
    context.metric_functions.push_back(
        {existing - context.metrics.begin(), store_callback(context, L, 2, "metric: function")});
  return 0;
}

// stop(), stop(message) or stop(message, success). As a callback, at(5, stop), it is called with the time and
// the tick.
int stop(ScriptContext& context, lua_State* L) {
  constexpr std::size_t kMaxStopMessage = 200;
  require_running(context, "stop");
  if (lua_type(L, 1) == LUA_TNUMBER) lua_settop(L, 0);
  std::string message;
  if (!lua_isnoneornil(L, 1)) {
    message = check_string(L, 1, "stop: message");
    if (message.size() > kMaxStopMessage || to_single_line(message) != message)
      throw_invalid_value(L, 1, "stop: message", "at most 200 characters in one line");
  }
  std::optional<bool> success;
  if (!lua_isnoneornil(L, 2)) {
    if (!lua_isboolean(L, 2)) throw_invalid_value(L, 2, "stop: success", "true or false");
    success = lua_toboolean(L, 2) != 0;
  }
  context.simulation->stop(std::move(message), success);
  return 0;
}

int quit(ScriptContext& context, lua_State*) {
  require_running(context, "quit");
  context.simulation->quit();
  return 0;
}

// pause and pace are allowed while the script loads; they take effect when the simulation starts.
void run_or_defer(ScriptContext& context, std::function<void(SimulationInterface&)> request) {
  if (context.phase == Phase::kRunning)
    request(*context.simulation);
  else if (context.deferred_requests.size() < kMaxDeferredRequests)
    context.deferred_requests.push_back(std::move(request));
}

int pause(ScriptContext& context, lua_State*) {
  run_or_defer(context, [](SimulationInterface& simulation) { simulation.pause(); });
  return 0;
}

int pace(ScriptContext& context, lua_State* L) {
  const std::string requirement = "'max', 'realtime' or a factor greater than 0";
  std::optional<double> factor;
  if (lua_type(L, 1) == LUA_TNUMBER) {
    factor = check_number(L, 1, "pace");
    if (*factor <= 0.0) throw_invalid_value(L, 1, "pace", requirement);
  } else {
    if (lua_type(L, 1) != LUA_TSTRING) throw_invalid_value(L, 1, "pace", requirement);
    const std::string name = check_string(L, 1, "pace");
    if (name == "realtime")
      factor = 1.0;
    else if (name != "max")
      throw_invalid_value(L, 1, "pace", requirement);
  }
  run_or_defer(context,
               [factor](SimulationInterface& simulation) { simulation.set_real_time_factor(factor); });
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
