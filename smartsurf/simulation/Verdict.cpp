#include "smartsurf/simulation/Verdict.h"

#include <algorithm>

namespace smartsurf::simulation {

Verdict judge(const script::Experiment& experiment, std::optional<double> reached_s,
              std::optional<bool> stop_success, double end_s) {
  if (reached_s) return {true, reached_s};
  std::optional<bool> success = stop_success;
  const auto is_success = [](const auto& metric) { return metric.first == "success"; };
  const auto metric = std::ranges::find_if(experiment.metrics(), is_success);
  if (!success && metric != experiment.metrics().end()) success = metric->second > 0.0;
  if (!success && experiment.declares_success()) success = false;
  return {success, success == true ? std::optional(end_s) : std::nullopt};
}

std::string outcome_of(const ScriptRequests& requests) {
  return "stopped by the script" + (requests.stop_message.empty() ? "" : ": " + requests.stop_message);
}

}  // namespace smartsurf::simulation
