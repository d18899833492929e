#include "smartsurf/run/PythonModule.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <climits>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <sstream>
#include <system_error>

#include "common/files/Installation.h"
#include "common/files/ReadFile.h"
#include "common/process/Arguments.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::run {
namespace {

namespace fs = std::filesystem;

// `-m` would put the current folder first on the path, as `-c` does: nothing but the built-in sys is imported
// before it is off. Arguments: the build's package or "", the program's name.
constexpr const char* kStart =
    R"(import sys
package, module = sys.argv[1:3]
sys.path[:] = ([package] if package else []) + [entry for entry in sys.path if entry]
sys.argv[:3] = [module]
import runpy
try:
    import smartsurf
except ModuleNotFoundError as error:
    print(f'smartsurf: {module} needs the Python package smartsurf: {error}; install the wheel or the checkout (docs/install.md)', file=sys.stderr)
    sys.exit(2)
runpy.run_module(module, run_name='__main__'))";

std::string environment(const char* name) {
  const char* const value = std::getenv(name);
  return value != nullptr ? value : "";
}

// `package`: the build's, or "".
std::string interpreter(const fs::path& program_folder, const fs::path& package) {
  if (const std::string chosen = environment("SMARTSURF_PYTHON"); !chosen.empty()) return chosen;
  if (const fs::path sibling = program_folder / "python3"; access(sibling.c_str(), X_OK) == 0) return sibling;
  const bool in_environment = !environment("VIRTUAL_ENV").empty() || !environment("CONDA_PREFIX").empty();
  std::string of_build;
  if (package.empty() || in_environment || common::read_file(package / "interpreter", PATH_MAX, of_build) ||
      access(of_build.c_str(), X_OK) != 0)
    return "python3";
  return of_build;
}

}  // namespace

std::vector<std::string> python_command(const std::string& module,
                                        const std::vector<std::string>& arguments) {
  std::error_code error;
  const fs::path folder = common::program_path().parent_path();
  fs::path package = folder.parent_path() / "python";
  if (!fs::exists(package / "smartsurf" / "__init__.py", error)) package.clear();
  std::vector<std::string> command = {interpreter(folder, package), "-c", kStart, package.string(),
                                      "smartsurf." + module};
  command.insert(command.end(), arguments.begin(), arguments.end());
  return command;
}

void drop_relative_python_path() {
  std::istringstream entries(environment("PYTHONPATH"));
  std::string kept;
  for (std::string entry; std::getline(entries, entry, ':');)
    if (entry.starts_with('/')) kept += (kept.empty() ? "" : ":") + entry;
  if (kept.empty())
    unsetenv("PYTHONPATH");
  else
    setenv("PYTHONPATH", kept.c_str(), 1);
}

void run_python(const std::string& module, const std::vector<std::string>& given) {
  const std::vector<std::string> command = python_command(module, given);
  drop_relative_python_path();
  std::vector<char*> arguments = common::argument_pointers(command);
  setenv("SMARTSURF", common::program_path().c_str(), 0);
  execvp(arguments[0], arguments.data());
  throw scene::InputError(fmt::format("{}: cannot start {}: {}", module, command[0], std::strerror(errno)));
}

}  // namespace smartsurf::run
