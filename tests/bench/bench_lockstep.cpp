// Round trips of two processes in lock-step: our endpoints beside a raw ping-pong on two words of shared
// memory (the limit) and a pair of POSIX semaphores. In each, both sides write all of their payload and read
// all of the other's.
//
//   bench_lockstep            two cores
//   bench_lockstep one-core   both processes on one core (without the raw ping-pong, which cannot work there)
#include <sched.h>
#include <semaphore.h>
#include <shm_protocol/ControllerEndpoint.h>
#include <shm_protocol/SurfaceEndpoint.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace {

using namespace std::chrono_literals;
using shm_protocol::ControllerEndpoint;
using shm_protocol::Status;
using shm_protocol::SurfaceEndpoint;

struct Case {
  const char* label;
  std::uint32_t side;  // the payload is side × side f32 each way; 1 stands for empty
  int rounds;
};

struct Figures {
  double median_us = 0, p99_us = 0;
};

volatile float g_sink;

void produce(std::span<float> values, int round) { std::ranges::fill(values, static_cast<float>(round % 7)); }

void consume(std::span<const float> values) {
  float sums[16] = {};
  std::size_t i = 0;
  for (; i + 16 <= values.size(); i += 16)
    for (std::size_t k = 0; k < 16; ++k) sums[k] += values[i + k];
  for (; i < values.size(); ++i) sums[0] += values[i];
  float total = 0;
  for (const float s : sums) total += s;
  g_sink = total;
}

void pin_to(int cpu) {
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(cpu, &set);
  if (::sched_setaffinity(0, sizeof set, &set) != 0) std::perror("sched_setaffinity");
}

pid_t start_peer(int cpu, const std::function<void()>& body) {
  const pid_t pid = ::fork();
  if (pid != 0) return pid;
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  pin_to(cpu);
  body();
  ::_exit(0);
}

// Times `round`, after a tenth of the rounds to warm up.
Figures measure(int rounds, const std::function<void(int)>& round) {
  std::vector<double> times;
  const int warm = rounds / 10 + 5;
  for (int i = 1; i <= rounds + warm; ++i) {
    const auto start = std::chrono::steady_clock::now();
    round(i);
    const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - start;
    if (i > warm) times.push_back(took.count());
  }
  std::ranges::sort(times);
  return {times[times.size() / 2], times[times.size() * 99 / 100]};
}

// What both processes of the two peers share: one array each way, and a word or a semaphore each way.
struct Shared {
  alignas(128) std::atomic<int> there{0};
  alignas(128) std::atomic<int> back{0};
  alignas(128) sem_t there_posted;
  alignas(128) sem_t back_posted;
};

