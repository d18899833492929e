// Pausing and stepping a program whose surface is another process: the surface waits meanwhile and does not
// consider the controller dead.
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
#include "apron/debugger/DebugSession.h"
#include "apron/debugger/SessionThread.h"
#include "apron/run/host/SurfaceHost.h"

namespace apron {
namespace {

using namespace std::chrono_literals;
using shm_protocol::State;
using shm_protocol::Status;

constexpr const char* kEcho =
    "!register(A)\nwhile(1)\n  A = surface.sense('in')\n  surface.actuate('out', A + 1)\n  "
    "surface.step\nendwhile\n";

// Executes one-letter commands: r run, h pause, t tick, 0 reset, q quit.
void run_commands(debugger::SessionThread& runner, int command_fd) {
  for (char letter = 0; letter != 'q';) {
    if (read(command_fd, &letter, 1) != 1) return;
    runner.post([letter](debugger::DebugSession& session) {
      if (letter == 'r') session.run();
      if (letter == 'h') session.pause();
      if (letter == 't') session.step(debugger::StepUnit::kTick);
      if (letter == '0') session.reset();
    });
    // Like the window's loop, interrupts a program that waits for its surface.
    for (int i = 0; i < 10; ++i) {
      runner.interrupt_if_overdue();
      std::this_thread::sleep_for(10ms);
    }
  }
}

// The controller process.
[[noreturn]] void run_controller(const std::string& name, int command_fd) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  syntax::MemoryReader reader;
  reader.files["echo.aps"] = kEcho;
  compiler::CompileOptions compile_options;
  compile_options.file = "echo.aps";
  compile_options.width = compile_options.height = 2;
  compiler::CompileResult compiled = compiler::compile(compile_options, reader);
  if (!compiled.program) _exit(90);
  auto surface = shm_protocol::ControllerEndpoint::attach(name, {.timeout = 30s});
  std::atomic<bool> interrupt{false};
  run::SurfaceHost host(surface, interrupt, {});
  if (host.await_first_frame() != vm::HostStatus::kOk) _exit(91);
  vm::VmOptions options;
  options.stop = &interrupt;
  debugger::DebugSession session(*compiled.program, options, host,
                                 [&](bool paused) { host.publish_paused(paused); });
  {
    debugger::SessionThread runner(session, interrupt);
    run_commands(runner, command_fd);
  }
  _exit(session.state() == debugger::ExecutionState::kFinished ? 92 : 0);
}

class PauseTest : public testing::Test {
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
      run_controller(name, ends[0]);
    }
    close(ends[0]);
    command_fd_ = ends[1];
    ASSERT_EQ(surface->await_controller({.timeout = 60s}), Status::kOk);
    publish();
  }
  void TearDown() override {
    close(command_fd_);
    if (child > 0) {
      kill(child, SIGKILL);
      waitpid(child, nullptr, 0);
    }
  }
  void send_command(char letter) { ASSERT_EQ(write(command_fd_, &letter, 1), 1); }
  void publish() {
    ++tick;
    for (float& cell : surface->sensor(0)) cell = static_cast<float>(tick);
    ASSERT_EQ(surface->publish(tick, 0.02 * static_cast<double>(tick)), Status::kOk);
  }
  Status await_actuators(std::chrono::nanoseconds patience) {
    return surface->await_actuators(tick, {.timeout = patience});
  }
  void expect_answer() {
    ASSERT_EQ(await_actuators(60s), Status::kOk);
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
  int command_fd_ = -1;
  std::uint64_t tick = 0;
};

TEST_F(PauseTest, SurfaceWaitsForPausedProgramAndFollowsSteps) {
  expect_state(State::kPaused);
  // Longer than the timeout after which a peer counts as dead.
  EXPECT_EQ(await_actuators(1500ms), Status::kTimeout);
  EXPECT_EQ(surface->controller_state(), State::kPaused);
  for (int step = 0; step < 3; ++step) {
    send_command('t');
    expect_answer();
    publish();  // completes the step
    expect_state(State::kPaused);
    EXPECT_EQ(await_actuators(100ms), Status::kTimeout) << "a step sends one answer";
  }
  send_command('r');
  for (int i = 0; i < 50; ++i) {
    expect_answer();
    publish();
  }
  expect_state(State::kRunning);
  EXPECT_EQ(surface->controllers_seen(), 1U);
}

TEST_F(PauseTest, ProgramWaitingForSurfaceCanBePausedAndReset) {
  send_command('r');
  expect_answer();
  // Now the surface stalls: the program waits in its step and is paused there.
  send_command('h');
  expect_state(State::kPaused);
  std::this_thread::sleep_for(200ms);
  publish();
  EXPECT_EQ(await_actuators(300ms), Status::kTimeout);
  // After a reset it reads the frame that arrived meanwhile and continues normally.
  send_command('0');
  send_command('r');
  for (int i = 0; i < 20; ++i) {
    expect_answer();
    publish();
  }
  send_command('q');
  int status = -1;
  waitpid(child, &status, 0);
  child = -1;
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

}  // namespace
}  // namespace apron
