// Round trips of two processes in lock-step: our endpoints beside a raw ping-pong on two words of shared
// memory (the limit), POSIX semaphores, and what else there is to connect two processes. In each, both sides
// write all of their payload and read all of the other's.
//
//   bench_lockstep            two cores; and what a tick costs beyond the sides' own work
//   bench_lockstep one-core   both processes on one core
//   bench_lockstep NAME       only the ways whose name begins so
//   bench_lockstep … --json   a JSON object a line
//   bench_lockstep work       only what a tick costs beyond the sides' own work
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

// Cells asked for at once: 64 KiB; two pieces of a small frame.
constexpr std::size_t kPieceCells = 16 * 1024;
std::size_t piece_cells(std::size_t cells) { return std::clamp<std::size_t>(cells / 2, 1, kPieceCells); }

// As a streaming pair does: each piece is answered as soon as it has come, and taken in while the next one is
// being made.
void answer_in_pieces(ControllerEndpoint& controller) {
  for (int i = 1;; ++i) {
    std::size_t at = 0;
    for (auto in = controller.next_cells(0); !in.empty(); in = controller.next_cells(0)) {
      consume(in);
      const std::size_t end = at + in.size();
      while (at < end) {
        const auto out = controller.reserve(1, at, end - at);
        produce(out, i);
        controller.commit();
        at += out.size();
      }
    }
    if (controller.await_sensors() != Status::kOk) return;
    require(controller.publish());
  }
}

void tick_in_pieces(SurfaceEndpoint& surface, int i) {
  const std::size_t cells = surface.description().cells(), piece = piece_cells(cells);
  for (std::size_t at = 0; at < cells;) {
    const auto out = surface.reserve(0, at, std::min(piece, cells - at));
    produce(out, i);
    surface.commit();
    at += out.size();
    consume(surface.next_cells(1));
  }
  require(surface.publish(static_cast<std::uint64_t>(i), 0.0));
  for (auto in = surface.next_cells(1); !in.empty(); in = surface.next_cells(1)) consume(in);
  require(surface.await_actuators(static_cast<std::uint64_t>(i)));
}

