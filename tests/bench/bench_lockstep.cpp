// Benchmarks round trips of two processes in lock-step: our endpoints, a raw ping-pong on two words of shared
// memory (the lower bound), POSIX semaphores and other transports. Both sides write their whole payload and
// read that of the other.
//
//   bench_lockstep            two cores, and the lock-step overhead
//   bench_lockstep one-core   both processes on one core
//   bench_lockstep NAME       only transports whose name starts with NAME
//   bench_lockstep … --json   print one JSON object per line
//   bench_lockstep work       only the lock-step overhead (see lockstep_overhead.cpp)
#include <semaphore.h>
#include <shm_protocol/ControllerEndpoint.h>
#include <shm_protocol/SurfaceEndpoint.h>
#include <sys/mman.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "RoundTrip.h"
#include "tests/bench/CommandLine.h"

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

// The shared header of ping_pong(): one word and one semaphore per direction. The arrays follow on their own
// pages.
struct Shared {
  alignas(128) std::atomic<int> request{0};
  alignas(128) std::atomic<int> response{0};
  alignas(128) sem_t request_posted;
  alignas(128) sem_t response_posted;
};

template <class Post, class Wait>
Figures ping_pong(const Case& c, int peer_cpu, Post post, Wait wait) {
  const std::size_t cells = std::size_t{c.side} * c.side, bytes = cells * sizeof(float);
  const std::size_t array = (bytes + 4095) / 4096 * 4096, total = 4096 + 2 * array;
  void* memory = ::mmap(nullptr, total, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  std::memset(memory, 0, total);
  auto& shared = *new (memory) Shared;
  ::sem_init(&shared.request_posted, 1, 0);
  ::sem_init(&shared.response_posted, 1, 0);
  auto* base = static_cast<std::byte*>(memory) + 4096;
  const std::span request(reinterpret_cast<float*>(base), cells),
      response(reinterpret_cast<float*>(base + array), cells);
  const pid_t peer = start_peer(peer_cpu, [&] {
    for (int i = 1;; ++i) {
      wait(shared.request, shared.request_posted, i);
      consume(request);
      produce(response, i);
      post(shared.response, shared.response_posted, i);
    }
  });
  const Figures figures = measure(c.rounds, [&](int i) {
    produce(request, i);
    post(shared.request, shared.request_posted, i);
    wait(shared.response, shared.response_posted, i);
    consume(response);
  });
  ::kill(peer, SIGKILL);
  ::waitpid(peer, nullptr, 0);
  ::munmap(memory, total);
  return figures;
}

void post_word(std::atomic<int>& word, sem_t&, int i) { word.store(i, std::memory_order_release); }
void await_word(std::atomic<int>& word, sem_t&, int i) {
  while (word.load(std::memory_order_acquire) != i) {
#if defined(__x86_64__)
    __builtin_ia32_pause();
#endif
  }
}

Figures raw_spin(const Case& c, int peer_cpu) { return ping_pong(c, peer_cpu, post_word, await_word); }

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

// Writes and reads the arrays in place.
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

// Cells per chunk: 64 KiB, but at least two chunks per frame.
constexpr std::size_t kChunkCells = 16 * 1024;
std::size_t chunk_cells(std::size_t cells) { return std::clamp<std::size_t>(cells / 2, 1, kChunkCells); }

// Streams the frame: the controller answers each chunk as it arrives, and the surface reads the answer while
// the next chunk is in progress.
void answer_chunked(ControllerEndpoint& controller) {
  std::vector<float> chunk(chunk_cells(controller.description().cells()));
  for (int i = 1;; ++i) {
    std::size_t at = 0;
    for (auto in = controller.next_cells(0); !in.empty(); in = controller.next_cells(0)) {
      consume(in);
      const std::size_t end = at + in.size();
      while (at < end) {
        const auto out = std::span(chunk).first(std::min(chunk.size(), end - at));
        produce(out, i);
        controller.write(1, at, std::span<const float>(out));
        at += out.size();
      }
    }
    if (controller.await_sensors() != Status::kOk) return;
    require(controller.publish());
  }
}

void tick_chunked(SurfaceEndpoint& surface, int i) {
  const std::size_t cells = surface.description().cells();
  static std::vector<float> chunk;
  chunk.resize(chunk_cells(cells));
  for (std::size_t at = 0; at < cells;) {
    const auto out = std::span(chunk).first(std::min(chunk.size(), cells - at));
    produce(out, i);
    surface.write(0, at, std::span<const float>(out));
    at += out.size();
    consume(surface.next_cells(1));
  }
  require(surface.publish(static_cast<std::uint64_t>(i), 0.0));
  for (auto in = surface.next_cells(1); !in.empty(); in = surface.next_cells(1)) consume(in);
  require(surface.await_actuators(static_cast<std::uint64_t>(i)));
}

Figures endpoints_chunked(const Case& c, int peer_cpu) {
  auto config = config_of(c);
  config.answers_in_place = true;
  auto surface = SurfaceEndpoint::create(config);
  const pid_t peer = start_peer(peer_cpu, [&] {
    auto controller = ControllerEndpoint::attach(config.name);
    answer_chunked(controller);
  });
  require(surface.await_controller());
  const Figures figures = measure(c.rounds, [&](int i) { tick_chunked(surface, i); });
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

struct Transport {
  const char* name;
  std::function<Figures(const Case&, int)> measure;
  const char* unavailable = nullptr;
};

constexpr Case kTwoCores[] = {{"empty", 1, 8'000}, {"64x64 f32", 64, 3'000}, {"1024x1024 f32", 1024, 60}};
constexpr Case kOneCore[] = {{"empty", 1, 3'000}, {"64x64 f32", 64, 1'000}, {"1024x1024 f32", 1024, 30}};
constexpr int kPasses = 7;

std::vector<Transport> all_transports(bool one_core) {
  return {
      {"raw ping-pong", raw_spin, one_core ? "requires two cores" : nullptr},
      {"endpoints", endpoints},
      {"endpoints, chunked", endpoints_chunked},
      {"POSIX semaphores", semaphores},
      {"Unix socket", bench::unix_socket},
      {"Boost message_queue", bench::message_queue},
      {"ZeroMQ (ipc)", bench::zeromq, bench::zeromq_unavailable()},
      {"iceoryx (waiting)", bench::iceoryx,
       one_core ? "its start sometimes hangs on one core" : bench::iceoryx_unavailable()},
  };
}

// The results of one pass, and the CPU latency before and after it (see core_distance_us()).
struct Pass {
  Figures figures;
  double before_us = 0, after_us = 0;
};
// Indexed by transport, case and pass.
using Passes = std::vector<std::vector<std::vector<Pass>>>;

// Interleaves the transports.
Passes measure_all(const std::vector<Transport>& transports, std::span<const Case> cases, int peer_cpu,
                   bool one_core) {
  Passes all(transports.size(), std::vector<std::vector<Pass>>(cases.size()));
  const auto distance = [&] { return one_core ? 0.0 : bench::core_distance_us(peer_cpu); };
  for (std::size_t c = 0; c < cases.size(); ++c)
    for (int pass = 0; pass < kPasses; ++pass)
      for (std::size_t w = 0; w < transports.size(); ++w) {
        if (transports[w].unavailable) continue;
        const double before = distance();
        const Figures figures = transports[w].measure(cases[c], peer_cpu);
        all[w][c].push_back({figures, before, distance()});
      }
  return all;
}

// Selects passes whose CPU latency was in [from_us, to_us) both before and after.
struct DistanceRange {
  double from_us, to_us;
  bool contains(const Pass& p) const {
    return std::min(p.before_us, p.after_us) >= from_us && std::max(p.before_us, p.after_us) < to_us;
  }
};

// One range, or two if the hypervisor moved the CPUs during the measurement.
std::vector<DistanceRange> distance_ranges(const Passes& all) {
  double nearest = 1e9, farthest = 0;
  for (const auto& way : all)
    for (const auto& one : way)
      for (const Pass& p : one)
        for (const double d : {p.before_us, p.after_us})
          nearest = std::min(nearest, d), farthest = std::max(farthest, d);
  const double between = std::sqrt(nearest * farthest);
  if (farthest < 1.8 * nearest) return {{0, 1e9}};
  return {{0, between}, {between, 1e9}};
}

std::optional<Figures> median_pass(const std::vector<Pass>& passes, const DistanceRange& range) {
  std::vector<Figures> good;
  for (const Pass& p : passes)
    if (range.contains(p) && p.figures.median_us > 0) good.push_back(p.figures);
  if (good.empty()) return std::nullopt;
  const auto median = [&](double Figures::*value) {
    std::ranges::sort(good, {}, value);
    return good[good.size() / 2].*value;
  };
  return Figures{median(&Figures::median_us), median(&Figures::p99_us)};
}

void print(const std::vector<Transport>& transports, std::span<const Case> cases, const Passes& all,
           const DistanceRange& range) {
  std::vector<double> ours(cases.size(), 1e300);
  for (std::size_t w = 0; w < transports.size(); ++w)
    for (std::size_t c = 0; c < cases.size(); ++c)
      if (const auto f = median_pass(all[w][c], range);
          f && std::string(transports[w].name).starts_with("endpoints"))
        ours[c] = std::min(ours[c], f->median_us);
  std::printf("\n%-21s", "");
  for (const Case& c : cases) std::printf("%27s", c.label);
  std::puts("");
  for (std::size_t w = 0; w < transports.size(); ++w) {
    std::printf("%-21s", transports[w].name);
    if (transports[w].unavailable) std::printf("  skipped: %s", transports[w].unavailable);
    for (std::size_t c = 0; c < cases.size() && !transports[w].unavailable; ++c) {
      const auto f = median_pass(all[w][c], range);
      char cell[64] = "-";
      if (f)
        std::snprintf(cell, sizeof cell, "%.2f / %.1f  x%.2f", f->median_us, f->p99_us,
                      f->median_us / ours[c]);
      std::printf("%27s", cell);
    }
    std::puts("");
  }
}

std::size_t passes_in(const Passes& all, const DistanceRange& range) {
  std::size_t count = 0;
  for (const auto& way : all)
    for (const auto& one : way)
      count += static_cast<std::size_t>(
          std::ranges::count_if(one, [&](const Pass& p) { return range.contains(p); }));
  return count;
}

// Reports passes at the most frequent CPU latency; all passes of a transport that has none there.
void print_json(const std::vector<Transport>& transports, std::span<const Case> cases, const Passes& all,
                const std::vector<DistanceRange>& ranges, bool one_core) {
  const DistanceRange most =
      std::ranges::max(ranges, {}, [&](const DistanceRange& r) { return passes_in(all, r); });
  for (std::size_t w = 0; w < transports.size(); ++w)
    for (std::size_t c = 0; c < cases.size(); ++c) {
      auto f = median_pass(all[w][c], most);
      if (!f) f = median_pass(all[w][c], {0, 1e9});
      if (!f) continue;
      const nlohmann::ordered_json line{{"benchmark", "lockstep"},   {"case", cases[c].label},
                                        {"who", transports[w].name}, {"cores", one_core ? 1 : 2},
                                        {"median_us", f->median_us}, {"p99_us", f->p99_us}};
      std::puts(line.dump().c_str());
    }
}

void print(const std::vector<Transport>& transports, std::span<const Case> cases, const Passes& all,
           const std::vector<DistanceRange>& ranges, bool one_core) {
  std::printf(
      "round trips in us: median / p99 of the median of %d passes, and the ratio of its median to the faster "
      "of the\ntwo `endpoints`; the whole payload is written and read in each direction; processes on %s\n",
      kPasses, one_core ? "one core" : "two cores");
  for (const DistanceRange& range : ranges) {
    if (ranges.size() > 1)
      std::printf("\npasses with %s cores: an empty ping-pong takes %s than %.2f us\n",
                  range.from_us == 0 ? "near" : "distant", range.from_us == 0 ? "less" : "more",
                  range.from_us == 0 ? range.to_us : range.from_us);
    print(transports, cases, all, range);
  }
}

struct Arguments {
  bool one_core, json = false;
  std::string filter;
};

// Parses a positional argument: "one-core", "work" or a prefix of a transport's name.
void parse_word(const std::string& word, Arguments& args) {
  if (word == "one-core") {
    args.one_core = true;
    return;
  }
  const auto transports = all_transports(false);
  const bool known =
      word == "work" || std::any_of(transports.begin(), transports.end(), [&](const Transport& way) {
        return std::string(way.name).starts_with(word);
      });
  if (!known) throw CLI::ValidationError(word + ": must be one-core, work or a prefix of a transport's name");
  args.filter = word;
}

Arguments parse_arguments(int argc, char** argv, bool one_core) {
  Arguments args{one_core, false, {}};
  CLI::App app("Benchmarks round trips of two processes in lock-step", "bench_lockstep");
  app.add_option_function<std::vector<std::string>>(
      "what",
      [&](const std::vector<std::string>& words) {
        for (const std::string& word : words) parse_word(word, args);
      },
      "one-core, work (only the lock-step overhead) or a prefix of a transport's name");
  app.add_flag("--json", args.json, "print one JSON object per line");
  bench::parse_or_exit(app, argc, argv);
  return args;
}

}  // namespace

double bench::core_distance_us(int peer_cpu) {
  const auto pass = [&] { return ping_pong({"", 1, 400}, peer_cpu, post_word, await_word).quartile_us; };
  return std::min(pass(), pass());
}

int main(int argc, char** argv) {
  const auto cpus = usable_cpus();
  const Arguments args = parse_arguments(argc, argv, cpus.size() == 1);
  const bool one_core = args.one_core;
  const int peer_cpu = one_core ? cpus.front() : cpus.back();
  pin_to(cpus.front());
  if (args.filter == "work") return bench::print_lockstep_overhead(peer_cpu), 0;
  auto transports = all_transports(one_core);
  std::erase_if(transports,
                [&](const Transport& way) { return !std::string(way.name).starts_with(args.filter); });
  const std::span<const Case> cases = one_core ? std::span<const Case>(kOneCore) : kTwoCores;
  const Passes all = measure_all(transports, cases, peer_cpu, one_core);
  const auto ranges = one_core ? std::vector<DistanceRange>{{0, 1e9}} : distance_ranges(all);
  if (args.json) return print_json(transports, cases, all, ranges, one_core), 0;
  print(transports, cases, all, ranges, one_core);
  if (!one_core && args.filter.empty()) bench::print_lockstep_overhead(peer_cpu);
}
