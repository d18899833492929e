#include "apron/debugger/DebugSession.h"
#include "apron/debugger/FrontPanel.h"

#include <gtest/gtest.h>

#include "apron/debugger/PanelHost.h"
#include "tests/unit/apron/debugger/TestSource.h"

namespace apron::debugger::test {
namespace {

class DebugSessionTest : public testing::Test {
 protected:
  void start(const std::string& text) {
    code = compile(text);
    listing = Listing(code.program, code.texts);
    session = std::make_unique<DebugSession>(code.program, vm::VmOptions{}, host,
                                             [this](bool paused) { pauses.push_back(paused); });
  }
  std::uint32_t line() const {
    return listing.rows()[listing.groups()[session->vm().program_counter()]].line;
  }
  void advance(int times = 1) {
    while (times-- > 0) session->advance();
  }
  DebugSnapshot capture(const SnapshotRequest& request = {}) {
    DebugSnapshot snapshot;
    session->capture_snapshot(request, snapshot);
    return snapshot;
  }
  float variable(const std::string& name) {
    for (std::size_t i = 0; i < code.program.variables.size(); ++i)
      if (code.program.variables[i].name == name) return capture().variables[i];
    ADD_FAILURE() << name;
    return 0.0F;
  }
  void break_when(const std::string& condition) {
    Breakpoint breakpoint;
    breakpoint.kind = Breakpoint::Kind::kCondition;
    breakpoint.condition = condition;
    session->set_breakpoints({breakpoint}, {compile_condition(condition, code.program)});
  }

