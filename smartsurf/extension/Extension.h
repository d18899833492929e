// Loads extensions: shared objects with the C interface of smartsurf_plugin.h, which add actuators and
// sensors.
#pragma once

#include <filesystem>

namespace smartsurf::extension {

// Loads the extension for the rest of the process; all experiments that are loaded later know its actuators
// and sensors. Does nothing if it is loaded already. Runs native code. Throws common::UserError, one line,
// for a file that cannot be loaded, is of another version of the interface or has an invalid table, and for
// the name of a kind that exists: then none of its kinds exists. Thread-safe.
void load(const std::filesystem::path&);

}  // namespace smartsurf::extension
