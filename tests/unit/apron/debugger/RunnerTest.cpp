#include "apron/debugger/Runner.h"

#include <gtest/gtest.h>

#include "tests/unit/apron/debugger/Programs.h"

namespace apron::debugger::test {
namespace {

using namespace std::chrono_literals;

class RunnerTest : public testing::Test {
 protected:
  void begin(const std::string& text) {
    code = compiled(text);
    vm::VmOptions options;
    options.stop = &interrupt;
    session = std::make_unique<Session>(code.program, options, host);
    runner = std::make_unique<Runner>(*session, interrupt);
  }
  // A look that is what is waited for; it never takes long, unless something hangs.
  Look wait_for(const std::function<bool(const Look&)>& wanted) {
    const auto deadline = std::chrono::steady_clock::now() + 60s;
    Look look;
    while (std::chrono::steady_clock::now() < deadline) {
      runner->ask({});
      while (!runner->take(look) && std::chrono::steady_clock::now() < deadline) {
        runner->tend();
        std::this_thread::sleep_for(1ms);
      }
      if (wanted(look)) return look;
    }
    ADD_FAILURE() << "it never came";
    return look;
  }
  void order(std::function<void(Session&)> what) { runner->post(std::move(what)); }

  std::atomic<bool> interrupt{false};
  FakeHost host;
  Compiled code;
  std::unique_ptr<Session> session;
  std::unique_ptr<Runner> runner;
};

TEST_F(RunnerTest, RunsLooksAndHoldsBetweenTicks) {
  begin(kCounting);
  EXPECT_EQ(wait_for([](const Look&) { return true; }).ticks, 0U);
  order([](Session& s) { s.run(); });
  wait_for([](const Look& l) { return l.ticks > 100; });
  order([](Session& s) { s.hold(); });
  const Look held = wait_for([](const Look& l) { return l.mode == Mode::kHeld; });
  // Held between two ticks, and there it stays.
  EXPECT_EQ(held.variables.front(), static_cast<float>(held.ticks));
  const Look still = wait_for([](const Look&) { return true; });
  EXPECT_EQ(still.ticks, held.ticks);
  order([](Session& s) { s.step(Unit::kTick); });
  wait_for([&](const Look& l) { return l.ticks == held.ticks + 1 && l.mode == Mode::kHeld; });
}

TEST_F(RunnerTest, AnswersFromTheMiddleOfAnEndlessTick) {
  begin("x = 0\nwhile(1)\n  x = x + 1\nendwhile\n");
  order([](Session& s) { s.run(); });
  const Look first = wait_for([](const Look& l) { return l.variables.front() > 0.0F; });
  EXPECT_EQ(first.mode, Mode::kRunning);
  wait_for([&](const Look& l) { return l.variables.front() > first.variables.front(); });
  order([](Session& s) { s.hold(); });
  wait_for([](const Look& l) { return l.mode == Mode::kHeld; });
}

TEST_F(RunnerTest, EndsAProgramThatDoesNot) {
  begin("while(1)\nendwhile\n");
  order([](Session& s) { s.run(); });
  runner.reset();  // or the test hangs
  EXPECT_EQ(session->mode(), Mode::kRunning);
}

TEST_F(RunnerTest, WalksByTheClock) {
  begin(kCounting);
  order([](Session& s) { s.walk(1ms, Groups{}); });
  wait_for([](const Look& l) { return l.mode == Mode::kWalking && l.ticks >= 1; });
}

}  // namespace
}  // namespace apron::debugger::test
