// The apron executable: exit statuses, messages, signals, and sessions with a surface in this process.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <shm_protocol/SurfaceEndpoint.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <thread>

namespace apron::run {
namespace {

using namespace std::chrono_literals;
using shm_protocol::Direction;
using shm_protocol::Mode;
using shm_protocol::Status;
using shm_protocol::SurfaceEndpoint;

struct ProcessResult {
  int status = -1;  // as in a shell: 128 + signal if killed
  std::string out, err;
};

class Cli : public testing::Test {
 protected:
  void SetUp() override {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    id_ = "ac_" + std::to_string(getpid()) + "_" + std::string(test->name()).substr(0, 20);
    directory_ = std::filesystem::path(testing::TempDir()) / id_;
    std::filesystem::create_directories(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  std::string path(const std::string& name) const { return (directory_ / name).string(); }
  std::string file(const std::string& name, const std::string& text) const {
    std::ofstream(path(name)) << text;
    return path(name);
  }

  pid_t start(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), APRON_EXECUTABLE);
    std::vector<char*> argv;
    for (std::string& a : arguments) argv.push_back(a.data());
    argv.push_back(nullptr);
    const std::string out = path("stdout"), err = path("stderr");
    const pid_t child = fork();
    if (child == 0) {
      if (chdir(directory_.c_str()) != 0) _exit(99);
      dup2(open(out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600), STDOUT_FILENO);
      dup2(open(err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600), STDERR_FILENO);
      execv(argv[0], argv.data());
      _exit(99);
    }
    return child;
  }
  // Waits for the child. Kills it on timeout, which yields the status 137.
  ProcessResult finish(pid_t child) const {
    int status = 0;
    for (int i = 0; waitpid(child, &status, WNOHANG) == 0; ++i) {
      if (i == 3000) kill(child, SIGKILL);
      std::this_thread::sleep_for(10ms);
    }
    return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), read("stdout"), read("stderr")};
  }
  ProcessResult run(std::vector<std::string> arguments) const { return finish(start(std::move(arguments))); }
  std::string read(const std::string& name) const {
    std::ostringstream text;
    text << std::ifstream(path(name)).rdbuf();
    return text.str();
  }

  SurfaceEndpoint surface(Mode mode, std::uint32_t columns = 4) const {
    shm_protocol::SurfaceConfig config;
    config.name = id_;
    config.rows = 2;
    config.columns = columns;
    config.period_ns = 10'000'000;
    config.mode = mode;
    config.channels = {{"proximity", Direction::kSensor, shm_protocol::DType::kF32, 1, "u", 0, 100, 0},
                       {"height", Direction::kActuator, shm_protocol::DType::kF32, 1, "u", 0, 1000, 4}};
    return SurfaceEndpoint::create(config);
  }
  static void publish_sensors(SurfaceEndpoint& surface, std::uint64_t tick) {
    for (float& cell : surface.sensor(0)) cell = static_cast<float>(tick);
    ASSERT_EQ(surface.publish(tick, static_cast<double>(tick) / 100), Status::kOk);
  }

  std::string id_;
  std::filesystem::path directory_;
};

constexpr const char* kLoop =
    "!register(D)\n"
    "#again\n"
    "surface.sense('proximity', D)\n"
    "D = D * 2 + 1\n"
    "surface.actuate(D, 'height')\n"
    "surface.step\n"
    "jump(#again)\n";

TEST_F(Cli, HelpAndVersionSucceed) {
  EXPECT_EQ(run({"--help"}).status, 0);
  EXPECT_NE(run({"run", "--help"}).out.find("--shm"), std::string::npos);
  const ProcessResult version = run({"--version"});
  EXPECT_EQ(version.status, 0);
  EXPECT_EQ(version.out.find("apron " SMARTSURF_VERSION "\narray code: "), 0U) << version.out;
}

