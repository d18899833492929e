// The modules of the Python package `smartsurf` that are programs.
#pragma once

#include <string>
#include <vector>

namespace smartsurf::run {

// The command that runs smartsurf.NAME with these arguments, by the interpreter that SMARTSURF_PYTHON in the
// environment names, the one beside this program, where pip has installed both, in a build folder the one that the
// build's package is made for, or the one on PATH, which a virtual environment that is active always chooses. In a
// build folder the package is that of the build. Nothing is loaded from the current folder.
std::vector<std::string> python_command(const std::string& module, const std::vector<std::string>& arguments);
// Becomes that program, which finds this one as SMARTSURF. Throws scene::InputError if there is no
// interpreter.
[[noreturn]] void run_python(const std::string& module, const std::vector<std::string>& arguments);

}  // namespace smartsurf::run
