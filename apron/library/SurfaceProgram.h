// A program as the controller of a surface in the same process.
#pragma once

#include <memory>

#include "apron/library/EmbeddedHost.h"
#include "apron/library/ProgramSource.h"
#include "common/controller/Controller.h"

namespace apron::library {

// Controllers that each run the program, on one thread, with the values of the sliders and switches. What
// they print goes to `print`, from the threads that call them. Throws common::UserError if the file cannot be
// read; create() throws it for errors in the program.
std::shared_ptr<const common::ControllerFactory> make_controller_factory(ProgramSource source,
                                                                         ParameterValues parameters,
                                                                         EmbeddedHost::Print print);

}  // namespace apron::library
