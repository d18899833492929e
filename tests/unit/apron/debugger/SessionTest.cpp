#include "apron/debugger/Session.h"

#include <gtest/gtest.h>

#include "apron/debugger/PanelHost.h"
#include "tests/unit/apron/debugger/Programs.h"

namespace apron::debugger::test {
namespace {

class SessionTest : public testing::Test {
 protected:
  void begin(const std::string& text) {
    code = compiled(text);
    listing = Listing(code.program, code.texts);
    session = std::make_unique<Session>(code.program, vm::VmOptions{}, host,
                                        [this](bool held) { holds.push_back(held); });
  }
  std::uint32_t line() const {
    return listing.rows()[listing.groups()[session->vm().program_counter()]].line;
  }
  void advance(int times = 1) {
    while (times-- > 0) session->advance();
  }
  Look look(const LookRequest& request = {}) {
    Look look;
    session->look(request, look);
    return look;
  }
  float variable(const std::string& name) {
    for (std::size_t i = 0; i < code.program.variables.size(); ++i)
      if (code.program.variables[i].name == name) return look().variables[i];
    ADD_FAILURE() << name;
    return 0.0F;
  }
  void stop_when(const std::string& condition) {
    Breakpoint one;
    one.kind = Breakpoint::Kind::kCondition;
    one.condition = condition;
    session->set_breakpoints({one}, {question(condition, code.program)});
  }

