// How an episode ends, in the words of recordings and statistics.
#pragma once

#include <optional>
#include <string>

#include "smartsurf/script/Experiment.h"
#include "smartsurf/simulation/Simulation.h"

namespace smartsurf::simulation {

struct Verdict {
  std::optional<bool> success;      // nullopt: the script does not say
  std::optional<double> success_s;  // when the goal was reached; nullopt: it was not
};

// The verdict of success() at any tick, else of stop() or the metric `success` at the end. reached_s: the
// time that success() returned first. stop_success: the result of stop(). end_s: the time of the last state.
Verdict judge(const script::Experiment&, std::optional<double> reached_s, std::optional<bool> stop_success,
              double end_s);

// The outcome of an episode that its script has stopped.
std::string outcome_of(const ScriptRequests&);

}  // namespace smartsurf::simulation
