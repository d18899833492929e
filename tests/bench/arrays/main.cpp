// Compares all peers on the array workloads, interleaved, and checks that their checksums agree.
//   bench_arrays [WORKLOADS [SIZES [REPETITIONS [WITHOUT]]]], for example: bench_arrays 2,6 64,1024 9 eigen
// Prints the minimum and median time of one run over the whole array, in microseconds; with --json, one JSON
// object per line. With --cpu-time it measures the calling thread's processor time, for a machine with other
// work to do.
#include <time.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/bench/CommandLine.h"
#include "tests/bench/arrays/Peers.h"

namespace {

using arrays::Job;

double now_us(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) * 1e6 + static_cast<double>(now.tv_nsec) * 1e-3;
}

struct Measurement {
  std::string peer;
  double min_us = 0, median_us = 0, checksum = 0;
};

struct Contender {
  std::string peer;
  Job job;
  double checksum = 0;
  long runs_per_sample = 1;
  std::vector<double> times_us{};

  double time_run_us(clockid_t clock) const {
    job.run();  // warm-up: evicts the other peers' arrays from the caches
    const double start = now_us(clock);
    for (long i = 0; i < runs_per_sample; ++i) job.run();
    return (now_us(clock) - start) / static_cast<double>(runs_per_sample);
  }
};

// Interleaves the peers, so that load from other processes affects all of them alike.
std::vector<Measurement> measure(std::vector<Contender>& runners, int repetitions, clockid_t clock) {
  for (Contender& r : runners) {
    r.job.run();
    r.checksum = r.job.checksum();
    r.runs_per_sample = std::max(1L, static_cast<long>(3000.0 / std::max(r.time_run_us(clock), 1e-3)));
    r.time_run_us(clock);
  }
  for (int i = 0; i < repetitions; ++i)
    for (Contender& r : runners) r.times_us.push_back(r.time_run_us(clock));
  std::vector<Measurement> all;
  for (Contender& r : runners) {
    std::sort(r.times_us.begin(), r.times_us.end());
    all.push_back({r.peer, r.times_us.front(), r.times_us[r.times_us.size() / 2], r.checksum});
  }
  return all;
}

std::optional<Measurement> run_numpy(int workload, int n) {
  const std::string command = std::string(ARRAYS_PYTHON " " ARRAYS_SOURCE_DIR "/numpy_peer.py ") +
                              std::to_string(workload) + " " + std::to_string(n) + " 2>/dev/null";
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return std::nullopt;
  Measurement f{"numpy"};
  const int fields = std::fscanf(pipe, "%lf %lf %lf", &f.min_us, &f.median_us, &f.checksum);
  return pclose(pipe) == 0 && fields == 3 ? std::optional(f) : std::nullopt;
}

void print(int workload, int n, const Measurement& f, const Measurement& ours, bool same) {
  std::printf("W%d %4d  %-17s %11.3f %11.3f  apron is %5.2f x  checksum %.9g%s\n", workload, n,
              f.peer.c_str(), f.min_us, f.median_us, f.min_us / ours.min_us, f.checksum,
              same ? "" : "  DIFFERS");
}

void print_json(int workload, int n, const Measurement& f, bool same) {
  const nlohmann::ordered_json line{{"benchmark", "arrays"},
                                    {"case", "W" + std::to_string(workload) + " " + std::to_string(n)},
                                    {"who", f.peer},
                                    {"least_us", f.min_us},
                                    {"median_us", f.median_us},
                                    {"checksum_agrees", same}};
  std::puts(line.dump().c_str());
}