  FakeHost host;
  Compiled code;
  Listing listing;
  std::unique_ptr<Session> session;
  std::vector<bool> holds;
};

TEST_F(SessionTest, IsHeldAtFirstAndStepsByTickLineAndInstruction) {
  begin(kCounting);
  EXPECT_EQ(session->mode(), Mode::kHeld);
  advance();
  EXPECT_EQ(session->vm().instructions_executed(), 0U);
  session->step(Unit::kTick);
  EXPECT_EQ(session->mode(), Mode::kStepping);
  advance();
  EXPECT_EQ(session->mode(), Mode::kHeld);
  EXPECT_EQ(session->ticks(), 1U);
  EXPECT_EQ(host.step_count, 1);
  EXPECT_EQ(variable("count"), 1.0F);

  std::vector<std::uint32_t> lines;
  for (int i = 0; i < 6; ++i) {
    session->step(Unit::kLine, listing.groups());
    advance();
    lines.push_back(line());
  }
  EXPECT_EQ(lines, (std::vector<std::uint32_t>{5, 6, 7, 8, 9, 5}));
  const std::size_t next = session->vm().program_counter();
  session->step(Unit::kInstruction);
  advance();
  EXPECT_EQ(session->vm().program_counter(), next + 1);
  EXPECT_EQ(holds, (std::vector<bool>{true, false, true, false, true, false, true, false, true, false, true,
                                      false, true, false, true, false, true}));
}

TEST_F(SessionTest, RunsUntilItIsHeldAndStopsAtItsLimit) {
  begin(kCounting);
  session->run();
  advance(3);
  EXPECT_EQ(session->mode(), Mode::kRunning);
  EXPECT_EQ(session->ticks(), 3U);
  session->hold();
  advance(3);
  EXPECT_EQ(session->ticks(), 3U);
  session->limit_ticks(5);
  session->run();
  advance(10);
  EXPECT_EQ(session->mode(), Mode::kOver);
  EXPECT_EQ(session->status(), Status::kEnded);
  EXPECT_EQ(session->ticks(), 5U);
  EXPECT_TRUE(holds.back());
}

TEST_F(SessionTest, StopsAtALineInEachRound) {
  begin(kCounting);
  Breakpoint one;
  one.file = "main.aps";
  one.line = 6;
  session->set_breakpoints({one}, {});
  for (int round = 1; round <= 3; ++round) {
    session->run();
    advance(2);  // the tick before, then to the line
    EXPECT_EQ(session->mode(), Mode::kHeld);
    EXPECT_EQ(look().hit, std::size_t{0});
    EXPECT_EQ(line(), 6U);
    EXPECT_EQ(variable("count"), static_cast<float>(round));
  }
  one.on = false;
  session->set_breakpoints({one}, {});
  EXPECT_FALSE(look().hit) << "the number of another breakpoint now";
  session->run();
  advance(4);
  EXPECT_EQ(session->mode(), Mode::kRunning);
}

TEST_F(SessionTest, StopsAtATick) {
  begin(kCounting);
  Breakpoint one;
  one.kind = Breakpoint::Kind::kTick;
  one.tick = 4;
  session->set_breakpoints({one}, {});
  session->run();
  advance(10);
  EXPECT_EQ(session->mode(), Mode::kHeld);
  EXPECT_EQ(session->ticks(), 4U);
  session->run();
  advance(3);
  EXPECT_EQ(session->ticks(), 7U);
}

TEST_F(SessionTest, StopsWhereAConditionBecomesTrueAndNotAgainWhileItHolds) {
  begin(kCounting);
  // 47 cells hold the count and one 100, once line 7 has run.
  stop_when("globalsum(A) > 47 * 3 + 100");
  session->run();
  advance(10);
  EXPECT_EQ(session->mode(), Mode::kHeld);
  EXPECT_EQ(line(), 8U) << "the instruction before it made it true";
  EXPECT_EQ(variable("count"), 4.0F);
  // It no longer holds where A is written anew without the 100, and does again with it.
  session->run();
  advance(10);
  EXPECT_EQ(session->mode(), Mode::kHeld);
  EXPECT_EQ(variable("count"), 5.0F);
  // From the sixth round on 48 times the count is enough by itself.
  session->run();
  advance(20);
  EXPECT_EQ(session->mode(), Mode::kRunning);
}

TEST_F(SessionTest, AConditionAsksScalarsAndTheSurfaceAndTouchesNothing) {
  begin(kCounting);
  stop_when("count >= 3 and surface.tick >= 3");
  session->run();
  advance(10);
  EXPECT_EQ(session->mode(), Mode::kHeld);
  EXPECT_EQ(session->ticks(), 3U);
  // The same run without a condition has the same registers.
  FakeHost other;
  Session plain(code.program, vm::VmOptions{}, other);
  plain.run();
  for (int i = 0; i < 3; ++i) plain.advance();
  for (std::size_t r = 0; r < code.program.registers.size(); ++r)
    EXPECT_EQ(vm::test::read_cells(session->vm().plane(r)), vm::test::read_cells(plain.vm().plane(r))) << r;
  EXPECT_EQ(host.step_count, other.step_count);
}

TEST_F(SessionTest, AConditionThatCannotBeAnsweredIsNo) {
  begin(kCounting);
  stop_when("pixel.get(A, count, 0) == 1");  // leaves the array at count 8
  session->run();
  advance(2);
  EXPECT_EQ(session->mode(), Mode::kHeld);
  session->run();
  advance(20);
  EXPECT_EQ(session->mode(), Mode::kRunning);
}

TEST(Question, SaysWhatIsWrongInOneLine) {
  const Compiled c = compiled(kCounting);
  const auto wrong = [&](const std::string& condition) {
    std::string text;
    EXPECT_FALSE(run::compile_question(condition, c.program, 8, 6, text)) << condition;
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    return text;
  };
  EXPECT_NE(wrong("globalsum(Aa) > 0").find("Aa"), std::string::npos);
  EXPECT_NE(wrong("A > 0"), "");
  EXPECT_NE(wrong("count >"), "");
  EXPECT_NE(wrong(""), "");
  EXPECT_NE(wrong("count > 1 // or so").find("comment"), std::string::npos);
  EXPECT_NE(wrong("count > 1\nA = 3"), "");
}

TEST_F(SessionTest, BeginsAgainAsItWas) {
  begin(kCounting);
  session->run();
  advance(5);
  session->reset();
  EXPECT_EQ(session->mode(), Mode::kRunning);
  EXPECT_EQ(session->ticks(), 0U);
  EXPECT_EQ(session->vm().instructions_executed(), 0U);
  advance(2);
  EXPECT_EQ(variable("count"), 2.0F);
  session->replace(compiled("x = 7\nsurface.step\nx = 8\n").program);
  EXPECT_EQ(look().program, 2U);
  advance(1);
  EXPECT_EQ(look().variables.front(), 7.0F);
  advance(1);
  EXPECT_EQ(session->mode(), Mode::kOver);
  session->run();  // it is over
  EXPECT_EQ(session->mode(), Mode::kOver);
  session->reset();
  EXPECT_EQ(session->mode(), Mode::kHeld);
}

TEST_F(SessionTest, WalksLineByLine) {
  begin(kCounting);
  session->walk(std::chrono::milliseconds(5), listing.groups());
  EXPECT_EQ(session->period(), std::chrono::milliseconds(5));
  std::vector<std::uint32_t> lines;
  for (int i = 0; i < 4; ++i) {
    advance();
    lines.push_back(line());
  }
  EXPECT_EQ(lines, (std::vector<std::uint32_t>{5, 6, 7, 8}));
  EXPECT_EQ(session->mode(), Mode::kWalking);
  session->hold();
  EXPECT_EQ(session->mode(), Mode::kHeld);
}

TEST_F(SessionTest, AnInterruptedStepGoesOn) {
  begin(kCounting);
  host.step_status = vm::HostStatus::kInterrupted;  // as of a surface that does not answer
  session->step(Unit::kTick);
  advance(2);
  EXPECT_EQ(session->mode(), Mode::kStepping);
  EXPECT_EQ(session->ticks(), 0U);
  EXPECT_EQ(line(), 8U);
  host.step_status = vm::HostStatus::kOk;
  advance();
  EXPECT_EQ(session->mode(), Mode::kHeld);
  EXPECT_EQ(session->ticks(), 1U);
}

TEST_F(SessionTest, LooksAtRegistersLargeAndSmall) {
  begin("!create('BIG', REGISTER, 300, 100)\nr[BIG] = cell.x + 1000 * cell.y\nsurface.step\n");
  session->step(Unit::kTick);
  advance();
  LookRequest request;
  request.large = 0;
  request.small = {0, 7};  // there is no seventh
  request.small_edge = 64;
  const Look all = look(request);
  ASSERT_TRUE(all.large);
  EXPECT_EQ(all.large->width, 300U);
  EXPECT_EQ(all.large->cells[2 * 300 + 5], 2005.0F);
  ASSERT_EQ(all.small.size(), 1U);
  EXPECT_EQ(all.small[0].step, 5U);
  EXPECT_EQ(all.small[0].width, 60U);
  EXPECT_EQ(all.small[0].height, 20U);
  EXPECT_EQ(all.small[0].cells[60 + 1], 5005.0F);  // the north-western one of its square
  EXPECT_EQ(all.time_s, 0.5);
}

TEST_F(SessionTest, WatchesACellWithItsNeighboursOverTicks) {
  begin(kCounting);
  session->watch({0, 0});
  session->run();
  advance(3);
  LookRequest request;
  request.cell = true;
  const Look l = look(request);
  ASSERT_EQ(l.around.size(), code.program.registers.size());
  const Around& a = l.around[0];
  EXPECT_TRUE(std::isnan(a[0]) && std::isnan(a[1]) && std::isnan(a[3]));  // beyond the north-west edge
  EXPECT_EQ(a[4], 100.0F);
  EXPECT_EQ(a[5], 3.0F);  // east
  EXPECT_EQ(a[7], 3.0F);  // south
  ASSERT_EQ(l.history.size(), 3U);
  EXPECT_EQ(l.history[1].tick, 2U);
  EXPECT_EQ(l.history[1].values[0], 100.0F);
  session->watch({1, 0});
  advance(200);
  const Look later = look(request);
  ASSERT_EQ(later.history.size(), Probe::kTicks);
  EXPECT_EQ(later.history.back().tick, 203U);
  EXPECT_EQ(later.history.back().values[0], 203.0F);
  EXPECT_EQ(later.history.front().values[0], static_cast<float>(203 - Probe::kTicks + 1));
}

TEST_F(SessionTest, ProfilesFromWhenItIsTold) {
  begin(kCounting);
  session->run();
  advance(2);
  LookRequest request;
  request.profile = true;
  EXPECT_TRUE(look(request).spent.empty());
  session->profile(true);
  advance(3);
  const auto rows = listing.by_row(look(request).spent);
  EXPECT_EQ(rows[7].executions, 3U);  // surface.step
  session->profile(false);
  advance(3);
  EXPECT_EQ(listing.by_row(look(request).spent)[7].executions, 3U);
}

TEST_F(SessionTest, AFailureNamesItsPlace) {
  begin("!register(A)\nx = pixel.get(A, 99, 0)\n");
  session->run();
  advance();
  EXPECT_EQ(session->mode(), Mode::kOver);
  EXPECT_EQ(look().status, Status::kFailed);
  EXPECT_NE(look().error.find("main.aps:2"), std::string::npos);
}

TEST(PanelHost, HasWhatAScriptMakesAndThePersonsValues) {
  const Compiled c = compiled(R"(!register(A)
sim.slider.add('gain', 0, 10, 2)
reg.setPalette(A, 'flame')
reg.setScale(A, 0, 8)
sim.show(A, 'the map')
sim.label('stage')
while(1)
  A = sim.slider.get('gain')
  sim.label('gain', sim.slider.get('gain'))
  sim.label('state', 'on')
  println('gain ', pixel.get(A, 0, 0))
  surface.step
endwhile
)");
  FakeHost inner;
  FrontPanel panel;
  PanelHost host(inner, panel);
  Session session(c.program, vm::VmOptions{}, host);
  session.run();
  session.advance();
  std::uint64_t revision = 0;
  FrontPanel::State state;
  ASSERT_TRUE(panel.read(revision, state));
  EXPECT_EQ(state.console.front(), "gain 2");
  EXPECT_EQ(inner.console, "gain 2\n");
  using Labels = std::vector<std::pair<std::string, std::string>>;
  EXPECT_EQ(state.labels, (Labels{{"stage", ""}, {"gain", "2"}, {"state", "on"}}));
  const Appearance& a = state.appearances.at("A");
  EXPECT_EQ(a.title, "the map");
  EXPECT_EQ(a.palette, PaletteId::kFlame);
  EXPECT_EQ(a.range->high, 8.0F);
  EXPECT_EQ(state.latest_shown, "A");
  panel.set_parameter("gain", 7.0F);
  session.advance();
  EXPECT_EQ(session.vm().plane(0).row(3)[3], 7.0F);
  ASSERT_TRUE(panel.read(revision, state));
  EXPECT_EQ(state.labels[1].second, "7");
  EXPECT_FALSE(panel.read(revision, state));
  panel.clear_program();
  ASSERT_TRUE(panel.read(revision, state));
  EXPECT_TRUE(state.labels.empty());
  EXPECT_EQ(panel.parameter("gain"), 7.0F) << "the person's setting stays";
}

TEST(FrontPanel, KeepsTheLatestLines) {
  FrontPanel panel;
  for (int i = 0; i < 3000; ++i) panel.print("line " + std::to_string(i) + "\n");
  panel.print("no end");
  panel.note("reloaded");
  std::uint64_t revision = 0;
  FrontPanel::State state;
  ASSERT_TRUE(panel.read(revision, state));
  EXPECT_EQ(state.console.size(), FrontPanel::kMaxLines);
  EXPECT_EQ(state.console[state.console.size() - 3], "no end");
  EXPECT_EQ(state.console[state.console.size() - 2], "- reloaded");
  EXPECT_EQ(state.console.back(), "");
}

}  // namespace
}  // namespace apron::debugger::test