TEST_F(Cli, InstructionSetIsChecked) {
  const std::string script = file("one.aps", "println(1)\n");
  EXPECT_EQ(run({"run", script, "--isa", "portable"}).out, "1\n");
  const ProcessResult wrong = run({"run", script, "--isa", "avx3"});
  EXPECT_EQ(wrong.status, 2);
  EXPECT_NE(wrong.err.find("'avx3' is not avx512, avx2 or portable"), std::string::npos) << wrong.err;
}

TEST_F(Cli, WarnsOfProgramsThatNeverStep) {
  const std::string never =
      file("never.aps", "!register(D)\n#again\nD = surface.sense('proximity')\njump(#again)\n");
  const ProcessResult checked = run({"check", never});
  EXPECT_EQ(checked.status, 0);
  EXPECT_NE(checked.err.find("never reaches surface.step"), std::string::npos) << checked.err;
  const std::string unreached =
      file("unreached.aps", "n = 0\nwhile(1)\n  n = n + 1\nendwhile\nsurface.step\n");
  EXPECT_NE(run({"check", unreached}).err.find("never reaches surface.step"), std::string::npos);
  const std::string stuck = file("stuck.aps", "surface.step\nn = 0\n#again\nn = n + 1\njump(#again)\n");
  EXPECT_EQ(run({"check", stuck}).err,
            stuck +
                ":2: warning: from here the program repeats forever without surface.step, for which the "
                "surface waits\n");
  EXPECT_EQ(run({"check", file("loop.aps", kLoop)}).err, "");
  EXPECT_EQ(run({"check", file("plain.aps", "println(1)\n")}).err, "");
  SurfaceEndpoint waiting = surface(Mode::kTimeStep);
  const pid_t child = start({"run", never, "--shm", id_});
  publish_sensors(waiting, 0);
  std::string err;
  for (int i = 0; i < 60 && err.empty(); ++i) {
    std::this_thread::sleep_for(100ms);
    err = read("stderr");
  }
  EXPECT_EQ(err, "apron: warning: the surface has waited 2 s for surface.step\n");
  kill(child, SIGTERM);
  EXPECT_EQ(finish(child).status, 128 + SIGTERM);
}

TEST_F(Cli, ImportsKernels) {
  const std::string kernel = file(
      "k.cpp", "scamp5_kernel_begin();\nscamp5_in(A, 3);\nmov(C, A);\nadd(B, A, C);\nscamp5_kernel_end();\n");
  const ProcessResult imported = run({"import", kernel});
  EXPECT_EQ(imported.status, 0) << imported.err;
  EXPECT_EQ(imported.err, "");
  const ProcessResult warned =
      run({"import", file("w.cpp", "scamp5_kernel_begin();\nadd(B, A, A);\nscamp5_kernel_end();\n")});
  EXPECT_EQ(warned.status, 0);
  EXPECT_EQ(warned.err,
            path("w.cpp") + ":2: warning: the chip connects 'A' once in 'add' and computes something else\n");
  const ProcessResult ran = run({"run", file("k.aps", imported.out + "println(B)\n"), "--size", "2x1"});
  EXPECT_EQ(ran.out, "6 6\n");
  const ProcessResult partial =
      run({"import", file("p.cpp", "scamp5_kernel_begin();\nres(A);\nfly(A);\n"), "--output", path("p.aps")});
  EXPECT_EQ(partial.status, 1);
  EXPECT_EQ(partial.err, path("p.cpp") + ":3: not translated: scamp5.aps has no instruction 'fly'\n");
  EXPECT_EQ(run({"check", path("p.aps")}).status, 0);
  EXPECT_EQ(run({"import", file("e.cpp", "int main(){}\n")}).status, 2);
  const ProcessResult unresolved =
      run({"import", file("u.cpp", "int main(){ scamp5_in(A, 1);\n  rect(S0, 3);\n}\n"), "--output",
           path("u.aps")});
  EXPECT_EQ(unresolved.status, 2);
  EXPECT_EQ(unresolved.err, path("u.cpp") + ":2: error: 'rect' runs on the controller or host\n");
  EXPECT_FALSE(std::filesystem::exists(path("u.aps")));
  EXPECT_EQ(run({"import", path("absent.cpp")}).status, 2);
}

