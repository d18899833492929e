// Tries an action in a child process first. Internal to this module.
//
// HDF5 1.10 does not validate everything that it reads: a damaged file can make it access memory out of
// bounds. A recording is therefore opened in a child process first.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>

namespace smartsurf::record {

// Runs the action in a forked child, which may read the file alone, with 15 s of processor time and so much
// more address space; its side effects are lost. Returns why the file must not be read here; empty if the
// action returns or throws anything but std::bad_alloc. Throws std::runtime_error if no child can be created.
std::string refusal_of_child(const std::filesystem::path& file, std::size_t memory_bytes,
                             const std::function<void()>& action);

}  // namespace smartsurf::record
