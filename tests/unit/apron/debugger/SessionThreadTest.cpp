#include "apron/debugger/SessionThread.h"

#include <gtest/gtest.h>

#include "apron/debugger/DebugSession.h"
#include "tests/unit/apron/vm/TestProgram.h"

// Programs are written by hand, so that ThreadSanitizer's build does without the compiler.
namespace apron::debugger::test {
namespace {

using namespace std::chrono_literals;
using program::Operand;
using vm::test::FakeHost;
using vm::test::Opcode;
using vm::test::TestProgram;

// Counts ticks in v0, and writes the count to all cells but one.
program::Program counting_program() {
  TestProgram b;
  const Operand cells = b.reg(8, 6), count = b.var();
  b.add(Opcode::kAdd, count, count, b.lit(1));
  b.add(Opcode::kMul, cells, count, b.lit(2));
  b.add(Opcode::kPixelSet, cells, b.lit(0), b.lit(0), b.lit(100));
  b.add(Opcode::kSurfaceStep);
  b.add(Opcode::kJump, {}, TestProgram::label(0));
  return b.finish();
}

// Counts in v0 and never steps.
program::Program endless_program() {
  TestProgram b;
  const Operand count = b.var();
  b.add(Opcode::kAdd, count, count, b.lit(1));
  b.add(Opcode::kJump, {}, TestProgram::label(0));
  return b.finish();
}

class SessionThreadTest : public testing::Test {
 protected:
  void start(program::Program program) {
    vm::VmOptions options;
    options.stop = &interrupt;
    session = std::make_unique<DebugSession>(std::move(program), options, host);
    session_thread = std::make_unique<SessionThread>(*session, interrupt);
  }
  // Polls until a snapshot satisfies the predicate. The timeout only expires if something hangs.
  DebugSnapshot wait_for(const std::function<bool(const DebugSnapshot&)>& predicate) {
    const auto deadline = std::chrono::steady_clock::now() + 60s;
    DebugSnapshot snapshot;
    while (std::chrono::steady_clock::now() < deadline) {
      session_thread->request_snapshot({});
      while (!session_thread->poll_snapshot(snapshot) && std::chrono::steady_clock::now() < deadline) {
        session_thread->interrupt_if_overdue();
        std::this_thread::sleep_for(1ms);
      }
      if (predicate(snapshot)) return snapshot;
    }
    ADD_FAILURE() << "no snapshot satisfies the predicate";
    return snapshot;
  }
  void post(std::function<void(DebugSession&)> what) { session_thread->post(std::move(what)); }

  std::atomic<bool> interrupt{false};
  FakeHost host;
  std::unique_ptr<DebugSession> session;
  std::unique_ptr<SessionThread> session_thread;
};

TEST_F(SessionThreadTest, RunsTakesSnapshotsAndPausesBetweenTicks) {
  start(counting_program());
  EXPECT_EQ(wait_for([](const DebugSnapshot&) { return true; }).ticks, 0U);
  post([](DebugSession& s) { s.run(); });
  wait_for([](const DebugSnapshot& l) { return l.ticks > 100; });
  post([](DebugSession& s) { s.pause(); });
  const DebugSnapshot paused =
      wait_for([](const DebugSnapshot& l) { return l.mode == ExecutionState::kPaused; });
  // Paused between two ticks, and stays there.
  EXPECT_EQ(paused.variables.front(), static_cast<float>(paused.ticks));
  const DebugSnapshot still = wait_for([](const DebugSnapshot&) { return true; });
  EXPECT_EQ(still.ticks, paused.ticks);
  post([](DebugSession& s) { s.step(StepUnit::kTick); });
  wait_for([&](const DebugSnapshot& l) {
    return l.ticks == paused.ticks + 1 && l.mode == ExecutionState::kPaused;
  });
}

TEST_F(SessionThreadTest, TakesSnapshotsDuringEndlessTick) {
  start(endless_program());
  post([](DebugSession& s) { s.run(); });
  const DebugSnapshot first = wait_for([](const DebugSnapshot& l) { return l.variables.front() > 0.0F; });
  EXPECT_EQ(first.mode, ExecutionState::kRunning);
  wait_for([&](const DebugSnapshot& l) { return l.variables.front() > first.variables.front(); });
  post([](DebugSession& s) { s.pause(); });
  wait_for([](const DebugSnapshot& l) { return l.mode == ExecutionState::kPaused; });
}

TEST_F(SessionThreadTest, DestructorInterruptsEndlessProgram) {
  start(endless_program());
  post([](DebugSession& s) { s.run(); });
  session_thread.reset();  // hangs if the destructor does not interrupt the program
  EXPECT_EQ(session->state(), ExecutionState::kRunning);
}

TEST_F(SessionThreadTest, WalksOnTimer) {
  start(counting_program());
  post([](DebugSession& s) { s.walk(StepUnit::kLine, 1ms); });
  wait_for([](const DebugSnapshot& l) { return l.mode == ExecutionState::kWalking && l.ticks >= 1; });
}

}  // namespace
}  // namespace apron::debugger::test
