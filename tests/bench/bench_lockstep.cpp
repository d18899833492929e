// Round trips of two processes in lock-step: our endpoints beside a raw ping-pong on two words of shared
// memory (the limit), POSIX semaphores, and what else there is to connect two processes. In each, both sides
// write all of their payload and read all of the other's.
//
//   bench_lockstep            two cores; and what a tick costs beyond the sides' own work
//   bench_lockstep one-core   both processes on one core
//   bench_lockstep NAME       only the ways whose name begins so
//   bench_lockstep … --json   a JSON object a line
#include <semaphore.h>
#include <shm_protocol/ControllerEndpoint.h>
#include <shm_protocol/SurfaceEndpoint.h>
#include <sys/mman.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>

#include "RoundTrip.h"

namespace {

using bench::Case;
using bench::consume;
using bench::Figures;
using bench::measure;
using bench::pin_to;
using bench::produce;
using bench::start_peer;
using shm_protocol::ControllerEndpoint;
using shm_protocol::Status;
using shm_protocol::SurfaceEndpoint;

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

shm_protocol::SurfaceConfig config_of(const Case& c) {
  using namespace shm_protocol;
  SurfaceConfig config;
  config.name = "bench-" + std::to_string(::getpid());
  config.rows = config.columns = c.side;
  config.period_ns = 1'000'000;
  config.channels = {{"in", Direction::kSensor, DType::kF32, 1, "", 0, 10, 0},
                     {"out", Direction::kActuator, DType::kF32, 1, "", 0, 10, 0}};
  return config;
}

// Arrays written and read in place.
Figures endpoints(const Case& c, int peer_cpu) {
  const auto config = config_of(c);
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

// Cells computed at once in a buffer of one's own, then handed to write(): up to 64 KiB.
constexpr std::size_t kPieceCells = 16 * 1024;

// As a streaming pair does: each piece is answered as soon as it has come, and taken in while the next one is
// being made.
void answer_in_pieces(ControllerEndpoint& controller, std::span<float> buffer) {
  for (int i = 1;; ++i) {
    std::size_t at = 0;
    for (auto in = controller.next_cells(0); !in.empty(); in = controller.next_cells(0)) {
      consume(in);
      const auto out = buffer.first(in.size());
      produce(out, i);
      controller.write(1, at, std::span<const float>(out));
      at += in.size();
    }
    if (controller.await_sensors() != Status::kOk) return;
    require(controller.publish());
  }
}

void tick_in_pieces(SurfaceEndpoint& surface, std::span<float> buffer, int i) {
  const std::size_t cells = surface.description().cells();
  for (std::size_t at = 0; at < cells; at += buffer.size()) {
    const auto out = buffer.first(std::min(buffer.size(), cells - at));
    produce(out, i);
    surface.write(0, at, std::span<const float>(out));
    consume(surface.next_cells(1));
  }
  require(surface.publish(static_cast<std::uint64_t>(i), 0.0));
  for (auto in = surface.next_cells(1); !in.empty(); in = surface.next_cells(1)) consume(in);
  require(surface.await_actuators(static_cast<std::uint64_t>(i)));
}

Figures endpoints_in_pieces(const Case& c, int peer_cpu) {
  const auto config = config_of(c);
  auto surface = SurfaceEndpoint::create(config);
  std::vector<float> buffer(kPieceCells);
  const pid_t peer = start_peer(peer_cpu, [&] {
    auto controller = ControllerEndpoint::attach(config.name);
    answer_in_pieces(controller, buffer);
  });
  require(surface.await_controller());
  const Figures figures = measure(c.rounds, [&](int i) { tick_in_pieces(surface, buffer, i); });
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

namespace {

struct Way {
  const char* name;
  std::function<Figures(const Case&, int)> measure;
  const char* missing = nullptr;
};

constexpr Case kCases[] = {{"empty", 1, 20'000}, {"64x64 f32", 64, 4'000}, {"1024x1024 f32", 1024, 120}};
constexpr int kPasses = 3;

std::vector<Way> all_ways(bool one_core) {
  return {
      {"raw ping-pong", raw_spin, one_core ? "cannot work on one core" : nullptr},
      {"endpoints, in place", endpoints},
      {"endpoints, in pieces", endpoints_in_pieces},
      {"POSIX semaphores", semaphores},
      {"Unix socket", bench::unix_socket},
      {"Boost message_queue", bench::message_queue},
      {"ZeroMQ (ipc)", bench::zeromq, bench::zeromq_missing()},
      {"iceoryx (waiting)", bench::iceoryx, bench::iceoryx_missing()},
  };
}

Figures middle_of(std::vector<Figures> passes) {
  const auto middle = [&](double Figures::*value) {
    std::ranges::sort(passes, {}, value);
    return passes[passes.size() / 2].*value;
  };
  return {middle(&Figures::median_us), middle(&Figures::p99_us)};
}

// All ways in turn, several times: a virtual machine's cores may move apart and together while they are
// measured.
std::vector<std::vector<Figures>> measure_all(const std::vector<Way>& ways, int peer_cpu) {
  std::vector<std::vector<Figures>> table(ways.size());
  for (const Case& c : kCases) {
    std::vector<std::vector<Figures>> passes(ways.size());
    for (int pass = 0; pass < kPasses; ++pass)
      for (std::size_t w = 0; w < ways.size(); ++w)
        if (!ways[w].missing) passes[w].push_back(ways[w].measure(c, peer_cpu));
    for (std::size_t w = 0; w < ways.size(); ++w)
      if (!ways[w].missing) table[w].push_back(middle_of(passes[w]));
  }
  return table;
}

void print(const std::vector<Way>& ways, const std::vector<std::vector<Figures>>& table) {
  std::vector<double> ours(std::size(kCases), 1e300);
  for (std::size_t w = 0; w < ways.size(); ++w)
    for (std::size_t i = 0; i < table[w].size(); ++i)
      if (std::string(ways[w].name).starts_with("endpoints"))
        ours[i] = std::min(ours[i], table[w][i].median_us);
  std::printf("%-21s", "");
  for (const Case& c : kCases) std::printf("%26s", c.label);
  std::puts("");
  for (std::size_t w = 0; w < ways.size(); ++w) {
    std::printf("%-21s", ways[w].name);
    if (ways[w].missing) std::printf("  skipped: %s", ways[w].missing);
    for (std::size_t i = 0; i < table[w].size(); ++i) {
      char cell[64];
      std::snprintf(cell, sizeof cell, "%.2f / %.1f  x%.2f", table[w][i].median_us, table[w][i].p99_us,
                    table[w][i].median_us / ours[i]);
      std::printf("%26s", cell);
    }
    std::puts("");
  }
}

void print_json(const std::vector<Way>& ways, const std::vector<std::vector<Figures>>& table, bool one_core) {
  for (std::size_t w = 0; w < ways.size(); ++w)
    for (std::size_t i = 0; i < table[w].size(); ++i) {
      const nlohmann::ordered_json line{{"benchmark", "lockstep"},
                                        {"case", kCases[i].label},
                                        {"who", ways[w].name},
                                        {"cores", one_core ? 1 : 2},
                                        {"median_us", table[w][i].median_us},
                                        {"p99_us", table[w][i].p99_us}};
      std::puts(line.dump().c_str());
    }
}

}  // namespace

int main(int argc, char** argv) {
  const auto cpus = usable_cpus();
  bool one_core = cpus.size() == 1;
  bool json = false;
  std::string only;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "one-core")
      one_core = true;
    else if (argument == "--json")
      json = true;
    else
      only = argument;
  }
  const int peer_cpu = one_core ? cpus.front() : cpus.back();
  pin_to(cpus.front());
  auto ways = all_ways(one_core);
  std::erase_if(ways, [&](const Way& way) { return !std::string(way.name).starts_with(only); });
  const auto table = measure_all(ways, peer_cpu);
  if (json) {
    print_json(ways, table, one_core);
    return 0;
  }
  std::printf(
      "round trips in us, median / p99 of the middle one of %d passes, and the median over that of "
      "`endpoints` "
      "(the faster way of the two)\npayload each way, all of it written and read; both processes on %s\n\n",
      kPasses, one_core ? "one core" : "a core each");
  print(ways, table);
  if (!one_core && only.empty()) bench::print_own_work(peer_cpu);
}
