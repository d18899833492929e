// `smartsurf train`: the trainer of the Python package, whose arguments it takes.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstring>

#include "smartsurf/run/PythonModule.h"
#include "smartsurf/run/cli/Subcommands.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::run {
namespace {

int train(const std::vector<std::string>& given) {
  const std::vector<std::string> command = python_command("train", given);
  std::vector<char*> arguments;
  for (const std::string& argument : command) arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  execvp(arguments[0], arguments.data());
  throw scene::InputError(fmt::format("train: cannot start {}: {}", command[0], std::strerror(errno)));
}

}  // namespace

CommandHandler add_train_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "train", "Learn a policy of a task (smartsurf train --help); needs the Python package");
  command->set_help_flag();
  command->prefix_command();
  return [command] { return train(command->remaining()); };
}

}  // namespace smartsurf::run
