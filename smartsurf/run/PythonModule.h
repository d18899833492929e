// The modules of the Python package `smartsurf` that are programs.
#pragma once

#include <string>
#include <vector>

namespace smartsurf::run {

// The command that runs smartsurf.NAME with these arguments. The interpreter is the one that SMARTSURF_PYTHON
// in the environment names; else the one beside this program, where pip has installed both; else, in a build
// folder and without an active virtual environment, the one that the build's package is for; else the one on
// PATH. A build folder's programs take its own package. Nothing is loaded from the current folder.
std::vector<std::string> python_command(const std::string& module, const std::vector<std::string>& arguments);
// Becomes that program, which finds this one as SMARTSURF. Throws scene::InputError if there is no
// interpreter.
[[noreturn]] void run_python(const std::string& module, const std::vector<std::string>& arguments);

}  // namespace smartsurf::run
