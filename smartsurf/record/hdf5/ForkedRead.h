// Tries an action in a child process first. Internal to this module.
//
// HDF5 1.10 does not validate everything that it reads: a damaged file can make it access memory out of
// bounds. A recording is therefore opened in a child process first.
#pragma once

#include <filesystem>
#include <functional>

namespace smartsurf::record {

// Returns whether the action returns or throws within 15 s of processor time, without a crash. It runs in a
// forked child, which may read the file alone; its side effects are lost. Throws std::runtime_error if no
// child can be created.
bool completes_in_child(const std::filesystem::path& file, const std::function<void()>& action);

}  // namespace smartsurf::record
