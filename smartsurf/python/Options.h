// The options of an environment from the arguments of the Python files.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/controller/Controller.h"
#include "smartsurf/python/Arrays.h"
#include "smartsurf/scene/NamedValues.h"
#include "smartsurf/simulation/Environment.h"

namespace smartsurf::python {

using simulation::EnvironmentOptions;

EnvironmentOptions make_options(std::string experiment, std::string engine, scene::Overrides overrides,
                                std::optional<std::uint64_t> seed, int threads,
                                std::optional<std::string> source);

// The content of a capsule of the package `apron` holds; null for None.
std::shared_ptr<const common::ControllerFactory> controller_factory(const py::object& capsule);

}  // namespace smartsurf::python
