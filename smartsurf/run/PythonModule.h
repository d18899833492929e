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
// Takes the empty and relative entries out of this process's PYTHONPATH: Python reads its first modules
// through it before it runs anything, and such an entry is the current folder or below it.
void drop_relative_python_path();
// Becomes that program, which finds this one as SMARTSURF. Throws scene::InputError if there is no
// interpreter.
[[noreturn]] void run_python(const std::string& module, const std::vector<std::string>& arguments);

}  // namespace smartsurf::run
