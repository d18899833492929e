// The classes of the module `_core`.
#pragma once

#include "smartsurf/python/Arrays.h"

namespace smartsurf::python {

void bind_simulation(py::module_& m);
void bind_window(py::module_& m);  // after bind_simulation()
void bind_batch(py::module_& m);

}  // namespace smartsurf::python
