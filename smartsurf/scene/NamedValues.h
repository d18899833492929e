// Lists of values by name.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace smartsurf::scene {

// The values that the script's metric() set, in order of first use.
using Metric = std::pair<std::string, double>;
using Metrics = std::vector<Metric>;

// The values of options, as text: --set NAME=VALUE.
using Overrides = std::vector<std::pair<std::string, std::string>>;

}  // namespace smartsurf::scene
