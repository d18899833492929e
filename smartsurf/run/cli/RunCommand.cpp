// `smartsurf run` and `smartsurf check`.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iterator>
#include <memory>

#include "common/files/FileKind.h"
#include "common/process/StopSignals.h"
#include "common/text/Number.h"
#include "common/text/Printable.h"
#include "smartsurf/extension/Extension.h"
#include "smartsurf/mesh/SolidLibrary.h"
#include "smartsurf/run/ConfinedRuns.h"
#include "smartsurf/run/ControllerProcess.h"
#include "smartsurf/run/OutputFile.h"
#include "smartsurf/run/Run.h"
#include "smartsurf/run/ScriptOverrun.h"
#include "smartsurf/run/Worlds.h"
#include "smartsurf/run/cli/Subcommands.h"
#include "smartsurf/run/cli/WindowSession.h"
#include "smartsurf/run/options/FlagValues.h"
#include "smartsurf/scene/ChannelKind.h"
#include "smartsurf/scene/UnlikelyPlacements.h"
#include "smartsurf/simulation/Simulation.h"
#include "smartsurf/world/bullet/EngineFactory.h"

namespace smartsurf::run {
namespace {

// The flags of `run` as given on the command line, before validation.
struct RunFlags {
  std::string experiment, mode = "time-step", pace, controller, shm, stats, video, record_registers;
  bool window = false, headless = false, paused = false, close = false, no_controller = false, unsafe = false,
       help = false, allow_extensions = false;
  std::vector<std::string> set, vary, controller_set, record, screenshot;
  RenderFlags render;
  std::optional<std::uint64_t> seed, ticks;
  std::optional<std::string> engine;
  std::string until;
  int threads = 1;
  int worlds = 0;  // 0: no --worlds
};

void add_script_flags(CLI::App& app, RunFlags& flags) {
  add_extension_flags(app, flags.allow_extensions);
  app.add_option("--seed", flags.seed, "Seed of everything random, instead of the script's")
      ->check(whole_number_validator())
      ->type_name("N");
  app.add_option("--set", flags.set, "Set an option that the script defines")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  app.add_option("--vary", flags.vary,
                 "Draw a quantity of the scene from a range, as the script's vary{} does; MODE is factor, "
                 "offset or absolute (default)")
      ->type_name("NAME=LOW:HIGH[:MODE]")
      ->allow_extra_args(false);
  app.add_option("--engine", flags.engine, "Physics engine, instead of the script's: native or bullet")
      ->check(CLI::IsMember(
          std::vector<std::string>(std::begin(scene::kEngineNames), std::end(scene::kEngineNames))))
      ->type_name("ENGINE");
}

void add_run_flags(CLI::App& app, RunFlags& flags) {
  app.set_help_flag();  // replaced by one that also lists the experiment's options
  app.add_flag("-h,--help", flags.help,
               "Show this help; with an experiment, also the options that its script defines");
  app.add_option("experiment", flags.experiment, "The experiment, a Lua script")->type_name("EXPERIMENT.lua");
  app.add_flag("--headless", flags.headless, "Run without a window (the default)");
  app.add_flag("--window", flags.window,
               "Open a window, and that of an APRON program beside it; the default pace is then real time");
  app.add_flag("--paused", flags.paused, "Start paused; needs --window");
  app.add_flag("--close", flags.close, "Close the window at the end of the run; needs --window");
  app.add_option("--mode", flags.mode,
                 "time-step: physics waits for the controller; passive: it follows the clock")
      ->check(CLI::IsMember({"time-step", "passive"}))
      ->type_name("MODE");
  app.add_option("--pace", flags.pace, "max, realtime, or simulated seconds per second")->type_name("PACE");
  app.add_option("--until", flags.until, "End at this simulated time")->type_name("SECONDS");
  app.add_option("--ticks", flags.ticks, "End after N control periods")
      ->check(whole_number_validator())
      ->type_name("N");
  app.add_option("--shm", flags.shm, "Name of the shared-memory surface (default: surface)")
      ->type_name("NAME");
  app.add_option("--controller", flags.controller,
                 "Start this controller and end it with the run: an APRON program, an ONNX model, or a shell "
                 "command in which {shm} "
                 "is the surface's name")
      ->type_name("PROGRAM.aps|POLICY.onnx|COMMAND");
  app.add_option("--controller-set", flags.controller_set, "Set a slider or switch of the APRON program")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  app.add_flag("--no-controller", flags.no_controller,
               "Run without a controller: the script sets the actuators");
  add_script_flags(app, flags);
  app.add_option("--threads", flags.threads, "Threads for physics, actuators and sensors; changes no result")
      ->check(CLI::Range(1, 256))
      ->type_name("N");
  app.add_option(
         "--worlds", flags.worlds,
         "Run N copies at once, with consecutive seeds; their surfaces and files are NAME-0, NAME-1 …")
      ->check(CLI::Range(1, kMaxWorlds))
      ->type_name("N");
  app.add_option("--record", flags.record, "Record the run, as HDF5 or CSV")
      ->type_name("FILE.h5|FILE.csv")
      ->allow_extra_args(false);
  app.add_option("--record-registers", flags.record_registers,
                 "With --record FILE.h5: also these registers of the APRON program, such as A,B, or all")
      ->type_name("NAMES");
  app.add_option("--stats", flags.stats, "Write statistics of the run as JSON (-: to standard output)")
      ->type_name("FILE.json");
  app.add_option("--screenshot", flags.screenshot, "Write a picture at a simulated time, or at the end")
      ->type_name("FILE.png[@SECONDS]")
      ->allow_extra_args(false);
  app.add_option("--video", flags.video,
                 "Write a video, 30 frames per simulated second; needs ffmpeg, but no display")
      ->type_name("FILE.mp4");
  add_render_flags(app, flags.render);
  app.add_flag("--unsafe", flags.unsafe, "Give the script all of Lua: processes, files, native modules");
}

std::optional<double> parse_pace(const RunFlags& flags) {
  if (flags.pace == "max") return std::nullopt;
  if (flags.pace == "realtime") return 1.0;
  if (!flags.pace.empty()) {
    if (flags.pace.find_first_not_of("0123456789.eE+-") != std::string::npos)
      throw scene::InputError(
          fmt::format("--pace {}: must be max, realtime or a number greater than 0", flags.pace));
    return parse_positive_number("--pace", flags.pace);
  }
  const bool real_time = flags.window || flags.mode == "passive";
  return real_time ? std::optional(1.0) : std::nullopt;
}

// Loads an experiment to inspect it, discarding what the script prints.
script::Experiment load_silently(const RunFlags& flags) {
  confine_to_experiment(flags.experiment, flags.allow_extensions);
  script::LoadOptions options;
  options.overrides = parse_overrides(flags.set, flags.vary);
  options.seed = flags.seed;
  options.engine = flags.engine;
  options.print_output = [](std::string_view) {};
  options.end_process = end_for_script;
  options.solid_factory = std::make_shared<mesh::SolidLibrary>(mesh::decomposition_folder());
  if (flags.allow_extensions) options.load_extension = extension::load;
  return script::Experiment::load(flags.experiment, options);
}

// The registers that a run records or draws: those of --record-registers and that of --cells apron:NAME. Null
// for none.
std::shared_ptr<ShownRegisters> shown_registers(const RunFlags& flags) {
  const scene::ChannelReference cells = scene::parse_channel(flags.render.cells);
  const bool draws = cells.kind == scene::ChannelKind::kRegister;
  const bool records = !flags.record_registers.empty();
  const char* const flag = draws ? "--cells apron:NAME" : "--record-registers";
  if (!draws && !records) return nullptr;
  if (!is_apron_program(flags.controller))
    throw scene::InputError(
        fmt::format("{}: needs --controller PROGRAM.aps, whose registers it shows", flag));
  if (flags.mode == "passive")
    throw scene::InputError(
        fmt::format("{}: needs --mode time-step, in which the table waits for the program", flag));
  if (flags.worlds > 0) throw scene::InputError(fmt::format("{}: cannot be combined with --worlds", flag));
  if (records && std::ranges::none_of(flags.record, [](const auto& file) { return !file.ends_with(".csv"); }))
    throw scene::InputError("--record-registers: needs --record FILE.h5, in which they are recorded");
  const std::string drawn(draws ? cells.name : "");
  if (drawn.empty() && !records) return nullptr;
  return std::make_shared<ShownRegisters>(flags.record_registers, drawn);
}

// A command of the shell would otherwise be "not found".
void refuse_other_controllers(const std::string& controller) {
  if (controller.empty() || is_apron_program(controller) || ::access(controller.c_str(), X_OK) == 0) return;
  const common::FileKind kind = common::file_kind(controller);
  if (kind == common::FileKind::kProgram)
    throw scene::InputError(
        fmt::format("--controller {}: is an APRON program, whose name must end in .aps", controller));
  if (kind != common::FileKind::kOther)
    throw scene::InputError(fmt::format("--controller {}: is {}, not an APRON program, a policy or a command",
                                        controller, common::description(kind)));
}

void require_times_before_end(const RunOptions& options) {
  for (const Screenshot& screenshot : options.screenshots)
    if (screenshot.time_s && options.until_s && *screenshot.time_s > *options.until_s + 1e-9)
      throw scene::InputError(fmt::format("--screenshot {}@{}: the run ends before, --until {}",
                                          screenshot.file, *screenshot.time_s, *options.until_s));
}

RunOptions make_run_options(const RunFlags& flags, const std::string& command_line) {
  if (flags.experiment.empty())
    throw scene::InputError("run: no experiment given; usage: smartsurf run EXPERIMENT.lua");
  reject_both(flags.window && flags.headless, "--window and --headless");
  if (flags.paused && !flags.window)
    throw scene::InputError("--paused: needs --window, where the run can be resumed");
  if (!flags.render.plots.empty() && !flags.window)
    throw scene::InputError("--plot: needs --window; smartsurf plot draws the signals of a recording");
  if (flags.close && !flags.window)
    throw scene::InputError("--close: needs --window, which otherwise stays open at the end of the run");
  reject_both(flags.no_controller && !flags.controller.empty(), "--controller and --no-controller");
  if (!flags.controller_set.empty() && !is_apron_program(flags.controller))
    throw scene::InputError(
        "--controller-set: needs --controller PROGRAM.aps, whose sliders and switches it sets");
  reject_both(flags.no_controller && !flags.shm.empty(), "--shm and --no-controller");
  refuse_other_controllers(flags.controller);
  reject_both(!flags.until.empty() && flags.ticks, "--until and --ticks");
  const bool renders = flags.window || !flags.screenshot.empty() || !flags.video.empty();
  if (flags.worlds > 0 && renders)
    throw scene::InputError(
        "--worlds: cannot be combined with --window, --screenshot or --video; use --record");
  const std::string stats = flags.stats == "-" ? "/dev/stdout" : flags.stats;
  if (!stats.empty()) require_writable("--stats", stats);
  // The controller's program may include it, which this process does not see.
  if (stats.ends_with(".aps") || stats.ends_with(".lua"))
    throw scene::InputError("--stats " + stats + ": is the name of a program; choose another ending");
  if (!flags.video.empty()) require_writable("--video", flags.video);
  RunOptions options;
  options.experiment = flags.experiment;
  options.command_line = command_line;
  options.window = flags.window;
  options.paused = flags.paused;
  options.close = flags.close;
  options.summary = true;
  options.mode = flags.mode == "passive" ? RunMode::kPassive : RunMode::kTimeStep;
  options.pace = parse_pace(flags);
  options.ticks = flags.ticks;
  if (!flags.until.empty()) options.until_s = parse_positive_number("--until", flags.until);
  options.shm = flags.shm;
  options.controller = flags.controller;
  options.controller_overrides = flags.controller_set;
  options.registers = shown_registers(flags);
  options.no_controller = flags.no_controller;
  options.seed = flags.seed;
  options.engine = flags.engine;
  options.overrides = parse_overrides(flags.set, flags.vary);
  options.threads = flags.threads;
  options.recording_files = flags.record;
  options.stats_file = stats;
  for (const auto& text : flags.screenshot) {
    options.screenshots.push_back(parse_screenshot(text));
    require_writable("--screenshot", options.screenshots.back().file);
  }
  require_times_before_end(options);
  options.video_file = flags.video;
  options.render = parse_render_options(flags.render);
  options.unsafe = flags.unsafe;
  options.allow_extensions = flags.allow_extensions;
  return options;
}

void print_options(const scene::SceneSpec& scene) {
  if (scene.options.empty()) {
    common::print_output(fmt::format("{} defines no options.\n", scene.file));
    return;
  }
  common::print_output(fmt::format("Options of {} (change one with --set NAME=VALUE):\n", scene.file));
  for (const auto& o : scene.options)
    common::print_output(fmt::format("  {:<28}{}\n", fmt::format("{} = {}", o.name, o.value), o.help));
}

int run_command(CLI::App& app, const RunFlags& flags, const std::string& command_line) {
  if (flags.help) {
    common::print_output(
        fmt::format("{}\n", app.get_parent()->help()));  // with the program's name in the usage line
    if (!flags.experiment.empty()) print_options(load_silently(flags).scene());
    return common::kDone;
  }
  const RunOptions options = make_run_options(flags, command_line);
  return common::status_after_signals(flags.worlds > 0 ? run_worlds(options, flags.worlds)
                                                       : run_session(options));
}

int check_command(const RunFlags& flags) {
  const auto experiment = load_silently(flags);
  const std::string& file = flags.experiment;
  const auto& scene = experiment.scene();
  simulation::validate_surface(scene);
  simulation::Nuisances::check(scene, experiment.variations());
  world::require_engine(scene);
  for (const std::string& line : scene::unlikely_placements(scene))
    common::print_error_line("smartsurf", "warning: " + line);
  const auto count = [](std::size_t n, const char* what) {
    return fmt::format("{} {}{}", n, what, n == 1 ? "" : "s");
  };
  common::print_output(fmt::format("{}: ok: {} x {} cells, {}, {}\n", file, scene.surface.rows,
                                   scene.surface.columns, count(scene.objects.size(), "object"),
                                   count(scene.options.size(), "option")));
  return common::kDone;
}

}  // namespace

CLI::Validator whole_number_validator() {
  return {[](std::string& text) {
            std::uint64_t value = 0;
            if (common::parse_number(text, value)) return std::string();
            return fmt::format("'{}' is not a whole number from 0 to {}", text, UINT64_MAX);
          },
          ""};
}

void add_extension_flags(CLI::App& app, bool& allow_extensions) {
  app.add_option("--load", "Load an extension: a shared object that adds actuators and sensors")
      ->each([](const std::string& file) { extension::load(file); })
      ->type_name("FILE.so")
      ->allow_extra_args(false)
      ->take_all();
  app.add_flag("--allow-extensions", allow_extensions,
               "Let the script load the extensions that it names, from its folder");
}

CommandHandler add_run_command(CLI::App& app, const std::string& command_line) {
  CLI::App* run = app.add_subcommand("run", "Run an experiment");
  const auto flags = std::make_shared<RunFlags>();
  add_run_flags(*run, *flags);
  return [run, flags, command_line] { return run_command(*run, *flags, command_line); };
}

CommandHandler add_check_command(CLI::App& app) {
  CLI::App* check = app.add_subcommand("check", "Check an experiment for errors without running it");
  const auto flags = std::make_shared<RunFlags>();
  check->add_option("experiment", flags->experiment, "The experiment")
      ->required()
      ->type_name("EXPERIMENT.lua");
  add_script_flags(*check, *flags);
  return [flags] { return check_command(*flags); };
}

}  // namespace smartsurf::run
