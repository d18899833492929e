// Shared by the transports of the round-trip benchmark: payload, peer process and timing.
#pragma once

#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <span>
#include <vector>

#if defined(__x86_64__) && !defined(__clang__)
#define BENCH_WIDE __attribute__((target_clones("default", "avx2", "avx512f")))
#else
#define BENCH_WIDE
#endif

namespace bench {

struct Case {
  const char* label;
  std::uint32_t side;  // payload: side x side f32 in each direction; 1 means empty
  int rounds;
};

struct Figures {
  double median_us = 0, p99_us = 0, quartile_us = 0;
};

inline volatile float g_sink;

// produce() and consume() are vectorised, so that the exchange dominates the measurement.
BENCH_WIDE inline void produce(std::span<float> values, int round) {
  const auto value = static_cast<float>(round % 7);
  for (float& v : values) v = value;
}

BENCH_WIDE inline void consume(std::span<const float> values) {
  float sums[64] = {};
  std::size_t i = 0;
  for (; i + 64 <= values.size(); i += 64)
    for (std::size_t k = 0; k < 64; ++k) sums[k] += values[i + k];
  for (; i < values.size(); ++i) sums[0] += values[i];
  float total = 0;
  for (const float s : sums) total += s;
  g_sink = total;
}

inline void pin_to(int cpu) {
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(cpu, &set);
  if (::sched_setaffinity(0, sizeof set, &set) != 0) std::perror("sched_setaffinity");
}

inline pid_t start_peer(int cpu, const std::function<void()>& body) {
  const pid_t pid = ::fork();
  if (pid != 0) return pid;
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  pin_to(cpu);
  body();
  ::_exit(0);
}

// Times `round` after a warm-up of a tenth of the rounds.
inline Figures measure(int rounds, const std::function<void(int)>& round) {
  std::vector<double> times;
  const int warm = rounds / 10 + 5;
  for (int i = 1; i <= rounds + warm; ++i) {
    const auto start = std::chrono::steady_clock::now();
    round(i);
    const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - start;
    if (i > warm) times.push_back(took.count());
  }
  std::ranges::sort(times);
  return {times[times.size() / 2], times[times.size() * 99 / 100], times[times.size() / 4]};
}

// The communication latency of two CPUs: the lower quartile of an empty ping-pong on two words, in us. A
// hypervisor may move virtual CPUs between sibling threads of a core and different chips at any time, which
// changes all results.
double core_distance_us(int peer_cpu);

// The peers, one per file. *_unavailable() returns the reason why a peer is not built in, or null.
Figures unix_socket(const Case&, int peer_cpu);
Figures message_queue(const Case&, int peer_cpu);
Figures zeromq(const Case&, int peer_cpu);
const char* zeromq_unavailable();
Figures iceoryx(const Case&, int peer_cpu);
// Prints the time of a tick in excess of the work of both sides.
void print_lockstep_overhead(int peer_cpu);
const char* iceoryx_unavailable();

}  // namespace bench
