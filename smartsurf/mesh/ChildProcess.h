// Runs an action in a child process. Internal to this module.
//
// The mesh library is not robust against damaged files: some make it crash or loop forever.
#pragma once

#include <functional>
#include <optional>
#include <string>

namespace smartsurf::mesh {

// The bytes that the action returns; none when it crashed, threw, or took more than `cpu_s` seconds of
// processor time. Nothing else that it does is seen here. Where no child can be had, the action runs in this
// process.
std::optional<std::string> run_in_child_process(const std::function<std::string()>& task, double cpu_s);

}  // namespace smartsurf::mesh
