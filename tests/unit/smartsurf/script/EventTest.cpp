#include <cmath>

#include "ScriptFixture.h"
#include "smartsurf/script/EventQueue.h"

namespace smartsurf::script {
namespace {

using Log = std::vector<std::string>;

class EventTest : public ScriptTest {
 protected:
  // Loads, starts and runs ticks 0 to `last`.
  void run(const std::string& text, std::uint64_t last) {
    experiment.emplace(load_on_surface(text));
    simulation.emplace(experiment->scene());
    experiment->start(*simulation);
    run_ticks(*experiment, 0, last);
  }
  std::optional<Experiment> experiment;
  std::optional<FakeSimulation> simulation;
};

TEST(ScheduleTest, OrdersByTimeThenRegistration) {
  EventQueue s;
  s.schedule_at(2.0, 1);
  s.schedule_at(1.0, 2);
  s.schedule_every(0.0, 1.0, 3);
  s.schedule_at(1.0, 4);
  std::vector<int> ran;
  const auto note = [&](const TimedEvent& e) {
    ran.push_back(e.callback);
    return true;
  };
  s.run_due(1.5, note);
  EXPECT_EQ(ran, (std::vector<int>{2, 3, 4}));
  s.run_due(3.0, note);
  EXPECT_EQ(ran, (std::vector<int>{2, 3, 4, 1, 3, 3}));
  s.run_due(4.0, note);
  EXPECT_EQ(ran, (std::vector<int>{2, 3, 4, 1, 3, 3, 3}));
}

TEST(ScheduleTest, EventsScheduledDuringRunWaitForNextRun) {
  EventQueue s;
  int calls = 0;
  s.schedule_at(0.0, 0);
  const auto again = [&](const TimedEvent&) {
    ++calls;
    s.schedule_at(0.0, 0);
    return false;
  };
  s.run_due(0.0, again);
  EXPECT_EQ(calls, 1);
  s.run_due(0.0, again);
  EXPECT_EQ(calls, 2);
}

TEST_F(EventTest, AtRunsAtFirstTickNotBeforeItsTime) {
  run("at(0, function(t, n) print('zero', n) end) at(0.5, function(t, n) print('half', t, n) end) "
      "at(0.51, function(t, n) print('later', n) end)",
      59);
  EXPECT_EQ(printed, "zero\t0\nhalf\t0.5\t30\nlater\t31\n");
}

TEST_F(EventTest, ReportsCallbacksOfAtForOneTick) {
  run("at(0.5, function() end)\nevery(0.5, function() end)\non_tick(function() end)\nat(0.5, function() end)",
      29);
  EXPECT_TRUE(experiment->events().empty());
  run_ticks(*experiment, 30, 30);
  ASSERT_EQ(experiment->events().size(), 2u);  // at(), not every() or on_tick()
  EXPECT_TRUE(experiment->events()[1].ends_with(":5")) << experiment->events()[1];
  run_ticks(*experiment, 31, 31);
  EXPECT_TRUE(experiment->events().empty());
}

TEST_F(EventTest, MetricKeepsLastValue) {
  run("metric('tries', 1) on_tick(function(t, n) metric('error', 1 / (n + 1)) end) "
      "on_finish(function() metric('tries', 3) end)",
      3);
  experiment->finish();
  const std::vector<std::pair<std::string, double>> expected{{"tries", 3.0}, {"error", 0.25}};
  EXPECT_EQ(experiment->metrics(), expected);
}

TEST_F(EventTest, MetricFunctionsAreEvaluatedWithTheNewState) {
  run("local n = 0 on_tick(function() n = n + 1 end) metric('ticks', function(t, tick) return n + 10 * t + "
      "100 * tick end) "
      "metric('none', function() end) on_finish(function(t, tick) print(t, tick, time()) end) "
      "reward(function() return 1 end) success(function() end) info { one = function() return 1 end }",
      3);
  EXPECT_EQ(experiment->metrics()[0].first, "ticks");
  EXPECT_TRUE(std::isnan(experiment->metrics()[0].second)) << "not yet evaluated";
  experiment->update_metrics(0.5, 4);
  EXPECT_EQ(experiment->metrics()[0].second, 4.0 + 5.0 + 400.0);
  EXPECT_TRUE(std::isnan(experiment->metrics()[1].second));
  experiment->success(0.5, 4);
  experiment->reward(0.5, 4);
  double one = 0.0;
  experiment->info(0.5, 4, {&one, 1});
  EXPECT_EQ(one, 1.0);
  experiment->finish();
  EXPECT_EQ(printed, "0.05\t3\t0.05\n") << "the time of the latest tick";
}

TEST_F(EventTest, MetricFunctionsAreDeclaredWhileLoading) {
  EXPECT_EQ(run_error_of("metric('late', function() return 1 end)"),
            "t.lua:2: metric: a function: only while the script loads, outside at, every, on_tick and "
            "on_finish");
}

TEST_F(EventTest, SuccessReturnsItsTime) {
  const auto success = [&](const std::string& text) {
    run(text, 3);
    return experiment->success(0.5, 4);
  };
  EXPECT_FALSE(success("metric('a', 1)"));
  EXPECT_FALSE(experiment->declares_success());
  EXPECT_FALSE(success("success(function() return false end)"));
  EXPECT_TRUE(experiment->declares_success());
  EXPECT_EQ(success("success(function(t, tick) return t == 0.5 and tick == 4 end)"), 0.5);
  for (const double time_s : {0.0, 0.25, 0.5})
    EXPECT_EQ(success("success(function() return " + std::to_string(time_s) + " end)"), time_s);
  EXPECT_EQ(success("success(function(t) return t * (1 + 1e-15) end)"), 0.5 * (1 + 1e-15)) << "rounding";
  for (const auto& [value, shown] : std::vector<std::pair<std::string, std::string>>{{"0/0", "nan"},
                                                                                     {"1/0", "inf"},
                                                                                     {"-5", "-5"},
                                                                                     {"0.501", "0.501"},
                                                                                     {"1e9", "1000000000"},
                                                                                     {"'no'", "string"},
                                                                                     {"{}", "table"}})
    EXPECT_EQ(
        caught([&, v = value] { success("success(function() return " + v + " end)"); }),
        "t.lua:2: success returned " + shown + ": must be true, false, nil or a time from 0 to now, 0.5 s");
}

TEST_F(EventTest, EveryStartsAfterOnePeriodWithoutDrift) {
  run("every(0.1, function(t, n) print(n) end)", 60);
  EXPECT_EQ(printed, "6\n12\n18\n24\n30\n36\n42\n48\n54\n60\n");
}

TEST_F(EventTest, AccumulatedClockErrorDoesNotDelayEvents) {
  Experiment e = load_on_surface(
      "count = 0; every(0.1, function(t, n) count = count + 1; assert(n == 6 * count) end) "
      "on_finish(function() print(count) end)");
  FakeSimulation fake(e.scene());
  e.start(fake);
  double t_s = 0.0;
  for (std::uint64_t tick = 0; tick <= 60000; ++tick, t_s += 1.0 / 60.0) e.tick(t_s, tick);
  e.finish();
  EXPECT_EQ(printed, "10000\n");
}

TEST_F(EventTest, PeriodBelowTickRunsSeveralTimesPerTick) {
  run("n = 0; every(1/240, function() n = n + 1 end) on_tick(function() print(n) end)", 2);
  EXPECT_EQ(printed, "0\n4\n8\n");
}

TEST_F(EventTest, OrderWithinTick) {
  run("on_tick(function(t, n) if n == 1 then print('tick') end end) "
      "at(1/60, function() print('b') end) every(1/60, function() print('c') end) "
      "at(0.016, function() print('a') end) at(1/60, function() print('d') end)",
      1);
  EXPECT_EQ(printed, "a\nb\nc\nd\ntick\n");
}

TEST_F(EventTest, OnTickReceivesTimeAndTick) {
  run("on_tick(function(t, n) print(t * 60, math.type(n), n) assert(time() == t) end)", 2);
  EXPECT_EQ(printed, "0.0\tinteger\t0\n1.0\tinteger\t1\n2.0\tinteger\t2\n");
}

TEST_F(EventTest, ReturningFalseUnregistersCallback) {
  run("a = 0; every(1/60, function() a = a + 1; return a < 3 end) "
      "b = 0; on_tick(function() b = b + 1; return b < 2 end) "
      "on_tick(function(t, n) if n == 9 then print(a, b) end end)",
      9);
  EXPECT_EQ(printed, "3\t2\n");
}

TEST_F(EventTest, CallbacksMayRegisterCallbacks) {
  run("at(0, function() every(1/60, function(t, n) print('e', n) return n < 2 end) "
      "at(2/60, function(t, n) print('a', n) end) on_tick(function(t, n) print('t', n) return false end) "
      "end)",
      4);
  EXPECT_EQ(printed, "t\t0\ne\t1\ne\t2\na\t2\n");
}

TEST_F(EventTest, SelfReschedulingCallbackRunsOncePerTick) {
  run("local function f(t, n) print(n) at(t, f) end at(0, f)", 3);
  EXPECT_EQ(printed, "0\n1\n2\n3\n");
}

TEST_F(EventTest, RejectsTimeInThePast) {
  EXPECT_EQ(caught([&] { run("on_tick(function(t) if t > 0 then at(0, print) end end)", 1); }),
            "t.lua:2: at: seconds = 0: is in the past, the simulated time is 0.016666666666667");
}

TEST_F(EventTest, ObjectLifecycle) {
  run(R"(
    local first = sphere{radius = 1, position = {1, 2, 3}, velocity = {4, 5, 6}, label = 'small'}
    at(0, function()
      local id = box{size = {1, 1, 1}, position = {7, 8, 9}, label = 'big',
                     orientation = {x = 0, y = 0, z = 1, w = 0}, angular_velocity = {0, 0, 2}}
      local o = object(id)
      print(first, id, o:id(), o, o:label(), o == object(id), o == object(first), o:alive())
      print(object(first):position())
      print(object(first):velocity())
      print(o:orientation())
      print(o:angular_velocity())
      o:push{force = {1, 0, 0}}
      o:push{0, 2, 0}
      o:push{force = {1, 0, 0}, point = {7, 8, 10}, seconds = 0.5}
      o:teleport{position = {0, 0, 5}, velocity = {1, 0, 0}}
      print(o:position())
      print(#objects(), #objects{label = 'small'}, objects{label = 'big'}[1]:id(), #objects{label = 'none'})
      for _, each in ipairs(objects{label = 'small'}) do each:remove() end
      print(object(first):alive())
    end))",
      0);
  EXPECT_EQ(printed,
            "0\t1\t1\tobject 1\tbig\ttrue\tfalse\ttrue\n1.0\t2.0\t3.0\n4.0\t5.0\t6.0\n0.0\t0.0\t1.0\t0.0\n"
            "0.0\t0.0\t2.0\n0.0\t0.0\t5.0\n2\t1\t1\t0\nfalse\n");
  EXPECT_EQ(simulation->log,
            (Log{"spawn 1", "push 1 1 0 0 at centre for 0.0166667", "push 1 0 2 0 at centre for 0.0166667",
                 "push 1 1 0 0 at  7  8 10 for 0.5", "place 1", "remove 0"}));
}

TEST_F(EventTest, CellIndicesAreOneBasedInLua) {
  run("at(0, function() cells:target('height', 1, 6, 2.5) print(cells:sense('proximity', 4, 2)) end)", 0);
  EXPECT_EQ(simulation->log, (Log{"target height 0 5 2.5"}));
  EXPECT_EQ(printed, "90301.0\n");
}

TEST_F(EventTest, TargetsAcceptsFlatListOrRows) {
  const std::string list = "local v = {} for i = 1, 24 do v[i] = i end ";
  const std::string rows =
      "local w = {} for r = 1, 4 do w[r] = {} for c = 1, 6 do w[r][c] = (r-1)*6 + c end end ";
  std::vector<float> expected;
  for (int i = 1; i <= 24; ++i) expected.push_back(static_cast<float>(i));
  run("at(0, function() " + list + "cells:targets('height', v) end)", 0);
  EXPECT_EQ(simulation->last_targets, expected);
  run("at(0, function() " + rows + "cells:targets('height', w) end)", 0);
  EXPECT_EQ(simulation->last_targets, expected);
}

TEST_F(EventTest, RunControl) {
  run("pace('max') pause() at(0, function() pace(2) pace('realtime') pause() stop() stop('sorted', true) "
      "quit() end)",
      0);
  EXPECT_EQ(simulation->log,
            (Log{"pace max", "pause", "pace 2", "pace 1", "pause", "stop", "stop sorted success", "quit"}));
}

}  // namespace
}  // namespace smartsurf::script
