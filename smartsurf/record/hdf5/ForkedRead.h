// Tries an action in a child process first. Internal to this module.
//
// HDF5 1.10 does not validate everything that it reads: a damaged file can make it access memory out of
// bounds. A recording is therefore opened in a child process first.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>

namespace smartsurf::record {

// Returns whether the action returns or throws within 15 s of processor time and so much more address space,
// without a crash. It runs in a forked child, which may read the file alone; its side effects are lost.
// Throws std::runtime_error if no child can be created.
bool completes_in_child(const std::filesystem::path& file, std::size_t memory_bytes,
                        const std::function<void()>& action);

}  // namespace smartsurf::record
