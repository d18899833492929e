// A person holds and steps a program whose surface is another process: the surface stands still for as long,
// and takes nobody for dead.
#include <gtest/gtest.h>
#include <shm_protocol/ControllerEndpoint.h>
#include <shm_protocol/SurfaceEndpoint.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <thread>

#include "apron/compiler/Compiler.h"
#include "apron/debugger/Runner.h"
#include "apron/debugger/Session.h"
#include "apron/run/SurfaceHost.h"

namespace apron {
namespace {

using namespace std::chrono_literals;
using shm_protocol::State;
using shm_protocol::Status;

constexpr const char* kEcho =
    "!register(A)\nwhile(1)\n  A = surface.sense('in')\n  surface.actuate('out', A + 1)\n  "
    "surface.step\nendwhile\n";

// What the person's process does on a letter: r run, h hold, t tick, 0 reset, q quit.
void obey(debugger::Runner& runner, int orders) {
  for (char letter = 0; letter != 'q';) {
    if (read(orders, &letter, 1) != 1) return;
    runner.post([letter](debugger::Session& session) {
      if (letter == 'r') session.run();
      if (letter == 'h') session.hold();
      if (letter == 't') session.step(debugger::Unit::kTick);
      if (letter == '0') session.reset();
    });
    // As a window does: a program that waits for its surface is interrupted before long.
    for (int i = 0; i < 10; ++i) {
      runner.tend();
      std::this_thread::sleep_for(10ms);
    }
  }
}

// The other process.
[[noreturn]] void control(const std::string& name, int orders) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  syntax::MemoryReader reader;
  reader.files["echo.aps"] = kEcho;
  compiler::CompileOptions how;
  how.file = "echo.aps";
  how.width = how.height = 2;
  compiler::CompileResult compiled = compiler::compile(how, reader);
  if (!compiled.program) _exit(90);
  auto surface = shm_protocol::ControllerEndpoint::attach(name, {.timeout = 30s});
  std::atomic<bool> interrupt{false};
  run::SurfaceHost host(surface, interrupt, {});
  if (host.begin() != vm::HostStatus::kOk) _exit(91);
  vm::VmOptions options;
  options.stop = &interrupt;
  debugger::Session session(*compiled.program, options, host, [&](bool held) { host.show_paused(held); });
  {
    debugger::Runner runner(session, interrupt);
    obey(runner, orders);
  }
  _exit(session.mode() == debugger::Mode::kOver ? 92 : 0);
}

class HoldTest : public testing::Test {
 protected:
  void SetUp() override {
    const std::string name = "hold_" + std::to_string(getpid());
    shm_protocol::SurfaceConfig config;
    config.name = name;
    config.rows = config.columns = 2;
    config.period_ns = 20'000'000;
    config.channels = {
        {"in", shm_protocol::Direction::kSensor, shm_protocol::DType::kF32, 1, "", -1e6, 1e6, 0},
        {"out", shm_protocol::Direction::kActuator, shm_protocol::DType::kF32, 1, "", -1e6, 1e6, 0}};
    surface = std::make_unique<shm_protocol::SurfaceEndpoint>(shm_protocol::SurfaceEndpoint::create(config));
    std::array<int, 2> ends{};
    ASSERT_EQ(pipe(ends.data()), 0);
    child = fork();
    if (child == 0) {
      close(ends[1]);
      control(name, ends[0]);
    }
    close(ends[0]);
    orders = ends[1];
    ASSERT_EQ(surface->await_controller({.timeout = 60s}), Status::kOk);
    publish();
  }
  void TearDown() override {
    close(orders);
    if (child > 0) {
      kill(child, SIGKILL);
      waitpid(child, nullptr, 0);
    }
  }
  void order(char letter) { ASSERT_EQ(write(orders, &letter, 1), 1); }
  void publish() {
    ++tick;
    for (float& cell : surface->sensor(0)) cell = static_cast<float>(tick);
    ASSERT_EQ(surface->publish(tick, 0.02 * static_cast<double>(tick)), Status::kOk);
  }
  Status await(std::chrono::nanoseconds patience) {
    return surface->await_actuators(tick, {.timeout = patience});
  }
  void expect_answer() {
    ASSERT_EQ(await(60s), Status::kOk);
    EXPECT_EQ(surface->actuator(1)[0], static_cast<float>(tick + 1));
  }
  void expect_state(State wanted) {
    const auto deadline = std::chrono::steady_clock::now() + 60s;
    while (surface->controller_state() != wanted && std::chrono::steady_clock::now() < deadline)
      std::this_thread::sleep_for(1ms);
    EXPECT_EQ(surface->controller_state(), wanted);
  }

  std::unique_ptr<shm_protocol::SurfaceEndpoint> surface;
  pid_t child = -1;
  int orders = -1;
  std::uint64_t tick = 0;
};

TEST_F(HoldTest, TheSurfaceWaitsForAHeldProgramAndFollowsItStepByStep) {
  expect_state(State::kPaused);
  // Longer than a dead peer is given.
  EXPECT_EQ(await(1500ms), Status::kTimeout);
  EXPECT_EQ(surface->controller_state(), State::kPaused);
  for (int step = 0; step < 3; ++step) {
    order('t');
    expect_answer();
    publish();  // what the step waits for
    expect_state(State::kPaused);
    EXPECT_EQ(await(100ms), Status::kTimeout) << "a step is one answer";
  }
  order('r');
  for (int i = 0; i < 50; ++i) {
    expect_answer();
    publish();
  }
  expect_state(State::kRunning);
  EXPECT_EQ(surface->controllers_seen(), 1U);
}

TEST_F(HoldTest, AProgramThatWaitsForItsSurfaceCanBeHeldResetAndRunOn) {
  order('r');
  expect_answer();
  // Now the surface is the one that is held: the program waits in its step, and is held there.
  order('h');
  expect_state(State::kPaused);
  std::this_thread::sleep_for(200ms);
  publish();
  EXPECT_EQ(await(300ms), Status::kTimeout);
  // It begins again, takes the frame that came meanwhile, and goes on as if nothing had been.
  order('0');
  order('r');
  for (int i = 0; i < 20; ++i) {
    expect_answer();
    publish();
  }
  order('q');
  int status = -1;
  waitpid(child, &status, 0);
  child = -1;
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

}  // namespace
}  // namespace apron