TEST_F(Cli, InvalidCommandLineExitsWithStatus2) {
  const std::string good = file("a.aps", "println(1)\n");
  const std::vector<std::vector<std::string>> wrong = {
      {},
      {"fly"},
      {"run"},
      {"run", good, "--sice", "3x3"},
      {"run", good, "--size", "3"},
      {"run", good, "--size", "0x4"},
      {"run", good, "--size", "99999x99999"},
      {"run", good, "--size", "4x4z"},
      {"run", good, "--threads", "0"},
      {"run", good, "--ticks", "-1"},
      {"run", good, "--set", "speed"},
      {"run", good, "--set", "speed=fast"},
      {"run", good, "--set", "speed=nan"},
      {"run", good, "--set", "speed=1"},  // no such slider
      {"run", good, "--shm", "s", "--size", "4x4"},
      {"run", good, "--shm", "no_such_surface", "--wait", "0"},
      {"run", good, "--window", "--reconnect"},
      {"run", good, "--hold"},
      {"run", good, "--show", "A"},
      {"run", good, "--screenshot", "a.jpg"},
      {"run", good, "--screenshot", "a.png@soon"},
      {"run", good, "--screenshot", "a.png", "--geometry", "80x25"},
      {"run", good, "--screenshot", "a.png", "--window"},
      {"run", good, "--save", "A"},
      {"run", good, "--save", "A=a.npy"},  // no such register
      {"run", file("r.aps", "!register(A)\n"), "--save", "A=a.txt"},
      {"run", good, "--pace", "fast"},
      {"run", good, "--fps", "0"},
      {"run", good, "--keys", "left"},
      {"run", good, "--shm", "s", "--pace", "1"},
      {"run", good, "--cost-model", "cost.json"},  // without --profile
      {"run", good, "--profile", "/dev/null", "--cost-model", path("none.json")},
      {"fmt"},
      {"fmt", path("none.aps")},
      {"repl", "--size", "0x1"},
      {"check", good, "--profile", "global"},
      {"run", path("none.aps")},
      {"check", path("none.aps")},
      {"disasm", path("none.aps")},
  };
  for (const auto& arguments : wrong) {
    const ProcessResult result = run(arguments);
    const std::string shown = testing::PrintToString(arguments) + ": " + result.err;
    EXPECT_EQ(result.status, 2) << shown;
    EXPECT_NE(result.err.find("error: "), std::string::npos) << shown;
    EXPECT_EQ(result.out, "") << shown;
  }
  EXPECT_NE(run({"fmt"}).err.find("error: programs is required"), std::string::npos);
}

TEST_F(Cli, RunsProgramAndPrintsToStdout) {
  const ProcessResult result =
      run({"run", file("a.aps", "println('cells ', SURFACE_WIDTH * SURFACE_HEIGHT)\n"), "--size", "5x3"});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(result.out, "cells 15\n");
  EXPECT_EQ(result.err, "");
}

TEST_F(Cli, InvalidProgramExitsWithStatus2) {
  const std::string bad = file("bad.aps", "!register(A)\nA = 1\nprintln(Bee)\n");
  for (const char* command : {"run", "check", "disasm"}) {
    const ProcessResult result = run({command, bad});
    EXPECT_EQ(result.status, 2);
    EXPECT_NE(result.err.find("bad.aps:3:"), std::string::npos) << result.err;
  }
}

TEST_F(Cli, RuntimeErrorExitsWithStatus1) {
  const ProcessResult result = run({"run", file("a.aps", "println('before')\n#deep\ncall(#deep)\n")});
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(result.out, "before\n");
  EXPECT_NE(result.err.find("a.aps:3: error: calls are nested"), std::string::npos) << result.err;
}

