// Compares filters, neighbourhoods and random planes with OpenCV on one thread, in processor time.
//   bench_filters [SIZE [REPETITIONS]] [--json]
// OpenCV is a Python package in build/opencv (scripts/setup --opencv); without it only our times are printed.
#include <time.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

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

std::optional<double> opencv_us(const std::string& workload, int n, int repetitions) {
  const std::string command = ARRAYS_OPENCV_PYTHON " " ARRAYS_SOURCE_DIR "/opencv_peer.py " + workload + " " +
                              std::to_string(n) + " " + std::to_string(repetitions) + " 2>/dev/null";
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return std::nullopt;
  double us = 0;
  const bool read = std::fscanf(pipe, "%lf", &us) == 1;
  return pclose(pipe) == 0 && read ? std::optional(us) : std::nullopt;
}

}  // namespace

int main(int argc, char** argv) {
  int n = 1024, repetitions = 15;
  bool json = false;
  CLI::App app("Compares filters and random planes with OpenCV", "bench_filters");
  app.add_option("size", n, "edge length [1024]")->check(CLI::Range(16, 8192));
  app.add_option("repetitions", repetitions, "repetitions of each measurement [15]")
      ->check(CLI::Range(1, 1000));
  app.add_flag("--json", json, "print one JSON object per line");
  bench::parse_or_exit(app, argc, argv);
  for (const std::string workload : {"filter3", "filter5", "filter7", "filter11", "gauss", "sobel", "uniform",
                                     "normal", "near", "shifts", "life", "life-wrap"}) {
    const auto opencv = opencv_us(workload, n, repetitions);
    for (const InstructionSet isa :
         {InstructionSet::kAvx512, InstructionSet::kAvx2, InstructionSet::kPortable}) {
      const std::optional<arrays::Job> job = arrays::make_filter_job(workload, n, isa);
      if (!job) continue;
      const double us = least_us(*job, repetitions);
      const std::string name(apron::vm::instruction_set_name(isa));
      if (json) {
        nlohmann::ordered_json line{
            {"benchmark", "filters"}, {"case", workload}, {"who", "apron " + name}, {"least_us", us}};
        if (opencv) line["opencv_us"] = *opencv;
        std::puts(line.dump().c_str());
      } else {
        std::printf("%-10s %-9s %10.1f us", workload.c_str(), name.c_str(), us);
        if (opencv) std::printf("   opencv %10.1f us   ours / opencv %5.2f", *opencv, us / *opencv);
        std::puts("");
      }
      std::fflush(stdout);
    }
  }
}
