// Measures the overhead of lock-step when both sides do work: the time of a tick minus the time of both
// sides' work alone, measured in the same processes on the same cores between the same ticks.
#include <shm_protocol/ControllerEndpoint.h>
#include <shm_protocol/SurfaceEndpoint.h>
#include <sys/mman.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <string>
#include <utility>

#include "RoundTrip.h"
#include "tests/bench/Timing.h"

namespace bench {
namespace {

using shm_protocol::ControllerEndpoint;
using shm_protocol::Status;
using shm_protocol::SurfaceEndpoint;

constexpr std::uint32_t kSide = 64;
constexpr std::size_t kCells = std::size_t{kSide} * kSide;
constexpr std::uint64_t kRounds = 1600;
constexpr int kPasses = 5;

// Copies `in`, smooths it `times` times (about 1 us each) and writes the result to `out`.
class Work {
 public:
  explicit Work(int times) : times_(times), a_(kCells + 2), b_(kCells + 2) {}
  BENCH_WIDE void operator()(std::span<const float> in, std::span<float> out) {
    std::copy(in.begin(), in.end(), a_.begin() + 1);
    for (int t = 0; t < times_; ++t) {
      for (std::size_t i = 1; i <= kCells; ++i) b_[i] = 0.5F * a_[i] + 0.25F * (a_[i - 1] + a_[i + 1]);
      std::swap(a_, b_);
    }
    std::copy_n(a_.begin() + 1, out.size(), out.begin());
  }

 private:
  int times_;
  std::vector<float> a_, b_;
};

// Times the work alone, periodically between ticks, so that both measurements see the same state of the
// cores. Ticks that such a pause may prolong are discarded.
class SoloTimer {
 public:
  static constexpr std::uint64_t kInterval = 16;

  explicit SoloTimer(int times) : work_(times) {}
  void measure() {
    const auto start = std::chrono::steady_clock::now();
    work_(in_, out_);
    const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - start;
    times_.push_back(took.count());
  }
  double us() const { return bench::median(times_); }

 private:
  Work work_;
  std::vector<float> in_ = std::vector<float>(kCells, 1.0F), out_ = std::vector<float>(kCells);
  std::vector<double> times_;
};

shm_protocol::SurfaceConfig config_of() {
  using namespace shm_protocol;
  SurfaceConfig config;
  config.name = "bench-work-" + std::to_string(::getpid());
  config.rows = config.columns = kSide;
  config.period_ns = 1'000'000;
  config.channels = {{"in", Direction::kSensor, DType::kF32, 1, "", 0, 10, 0},
                     {"out", Direction::kActuator, DType::kF32, 1, "", 0, 10, 0}};
  return config;
}

void require(bool good) {
  if (!good) std::_Exit(1);
}

// Times of the work of each side alone, and of a tick that includes both.
struct Cost {
  double surface_us, controller_us, tick_us;
};

void run_controller(const std::string& name, int times, std::atomic<double>& result) {
  Work work(times);
  SoloTimer alone(times);
  std::vector<float> out(kCells);
  auto controller = ControllerEndpoint::attach(name);
  for (std::uint64_t i = 1; controller.await_sensors() == Status::kOk; ++i) {
    work(controller.sensor(0), out);
    controller.write(1, 0, std::span<const float>(out));
    require(controller.publish() == Status::kOk);
    if (i % SoloTimer::kInterval != SoloTimer::kInterval / 2) continue;
    alone.measure();
    result = alone.us();
  }
}

Cost measure_pair(int times, int peer_cpu) {
  const auto config = config_of();
  auto* controllers = static_cast<std::atomic<double>*>(::mmap(
      nullptr, sizeof(std::atomic<double>), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));
  auto surface = SurfaceEndpoint::create(config);
  const pid_t peer = start_peer(peer_cpu, [&] { run_controller(config.name, times, *controllers); });
  require(surface.await_controller() == Status::kOk);
  Work work(times);
  SoloTimer alone(times);
  std::vector<float> out(kCells);
  std::vector<double> ticks;
  for (std::uint64_t i = 1; i <= kRounds; ++i) {
    const auto start = std::chrono::steady_clock::now();
    work(surface.actuator(1), out);
    surface.write(0, 0, std::span<const float>(out));
    require(surface.publish(i, 0.0) == Status::kOk);
    require(surface.await_actuators(i) == Status::kOk);
    const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - start;
    const std::uint64_t phase = i % SoloTimer::kInterval;
    if (phase > SoloTimer::kInterval / 2 + 2 || (phase > 2 && phase < SoloTimer::kInterval / 2))
      ticks.push_back(took.count());
    if (phase == 0) alone.measure();
  }
  ::kill(peer, SIGKILL);
  ::waitpid(peer, nullptr, 0);
  const Cost cost{alone.us(), *controllers, bench::median(ticks)};
  ::munmap(controllers, sizeof(std::atomic<double>));
  return cost;
}

}  // namespace

void print_lockstep_overhead(int peer_cpu) {
  std::printf(
      "\ntick with 64x64 f32 in each direction and work on both sides, medians in us\n"
      "%12s%12s%12s%22s%22s\n",
      "surface", "controller", "tick", "tick minus both works", "empty ping-pong");
  for (const int times : {20, 50, 100, 200}) {
    for (int pass = 0; pass < kPasses; ++pass) {
      const double before = core_distance_us(peer_cpu);
      const Cost c = measure_pair(times, peer_cpu);
      std::printf("%12.2f%12.2f%12.2f%22.2f%14.2f …%6.2f\n", c.surface_us, c.controller_us, c.tick_us,
                  c.tick_us - c.surface_us - c.controller_us, before, core_distance_us(peer_cpu));
    }
  }
}

}  // namespace bench