TEST_F(Cli, MissingFileOrSurfaceExitsWithStatus2) {
  const ProcessResult media = run({"run", file("a.aps", "!register(A)\nA = io.array.open('none.npy')\n")});
  EXPECT_EQ(media.status, 2);
  EXPECT_NE(media.err.find("a.aps:2: error: cannot read 'none.npy'"), std::string::npos) << media.err;
  const ProcessResult alone = run({"run", file("b.aps", kLoop)});
  EXPECT_EQ(alone.status, 2);
  EXPECT_NE(alone.err.find("b.aps:3: error: there is no surface: run with --shm NAME"), std::string::npos)
      << alone.err;
}

TEST_F(Cli, SetOverridesSlider) {
  const std::string program =
      file("a.aps", "sim.slider.add('speed', 0, 10, 2.5)\nprintln(sim.slider.get('speed'))\n");
  EXPECT_EQ(run({"run", program}).out, "2.5\n");
  EXPECT_EQ(run({"run", program, "--set", "speed=4"}).out, "4\n");
  const ProcessResult wrong = run({"run", program, "--set", "sped=4"});
  EXPECT_EQ(wrong.status, 2);
  EXPECT_NE(wrong.err.find("it has speed"), std::string::npos) << wrong.err;
}

// Without a terminal, the register is printed once at the end, without control characters.
TEST_F(Cli, WatchShowsRegisterAtEnd) {
  const std::string program = file("watch.aps", "!register(A)\nprintln('begins')\nA = cell.x * 1\n");
  const ProcessResult r = run({"run", program, "--size", "10x2", "--watch", "A"});
  EXPECT_EQ(r.status, 0) << r.err;
  EXPECT_EQ(r.out, "begins\nA 10x2\n .:-=+*#%@\n .:-=+*#%@\n");
  const ProcessResult wrong = run({"run", program, "--watch", "a"});
  EXPECT_EQ(wrong.status, 2);
  EXPECT_EQ(wrong.err, "apron: error: --watch: the program has no register 'a'; did you mean 'A'?\n");
}

TEST_F(Cli, CtrlCStopsInfiniteLoop) {
  const pid_t child = start({"run", file("a.aps", "#again\njump(#again)\n")});
  std::this_thread::sleep_for(300ms);
  kill(child, SIGINT);
  EXPECT_EQ(finish(child).status, 130);
}

TEST_F(Cli, RunsInLockStepUntilSurfaceCloses) {
  const pid_t child = start({"run", file("a.aps", kLoop), "--shm", id_, "--wait", "20"});
  {
    SurfaceEndpoint s = surface(Mode::kTimeStep);
    ASSERT_EQ(s.await_controller({.timeout = 20s}), Status::kOk);
    for (std::uint64_t tick = 0; tick < 100; ++tick) {
      publish_sensors(s, tick);
      ASSERT_EQ(s.await_actuators(tick, {.timeout = 20s}), Status::kOk);
      for (const float cell : s.actuator(1)) ASSERT_EQ(cell, static_cast<float>(2 * tick + 1));
    }
  }
  const ProcessResult result = finish(child);
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(result.err, "");
}

TEST_F(Cli, RunsPassively) {
  SurfaceEndpoint s = surface(Mode::kPassive);
  const pid_t child = start({"run", file("a.aps", kLoop), "--shm", id_});
  float seen = 0;
  for (std::uint64_t tick = 0; tick < 2000 && seen < 21; ++tick) {
    publish_sensors(s, tick);
    std::this_thread::sleep_for(5ms);
    if (s.latest_actuators() == Status::kOk) seen = s.actuator(1)[0];
  }
  EXPECT_GE(seen, 21);
  kill(child, SIGTERM);
  EXPECT_EQ(finish(child).status, 143);
  EXPECT_EQ(s.latest_actuators(), Status::kControllerClosed);  // detached cleanly
}

