// What lock-step costs a pair whose sides have work of their own: the time of a tick, less what both sides'
// work takes alone in the same processes, on the same cores, in the same run.
#include <shm_protocol/ControllerEndpoint.h>
#include <shm_protocol/SurfaceEndpoint.h>
#include <sys/mman.h>

#include <atomic>
#include <cstdlib>
#include <string>
#include <utility>

#include "RoundTrip.h"

namespace bench {
namespace {

using shm_protocol::ControllerEndpoint;
using shm_protocol::Status;
using shm_protocol::SurfaceEndpoint;

constexpr std::uint32_t kSide = 64;
constexpr std::size_t kCells = std::size_t{kSide} * kSide;
constexpr int kRounds = 1500, kAlone = 300, kPasses = 5;

// Reads `in`, smooths it `times` times, and leaves the result in `out`: about a microsecond each time.
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

double alone_us(Work& work) {
  std::vector<float> in(kCells, 1.0F), out(kCells);
  return measure(kAlone, [&](int) { work(in, out); }).median_us;
}

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

void must(bool good) {
  if (!good) std::_Exit(1);
}

// Of both sides, each with work of so many turns: their work alone, and the tick.
struct Cost {
  double surface_us, controller_us, tick_us;
};

Cost measure_pair(int times, int peer_cpu) {
  const auto config = config_of();
  auto* controllers = static_cast<std::atomic<double>*>(::mmap(
      nullptr, sizeof(std::atomic<double>), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));
  auto surface = SurfaceEndpoint::create(config);
  const pid_t peer = start_peer(peer_cpu, [&] {
    Work work(times);
    std::vector<float> out(kCells);
    *controllers = alone_us(work);
    auto controller = ControllerEndpoint::attach(config.name);
    while (controller.await_sensors() == Status::kOk) {
      work(controller.sensor(0), out);
      controller.write(1, 0, std::span<const float>(out));
      must(controller.publish() == Status::kOk);
    }
  });
  must(surface.await_controller() == Status::kOk);
  Work work(times);
  std::vector<float> out(kCells);
  const double before = alone_us(work);
  const Figures tick = measure(kRounds, [&](int i) {
    work(surface.actuator(1), out);
    surface.write(0, 0, std::span<const float>(out));
    must(surface.publish(static_cast<std::uint64_t>(i), 0.0) == Status::kOk);
    must(surface.await_actuators(static_cast<std::uint64_t>(i)) == Status::kOk);
  });
  const double after = alone_us(work);
  ::kill(peer, SIGKILL);
  ::waitpid(peer, nullptr, 0);
  const Cost cost{std::min(before, after), *controllers, tick.median_us};
  ::munmap(controllers, sizeof(std::atomic<double>));
  return cost;
}

}  // namespace

void print_own_work(int peer_cpu) {
  std::printf(
      "\na tick at 64x64 f32 each way, both sides with work of their own, medians in "
      "us\n%12s%12s%12s%22s%22s\n",
      "surface", "controller", "tick", "tick less both works", "empty ping-pong");
  for (const int times : {20, 50, 100, 200}) {
    for (int pass = 0; pass < kPasses; ++pass) {
      const double before = distance_us(peer_cpu);
      const Cost c = measure_pair(times, peer_cpu);
      std::printf("%12.2f%12.2f%12.2f%22.2f%14.2f …%6.2f\n", c.surface_us, c.controller_us, c.tick_us,
                  c.tick_us - c.surface_us - c.controller_us, before, distance_us(peer_cpu));
    }
  }
}

}  // namespace bench
