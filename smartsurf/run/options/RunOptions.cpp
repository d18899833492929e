#include "smartsurf/run/options/RunOptions.h"

#include <fmt/format.h>
#include <unistd.h>

#include <filesystem>

namespace smartsurf::run {

std::vector<common::NamedOutput> named_outputs(const RunOptions& options) {
  std::vector<common::NamedOutput> outputs;
  for (const std::string& file : options.recording_files) {
    outputs.push_back({"--record", file});
    outputs.push_back({"--record", file + ".part"});  // its name until the run ends
  }
  if (!options.stats_file.empty()) outputs.push_back({"--stats", options.stats_file});
  for (const Screenshot& screenshot : options.screenshots)
    outputs.push_back({"--screenshot", screenshot.file});
  if (!options.video_file.empty()) outputs.push_back({"--video", options.video_file});
  return outputs;
}

std::string segment_name(const RunOptions& options) {
  // A name for the user to type is needed only if the controller is attached by hand.
  const std::string base = !options.shm.empty()         ? options.shm
                           : options.controller.empty() ? "surface"
                                                        : fmt::format("run-{}", getpid());
  return options.world_index ? fmt::format("{}-{}", base, *options.world_index) : base;
}

std::filesystem::path script_output_folder(const RunOptions& options) {
  if (options.recording_files.empty()) return {};
  return std::filesystem::path(options.recording_files.front()).replace_extension(".files");
}

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