TEST_F(Cli, StopsAfterTicksAndDetaches) {
  SurfaceEndpoint s = surface(Mode::kTimeStep);
  const pid_t child = start({"run", file("a.aps", kLoop), "--shm", id_, "--ticks", "3"});
  ASSERT_EQ(s.await_controller({.timeout = 20s}), Status::kOk);
  for (std::uint64_t tick = 0; tick < 3; ++tick) {
    publish_sensors(s, tick);
    ASSERT_EQ(s.await_actuators(tick, {.timeout = 20s}), Status::kOk);
  }
  publish_sensors(s, 3);  // completes the third step
  EXPECT_EQ(s.await_actuators(3, {.timeout = 20s}), Status::kControllerClosed);
  EXPECT_EQ(finish(child).status, 0);
}

TEST_F(Cli, UnknownChannelErrorListsChannels) {
  SurfaceEndpoint s = surface(Mode::kPassive);
  publish_sensors(s, 0);
  const ProcessResult result =
      run({"run", file("a.aps", "!register(D)\nD = surface.sense('proximty')\n"), "--shm", id_});
  EXPECT_EQ(result.status, 2);
  EXPECT_NE(
      result.err.find("a.aps:2: error: the surface has no sensor channel 'proximty'; its sensor channels: "
                      "proximity"),
      std::string::npos)
      << result.err;
}

// Forks a surface process that dies after the third frame without closing.
pid_t dying_surface(const std::function<SurfaceEndpoint()>& create) {
  const pid_t child = fork();
  if (child == 0) {
    SurfaceEndpoint s = create();
    if (s.await_controller({.timeout = 20s}) != Status::kOk) _exit(1);
    for (std::uint64_t tick = 0; tick < 3; ++tick)
      if (s.publish(tick, 0) != Status::kOk || s.await_actuators(tick, {.timeout = 20s}) != Status::kOk)
        _exit(1);
    kill(getpid(), SIGKILL);
  }
  return child;
}

TEST_F(Cli, LostSurfaceExitsWithStatus3) {
  const pid_t surface_pid = dying_surface([&] { return surface(Mode::kTimeStep); });
  const pid_t child = start({"run", file("a.aps", kLoop), "--shm", id_, "--wait", "20"});
  waitpid(surface_pid, nullptr, 0);
  const ProcessResult result = finish(child);
  EXPECT_EQ(result.status, 3);
  EXPECT_NE(result.err.find("was lost"), std::string::npos) << result.err;
  const SurfaceEndpoint reclaim = surface(Mode::kTimeStep);  // removes the dead surface's segment
}

TEST_F(Cli, ReconnectRestartsOnSurfaceOfAnotherSize) {
  const pid_t surface_pid = dying_surface([&] { return surface(Mode::kTimeStep); });
  const pid_t child = start({"run", file("a.aps", std::string("println(SURFACE_WIDTH)\n") + kLoop), "--shm",
                             id_, "--wait", "20", "--reconnect"});
  waitpid(surface_pid, nullptr, 0);
  {
    SurfaceEndpoint s = surface(Mode::kTimeStep, 7);
    ASSERT_EQ(s.await_controller({.timeout = 20s}), Status::kOk);
    for (std::uint64_t tick = 0; tick < 3; ++tick) {
      publish_sensors(s, tick);
      ASSERT_EQ(s.await_actuators(tick, {.timeout = 20s}), Status::kOk);
      EXPECT_EQ(s.actuator(1)[0], static_cast<float>(2 * tick + 1));
    }
  }
  const ProcessResult result = finish(child);
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(result.out, "4\n7\n");
}

TEST_F(Cli, SecondControllerErrorNamesFirstProcess) {
  SurfaceEndpoint s = surface(Mode::kPassive);
  publish_sensors(s, 0);
  const pid_t first = start({"run", file("a.aps", kLoop), "--shm", id_});
  ASSERT_EQ(s.await_controller({.timeout = 20s}), Status::kOk);
  const ProcessResult second = run({"run", path("a.aps"), "--shm", id_});
  EXPECT_EQ(second.status, 2);
  EXPECT_NE(second.err.find(std::to_string(first)), std::string::npos) << second.err;
  kill(first, SIGINT);
  EXPECT_EQ(finish(first).status, 130);
}

}  // namespace
}  // namespace apron::run
