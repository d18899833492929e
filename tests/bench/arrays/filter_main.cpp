// Compares filters, neighbourhoods and random planes with OpenCV, and mathematical functions with NumPy, on
// one thread, in processor time.
//   bench_filters [SIZE [REPETITIONS]] [--only filters|mathematics] [--json]
// OpenCV is a Python package in build/opencv (scripts/setup --opencv); without it only our times are printed.
#include <time.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tests/bench/CommandLine.h"
#include "tests/bench/arrays/Peers.h"

namespace {

using apron::vm::InstructionSet;

double thread_time_us() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e6 + static_cast<double>(now.tv_nsec) * 1e-3;
}

double least_us(const arrays::Job& job, int repetitions) {
  job.run();
  double least = 1e300;
  for (int i = 0; i < repetitions; ++i) {
    const double start = thread_time_us();
    job.run();
    least = std::min(least, thread_time_us() - start);
  }
  return least;
}

// The microseconds that a script here prints.
std::optional<double> peer_us(const std::string& script, const std::string& workload, int n,
                              int repetitions) {
  const std::string command =
      script + " " + workload + " " + std::to_string(n) + " " + std::to_string(repetitions) + " 2>/dev/null";
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return std::nullopt;
  double us = 0;
  const bool read = std::fscanf(pipe, "%lf", &us) == 1;
  return pclose(pipe) == 0 && read ? std::optional(us) : std::nullopt;
}

struct Group {
  const char* name;
  const char* peer;
  std::string script;
  std::vector<std::pair<std::string, std::string>> workloads;  // name, call of a mathematical function
};

const Group kGroups[] = {{"filters",
                          "opencv",
                          ARRAYS_OPENCV_PYTHON " " ARRAYS_SOURCE_DIR "/opencv_peer.py",
                          {{"filter3", ""},
                           {"filter5", ""},
                           {"filter7", ""},
                           {"filter11", ""},
                           {"gauss", ""},
                           {"sobel", ""},
                           {"uniform", ""},
                           {"normal", ""},
                           {"near", ""},
                           {"shifts", ""},
                           {"life", ""},
                           {"life-wrap", ""}}},
                         {"mathematics",
                          "numpy",
                          ARRAYS_PYTHON " " ARRAYS_SOURCE_DIR "/numpy_mathematics_peer.py",
                          {{"exp", "math.exp(A)"},
                           {"ln", "math.ln(A)"},
                           {"pow", "pow(A, B)"},
                           {"sin", "math.sin(A)"},
                           {"cos", "math.cos(A)"},
                           {"tan", "math.tan(A)"},
                           {"tanh", "math.tanh(A)"},
                           {"atan2", "math.atan2(A, B)"},
                           {"sqrt", "math.sqrt(A)"}}}};

}  // namespace

int main(int argc, char** argv) {
  int n = 1024, repetitions = 15;
  bool json = false;
  std::string only;
  CLI::App app("Compares filters with OpenCV and mathematical functions with NumPy", "bench_filters");
  app.add_option("size", n, "edge length [1024]")->check(CLI::Range(16, 8192));
  app.add_option("repetitions", repetitions, "repetitions of each measurement [15]")
      ->check(CLI::Range(1, 1000));
  app.add_flag("--json", json, "print one JSON object per line");
  app.add_option("--only", only, "filters or mathematics");
  bench::parse_or_exit(app, argc, argv);
  for (const Group& group : kGroups) {
    if (!only.empty() && only != group.name) continue;
    for (const auto& [workload, call] : group.workloads) {
      const std::optional<double> peer = peer_us(group.script, workload, n, repetitions);
      for (const InstructionSet isa :
           {InstructionSet::kAvx512, InstructionSet::kAvx2, InstructionSet::kPortable}) {
        const std::optional<arrays::Job> job = call.empty() ? arrays::make_filter_job(workload, n, isa)
                                                            : arrays::make_mathematics_job(call, n, isa);
        if (!job) continue;
        const double us = least_us(*job, repetitions);
        const std::string name(apron::vm::instruction_set_name(isa));
        if (json) {
          nlohmann::ordered_json line{
              {"benchmark", group.name}, {"case", workload}, {"who", "apron " + name}, {"least_us", us}};
          if (peer) line[std::string(group.peer) + "_us"] = *peer;
          std::puts(line.dump().c_str());
        } else {
          std::printf("%-10s %-9s %10.1f us", workload.c_str(), name.c_str(), us);
          if (peer) std::printf("   %s %10.1f us   ours / peer %5.2f", group.peer, *peer, us / *peer);
          std::puts("");
        }
        std::fflush(stdout);
      }
    }
  }
}