template <class Post, class Wait>
Figures ping_pong(const Case& c, int peer_cpu, Post post, Wait wait) {
  const std::size_t cells = std::size_t{c.side} * c.side, bytes = cells * sizeof(float);
  const std::size_t array = (bytes + 4095) / 4096 * 4096, total = 4096 + 2 * array;
  void* memory = ::mmap(nullptr, total, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  std::memset(memory, 0, total);
  auto& shared = *new (memory) Shared;
  ::sem_init(&shared.there_posted, 1, 0);
  ::sem_init(&shared.back_posted, 1, 0);
  auto* base = static_cast<std::byte*>(memory) + 4096;
  const std::span there(reinterpret_cast<float*>(base), cells),
      back(reinterpret_cast<float*>(base + array), cells);
  const pid_t peer = start_peer(peer_cpu, [&] {
    for (int i = 1;; ++i) {
      wait(shared.there, shared.there_posted, i);
      consume(there);
      produce(back, i);
      post(shared.back, shared.back_posted, i);
    }
  });
  const Figures figures = measure(c.rounds, [&](int i) {
    produce(there, i);
    post(shared.there, shared.there_posted, i);
    wait(shared.back, shared.back_posted, i);
    consume(back);
  });
  ::kill(peer, SIGKILL);
  ::waitpid(peer, nullptr, 0);
  ::munmap(memory, total);
  return figures;
}

Figures raw_spin(const Case& c, int peer_cpu) {
  return ping_pong(
      c, peer_cpu, [](std::atomic<int>& word, sem_t&, int i) { word.store(i, std::memory_order_release); },
      [](std::atomic<int>& word, sem_t&, int i) {
        while (word.load(std::memory_order_acquire) != i) {
#if defined(__x86_64__)
          __builtin_ia32_pause();
#endif
        }
      });
}

Figures semaphores(const Case& c, int peer_cpu) {
  return ping_pong(
      c, peer_cpu, [](std::atomic<int>&, sem_t& posted, int) { ::sem_post(&posted); },
      [](std::atomic<int>&, sem_t& posted, int) {
        while (::sem_wait(&posted) != 0) {
        }
      });
}

void require(Status s) {
  if (s == Status::kOk) return;
  std::fprintf(stderr, "bench_lockstep: %s\n", shm_protocol::text(s));
  std::exit(1);
}

Figures endpoints(const Case& c, int peer_cpu) {
  using namespace shm_protocol;
  SurfaceConfig config;
  config.name = "bench-" + std::to_string(::getpid());
  config.rows = config.columns = c.side;
  config.period_ns = 1'000'000;
  config.channels = {{"in", Direction::kSensor, DType::kF32, 1, "", 0, 10, 0},
                     {"out", Direction::kActuator, DType::kF32, 1, "", 0, 10, 0}};
  auto surface = SurfaceEndpoint::create(config);
  const pid_t peer = start_peer(peer_cpu, [&] {
    auto controller = ControllerEndpoint::attach(config.name);
    for (int i = 1; controller.await_sensors() == Status::kOk; ++i) {
      consume(controller.sensor(0));
      produce(controller.actuator(1), i);
      require(controller.publish());
    }
  });
  require(surface.await_controller());
  const Figures figures = measure(c.rounds, [&](int i) {
    const auto tick = static_cast<std::uint64_t>(i);
    produce(surface.sensor(0), i);
    require(surface.publish(tick, 0.0));
    require(surface.await_actuators(tick));
    consume(surface.actuator(1));
  });
  ::kill(peer, SIGKILL);
  ::waitpid(peer, nullptr, 0);
  return figures;
}

std::vector<int> usable_cpus() {
  cpu_set_t set;
  ::sched_getaffinity(0, sizeof set, &set);
  std::vector<int> cpus;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu)
    if (CPU_ISSET(cpu, &set)) cpus.push_back(cpu);
  return cpus;
}

}  // namespace

int main(int argc, char** argv) {
  const auto cpus = usable_cpus();
  const bool one_core = cpus.size() == 1 || (argc > 1 && std::string(argv[1]) == "one-core");
  const int peer_cpu = one_core ? cpus.front() : cpus.back();
  pin_to(cpus.front());
  const Case cases[] = {{"empty", 1, 100'000}, {"64x64 f32", 64, 20'000}, {"1024x1024 f32", 1024, 300}};
  std::printf("round trips, us, median / p99, both processes on %s\n", one_core ? "one core" : "a core each");
  std::printf("%-14s %18s %18s %18s %12s %12s\n", "each way", "raw ping-pong", "endpoints", "semaphores",
              "ours / raw", "sem / ours");
  for (const Case& c : cases) {
    const Figures raw = one_core ? Figures{} : raw_spin(c, peer_cpu);
    const Figures ours = endpoints(c, peer_cpu);
    const Figures sem = semaphores(c, peer_cpu);
    const auto cell = [](const Figures& f) {
      char text[64];
      std::snprintf(text, sizeof text, "%.2f / %.2f", f.median_us, f.p99_us);
      return std::string(text);
    };
    const std::string ratio = one_core ? "-" : std::to_string(ours.median_us / raw.median_us).substr(0, 5);
    std::printf("%-14s %18s %18s %18s %12s %12.2f\n", c.label, one_core ? "-" : cell(raw).c_str(),
                cell(ours).c_str(), cell(sem).c_str(), ratio.c_str(), sem.median_us / ours.median_us);
  }
}
