// The description of an experiment, for the Python files.
#pragma once

#include "smartsurf/python/Arrays.h"
#include "smartsurf/simulation/Environment.h"

namespace smartsurf::python {

using simulation::Environment;

// As text.
py::dict option_values(const Environment& environment);

// Rows, columns, pitch, period, channels, fields of info{}.
py::dict describe(const Environment& environment);

}  // namespace smartsurf::python