// Returns whether the checksums agree, with a tolerance: a fused multiply-add in a peer may change last bits.
bool compare(int workload, int n, int repetitions, const std::string& without, bool json, clockid_t clock) {
  std::vector<Contender> runners;
  std::string missing;
  const auto add = [&](const char* peer, const auto& make, auto... more) {
    const std::vector<std::string> names = CLI::detail::split(without, ',');
    const bool wanted = std::find(names.begin(), names.end(), peer) == names.end();
    std::optional<Job> job = wanted ? make(workload, n, more...) : std::nullopt;
    if (job)
      runners.push_back({peer, std::move(*job)});
    else
      missing += std::string(" ") + peer;
  };
  using apron::vm::InstructionSet;
  const InstructionSet best = apron::vm::best_instruction_set();
  add("apron", arrays::make_apron_job, 1U, best);
  add("apron, 2 threads", arrays::make_apron_job, 2U, best);
  add("hand-fused", arrays::make_hand_fused_job);
  add("halide", arrays::make_halide_job, best);
  if (best == InstructionSet::kAvx512) {
    add("apron avx2", arrays::make_apron_job, 1U, InstructionSet::kAvx2);
    add("halide avx2", arrays::make_halide_job, InstructionSet::kAvx2);
  }
  add("eigen", arrays::make_eigen_job);
  add("unfused", arrays::make_unfused_job);
  std::vector<Measurement> all = measure(runners, repetitions, clock);
  const bool wanted = without.find("numpy") == std::string::npos;
  if (const auto f = wanted ? run_numpy(workload, n) : std::nullopt)
    all.push_back(*f);
  else
    missing += " numpy";
  bool equal = true;
  for (const Measurement& f : all) {
    const bool same = std::fabs(f.checksum - all[0].checksum) <= 1e-6 * std::fabs(all[0].checksum);
    equal = equal && same;
    if (json)
      print_json(workload, n, f, same);
    else
      print(workload, n, f, all[0], same);
  }
  if (!missing.empty() && !json) std::printf("W%d %4d  not available:%s\n", workload, n, missing.c_str());
  std::fflush(stdout);
  return equal;
}

struct Options {
  std::vector<int> workloads{1, 2, 3, 4, 5, 6}, sizes{64, 256, 1024, 4096};
  int repetitions = 9;
  std::string without;
  bool json = false, cpu_time = false;
};

// Parses one comma-separated argument such as 64,1024. A CLI11 list option would also consume the arguments
// after it.
std::function<void(const std::string&)> list_into(std::vector<int>& to, int least, int most) {
  return [&to, least, most](const std::string& text) {
    to.clear();
    for (const std::string& one : CLI::detail::split(text, ',')) {
      int number = 0;
      const char* end = one.data() + one.size();
      const auto [rest, wrong] = std::from_chars(one.data(), end, number);
      if (wrong != std::errc{} || rest != end || number < least || number > most)
        throw CLI::ValidationError("'" + one + "': must be a whole number from " + std::to_string(least) +
                                   " to " + std::to_string(most));
      to.push_back(number);
    }
  };
}

Options read_options(int argc, char** argv) {
  Options o;
  CLI::App app("Compares apron with other array libraries on the same workloads", "bench_arrays");
  app.add_option_function("workloads", list_into(o.workloads, 1, 6), "workloads, such as 2,6");
  app.add_option_function("sizes", list_into(o.sizes, 4, 16384), "edge lengths, such as 64,1024");
  app.add_option("repetitions", o.repetitions, "repetitions of each measurement")->check(CLI::Range(1, 1000));
  app.add_option("without", o.without, "peers to leave out, such as eigen,numpy");
  app.add_flag("--json", o.json, "print one JSON object per line");
  app.add_flag("--cpu-time", o.cpu_time, "measure the calling thread's processor time, not wall time");
  bench::parse_or_exit(app, argc, argv);
  return o;
}

}  // namespace

int main(int argc, char** argv) {
  const Options o = read_options(argc, argv);
  const clockid_t clock = o.cpu_time ? CLOCK_THREAD_CPUTIME_ID : CLOCK_MONOTONIC;
  bool equal = true;
  if (!o.json) std::printf("           peer                min us   median us\n");
  for (const int n : o.sizes)
    for (const int w : o.workloads) equal = compare(w, n, o.repetitions, o.without, o.json, clock) && equal;
  return equal ? 0 : 1;
}
