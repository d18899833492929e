#include "smartsurf/run/cli/CommandLine.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "common/cli/ParseErrors.h"
#include "common/process/StandardStreams.h"
#include "common/process/StopSignals.h"
#include "common/process/Termination.h"
#include "common/text/Printable.h"
#include "smartsurf/run/Run.h"
#include "smartsurf/run/cli/StartCommand.h"
#include "smartsurf/run/cli/Subcommands.h"
#include "smartsurf/view/window/Window.h"

namespace smartsurf::run {
namespace {

int parse_and_run(int argc, const char* const* argv);

int run_arguments(const std::vector<std::string>& arguments) {
  std::vector<const char*> argv = {"smartsurf"};
  for (const std::string& argument : arguments) argv.push_back(argument.c_str());
  return parse_and_run(static_cast<int>(argv.size()), argv.data());
}

int parse_and_run(int argc, const char* const* argv) {
  if (argc == 1 && view::Window::display_available()) return start_command();
  CLI::App app{"Simulates a smart surface: a table of actuators and sensors that moves the objects on it.",
               "smartsurf"};
  app.set_version_flag("--version", "smartsurf " SMARTSURF_VERSION);
  app.require_subcommand(1);
  std::string command_line = "smartsurf";
  for (int i = 1; i < argc; ++i) command_line += std::string(" ") + argv[i];

  const std::map<std::string, CommandHandler> handlers = {{"run", add_run_command(app, command_line)},
                                                          {"compare", add_compare_command(app, command_line)},
                                                          {"record", add_record_command(app, command_line)},
                                                          {"replay", add_replay_command(app)},
                                                          {"info", add_info_command(app)},
                                                          {"plot", add_plot_command(app)},
                                                          {"export", add_export_command(app)},
                                                          {"check", add_check_command(app)},
                                                          {"clean", add_clean_command(app)},
                                                          {"new", add_new_command(app)},
                                                          {"train", add_train_command(app)},
                                                          {"identify", add_identify_command(app)},
                                                          {"fmu", add_fmu_command(app)},
                                                          {"demo", add_demo_command(app, run_arguments)}};
  common::refuse_empty_values(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);
    throw scene::InputError(common::describe_parse_error(app, e, argc, argv));
  }
  return handlers.at(app.get_subcommands().front()->get_name())();
}

}  // namespace

int main(int argc, char** argv) noexcept {
  common::open_standard_streams();
  common::report_file_size_errors();
  const common::Termination termination("smartsurf");
  return run_and_report([=] { return parse_and_run(argc, argv); });
}

int run_and_report(const std::function<int()>& command) noexcept {
  try {
    const int status = command();
    if (status != common::kDone) return status;
    if (std::fflush(stdout) != 0)
      common::print_error_line("smartsurf", std::string("cannot write the output: ") + std::strerror(errno));
    else if (std::ferror(stdout) != 0)
      common::print_error_line("smartsurf", "a part of the output could not be written");
    else
      return status;
    return common::kFailed;
  } catch (const common::Interrupted&) {
    return common::status_after_signals(common::kDone);
  } catch (const scene::InputError& error) {
    common::print_error_line("smartsurf", error.what());
    return common::kUserError;
  } catch (const std::exception& error) {
    common::print_error_line("smartsurf", common::failure_text(error));
    return common::kFailed;
  }
}

}  // namespace smartsurf::run