Figures endpoints_in_pieces(const Case& c, int peer_cpu) {
  auto config = config_of(c);
  config.answers_in_place = true;
  auto surface = SurfaceEndpoint::create(config);
  const pid_t peer = start_peer(peer_cpu, [&] {
    auto controller = ControllerEndpoint::attach(config.name);
    answer_in_pieces(controller);
  });
  require(surface.await_controller());
  const Figures figures = measure(c.rounds, [&](int i) { tick_in_pieces(surface, i); });
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

constexpr Case kTwoCores[] = {{"empty", 1, 8'000}, {"64x64 f32", 64, 3'000}, {"1024x1024 f32", 1024, 60}};
constexpr Case kOneCore[] = {{"empty", 1, 3'000}, {"64x64 f32", 64, 1'000}, {"1024x1024 f32", 1024, 30}};
constexpr int kPasses = 7;

std::vector<Way> all_ways(bool one_core) {
  return {
      {"raw ping-pong", raw_spin, one_core ? "cannot work on one core" : nullptr},
      {"endpoints", endpoints},
      {"endpoints, in pieces", endpoints_in_pieces},
      {"POSIX semaphores", semaphores},
      {"Unix socket", bench::unix_socket},
      {"Boost message_queue", bench::message_queue},
      {"ZeroMQ (ipc)", bench::zeromq, bench::zeromq_missing()},
      {"iceoryx (waiting)", bench::iceoryx,
       one_core ? "now and then its start hangs on one core" : bench::iceoryx_missing()},
  };
}

// One pass, and how far apart the CPUs were before and after it.
struct Pass {
  Figures figures;
  double before_us = 0, after_us = 0;
};
// Of each way and each case.
using Passes = std::vector<std::vector<std::vector<Pass>>>;

// All ways in turn, several times.
Passes measure_all(const std::vector<Way>& ways, std::span<const Case> cases, int peer_cpu, bool one_core) {
  Passes all(ways.size(), std::vector<std::vector<Pass>>(cases.size()));
  const auto distance = [&] { return one_core ? 0.0 : bench::distance_us(peer_cpu); };
  for (std::size_t c = 0; c < cases.size(); ++c)
    for (int pass = 0; pass < kPasses; ++pass)
      for (std::size_t w = 0; w < ways.size(); ++w) {
        if (ways[w].missing) continue;
        const double before = distance();
        const Figures figures = ways[w].measure(cases[c], peer_cpu);
        all[w][c].push_back({figures, before, distance()});
      }
  return all;
}

// Passes at a distance within the range, both before and after them.
struct Range {
  double from_us, to_us;
  bool has(const Pass& p) const {
    return std::min(p.before_us, p.after_us) >= from_us && std::max(p.before_us, p.after_us) < to_us;
  }
};

// One range, or two when the CPUs moved together or apart meanwhile.
std::vector<Range> ranges_of(const Passes& all) {
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

std::optional<Figures> middle_of(const std::vector<Pass>& passes, const Range& range) {
  std::vector<Figures> good;
  for (const Pass& p : passes)
    if (range.has(p) && p.figures.median_us > 0) good.push_back(p.figures);
  if (good.empty()) return std::nullopt;
  const auto middle = [&](double Figures::*value) {
    std::ranges::sort(good, {}, value);
    return good[good.size() / 2].*value;
  };
  return Figures{middle(&Figures::median_us), middle(&Figures::p99_us)};
}

void print(const std::vector<Way>& ways, std::span<const Case> cases, const Passes& all, const Range& range) {
  std::vector<double> ours(cases.size(), 1e300);
  for (std::size_t w = 0; w < ways.size(); ++w)
    for (std::size_t c = 0; c < cases.size(); ++c)
      if (const auto f = middle_of(all[w][c], range); f && std::string(ways[w].name).starts_with("endpoints"))
        ours[c] = std::min(ours[c], f->median_us);
  std::printf("\n%-21s", "");
  for (const Case& c : cases) std::printf("%27s", c.label);
  std::puts("");
  for (std::size_t w = 0; w < ways.size(); ++w) {
    std::printf("%-21s", ways[w].name);
    if (ways[w].missing) std::printf("  skipped: %s", ways[w].missing);
    for (std::size_t c = 0; c < cases.size() && !ways[w].missing; ++c) {
      const auto f = middle_of(all[w][c], range);
      char cell[64] = "-";
      if (f)
        std::snprintf(cell, sizeof cell, "%.2f / %.1f  x%.2f", f->median_us, f->p99_us,
                      f->median_us / ours[c]);
      std::printf("%27s", cell);
    }
    std::puts("");
  }
}

std::size_t passes_in(const Passes& all, const Range& range) {
  std::size_t count = 0;
  for (const auto& way : all)
    for (const auto& one : way)
      count +=
          static_cast<std::size_t>(std::ranges::count_if(one, [&](const Pass& p) { return range.has(p); }));
  return count;
}

// Of the distance at which most passes were made; of all where one had none of these.
void print_json(const std::vector<Way>& ways, std::span<const Case> cases, const Passes& all,
                const std::vector<Range>& ranges, bool one_core) {
  const Range most = std::ranges::max(ranges, {}, [&](const Range& r) { return passes_in(all, r); });
  for (std::size_t w = 0; w < ways.size(); ++w)
    for (std::size_t c = 0; c < cases.size(); ++c) {
      auto f = middle_of(all[w][c], most);
      if (!f) f = middle_of(all[w][c], {0, 1e9});
      if (!f) continue;
      const nlohmann::ordered_json line{{"benchmark", "lockstep"},   {"case", cases[c].label},
                                        {"who", ways[w].name},       {"cores", one_core ? 1 : 2},
                                        {"median_us", f->median_us}, {"p99_us", f->p99_us}};
      std::puts(line.dump().c_str());
    }
}

void print(const std::vector<Way>& ways, std::span<const Case> cases, const Passes& all,
           const std::vector<Range>& ranges, bool one_core) {
  std::printf(
      "round trips in us, median / p99 of the middle one of %d passes, and the median over that of "
      "`endpoints` (the "
      "faster way of the two)\npayload each way, all of it written and read; both processes on %s\n",
      kPasses, one_core ? "one core" : "a core each");
  for (const Range& range : ranges) {
    if (ranges.size() > 1)
      std::printf("\npasses with the cores %s apart: an empty ping-pong of %s than %.2f us\n",
                  range.from_us == 0 ? "little" : "far", range.from_us == 0 ? "less" : "more",
                  range.from_us == 0 ? range.to_us : range.from_us);
    print(ways, cases, all, range);
  }
}

struct Asked {
  bool one_core, json = false;
  std::string only;
};

// Words that are no flags: "one-core", "work", or the beginning of a way's name.
void read_word(const std::string& word, Asked& asked) {
  if (word == "one-core") {
    asked.one_core = true;
    return;
  }
  const auto ways = all_ways(false);
  const bool known = word == "work" || std::any_of(ways.begin(), ways.end(), [&](const Way& way) {
                       return std::string(way.name).starts_with(word);
                     });
  if (!known) throw CLI::ValidationError(word + ": neither one-core, work nor the beginning of a way's name");
  asked.only = word;
}

Asked asked_of(int argc, char** argv, bool one_core) {
  Asked asked{one_core, false, {}};
  CLI::App app("Round trips of two processes in lock-step", "bench_lockstep");
  app.add_option_function<std::vector<std::string>>(
      "what",
      [&](const std::vector<std::string>& words) {
        for (const std::string& word : words) read_word(word, asked);
      },
      "one-core, work (only what a tick costs beyond the sides' own work), or the beginning of a way's name");
  app.add_flag("--json", asked.json, "a JSON object a line");
  bench::parse_or_exit(app, argc, argv);
  return asked;
}

}  // namespace

double bench::distance_us(int peer_cpu) {
  const auto pass = [&] { return ping_pong({"", 1, 400}, peer_cpu, post_word, await_word).quartile_us; };
  return std::min(pass(), pass());
}

int main(int argc, char** argv) {
  const auto cpus = usable_cpus();
  const Asked asked = asked_of(argc, argv, cpus.size() == 1);
  const bool one_core = asked.one_core;
  const int peer_cpu = one_core ? cpus.front() : cpus.back();
  pin_to(cpus.front());
  if (asked.only == "work") return bench::print_own_work(peer_cpu), 0;
  auto ways = all_ways(one_core);
  std::erase_if(ways, [&](const Way& way) { return !std::string(way.name).starts_with(asked.only); });
  const std::span<const Case> cases = one_core ? std::span<const Case>(kOneCore) : kTwoCores;
  const Passes all = measure_all(ways, cases, peer_cpu, one_core);
  const auto ranges = one_core ? std::vector<Range>{{0, 1e9}} : ranges_of(all);
  if (asked.json) return print_json(ways, cases, all, ranges, one_core), 0;
  print(ways, cases, all, ranges, one_core);
  if (!one_core && asked.only.empty()) bench::print_own_work(peer_cpu);
}
