#include "smartsurf/run/PythonModule.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "common/files/Installation.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::run {
namespace {

namespace fs = std::filesystem;

// `-m` would put the current folder first on the path. Arguments: the build's package or "", the program's
// name.
constexpr const char* kStart =
    R"(import runpy, sys
package, module = sys.argv[1:3]
sys.path[:] = ([package] if package else []) + [entry for entry in sys.path if entry]
sys.argv[:3] = [module]
try:
    import smartsurf
except ModuleNotFoundError as error:
    print(f'smartsurf: {module} needs the Python package smartsurf: {error}; pip install smartsurf-apron', file=sys.stderr)
    sys.exit(2)
runpy.run_module(module, run_name='__main__'))";

}  // namespace

std::vector<std::string> python_command(const std::string& module,
                                        const std::vector<std::string>& arguments) {
  std::error_code error;
  const fs::path folder = common::program_path().parent_path();
  const fs::path sibling = folder / "python3", package = folder.parent_path() / "python";
  const char* const chosen = std::getenv("SMARTSURF_PYTHON");
  std::vector<std::string> command = {
      chosen != nullptr && *chosen != '\0' ? chosen
      : access(sibling.c_str(), X_OK) == 0 ? sibling.string()
                                           : "python3",
      "-c", kStart, fs::exists(package / "smartsurf" / "__init__.py", error) ? package.string() : "",
      "smartsurf." + module};
  command.insert(command.end(), arguments.begin(), arguments.end());
  return command;
}

void run_python(const std::string& module, const std::vector<std::string>& given) {
  const std::vector<std::string> command = python_command(module, given);
  std::vector<char*> arguments;
  for (const std::string& argument : command) arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  setenv("SMARTSURF", common::program_path().c_str(), 0);
  execvp(arguments[0], arguments.data());
  throw scene::InputError(fmt::format("{}: cannot start {}: {}", module, command[0], std::strerror(errno)));
}

}  // namespace smartsurf::run
