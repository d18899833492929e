// `smartsurf compare`.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <filesystem>
#include <memory>

#include "common/files/Inputs.h"
#include "common/process/ExitStatus.h"
#include "common/process/StopSignals.h"
#include "common/text/Printable.h"
#include "smartsurf/run/ConfinedRuns.h"
#include "smartsurf/run/ControllerProcess.h"
#include "smartsurf/run/cli/Subcommands.h"
#include "smartsurf/run/compare/Report.h"
#include "smartsurf/run/options/FlagValues.h"

namespace smartsurf::run {
namespace {

struct CompareFlags {
  std::string experiment, engines = "native,bullet", controller, until = "10", tolerance = "0.1", out;
  std::vector<std::string> set, vary, controller_set;
  std::optional<std::uint64_t> seed;
  bool unsafe = false, allow_extensions = false;
};

std::pair<std::string, std::string> parse_engines(const std::string& text) {
  const std::size_t comma = text.find(',');
  auto is_known = [](const std::string& name) {
    return std::ranges::find(scene::kEngineNames, name) != std::end(scene::kEngineNames);
  };
  if (comma != std::string::npos) {
    std::pair<std::string, std::string> engines(text.substr(0, comma), text.substr(comma + 1));
    if (is_known(engines.first) && is_known(engines.second) && engines.first != engines.second)
      return engines;
  }
  throw scene::InputError(fmt::format("--engines {}: must be two engines, as native,bullet", text));
}

void create_folder(const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error || !std::filesystem::is_directory(folder))
    throw scene::InputError(fmt::format("--out {}: the folder cannot be created", folder));
}

RunOptions make_run_options(const CompareFlags& flags, const std::string& engine,
                            const std::string& command_line) {
  RunOptions options;
  options.experiment = flags.experiment;
  options.command_line = command_line;
  options.until_s = parse_positive_number("--until", flags.until);
  options.controller = flags.controller;
  options.controller_overrides = flags.controller_set;
  options.no_controller = flags.controller.empty();
  options.seed = flags.seed;
  options.overrides = parse_overrides(flags.set, flags.vary);
  options.unsafe = flags.unsafe;
  options.allow_extensions = flags.allow_extensions;
  options.engine = engine;
  if (!flags.out.empty()) options.recording_files = {flags.out + "/" + engine + ".h5"};
  return options;
}

int compare_command(const CompareFlags& flags, const std::string& command_line) {
  const auto [first_engine, second_engine] = parse_engines(flags.engines);
  const double tolerance = parse_positive_number("--tolerance", flags.tolerance);
  if (!flags.controller_set.empty() && !is_apron_program(flags.controller))
    throw scene::InputError(
        "--controller-set: needs --controller PROGRAM.aps, whose sliders and switches it sets");
  std::array runs{make_run_options(flags, first_engine, command_line),
                  make_run_options(flags, second_engine, command_line)};
  std::vector<common::NamedOutput> reports;
  if (!flags.out.empty()) {
    create_folder(flags.out);
    reports = report_files(flags.out);
  }
  const std::unique_ptr<ConfinedRuns> confined = ConfinedRuns::confine(runs, reports);
  const auto& stop = common::catch_stop_signals();
  const EngineTrace first = trace_run(runs[0], stop);
  const EngineTrace second = trace_run(runs[1], stop);
  const Comparison comparison = compare(first, second, tolerance);
  common::print_output(describe(comparison, first, second));
  if (!flags.out.empty()) {
    common::require_separate_outputs(reports);
    write_report(comparison, first, second, flags.experiment, flags.out);
  }
  return common::status_after_signals(common::kDone);
}

}  // namespace

CommandHandler add_compare_command(CLI::App& app, const std::string& command_line) {
  CLI::App* compare = app.add_subcommand(
      "compare", "Run an experiment on two engines and report where their results diverge");
  const auto flags = std::make_shared<CompareFlags>();
  compare->add_option("experiment", flags->experiment, "The experiment")
      ->required()
      ->type_name("EXPERIMENT.lua");
  compare->add_option("--engines", flags->engines, "The two engines (default: native,bullet)")
      ->type_name("ENGINE,ENGINE");
  compare
      ->add_option("--controller", flags->controller,
                   "Start this controller with each run; without it, the script sets the actuators")
      ->type_name("PROGRAM.aps|POLICY.onnx|COMMAND");
  compare
      ->add_option("--controller-set", flags->controller_set, "Set a slider or switch of the APRON program")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  compare->add_option("--seed", flags->seed, "Seed of everything random, instead of the script's")
      ->type_name("N");
  compare->add_option("--set", flags->set, "Set an option that the script defines")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  compare->add_option("--vary", flags->vary, "Draw a quantity of the scene from a range, as in a run")
      ->type_name("NAME=LOW:HIGH[:MODE]")
      ->allow_extra_args(false);
  compare
      ->add_option("--until", flags->until, "End at this simulated time (default: 10), if not stopped before")
      ->type_name("SECONDS");
  compare
      ->add_option("--tolerance", flags->tolerance,
                   "Distance at which an object counts as diverged, u (default: 0.1)")
      ->type_name("LENGTH");
  compare->add_option("--out", flags->out, "Write recordings, figures and a table to this folder")
      ->type_name("FOLDER");
  add_extension_flags(*compare, flags->allow_extensions);
  compare->add_flag("--unsafe", flags->unsafe,
                    "Give the script all of Lua: processes, files, native modules");
  return [flags, command_line] { return compare_command(*flags, command_line); };
}

}  // namespace smartsurf::run
