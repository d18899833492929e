// The subcommands of smartsurf. Each function adds one to the command line and returns its handler, which
// returns the exit status and throws scene::InputError for invalid input.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace CLI {
class App;
class Validator;
}  // namespace CLI

namespace smartsurf::run {

using CommandHandler = std::function<int()>;

// command_line: as typed; stored in recordings.
CommandHandler add_run_command(CLI::App& app, const std::string& command_line);
CommandHandler add_compare_command(CLI::App& app, const std::string& command_line);
CommandHandler add_record_command(CLI::App& app, const std::string& command_line);
CommandHandler add_replay_command(CLI::App& app);
CommandHandler add_info_command(CLI::App& app);
CommandHandler add_plot_command(CLI::App& app);
CommandHandler add_export_command(CLI::App& app);
CommandHandler add_check_command(CLI::App& app);
CommandHandler add_clean_command(CLI::App& app);
CommandHandler add_new_command(CLI::App& app);
CommandHandler add_train_command(CLI::App& app);
CommandHandler add_identify_command(CLI::App& app);
CommandHandler add_fmu_command(CLI::App& app);
// run: executes another command line, without the program's name.
CommandHandler add_demo_command(CLI::App& app, std::function<int(const std::vector<std::string>&)> run);

// Accepts an unsigned 64-bit integer.
CLI::Validator whole_number_validator();
// --load, which loads an extension while the command line is parsed, and --allow-extensions.
void add_extension_flags(CLI::App& app, bool& allow_extensions);

}  // namespace smartsurf::run
