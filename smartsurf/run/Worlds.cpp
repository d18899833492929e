#include "smartsurf/run/Worlds.h"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "smartsurf/run/OutputFile.h"
#include "smartsurf/run/Run.h"
#include "smartsurf/script/Experiment.h"

namespace smartsurf::run {
namespace {

struct Outcome {
  int status = kDone;
  std::string message;             // of a mistake or failure that was thrown
  nlohmann::ordered_json summary;  // null where the world did not get so far
};

std::string numbered(const std::string& file, int index) {
  const std::filesystem::path path(file);
  return (path.parent_path() / fmt::format("{}-{}{}", path.stem().string(), index, path.extension().string()))
      .string();
}

std::uint64_t seed_of(const RunOptions& options) {
  if (options.seed) return *options.seed;
  script::LoadOptions load;
  load.set = options.set;
  load.unsafe = options.unsafe;
  load.print = [](std::string_view) {};
  return script::Experiment::load(options.experiment, load).scene().world.seed;
}

Outcome run_one(const RunOptions& options, const std::atomic<bool>& stop) {
  // One at a time: making a run starts its controller, and a process is not to be forked by several threads
  // at once.
  static std::mutex making;
  Outcome outcome;
  try {
    std::unique_lock lock(making);
    Run run(options, stop, Run::load(options));
    lock.unlock();
    outcome.status = run.execute();
    outcome.summary = nlohmann::ordered_json::parse(run.stats_json());
  } catch (const scene::InputError& mistake) {
    outcome.status = kUserError;
    outcome.message = mistake.what();
  } catch (const std::exception& failure) {
    outcome.status = kFailed;
    outcome.message = text_of_failure(failure);
  }
  return outcome;
}

void write_stats(const std::string& file, const std::vector<Outcome>& outcomes, double wall_s) {
  nlohmann::ordered_json runs = nlohmann::ordered_json::array();
  double simulated_s = 0.0;
  for (const Outcome& o : outcomes) {
    if (!o.summary.is_null()) simulated_s += o.summary["simulated_s"].get<double>();
    runs.push_back(o.summary);
  }
  const nlohmann::ordered_json all{{"worlds", outcomes.size()},
                                   {"simulated_s", simulated_s},
                                   {"wall_s", wall_s},
                                   {"real_time_factor", wall_s > 0.0 ? simulated_s / wall_s : 0.0},
                                   {"runs", runs}};
  write_whole_file("--stats", file, all.dump(2) + "\n");
}

}  // namespace

RunOptions options_of_world(const RunOptions& all, int index, std::uint64_t first_seed) {
  RunOptions one = all;
  one.world = index;
  one.seed = first_seed + static_cast<std::uint64_t>(index);
  const std::string base = !all.shm.empty()         ? all.shm
                           : all.controller.empty() ? "surface"
                                                    : fmt::format("run-{}", getpid());
  if (!all.no_controller) one.shm = fmt::format("{}-{}", base, index);
  for (std::string& file : one.recordings) file = numbered(file, index);
  one.stats_file.clear();
  return one;
}

int run_worlds(const RunOptions& all, int count, const std::atomic<bool>& stop) {
  const auto started = std::chrono::steady_clock::now();
  const std::uint64_t first_seed = seed_of(all);
  std::vector<Outcome> outcomes(static_cast<std::size_t>(count));
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < count; ++i)
      threads.emplace_back([&, i] {
        outcomes[static_cast<std::size_t>(i)] = run_one(options_of_world(all, i, first_seed), stop);
      });
  }
  if (!all.stats_file.empty())
    write_stats(all.stats_file, outcomes,
                std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count());
  int status = kDone;
  for (int i = 0; i < count; ++i) {
    const Outcome& o = outcomes[static_cast<std::size_t>(i)];
    // What the user got wrong is said once, however many worlds met it.
    if (o.status == kUserError && !o.message.empty())
      throw scene::InputError(fmt::format("world {}: {}", i, o.message));
    if (!o.message.empty()) fmt::print(stderr, "smartsurf: world {}: {}\n", i, o.message);
    if (status == kDone) status = o.status;
  }
  return status;
}

}  // namespace smartsurf::run
