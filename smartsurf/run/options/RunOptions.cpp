#include "smartsurf/run/options/RunOptions.h"

#include <filesystem>

namespace smartsurf::run {

RunOptions options_for_opened(const std::string& experiment, const RunOptions& previous) {
  RunOptions options;
  options.experiment = experiment;
  options.command_line = "smartsurf run " + experiment + " --window";
  options.window = options.summary = true;
  options.close = previous.close;
  options.pace = 1.0;
  options.threads = previous.threads;
  options.render = previous.render;
  options.allow_extensions = previous.allow_extensions;
  const std::filesystem::path program = std::filesystem::path(experiment).replace_extension(".aps");
  std::error_code error;
  if (std::filesystem::is_regular_file(program, error))
    options.controller = program.string();
  else
    options.no_controller = true;
  return options;
}

}  // namespace smartsurf::run
