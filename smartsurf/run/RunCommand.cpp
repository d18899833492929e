// `smartsurf run` and `smartsurf check`: the flags about an experiment.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <memory>

#include "smartsurf/mesh/SolidLibrary.h"
#include "smartsurf/run/ControllerProcess.h"
#include "smartsurf/run/Flags.h"
#include "smartsurf/run/OutputFile.h"
#include "smartsurf/run/Run.h"
#include "smartsurf/run/Simulation.h"
#include "smartsurf/run/StopSignals.h"
#include "smartsurf/run/Subcommands.h"
#include "smartsurf/run/Worlds.h"

namespace smartsurf::run {
namespace {

// The flags of `run` as the command line gives them, before they are judged.
struct RunFlags {
  std::string experiment, mode = "time-step", pace, controller, shm, stats, video;
  bool window = false, headless = false, paused = false, no_controller = false, unsafe = false, help = false;
  std::vector<std::string> set, controller_set, record, screenshot;
  LookFlags look;
  std::optional<std::uint64_t> seed, ticks;
  std::string until;
  int threads = 1;
  int worlds = 0;  // 0: not asked for
};

CLI::Validator whole_number() {
  return {[](std::string& text) {
            std::uint64_t value = 0;
            const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
            if (error == std::errc{} && end == text.data() + text.size()) return std::string();
            return fmt::format("'{}' is not a whole number from 0 to {}", text, UINT64_MAX);
          },
          ""};
}

void add_script_flags(CLI::App& app, RunFlags& f) {
  app.add_option("--seed", f.seed, "Seed of everything random, instead of the script's")
      ->check(whole_number())
      ->type_name("N");
  app.add_option("--set", f.set, "Value of an option that the script makes")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
}

void add_run_flags(CLI::App& app, RunFlags& f) {
  app.set_help_flag();  // our own, that also lists the experiment's options
  app.add_flag("-h,--help", f.help,
               "Show this help; with an experiment also the options that its script makes");
  app.add_option("experiment", f.experiment, "The experiment, a Lua script")->type_name("EXPERIMENT.lua");
  app.add_flag("--headless", f.headless, "Run without a window (the default)");
  app.add_flag("--window", f.window,
               "Open a window, and that of an APRON program beside it; runs in real time unless --pace says "
               "otherwise");
  app.add_flag("--paused", f.paused, "Begin paused, in the window");
  app.add_option("--mode", f.mode,
                 "time-step: physics waits for the controller; passive: it follows the clock")
      ->check(CLI::IsMember({"time-step", "passive"}))
      ->type_name("MODE");
  app.add_option("--pace", f.pace, "max, realtime, or simulated seconds per second")->type_name("PACE");
  app.add_option("--until", f.until, "End at this simulated time")->type_name("SECONDS");
  app.add_option("--ticks", f.ticks, "End after so many control periods")
      ->check(whole_number())
      ->type_name("N");
  app.add_option("--shm", f.shm, "Name of the shared-memory surface (default: surface)")->type_name("NAME");
  app.add_option(
         "--controller", f.controller,
         "Start this controller and end it with the run: an APRON program, or a shell command in which {shm} "
         "is the surface's name")
      ->type_name("PROGRAM.aps|COMMAND");
  app.add_option("--controller-set", f.controller_set, "Value of a slider or switch of the APRON program")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  app.add_flag("--no-controller", f.no_controller, "Run without a controller: the script sets the actuators");
  add_script_flags(app, f);
  app.add_option("--threads", f.threads, "Threads for actuators and sensors; changes no result")
      ->check(CLI::Range(1, 256))
      ->type_name("N");
  app.add_option(
         "--worlds", f.worlds,
         "So many copies at once, with seeds counting up; NAME-0, NAME-1 … are their surfaces and files")
      ->check(CLI::Range(1, kMostWorlds))
      ->type_name("N");
  app.add_option("--record", f.record, "Record the run, as HDF5 or CSV")
      ->type_name("FILE.h5|FILE.csv")
      ->allow_extra_args(false);
  app.add_option("--stats", f.stats, "Write figures about the run as JSON")->type_name("FILE.json");
  app.add_option("--screenshot", f.screenshot, "Write a picture at a simulated time, or at the end")
      ->type_name("FILE.png[@SECONDS]")
      ->allow_extra_args(false);
  app.add_option("--video", f.video,
                 "Write a video, 30 pictures a simulated second; needs ffmpeg, no display")
      ->type_name("FILE.mp4");
  add_look_flags(app, f.look);
  app.add_flag("--unsafe", f.unsafe, "Give the script the whole of Lua: processes, files, native modules");
}

std::optional<double> pace_of(const RunFlags& f) {
  if (f.pace == "max") return std::nullopt;
  if (f.pace == "realtime") return 1.0;
  if (!f.pace.empty()) {
    if (f.pace.find_first_not_of("0123456789.eE+-") != std::string::npos)
      throw scene::InputError(
          fmt::format("--pace {}: must be max, realtime or a number greater than 0", f.pace));
    return positive_number("--pace", f.pace);
  }
  const bool clocked = f.window || f.mode == "passive";
  return clocked ? std::optional(1.0) : std::nullopt;
}

// For looking at an experiment without running it: what the script prints is not asked for.
script::Experiment load_silently(const std::string& file,
                                 std::vector<std::pair<std::string, std::string>> set,
                                 std::optional<std::uint64_t> seed) {
  script::LoadOptions options;
  options.set = std::move(set);
  options.seed = seed;
  options.print = [](std::string_view) {};
  options.solids = std::make_shared<mesh::SolidLibrary>();
  return script::Experiment::load(file, options);
}

RunOptions judge(const RunFlags& f, const std::string& command_line) {
  if (f.experiment.empty()) throw scene::InputError("run: which experiment? smartsurf run EXPERIMENT.lua");
  reject_both(f.window && f.headless, "--window and --headless");
  if (f.paused && !f.window) throw scene::InputError("--paused: needs --window, where it can be ended");
  reject_both(f.no_controller && !f.controller.empty(), "--controller and --no-controller");
  if (!f.controller_set.empty() && !is_apron_program(f.controller))
    throw scene::InputError(
        "--controller-set: goes with --controller PROGRAM.aps, whose sliders and switches it sets");
  reject_both(f.no_controller && !f.shm.empty(), "--shm and --no-controller");
  reject_both(!f.until.empty() && f.ticks, "--until and --ticks");
  const bool pictures = f.window || !f.screenshot.empty() || !f.video.empty();
  if (f.worlds > 0 && pictures)
    throw scene::InputError("--worlds: many worlds have no window, screenshot or video; record them");
  if (!f.stats.empty()) require_writable("--stats", f.stats);
  if (!f.video.empty()) require_writable("--video", f.video);
  RunOptions o;
  o.experiment = f.experiment;
  o.command_line = command_line;
  o.window = f.window;
  o.paused = f.paused;
  o.mode = f.mode == "passive" ? RunMode::kPassive : RunMode::kTimeStep;
  o.pace = pace_of(f);
  o.ticks = f.ticks;
  if (!f.until.empty()) o.until_s = positive_number("--until", f.until);
  o.shm = f.shm;
  o.controller = f.controller;
  o.controller_set = f.controller_set;
  o.no_controller = f.no_controller;
  o.seed = f.seed;
  o.set = pairs_of(f.set);
  o.threads = f.threads;
  o.recordings = f.record;
  o.stats_file = f.stats;
  for (const auto& text : f.screenshot) {
    o.screenshots.push_back(screenshot_of(text));
    require_writable("--screenshot", o.screenshots.back().file);
  }
  o.video_file = f.video;
  o.look = look_of(f.look);
  o.unsafe = f.unsafe;
  return o;
}

void print_options(const scene::SceneSpec& scene) {
  if (scene.options.empty()) {
    fmt::print("{} makes no options.\n", scene.file);
    return;
  }
  fmt::print("Options of {} (change one with --set NAME=VALUE):\n", scene.file);
  for (const auto& o : scene.options)
    fmt::print("  {:<28}{}\n", fmt::format("{} = {}", o.name, o.value), o.help);
}

// As often as the user of the window begins anew.
int run_until_done(RunOptions options) {
  const auto& stop = catch_stop_signals();
  script::Experiment experiment = Run::load(options);
  std::unique_ptr<Display> display;
  while (true) {
    Run run(options, stop, std::move(experiment), std::move(display));
    const int status = run.execute();
    std::optional<Run::Successor> next = run.take_successor();
    if (!next) return status;
    options = std::move(next->options);
    experiment = std::move(next->experiment);
    display = std::move(next->display);
  }
}

int run_command(CLI::App& app, const RunFlags& flags, const std::string& command_line) {
  if (flags.help) {
    fmt::print("{}\n", app.help());
    if (!flags.experiment.empty())
      print_options(load_silently(flags.experiment, pairs_of(flags.set), flags.seed).scene());
    return kDone;
  }
  const RunOptions options = judge(flags, command_line);
  return status_after_signals(flags.worlds > 0 ? run_worlds(options, flags.worlds, catch_stop_signals())
                                               : run_until_done(options));
}

int check_command(const RunFlags& flags) {
  const auto experiment = load_silently(flags.experiment, pairs_of(flags.set), flags.seed);
  const std::string& file = flags.experiment;
  const auto& scene = experiment.scene();
  check_surface(scene);
  const auto count = [](std::size_t n, const char* what) {
    return fmt::format("{} {}{}", n, what, n == 1 ? "" : "s");
  };
  fmt::print("{}: ok: {} x {} cells, {}, {}\n", file, scene.surface.rows, scene.surface.columns,
             count(scene.objects.size(), "object"), count(scene.options.size(), "option"));
  return kDone;
}

}  // namespace

Action add_run_command(CLI::App& app, const std::string& command_line) {
  CLI::App* run = app.add_subcommand("run", "Run an experiment");
  const auto flags = std::make_shared<RunFlags>();
  add_run_flags(*run, *flags);
  return [run, flags, command_line] { return run_command(*run, *flags, command_line); };
}

Action add_check_command(CLI::App& app) {
  CLI::App* check = app.add_subcommand("check", "Find the mistakes in an experiment without running it");
  const auto flags = std::make_shared<RunFlags>();
  check->add_option("experiment", flags->experiment, "The experiment")
      ->required()
      ->type_name("EXPERIMENT.lua");
  add_script_flags(*check, *flags);
  return [flags] { return check_command(*flags); };
}

}  // namespace smartsurf::run
