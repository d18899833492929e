// A second process, and the values that both sides expect from each other.
#pragma once

#include <gtest/gtest.h>
#include <shm_protocol/ControllerEndpoint.h>
#include <shm_protocol/SurfaceEndpoint.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <string>

namespace shm_protocol {

using namespace std::chrono_literals;

// A forked process that runs `body` and exits with what it returns; killed and reaped at the end.
class Peer {
 public:
  template <class Body>
  explicit Peer(Body&& body) : pid_(::fork()) {
    if (pid_ != 0) return;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    int code = 99;
    try {
      code = body();
    } catch (const std::exception& e) {
      std::fprintf(stderr, "peer %d: %s\n", ::getpid(), e.what());
    }
    ::_exit(code);
  }
  ~Peer() {
    if (reaped_) return;
    ::kill(pid_, SIGKILL);
    ::kill(pid_, SIGCONT);
    wait();
  }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  pid_t pid() const { return pid_; }
  void signal(int number) const { ::kill(pid_, number); }
  // Suspends it, and returns when it runs no more.
  void stop() const {
    signal(SIGSTOP);
    int status = 0;
    EXPECT_EQ(::waitpid(pid_, &status, WUNTRACED), pid_);
    EXPECT_TRUE(WIFSTOPPED(status));
  }
  // Its exit status, or minus the signal that ended it.
  int wait() {
    int status = 0;
    ::waitpid(pid_, &status, 0);
    reaped_ = true;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }

 private:
  pid_t pid_;
  bool reaped_ = false;
};

inline SurfaceConfig pair_config(const std::string& what, Mode mode = Mode::kTimeStep) {
  SurfaceConfig config;
  config.name = "test-" + what + "-" + std::to_string(::getpid());
  config.rows = 16;
  config.columns = 16;
  config.period_ns = 1'000'000;
  config.mode = mode;
  config.channels = {{"distance", Direction::kSensor, DType::kF32, 1, "u", 0, 2048, 0},
                     {"height", Direction::kActuator, DType::kF32, 1, "u", 0, 2048, 0}};
  return config;
}

// Small whole numbers, exact in f32, different for every tick and cell.
inline float sensed(std::uint64_t tick, std::size_t cell) {
  return static_cast<float>((tick * 7 + cell * 13) % 1021);
}
inline float commanded(std::uint64_t tick, std::size_t cell) {
  return static_cast<float>((tick * 5 + cell * 3) % 1019);
}

template <class Expected>
bool matches(std::span<const float> values, std::uint64_t tick, Expected expected) {
  for (std::size_t i = 0; i < values.size(); ++i)
    if (values[i] != expected(tick, i)) return false;
  return true;
}

template <class Value>
void fill(std::span<float> values, std::uint64_t tick, Value value) {
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = value(tick, i);
}

// Answers each frame, every value of it checked: the last Status, or kTorn when a value was wrong.
inline Status serve(ControllerEndpoint& controller, std::uint64_t until_tick) {
  for (;;) {
    if (const Status s = controller.await_sensors({.timeout = 100s}); s != Status::kOk) return s;
    const std::uint64_t tick = controller.sensor_info().tick;
    if (!matches(controller.sensor(0), tick, sensed)) return Status::kTorn;
    fill(controller.actuator(1), tick, commanded);
    if (const Status s = controller.publish(); s != Status::kOk) return s;
    if (tick >= until_tick) return Status::kOk;
  }
}

// One tick of the surface's side; kTorn when a value of the answer was wrong.
inline Status run_tick(SurfaceEndpoint& surface, std::uint64_t tick) {
  fill(surface.sensor(0), tick, sensed);
  if (const Status s = surface.publish(tick, static_cast<double>(tick) * 1e-3); s != Status::kOk) return s;
  if (const Status s = surface.await_actuators(tick, {.timeout = 100s}); s != Status::kOk) return s;
  return matches(surface.actuator(1), tick, commanded) ? Status::kOk : Status::kTorn;
}

constexpr std::uint64_t kForever = ~std::uint64_t{0};

}  // namespace shm_protocol
