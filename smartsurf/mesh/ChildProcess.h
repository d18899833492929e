// Runs a task in a forked child process. Internal to this module.
//
// Isolates the mesh importer, which may crash or loop forever on damaged files.
#pragma once

#include <functional>
#include <optional>
#include <string>

namespace smartsurf::mesh {

// Returns the bytes that the task returns; nullopt if it crashed, threw, or used more than `cpu_s` seconds of
// CPU time. The task has no other effect on this process. If fork fails, the task runs in this process.
std::optional<std::string> run_in_child_process(const std::function<std::string()>& task, double cpu_s);

}  // namespace smartsurf::mesh
