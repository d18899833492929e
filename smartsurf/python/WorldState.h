// The parameters and the state of one world, whose arrays the Python files have checked.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "smartsurf/python/Arrays.h"
#include "smartsurf/simulation/Environment.h"

namespace smartsurf::python {

using simulation::Environment;

// (shape, the numbers, whether they are whole, whether a fault of cells)
py::tuple parameter(const Environment& environment, const std::string& name);
void set_parameter(Environment& environment, const std::string& name, std::span<const double> values);
void randomise(Environment& environment, const std::string& name, std::span<const double> low,
               std::span<const double> high);

// The values set by set_parameter() and randomise(): (name, values) and (name, low, high).
using NamedRange = std::tuple<std::string, std::vector<double>, std::vector<double>>;
using ParameterSettings = std::pair<Environment::Values, std::vector<NamedRange>>;

ParameterSettings parameter_settings(const Environment& environment);
void set_parameter_settings(Environment& environment, const ParameterSettings& given);

// values: ids × numbers of the field; of wrenches force and torque.
void place(Environment& environment, const std::string& field, const std::vector<std::uint32_t>& ids,
           std::span<const double> values);
void set_wrenches(Environment& environment, const std::vector<std::uint32_t>& ids,
                  std::span<const double> values);

}  // namespace smartsurf::python
