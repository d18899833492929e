// Commands that read a recording run as a whole in a forked process, because HDF5 does not validate
// everything that it reads: any statement may crash on a damaged file, not only opening it.
#pragma once

#include <functional>
#include <string>

namespace smartsurf::run {

// Runs the command in a child, which ends with this process, and returns its exit status. Stop signals are
// passed on. Throws scene::InputError if it crashes, and std::runtime_error if there can be no child. Call it
// on the main thread.
int read_in_worker(const std::string& recording, const std::function<int()>& command);

}  // namespace smartsurf::run
