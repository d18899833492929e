// Commands of the Python package, which take their own arguments: `smartsurf train`, `identify`, `fmu`.
#include <CLI/CLI.hpp>

#include "smartsurf/run/PythonModule.h"
#include "smartsurf/run/cli/Subcommands.h"

namespace smartsurf::run {
namespace {

CommandHandler add_python_command(CLI::App& app, const char* name, const char* description) {
  CLI::App* command = app.add_subcommand(name, description);
  command->set_help_flag();
  command->prefix_command();
  return [command]() -> int { run_python(command->get_name(), command->remaining()); };
}

}  // namespace

CommandHandler add_train_command(CLI::App& app) {
  return add_python_command(app, "train",
                            "Learn a policy of a task (smartsurf train --help); needs the Python package");
}

CommandHandler add_identify_command(CLI::App& app) {
  return add_python_command(
      app, "identify",
      "Find the parameters with which an experiment behaves like a recorded table (smartsurf identify "
      "--help); needs the Python package, SciPy and h5py");
}

CommandHandler add_fmu_command(CLI::App& app) {
  return add_python_command(
      app, "fmu",
      "Pack an experiment as a co-simulation unit of FMI 3.0 (smartsurf fmu --help); needs "
      "the Python package");
}

}  // namespace smartsurf::run
