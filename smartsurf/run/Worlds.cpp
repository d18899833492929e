#include "smartsurf/run/Worlds.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <iterator>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "common/files/Inputs.h"
#include "common/process/StopSignals.h"
#include "common/text/Printable.h"
#include "smartsurf/extension/Extension.h"
#include "smartsurf/run/ConfinedRuns.h"
#include "smartsurf/run/OutputFile.h"
#include "smartsurf/run/Run.h"
#include "smartsurf/run/ScriptOverrun.h"
#include "smartsurf/script/Experiment.h"

namespace smartsurf::run {
namespace {

struct Outcome {
  int status = common::kDone;
  std::string message;             // what() of the exception that ended the world; "" if none
  nlohmann::ordered_json summary;  // null if the world did not finish
};

std::string numbered_file(const std::string& file, int index) {
  const std::filesystem::path path(file);
  return (path.parent_path() / fmt::format("{}-{}{}", path.stem().string(), index, path.extension().string()))
      .string();
}

std::uint64_t experiment_seed(const RunOptions& options) {
  if (options.seed) return *options.seed;
  script::LoadOptions load;
  load.overrides = options.overrides;
  load.unsafe = options.unsafe;
  if (options.allow_extensions || options.unsafe) load.load_extension = extension::load;
  load.print_output = [](std::string_view) {};
  load.stop = &common::stop_flag();
  load.end_process = end_for_script;
  return script::Experiment::load(options.experiment, load).scene().world.seed;
}

Outcome run_world(const RunOptions& options, const std::atomic<bool>& stop) {
  // Runs are created one at a time, because each forks its controller.
  static std::mutex launch_mutex;
  Outcome outcome;
  try {
    std::unique_lock lock(launch_mutex);
    Run run(options, stop, Run::load(options));
    lock.unlock();
    outcome.status = run.execute();
    outcome.summary = nlohmann::ordered_json::parse(run.stats_json());
  } catch (const script::Interrupted&) {  // the status of the signal follows
  } catch (const scene::InputError& error) {
    outcome.status = common::kUserError;
    outcome.message = error.what();
  } catch (const std::exception& error) {
    outcome.status = common::kFailed;
    outcome.message = common::failure_text(error);
  }
  return outcome;
}

void write_stats(const std::string& file, const std::vector<Outcome>& outcomes, double wall_s) {
  nlohmann::ordered_json runs = nlohmann::ordered_json::array();
  double simulated_s = 0.0;
  for (const Outcome& outcome : outcomes) {
    if (!outcome.summary.is_null()) simulated_s += outcome.summary["simulated_s"].get<double>();
    runs.push_back(outcome.summary);
  }
  const nlohmann::ordered_json summary{{"worlds", outcomes.size()},
                                       {"simulated_s", simulated_s},
                                       {"wall_s", wall_s},
                                       {"real_time_factor", wall_s > 0.0 ? simulated_s / wall_s : 0.0},
                                       {"runs", runs}};
  replace_output_file("--stats", file,
                      summary.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
}

}  // namespace

RunOptions world_options(const RunOptions& shared, int index, std::uint64_t first_seed) {
  RunOptions options = shared;
  options.world_index = index;
  options.summary = false;
  options.seed = first_seed + static_cast<std::uint64_t>(index);
  for (std::string& file : options.recording_files) file = numbered_file(file, index);
  options.stats_file.clear();
  return options;
}

int run_worlds(const RunOptions& shared, int count) {
  std::vector<RunOptions> runs;
  for (int i = 0; i < count; ++i) runs.push_back(world_options(shared, i, 0));
  std::vector<common::NamedOutput> others;
  if (!shared.stats_file.empty()) others.push_back({"--stats", shared.stats_file});
  const std::unique_ptr<ConfinedRuns> confined = ConfinedRuns::confine(runs, others);
  const std::atomic<bool>& stop = common::catch_stop_signals();
  const auto start_time = std::chrono::steady_clock::now();
  const std::uint64_t first_seed = experiment_seed(shared);
  common::note_input(shared.experiment);
  std::vector<common::NamedOutput> outputs = others;
  for (int i = 0; i < count; ++i) {
    runs[i].seed = world_options(shared, i, first_seed).seed;
    std::ranges::move(named_outputs(runs[i]), std::back_inserter(outputs));
  }
  common::require_separate_outputs(outputs);
  std::vector<Outcome> outcomes(count);
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < count; ++i) threads.emplace_back([&, i] { outcomes[i] = run_world(runs[i], stop); });
  }
  if (!shared.stats_file.empty())
    write_stats(shared.stats_file, outcomes,
                std::chrono::duration<double>(std::chrono::steady_clock::now() - start_time).count());
  int status = common::kDone;
  for (int i = 0; i < count; ++i) {
    const Outcome& outcome = outcomes[i];
    // An input error is reported once, although several worlds may have the same.
    if (outcome.status == common::kUserError && !outcome.message.empty())
      throw scene::InputError(fmt::format("world {}: {}", i, outcome.message));
    if (!outcome.message.empty())
      common::print_message(fmt::format("smartsurf: world {}: {}\n", i, outcome.message));
    if (status == common::kDone) status = outcome.status;
  }
  return status;
}

}  // namespace smartsurf::run