  FakeHost host;
  CompiledSource code;
  Listing listing;
  std::unique_ptr<DebugSession> session;
  std::vector<bool> pauses;
};

TEST_F(DebugSessionTest, StartsPausedAndStepsByTickLineAndInstruction) {
  start(kCounting);
  EXPECT_EQ(session->state(), ExecutionState::kPaused);
  advance();
  EXPECT_EQ(session->vm().instructions_executed(), 0U);
  session->step(StepUnit::kTick);
  EXPECT_EQ(session->state(), ExecutionState::kStepping);
  advance();
  EXPECT_EQ(session->state(), ExecutionState::kPaused);
  EXPECT_EQ(session->ticks(), 1U);
  EXPECT_EQ(host.step_count, 1);
  EXPECT_EQ(variable("count"), 1.0F);

  std::vector<std::uint32_t> lines;
  for (int i = 0; i < 6; ++i) {
    session->step(StepUnit::kLine, listing.groups());
    advance();
    lines.push_back(line());
  }
  EXPECT_EQ(lines, (std::vector<std::uint32_t>{5, 6, 7, 8, 9, 5}));
  const std::size_t next = session->vm().program_counter();
  session->step(StepUnit::kInstruction);
  advance();
  EXPECT_EQ(session->vm().program_counter(), next + 1);
  EXPECT_EQ(pauses, (std::vector<bool>{true, false, true, false, true, false, true, false, true, false, true,
                                       false, true, false, true, false, true}));
}

TEST_F(DebugSessionTest, RunsUntilPausedAndFinishesAtTickLimit) {
  start(kCounting);
  session->run();
  advance(3);
  EXPECT_EQ(session->state(), ExecutionState::kRunning);
  EXPECT_EQ(session->ticks(), 3U);
  session->pause();
  advance(3);
  EXPECT_EQ(session->ticks(), 3U);
  session->limit_ticks(5);
  session->run();
  advance(10);
  EXPECT_EQ(session->state(), ExecutionState::kFinished);
  EXPECT_EQ(session->status(), Status::kEnded);
  EXPECT_EQ(session->ticks(), 5U);
  EXPECT_TRUE(pauses.back());
}

TEST_F(DebugSessionTest, StopsAtLineInEachIteration) {
  start(kCounting);
  Breakpoint one;
  one.file = "main.aps";
  one.line = 6;
  session->set_breakpoints({one}, {});
  for (int round = 1; round <= 3; ++round) {
    session->run();
    advance(2);  // completes the current tick, then runs to the line
    EXPECT_EQ(session->state(), ExecutionState::kPaused);
    EXPECT_EQ(capture().hit, std::size_t{0});
    EXPECT_EQ(line(), 6U);
    EXPECT_EQ(variable("count"), static_cast<float>(round));
  }
  one.enabled = false;
  session->set_breakpoints({one}, {});
  EXPECT_FALSE(capture().hit) << "the index now refers to another breakpoint";
  session->run();
  advance(4);
  EXPECT_EQ(session->state(), ExecutionState::kRunning);
}

TEST_F(DebugSessionTest, StepsOfInstructionsReportTheBreakpointsThatTheyReach) {
  start(kCounting);
  const auto hits = [&](Breakpoint breakpoint) {
    session->reset();
    std::vector<program::Program> conditions;
    if (breakpoint.kind == Breakpoint::Kind::kCondition)
      conditions.push_back(compile_condition(breakpoint.condition, code.program));
    session->set_breakpoints({std::move(breakpoint)}, std::move(conditions));
    std::vector<std::string> stops;
    for (int i = 0; i < 40 && session->ticks() < 3; ++i) {
      session->step(StepUnit::kInstruction);
      advance();
      EXPECT_EQ(session->state(), ExecutionState::kPaused);
      if (capture().hit)
        stops.push_back("line " + std::to_string(line()) + ", count " +
                        std::to_string(int(variable("count"))));
    }
    return stops;
  };
  Breakpoint breakpoint;
  breakpoint.file = "main.aps";
  breakpoint.line = 6;
  EXPECT_EQ(hits(breakpoint),
            (std::vector<std::string>{"line 6, count 1", "line 6, count 2", "line 6, count 3"}));
  breakpoint.kind = Breakpoint::Kind::kCondition;
  breakpoint.condition = "count == 2";
  EXPECT_EQ(hits(breakpoint).size(), 1U);
  breakpoint.condition = "count";
  breakpoint.on_change = true;
  EXPECT_EQ(hits(breakpoint).size(), 3U);
  breakpoint.kind = Breakpoint::Kind::kTick;
  breakpoint.tick = 2;
  EXPECT_EQ(hits(breakpoint).size(), 1U);
}

TEST_F(DebugSessionTest, StopsAtTick) {
  start(kCounting);
  Breakpoint one;
  one.kind = Breakpoint::Kind::kTick;
  one.tick = 4;
  session->set_breakpoints({one}, {});
  session->run();
  advance(10);
  EXPECT_EQ(session->state(), ExecutionState::kPaused);
  EXPECT_EQ(session->ticks(), 4U);
  session->run();
  advance(3);
  EXPECT_EQ(session->ticks(), 7U);
}

TEST_F(DebugSessionTest, StopsOnlyWhenConditionBecomesTrue) {
  start(kCounting);
  // After line 7, 47 cells hold the count and one holds 100.
  break_when("globalsum(A) > 47 * 3 + 100");
  session->run();
  advance(10);
  EXPECT_EQ(session->state(), ExecutionState::kPaused);
  EXPECT_EQ(line(), 8U) << "the previous instruction made the condition true";
  EXPECT_EQ(variable("count"), 4.0F);
  // The condition becomes false when A is overwritten without the 100, and true again with it.
  session->run();
  advance(10);
  EXPECT_EQ(session->state(), ExecutionState::kPaused);
  EXPECT_EQ(variable("count"), 5.0F);
  // From the sixth iteration on, 48 times the count satisfies it, so it never becomes false.
  session->run();
  advance(20);
  EXPECT_EQ(session->state(), ExecutionState::kRunning);
}

TEST_F(DebugSessionTest, ConditionReadsStateWithoutSideEffects) {
  start(kCounting);
  break_when("count >= 3 and surface.tick >= 3");
  session->run();
  advance(10);
  EXPECT_EQ(session->state(), ExecutionState::kPaused);
  EXPECT_EQ(session->ticks(), 3U);
  // The same run without a condition produces the same registers.
  FakeHost other;
  DebugSession plain(code.program, vm::VmOptions{}, other);
  plain.run();
  for (int i = 0; i < 3; ++i) plain.advance();
  for (std::size_t r = 0; r < code.program.registers.size(); ++r)
    EXPECT_EQ(vm::test::read_cells(session->vm().plane(r)), vm::test::read_cells(plain.vm().plane(r))) << r;
  EXPECT_EQ(host.step_count, other.step_count);
}

// Nothing reads h and k after the tick, and fused code would leave them out.
TEST_F(DebugSessionTest, LocalNamesHaveTheirValuesAtTicks) {
  start(
      "!register(A, X)\n!macro_def\nhalve($a)\n!macro_begin\n:t = $a + 4\n$a = :t / 2\nsurface.step\n"
      "$a = $a + 1\n!macro_end\nfunction y = g(plane a)\nh = a * 3\ny = h + 1\n"
      "k = (a + 1) * (a + 2) * (a - 1)\ny = y + k\nsurface.step\ny = y + 1\nendfunction\n"
      "A = 6\n#again\nhalve(A)\nX = g(A)\njump(#again)\n");
  const auto expect_local = [&](const std::string& name, float value) {
    const vm::Vm& vm = session->vm();
    const program::LocalName* local = program::find_local(code.program, name, vm.program_counter());
    ASSERT_NE(local, nullptr) << name;
    EXPECT_EQ(vm::test::read_cells(vm.plane(local->operand.index))[5], value) << name;
  };
  float a = 6.0F;
  for (int tick = 0; tick < 6; ++tick) {
    session->step(StepUnit::kTick);
    advance();
    if (tick % 2 == 0) {
      expect_local(":t", a + 4.0F);
      a = (a + 4.0F) / 2.0F;
      expect_local("a", a);
      a += 1.0F;
    } else {
      expect_local("a", a);
      expect_local("h", a * 3.0F);
      expect_local("k", (a + 1.0F) * (a + 2.0F) * (a - 1.0F));
      expect_local("y", a * 3.0F + 1.0F + (a + 1.0F) * (a + 2.0F) * (a - 1.0F));
    }
  }
}

TEST_F(DebugSessionTest, FailingConditionIsFalse) {
  start(kCounting);
  break_when("pixel.get(A, count, 0) == 1");  // outside the array from count 8 on
  session->run();
  advance(2);
  EXPECT_EQ(session->state(), ExecutionState::kPaused);
  session->run();
  advance(20);
  EXPECT_EQ(session->state(), ExecutionState::kRunning);
}

TEST(ConditionCompiler, ReportsErrorsInOneLine) {
  const CompiledSource c = compile(kCounting);
  const auto wrong = [&](const std::string& condition) {
    std::string text;
    EXPECT_FALSE(run::compile_condition(condition, c.program, 8, 6, text)) << condition;
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    return text;
  };
  EXPECT_NE(wrong("globalsum(Aa) > 0").find("Aa"), std::string::npos);
  EXPECT_EQ(wrong("A > 0"),
            "a condition takes a scalar, and this is a register; write where(…) to act on the cells where it "
            "holds, or take one value of all: globalany(A)");
  EXPECT_NE(wrong("count >"), "");
  EXPECT_NE(wrong(""), "");
  EXPECT_NE(wrong("count > 1 // or so").find("comment"), std::string::npos);
  EXPECT_NE(wrong("count > 1\nA = 3"), "");
}

TEST(ConditionCompiler, KnowsRegistersOfAnotherSizeByTheirNames) {
  const CompiledSource c =
      compile("!create('S', REGISTER, 4, 3)\n!register(A, T.S)\nr[S] = cell.x\nsurface.step\n");
  std::string text;
  for (const std::string& condition : {cell_expression("S", 3, 2), cell_expression("r[S]", 3, 2),
                                       std::string("globalsum(S) + globalsum(r[S]) > pixel.get(T.S, 7, 5)")})
    EXPECT_TRUE(run::compile_condition(condition, c.program, 8, 6, text)) << condition << ": " << text;
  EXPECT_FALSE(run::compile_condition(cell_expression("S", 4, 2), c.program, 8, 6, text));
  EXPECT_EQ(text, "column 4, row 2 is outside a register of 4x3");
}

TEST(ConditionCompiler, RefusesConstantCellsOutsideOfTheirRegister) {
  const CompiledSource c = compile(kCounting);
  std::string text;
  const auto said = [&](const std::string& condition) {
    text.clear();
    run::compile_condition(condition, c.program, 8, 6, text);
    return text;
  };
  EXPECT_EQ(said(cell_expression("A", 9, 9)), "column 9, row 9 is outside a register of 8x6");
  EXPECT_EQ(said("pixel.get(A, count, 2 * 3) > 1"), "row 6 is outside a register of 8x6");
  EXPECT_EQ(said("pixel.get(A, -1, 0) > 1"), "column -1, row 0 is outside a register of 8x6");
  EXPECT_EQ(said(cell_expression("A", 7, 5)), "");
}

TEST_F(DebugSessionTest, ResetAndReplaceRestart) {
  start(kCounting);
  session->run();
  advance(5);
  session->reset();
  EXPECT_EQ(session->state(), ExecutionState::kRunning);
  EXPECT_EQ(session->ticks(), 0U);
  EXPECT_EQ(session->vm().instructions_executed(), 0U);
  advance(2);
  EXPECT_EQ(variable("count"), 2.0F);
  session->replace(compile("x = 7\nsurface.step\nx = 8\n").program);
  EXPECT_EQ(capture().program_id, 2U);
  advance(1);
  EXPECT_EQ(capture().variables.front(), 7.0F);
  advance(1);
  EXPECT_EQ(session->state(), ExecutionState::kFinished);
  session->run();  // no effect
  EXPECT_EQ(session->state(), ExecutionState::kFinished);
  session->reset();
  EXPECT_EQ(session->state(), ExecutionState::kPaused);
}

TEST_F(DebugSessionTest, WalksLineByLine) {
  start(kCounting);
  session->walk(StepUnit::kLine, std::chrono::milliseconds(5), listing.groups());
  EXPECT_EQ(session->walk_period(), std::chrono::milliseconds(5));
  std::vector<std::uint32_t> lines;
  for (int i = 0; i < 4; ++i) {
    advance();
    lines.push_back(line());
  }
  EXPECT_EQ(lines, (std::vector<std::uint32_t>{5, 6, 7, 8}));
  EXPECT_EQ(session->state(), ExecutionState::kWalking);
  session->pause();
  EXPECT_EQ(session->state(), ExecutionState::kPaused);
}

TEST_F(DebugSessionTest, WalksTickByTick) {
  start(kCounting);
  session->walk(StepUnit::kTick, std::chrono::milliseconds(5));
  for (std::uint64_t tick = 1; tick <= 3; ++tick) {
    session->advance();
    EXPECT_EQ(session->ticks(), tick);
    EXPECT_EQ(session->state(), ExecutionState::kWalking);
  }
}

TEST(FrontPanel, HoldsKeysAndQueuesPresses) {
  FrontPanel panel;
  panel.press_key('a');
  panel.press_key('b');
  panel.release_key('a');
  EXPECT_FALSE(panel.key_down('a'));
  EXPECT_TRUE(panel.key_down('b'));
  EXPECT_EQ(panel.take_key(), 'a');
  EXPECT_EQ(panel.take_key(), 'b');
  EXPECT_EQ(panel.take_key(), 0);
  for (std::size_t i = 0; i < 2 * FrontPanel::kMaxUnreadKeys; ++i) panel.press_key('c');
  std::size_t unread = 0;
  while (panel.take_key() != 0) ++unread;
  EXPECT_EQ(unread, FrontPanel::kMaxUnreadKeys);
  panel.release_all_keys();
  EXPECT_FALSE(panel.key_down('b'));
}

TEST_F(DebugSessionTest, InterruptedStepResumes) {
  start(kCounting);
  host.step_status = vm::HostStatus::kInterrupted;  // like a surface that does not answer
  session->step(StepUnit::kTick);
  advance(2);
  EXPECT_EQ(session->state(), ExecutionState::kStepping);
  EXPECT_EQ(session->ticks(), 0U);
  EXPECT_EQ(line(), 8U);
  host.step_status = vm::HostStatus::kOk;
  advance();
  EXPECT_EQ(session->state(), ExecutionState::kPaused);
  EXPECT_EQ(session->ticks(), 1U);
}

TEST_F(DebugSessionTest, SnapshotsFullAndSubsampledRegisters) {
  start("!create('BIG', REGISTER, 300, 100)\nr[BIG] = cell.x + 1000 * cell.y\nsurface.step\n");
  session->step(StepUnit::kTick);
  advance();
  SnapshotRequest request;
  request.full = 0;
  request.thumbnails = {0, 7};  // register 7 does not exist
  request.max_thumbnail_edge = 64;
  const DebugSnapshot all = capture(request);
  ASSERT_TRUE(all.full);
  EXPECT_EQ(all.full->width, 300U);
  EXPECT_EQ(all.full->cells[2 * 300 + 5], 2005.0F);
  ASSERT_EQ(all.thumbnails.size(), 1U);
  EXPECT_EQ(all.thumbnails[0].stride, 5U);
  EXPECT_EQ(all.thumbnails[0].width, 60U);
  EXPECT_EQ(all.thumbnails[0].height, 20U);
  EXPECT_EQ(all.thumbnails[0].cells[60 + 1], 5005.0F);  // north-west cell of its block
  EXPECT_EQ(all.time_s, 0.5);
}

TEST_F(DebugSessionTest, ProbeRecordsCellAndNeighbourhood) {
  start(kCounting);
  session->probe_cell({0, 0});
  session->run();
  advance(3);
  SnapshotRequest request;
  request.include_probe = true;
  const DebugSnapshot l = capture(request);
  ASSERT_EQ(l.neighbourhoods.size(), code.program.registers.size());
  const Neighbourhood& a = l.neighbourhoods[0];
  EXPECT_TRUE(std::isnan(a[0]) && std::isnan(a[1]) && std::isnan(a[3]));  // beyond the north-west edge
  EXPECT_EQ(a[4], 100.0F);
  EXPECT_EQ(a[5], 3.0F);  // east
  EXPECT_EQ(a[7], 3.0F);  // south
  ASSERT_EQ(l.history.size(), 3U);
  EXPECT_EQ(l.history[1].tick, 2U);
  EXPECT_EQ(l.history[1].values[0], 100.0F);
  session->probe_cell({1, 0});
  constexpr int kMore = static_cast<int>(Probe::kMaxRecords) + 72;
  advance(kMore);
  const DebugSnapshot later = capture(request);
  ASSERT_EQ(later.history.size(), Probe::kMaxRecords);
  EXPECT_EQ(later.history.back().tick, kMore + 3U);
  EXPECT_EQ(later.history.back().values[0], kMore + 3.0F);
  EXPECT_EQ(later.history.front().values[0], 3.0F + 72.0F + 1.0F);
}

TEST_F(DebugSessionTest, ProfilesOnlyWhileEnabled) {
  start(kCounting);
  session->run();
  advance(2);
  SnapshotRequest request;
  request.include_profile = true;
  EXPECT_TRUE(capture(request).profile.empty());
  session->set_profiling(true);
  advance(3);
  const auto rows = listing.profile_by_row(capture(request).profile);
  EXPECT_EQ(rows[7].executions, 3U);  // surface.step
  session->set_profiling(false);
  advance(3);
  EXPECT_EQ(listing.profile_by_row(capture(request).profile)[7].executions, 3U);
}

TEST_F(DebugSessionTest, FailureReportsSourceLocation) {
  start("!register(A)\nx = pixel.get(A, 99, 0)\n");
  session->run();
  advance();
  EXPECT_EQ(session->state(), ExecutionState::kFinished);
  EXPECT_EQ(capture().status, Status::kFailed);
  EXPECT_NE(capture().error.find("main.aps:2"), std::string::npos);
}

TEST(PanelHost, ForwardsPanelStateAndUserParameters) {
  const CompiledSource c = compile(R"(!register(A)
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
  DebugSession session(c.program, vm::VmOptions{}, host);
  session.run();
  session.advance();
  std::uint64_t revision = 0;
  FrontPanel::State state;
  ASSERT_TRUE(panel.copy_if_changed(revision, state));
  EXPECT_EQ(state.console.front(), "gain 2");
  EXPECT_EQ(inner.console, "gain 2\n");
  using Labels = std::vector<std::pair<std::string, std::string>>;
  EXPECT_EQ(state.labels, (Labels{{"stage", ""}, {"gain", "2"}, {"state", "on"}}));
  const Appearance& a = state.appearances.at("A");
  EXPECT_EQ(a.title, "the map");
  EXPECT_EQ(a.palette, common::Palette::kFlame);
  EXPECT_EQ(a.range->high, 8.0F);
  EXPECT_EQ(state.last_shown, "A");
  panel.set_parameter("gain", 7.0F);
  session.advance();
  EXPECT_EQ(session.vm().plane(0).row(3)[3], 7.0F);
  ASSERT_TRUE(panel.copy_if_changed(revision, state));
  EXPECT_EQ(state.labels[1].second, "7");
  EXPECT_FALSE(panel.copy_if_changed(revision, state));
  panel.clear_program();
  ASSERT_TRUE(panel.copy_if_changed(revision, state));
  EXPECT_TRUE(state.labels.empty());
  EXPECT_EQ(panel.parameter("gain"), 7.0F) << "user parameters are kept";
}

TEST(FrontPanel, KeepsTheLatestLines) {
  FrontPanel panel;
  for (int i = 0; i < 3000; ++i) panel.print("line " + std::to_string(i) + "\n");
  panel.print("no end");
  panel.note("reloaded");
  std::uint64_t revision = 0;
  FrontPanel::State state;
  ASSERT_TRUE(panel.copy_if_changed(revision, state));
  EXPECT_EQ(state.console.size(), FrontPanel::kMaxLines);
  EXPECT_EQ(state.console[state.console.size() - 3], "no end");
  EXPECT_EQ(state.console[state.console.size() - 2], "- reloaded");
  EXPECT_EQ(state.console.back(), "");
}

}  // namespace
}  // namespace apron::debugger::test
